"use strict";
(() => {
  const { data, root, save, csv } = page;

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

  document.addEventListener("theme", redraw);

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
