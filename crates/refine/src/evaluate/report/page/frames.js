// The table of frames: sorted by its headings, filtered by words and comparisons.

/** Rows that are made at first, and more each time. */
const ROWS = 500;

/** Whether a frame passes a filter; `keys` are those of columns. */
function passes(frame, filter, keys) {
  return filter.toLowerCase().split(/\s+/).filter(Boolean).every((word) => {
    const [, key, sign, number] = word.match(/^([a-z_-]+)([<>])(-?[\d.]+)$/) ?? [];
    if (key && keys.includes(key)) {
      const value = frame.figures[key];
      return value !== undefined && value !== null && (sign === "<" ? value < Number(number) : value > Number(number));
    }
    if (word === "flagged") return frame.flags.length > 0;
    return [frame.name, frame.status, ...frame.flags, ...frame.remarks].some((text) => text.toLowerCase().includes(word));
  });
}

class FrameTable {
  constructor(data, choose) {
    Object.assign(this, { data, choose, sort: null, falling: false, limit: ROWS, shown: [], chosen: null });
    this.keys = data.columns.map((c) => c.key);
    this.query = byId("query");
    byId("filter").addEventListener("submit", (e) => e.preventDefault());
    this.query.addEventListener("input", () => this.update());
    this.fillPresets();
    this.statuses = data.frames.some((f) => f.status);
    this.update();
  }

  /** Filters that these frames give reason for. */
  fillPresets() {
    const { frames, columns } = this.data;
    const known = [...new Set(frames.flatMap((f) => [...f.flags, f.status]))].filter(Boolean).sort();
    const choices = [["", "all frames"]];
    if (frames.some((f) => f.flags.length)) choices.push(["flagged", "with any flag"]);
    for (const word of known) choices.push([word, word]);
    const has = (key) => columns.some((c) => c.key === key);
    if (has("probability")) choices.push(["probability<0.9", "probability < 0.9"]);
    if (has("error")) choices.push(["error>5", "wrong by more than 5 mm"]);
    if (has("turned-error")) choices.push(["turned-error>5", "wrong by more than 5°"]);
    const presets = byId("presets");
    presets.append(...choices.map(([value, name]) => el("option", { value }, name)));
    presets.addEventListener("change", () => {
      this.query.value = presets.value;
      this.update();
    });
  }

  update() {
    const { frames } = this.data;
    const order = frames.map((_, k) => k).filter((k) => passes(frames[k], this.query.value, this.keys));
    if (this.sort) {
      const value = (k) => (this.sort === "name" ? k : this.sort === "status" ? frames[k].status : frames[k].figures[this.sort] ?? null);
      const sign = this.falling ? -1 : 1;
      order.sort((a, b) => {
        const [x, y] = [value(a), value(b)];
        // What is not known comes last, however the rest is sorted.
        if (x === null || y === null) return (x === null) - (y === null) || a - b;
        return sign * (x < y ? -1 : x > y ? 1 : 0) || a - b;
      });
    }
    this.shown = order;
    byId("count").textContent = order.length === frames.length ? `${frames.length} rows` : `${order.length} of ${frames.length} rows`;
    this.draw();
  }

  draw() {
    const { data, statuses } = this;
    const heading = (key, name, unit) => {
      const sorted = this.sort === key ? (this.falling ? "descending" : "ascending") : "none";
      const mark = { ascending: " ↑", descending: " ↓", none: "" }[sorted];
      const click = () => {
        this.falling = this.sort === key ? !this.falling : false;
        this.sort = key;
        this.update();
      };
      return el("th", { "aria-sort": sorted, scope: "col" }, el("button", { click }, name, unit ? el("small", {}, ` ${unit}`) : null, mark));
    };
    const heads = [
      heading("name", "frame"), statuses ? heading("status", "status") : null,
      ...data.columns.map((c) => heading(c.key, c.name, c.unit)), el("th.words", { scope: "col" }, el("button", { disabled: true }, "flags")),
    ];
    const row = (k) => {
      const frame = data.frames[k];
      const cells = data.columns.map((c) => el("td", {}, shown(frame.figures[c.key], c.digits)));
      return el(
        "tr", { id: `frame-${k}`, "aria-selected": String(k === this.chosen), click: () => this.select(k) },
        el("td", {}, frame.name), statuses ? el("td", {}, frame.status) : null, ...cells, el("td.words", {}, ...flags(frame)),
      );
    };
    byId("table").replaceChildren(el("thead", {}, el("tr", {}, ...heads)), el("tbody", {}, ...this.shown.slice(0, this.limit).map(row)));
    byId("more")?.remove();
    const left = this.shown.length - this.limit;
    if (left > 0) {
      const click = () => {
        this.limit += ROWS;
        this.draw();
      };
      byId("scroll").append(el("button", { id: "more", click }, `${left} more`));
    }
  }

  select(k) {
    byId(`frame-${this.chosen}`)?.setAttribute("aria-selected", "false");
    this.chosen = k;
    const row = byId(`frame-${k}`);
    row?.setAttribute("aria-selected", "true");
    // Within the table alone: the page stays where it is.
    const box = byId("scroll");
    if (row && (row.offsetTop < box.scrollTop + 30 || row.offsetTop + row.offsetHeight > box.scrollTop + box.clientHeight)) {
      box.scrollTop = row.offsetTop - box.clientHeight / 2;
    }
    this.choose(this.data.frames[k]);
    // Pages within other pages may have no address of their own.
    try { history.replaceState(null, "", `#${k}`); } catch { /* It is not kept, then. */ }
  }

  /** The frame so many rows further. */
  step(by) {
    if (!this.shown.length) return;
    const at = this.shown.indexOf(this.chosen);
    const next = at < 0 ? 0 : Math.max(0, Math.min(this.shown.length - 1, at + by));
    if (next >= this.limit) {
      this.limit = next + ROWS;
      this.draw();
    }
    this.select(this.shown[next]);
  }
}
