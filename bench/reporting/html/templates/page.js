"use strict";
(() => {
  const data = (id) => JSON.parse(document.getElementById(`data-${id}`).textContent);
  const root = document.documentElement;
  const narrow = () => innerWidth < 640;

  // ---- downloads

  const save = (name, type, content) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([content], { type }));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  const quoted = (value) => {
    const text = value === null || value === undefined ? "" : String(value);
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  const csv = (head, rows) => [head, ...rows].map((row) => row.map(quoted).join(",")).join("\r\n") + "\r\n";

  // ---- leaderboard

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
  const distinct = (key) => [...new Set(rows.map((row) => get(row, key)))];
  let order = { key: "rank", down: false };
  let shown = [];

  const options = (name, values, chosen) => {
    const select = form.elements[name];
    for (const [value, text] of values) select.add(new Option(text, value, value === chosen, value === chosen));
    select.parentElement.hidden = values.length < 2;
  };
  const any = (key) => distinct(key).map((value) => [value, value]);
  const failures = [...new Set(rows.flatMap((row) => row.failed))];
  options("scene", [...any("scene"), ["", "Each scene"]], rows.length ? get(rows[0], "scene") : "");
  options("method", [["", "All methods"], ...any("method")], "");
  options("outcome", [["", "Any outcome"], ["ok", "ok"], ["failed", "not ok"], ...failures.map((word) => [word, word])], "");
  options("alignment", [...any("alignment"), ["", "All alignments"]].slice(0, distinct("alignment").length > 1 ? undefined : 1), distinct("alignment")[0]);
  options("protocol", [...any("protocol"), ["", "All protocols"]].slice(0, distinct("protocol").length > 1 ? undefined : 1), "");
  if (distinct("protocol").length > 1) form.elements.protocol.value = "";

  const matches = (row) => {
    const chosen = (key) => form.elements[key].value;
    const same = ["scene", "method", "alignment", "protocol"].every((key) => !chosen(key) || get(row, key) === chosen(key));
    const ended = { "": true, ok: !row.failed.length, failed: row.failed.length > 0 }[chosen("outcome")] ?? row.failed.includes(chosen("outcome"));
    const words = chosen("text").toLowerCase().split(/\s+/).filter(Boolean);
    const text = ["method", "scene", "outcome", "protocol"].map((key) => get(row, key)).join(" ").toLowerCase();
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
    if (["scene", "protocol", "alignment"].includes(column.key)) return values.size > 1;
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
        const cell = element(k ? "td" : "th", k || !row.best ? text : `${text} *`, { className: column.kind !== "text" ? "number" : column.key === "outcome" ? "wrap" : "" });
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
  form.addEventListener("input", draw);
  form.addEventListener("reset", () => setTimeout(draw));
  form.addEventListener("submit", (event) => event.preventDefault());
  document.getElementById("leaderboard-csv").addEventListener("click", () => {
    save("leaderboard.csv", "text/csv", csv(board.columns.map((column) => column.key), shown.map((row) => row.values)));
  });
  draw();

  // ---- figures: drawn when they come into view

  const LIGHT = { ink: "#16191d", rule: "#e3e6e9", paper: "#ffffff" };
  const palette = () => (root.dataset.theme === "dark" ? { ink: "#e8eaed", rule: "#343a40", paper: "#14171a" } : LIGHT);
  const figures = [...document.querySelectorAll("figure[data-figure]")];
  const plot = (figure) => figure.querySelector(".plot");

  const styled = (id, colors, background, width) => {
    // Black is the colour of text, whatever the theme.
    const text = document.getElementById(`data-figure-${id}`).textContent.replaceAll('"#000000"', `"${colors.ink}"`);
    const { data: traces, layout } = JSON.parse(text);
    const axis = { gridcolor: colors.rule, zerolinecolor: colors.rule, linecolor: colors.rule, automargin: true };
    const small = width < 640;
    const named = traces.filter((trace) => trace.name && trace.showlegend !== false).length;
    const template = { data: layout.template?.data, layout: {
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colors.ink },
      paper_bgcolor: background, plot_bgcolor: background,
      margin: { l: 60, r: 12, t: 16, b: 52 },
      xaxis: axis, yaxis: axis,
      legend: small ? { orientation: "h", y: -0.2, yanchor: "top" } : { tracegroupgap: 2 },
      hoverlabel: { bgcolor: colors.paper, bordercolor: colors.rule, font: { color: colors.ink } },
      dragmode: small ? false : "zoom",
    } };
    const decade = width / (layout.xaxis?.range?.[1] - layout.xaxis?.range?.[0]);
    if (decade < 200 && layout.xaxis?.type === "log") delete layout.xaxis.dtick; // three labels in each would touch
    if (width < 800) for (const trace of traces) if (trace.mode === "markers+text") trace.mode = "markers";
    if (small && layout.xaxis?.side === "top" && layout.xaxis.type === "category") {
      layout.xaxis.tickangle = -60;
      template.layout.margin.r = 70;
    }
    const height = (layout.height ?? 420) + (small && layout.showlegend !== false && named > 1 ? 19 * named : 0);
    return { traces, layout: { ...layout, template, width: Math.max(width, layout.meta?.width ?? 0), height } };
  };
  const show = (figure) => {
    const target = plot(figure);
    const { traces, layout } = styled(figure.dataset.figure, palette(), "rgba(0,0,0,0)", target.clientWidth);
    if (figure.dataset.all) for (const trace of traces) delete trace.visible;
    target.style.height = `${layout.height}px`;
    target.tabIndex = layout.width > target.clientWidth ? 0 : -1;
    Plotly.react(target, traces, layout, { displayModeBar: false });
    const curves = figure.querySelector('[data-action="curves"]');
    curves.hidden = !figure.dataset.all && !traces.some((trace) => trace.visible === "legendonly");
    figure.dataset.drawn = "1";
  };
  const redraw = () => figures.filter((figure) => figure.dataset.drawn && plot(figure).clientWidth).forEach(show);
  const watcher = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) if (isIntersecting && !target.dataset.drawn) show(target);
  }, { rootMargin: "400px" });
  figures.forEach((figure) => watcher.observe(figure));
  let timer = 0;
  let lastWidth = innerWidth;
  addEventListener("resize", () => {
    if (innerWidth === lastWidth) return;
    lastWidth = innerWidth;
    clearTimeout(timer);
    timer = setTimeout(redraw, 150);
  });

  // ---- figures: SVG and CSV

  const svg = (id) => {
    const { traces, layout } = styled(id, LIGHT, LIGHT.paper, 900);
    return Plotly.downloadImage({ data: traces, layout }, { format: "svg", filename: id, width: layout.width, height: layout.height });
  };
  const decoded = (value) => (typeof value === "string" ? value.replaceAll("&lt;", "<").replaceAll("&amp;", "&") : value);
  const longTable = ({ data: traces, layout }) => {
    const title = (axis) => layout[axis]?.title?.text;
    const names = { x: title("xaxis") ?? "x", y: title("yaxis") ?? "y" };
    const records = [];
    for (const trace of traces) {
      if (Array.isArray(trace.z)) {
        const value = decoded(trace.name ?? trace.colorbar?.title?.text ?? "z");
        const z = trace.customdata ?? trace.z;
        z.forEach((line, i) => line.forEach((v, j) => records.push({ [names.y]: trace.y?.[i] ?? i, [names.x]: trace.x?.[j] ?? j, [value]: v, text: trace.text?.[i]?.[j] })));
        continue;
      }
      const arrays = Object.entries(trace).filter(([, values]) => Array.isArray(values));
      if (Array.isArray(trace.marker?.color)) arrays.push([trace.marker.colorbar?.title?.text ?? "color", trace.marker.color]);
      const length = Math.max(0, ...arrays.map(([, values]) => values.length));
      for (let i = 0; i < length; i++) {
        const record = { series: trace.name };
        for (const [key, values] of arrays) record[names[key] ?? key] = values[i];
        records.push(record);
      }
    }
    const head = [...new Set(records.flatMap(Object.keys))];
    return csv(head.map(decoded), records.map((record) => head.map((key) => decoded(record[key]))));
  };
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button[data-action]");
    if (!button) return;
    const figure = button.closest("figure");
    const id = figure.dataset.figure;
    if (button.dataset.action === "svg") svg(id);
    if (button.dataset.action === "csv") save(`${id}.csv`, "text/csv", longTable(data(`figure-${id}`)));
    if (button.dataset.action === "curves") {
      if (figure.dataset.all) delete figure.dataset.all; else figure.dataset.all = "1";
      button.textContent = figure.dataset.all ? "Best curves" : "All curves";
      show(figure);
    }
  });

  // ---- theme, links, paper

  const toggle = document.getElementById("theme");
  const mark = () => { toggle.textContent = root.dataset.theme === "dark" ? "Light" : "Dark"; };
  toggle.addEventListener("click", () => {
    root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem("theme", root.dataset.theme); } catch { /* the choice lasts as long as the page */ }
    mark();
    redraw();
  });
  mark();

  const reveal = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let node = target; node; node = node.parentElement) if (node.tagName === "DETAILS") node.open = true;
    if (target) target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  reveal();

  let before = null;
  addEventListener("beforeprint", () => {
    before = root.dataset.theme;
    root.dataset.theme = "light";
    document.body.style.width = "680px";
    figures.filter((figure) => plot(figure).clientWidth).forEach(show);
  });
  addEventListener("afterprint", () => {
    root.dataset.theme = before;
    document.body.style.width = "";
    redraw();
  });
})();
