"use strict";
(() => {
  const { data, save, csv } = page;

  const board = data("leaderboard");
  const best = new Set(board.best);
  const decode = (value, k) => board.columns[k].values?.[value] ?? (board.columns[k].values ? null : value);
  const rows = board.rows.map((values, k) => ({ values: values.map(decode), best: best.has(k), failed: board.failed[k] ?? [] }));
  const at = Object.fromEntries(board.columns.map((column, k) => [column.key, k]));
  const get = (row, key) => (key in at ? row.values[at[key]] : null);
  const digits = (value, three) => (value >= 100 ? value.toFixed(0) : value.toFixed(value >= 10 ? three - 2 : value >= 1 ? three - 1 : three));
  const written = {
    text: (v) => v,
    deg: (v) => (v === 0 ? "0" : v < 0.0005 ? v.toExponential(0) : v.toFixed(v < 0.005 ? 4 : 2)),
    seconds: (v) => digits(v, 3),
    percent: (v) => `${Math.round(100 * v)} %`,
    area: (v) => (v === 1 ? "1" : Math.min(v, 0.9999).toFixed(4)),
    number: (v) => v.toFixed(v < 100 ? 1 : 0),
    count: (v) => v.toFixed(0),
  };
  const form = document.getElementById("filters");
  const table = document.getElementById("board");
  const distinct = (pool, key) => [...new Set(pool.map((row) => get(row, key)))].filter((value) => value !== null);
  let order = { key: "rank", down: false };
  let shown = [];

  // A select chooses a value of the column of its name: data-any is what no choice is called, with data-first the first
  // value is chosen at first, and with data-of it offers what there is under the choice in another select.
  const selects = [...form.querySelectorAll("select:not([name=outcome])")];
  const options = (select, values, chosen) => {
    select.replaceChildren(...values.map(([value, text]) => new Option(text, value, value === chosen, value === chosen)));
    select.parentElement.hidden = values.length < 2;
  };
  const fill = (select) => {
    const { any, first, of } = select.dataset;
    const within = of && form.elements[of].value;
    const values = distinct(within ? rows.filter((row) => get(row, of) === within) : rows, select.name).map((value) => [value, value]);
    const kept = values.find(([value]) => value === select.value);
    const none = values.length > 1 ? [["", any]] : [];
    const offered = first === undefined ? [...none, ...values] : [...values, ...none];
    options(select, offered, (kept ?? offered[0] ?? [""])[0]);
  };
  const refill = (name) => selects.filter((select) => select.dataset.of === name).forEach(fill);
  const failures = [...new Set(rows.flatMap((row) => row.failed))];
  selects.forEach(fill);
  options(form.elements.outcome, [["", "Any outcome"], ["ok", "ok"], ["failed", "not ok"], ...failures.map((word) => [word, word])], "");

  const matches = (row) => {
    const chosen = (key) => form.elements[key].value;
    const same = selects.every(({ name, value }) => !value || get(row, name) === value);
    const ended = { "": true, ok: !row.failed.length, failed: row.failed.length > 0 }[chosen("outcome")] ?? row.failed.includes(chosen("outcome"));
    const words = chosen("text").toLowerCase().split(/\s+/).filter(Boolean);
    const text = ["outcome", ...selects.map((select) => select.name)].map((key) => get(row, key)).join(" ").toLowerCase();
    return same && ended && words.every((word) => text.includes(word));
  };
  const compare = (a, b) => {
    const [x, y] = [get(a, order.key), get(b, order.key)];
    if (x === null || y === null) return (x === null) - (y === null);
    const sign = typeof x === "number" ? x - y : String(x).localeCompare(String(y), undefined, { numeric: true });
    return order.down ? -sign : sign;
  };
  const tells = (column) => {
    const values = new Set(shown.map((row) => get(row, column.key)));
    if (board.constant.includes(column.key)) return values.size > 1;
    if (column.key === "outcome") return values.size > 1 || !values.has("ok");
    return column.key === "method" || [...values].some((value) => value !== null);
  };
  const element = (name, text, properties = {}) => Object.assign(document.createElement(name), { textContent: text }, properties);

  const draw = () => {
    shown = rows.filter(matches).sort(compare);
    const columns = shown.length ? board.columns.filter(tells) : board.columns.slice(0, 1);
    const focused = document.activeElement?.dataset?.key;
    table.tHead.rows[0].replaceChildren(...columns.map((column) => {
      const head = element("th", "", { scope: "col", title: column.meaning, className: column.kind === "text" ? "" : "number" });
      head.setAttribute("aria-sort", order.key !== column.key ? "none" : order.down ? "descending" : "ascending");
      const button = element("button", column.head, { type: "button" });
      button.dataset.key = column.key;
      head.append(button);
      return head;
    }));
    table.tBodies[0].replaceChildren(...shown.map((row) => {
      const line = element("tr", "", { className: row.best ? "best" : "" });
      line.append(...columns.map((column, k) => {
        const value = get(row, column.key);
        const text = value === null ? "–" : written[column.kind](value);
        const cell = element(k ? "td" : "th", "", { className: column.kind !== "text" ? "number" : column.key === "outcome" ? "wrap" : "" });
        const href = board.links?.[column.key]?.[value];
        cell.append(href ? element("a", text, { href }) : text, k || !row.best ? "" : " *");
        if (!k) cell.scope = "row";
        return cell;
      }));
      return line;
    }));
    if (focused) table.tHead.querySelector(`[data-key="${focused}"]`)?.focus();
    document.getElementById("count").textContent = shown.length === 1 ? "1 row" : `${shown.length} rows`;
  };
  table.tHead.addEventListener("click", (event) => {
    const key = event.target.closest("button")?.dataset.key;
    if (!key) return;
    order = { key, down: order.key === key && !order.down };
    draw();
  });
  form.addEventListener("input", (event) => {
    refill(event.target.name);
    draw();
  });
  form.addEventListener("reset", () => setTimeout(() => {
    selects.forEach((select) => refill(select.name));
    draw();
  }));
  form.addEventListener("submit", (event) => event.preventDefault());
  document.getElementById("leaderboard-csv").addEventListener("click", () => {
    save("leaderboard.csv", "text/csv", csv(board.columns.map((column) => column.key), shown.map((row) => row.values)));
  });
  draw();
})();
