// Puts the page together.

function drawBlock(block) {
  const heading = el("h2", {}, block.title);
  if (block.kind === "comparison") return el("section.card", {}, heading, drawSlider(block.pictures));
  if (block.kind === "picture") {
    const remarks = block.remarks.length ? el("ul", {}, ...block.remarks.map((r) => el("li", {}, r))) : null;
    return el("section.card", {}, heading, remarks, el("img", { src: block.picture, alt: block.title, loading: "lazy" }));
  }
  const cells = (row, tag) => el("tr", {}, ...row.map((cell) => el(tag, {}, cell)));
  return el("section.card", {}, heading, el("table", {}, cells(block.headings, "th"), ...block.rows.map((row) => cells(row, "td"))));
}

/** The reader's choice of light or dark, where the browser keeps it for files; else the system's. */
function theme() {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const kept = () => {
    try { return localStorage.getItem("prehend-theme"); } catch { return null; }
  };
  const set = (name) => root.setAttribute("data-theme", name);
  set(kept() ?? (dark.matches ? "dark" : "light"));
  dark.addEventListener("change", (e) => kept() ?? set(e.matches ? "dark" : "light"));
  return () => {
    const name = root.getAttribute("data-theme") === "dark" ? "light" : "dark";
    try { localStorage.setItem("prehend-theme", name); } catch { /* It holds until the page is closed. */ }
    set(name);
  };
}

function start() {
  const data = JSON.parse(byId("data").textContent);
  document.title = `${data.title} – Prehend`;
  byId("title").textContent = data.title;
  byId("facts").append(...data.facts.map(([what, value]) => el("div", {}, el("dt", {}, what), el("dd", {}, value))));
  if (data.charts.length) byId("blocks").append(el("div.cards", {}, ...data.charts.map(drawChart)));
  byId("blocks").append(...data.blocks.map(drawBlock));
  const toggleTheme = theme();
  byId("theme").addEventListener("click", toggleTheme);
  const help = byId("help");
  byId("help-button").addEventListener("click", () => help.showModal());
  byId("keys").append(...data.columns.flatMap(({ key, name, unit }) => [el("code", {}, key), ` ${name}${unit ? ` [${unit}]` : ""}; `]), el("code", {}, "flagged"), " with any flag");

  let table = null;
  if (data.frames.length) {
    byId("frames").hidden = false;
    const view = new SceneView(data);
    table = new FrameTable(data, (frame) => byId("detail").replaceChildren(...drawDetail(data, view, frame)));
    const asked = Number(location.hash.slice(1));
    table.select(location.hash && data.frames[asked] ? asked : 0);
    window.addEventListener("hashchange", () => {
      const k = Number(location.hash.slice(1));
      if (data.frames[k] && k !== table.chosen) table.select(k);
    });
  }
  const keys = {
    ArrowDown: () => table?.step(1), j: () => table?.step(1), ArrowUp: () => table?.step(-1), k: () => table?.step(-1),
    b: () => flipSlider(document), t: toggleTheme, "?": () => help.showModal(),
    "/": () => table?.query.focus(),
  };
  document.addEventListener("keydown", (e) => {
    // A slider has the arrow keys to itself.
    const writing = e.target.matches("input[type=search], select") || (e.target.matches("input[type=range]") && e.key.startsWith("Arrow"));
    if (e.target === table?.query && (e.key === "Escape" || e.key === "Enter")) return table.query.blur();
    if (writing || help.open || e.ctrlKey || e.metaKey || e.altKey || !keys[e.key]) return;
    e.preventDefault();
    keys[e.key]();
  });
}

start();
