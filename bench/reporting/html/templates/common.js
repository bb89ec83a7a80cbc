"use strict";
// What every script of a page uses: the data inside it, downloads, and the theme.
const page = (() => {
  const data = (id) => JSON.parse(document.getElementById(`data-${id}`).textContent);
  const root = document.documentElement;

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

  // ---- theme: who draws in colours of its own listens for the event

  const toggle = document.getElementById("theme");
  const mark = () => { toggle.textContent = root.dataset.theme === "dark" ? "Light" : "Dark"; };
  toggle.addEventListener("click", () => {
    root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem("theme", root.dataset.theme); } catch { /* the choice lasts as long as the page */ }
    mark();
    document.dispatchEvent(new Event("theme"));
  });
  mark();
  return { data, root, save, csv };
})();
