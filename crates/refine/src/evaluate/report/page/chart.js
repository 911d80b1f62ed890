// Curves over one axis, as SVG.

const CURVES = ["#2f7fc1", "#d64933", "#3a9a5b", "#8b62b5", "#c08a1e", "#5b6b78"];

/** Round places for marks on an axis, about `count` of them. */
function ticks(low, high, count) {
  const rough = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const places = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) places.push(k * step);
  return places;
}

function drawChart({ title, axes, logarithmic, series }) {
  const [width, height, left, right, top, bottom] = [520, 250, 52, 10, 8, 34];
  const fits = ([, y]) => Number.isFinite(y) && (!logarithmic || y > 0);
  const points = series.flatMap((s) => s.points.filter(fits));
  if (!points.length) return el("section.card", {}, el("h3", {}, title), el("p.faint", {}, "nothing to draw"));
  const place = logarithmic ? Math.log10 : (y) => y;
  const range = (values) => values.reduce(([l, h], v) => [Math.min(l, v), Math.max(h, v)], [Infinity, -Infinity]);
  const [x0, x1] = range(points.map((p) => p[0]));
  let [y0, y1] = range(points.map((p) => place(p[1])));
  if (logarithmic) y0 = Math.max(y0, y1 - 6);
  else y0 = Math.min(y0, 0);
  if (y1 - y0 < 1e-12) y1 = y0 + 1;
  const x = (value) => left + ((value - x0) / (x1 - x0 || 1)) * (width - left - right);
  const y = (value) => height - bottom - ((Math.max(value, y0) - y0) / (y1 - y0)) * (height - top - bottom);
  const svg = el("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title });
  for (const at of ticks(y0, y1, 4)) {
    if (logarithmic && Math.abs(at - Math.round(at)) > 1e-9) continue;
    svg.append(
      el("line.grid", { x1: left, x2: width - right, y1: y(at), y2: y(at) }),
      el("text", { x: left - 5, y: y(at) + 4, "text-anchor": "end" }, short(logarithmic ? 10 ** at : at)),
    );
  }
  for (const at of ticks(x0, x1, 6)) {
    svg.append(
      el("line.grid", { x1: x(at), x2: x(at), y1: height - bottom, y2: height - bottom + 4 }),
      el("text", { x: x(at), y: height - bottom + 16, "text-anchor": "middle" }, String(Number(at.toPrecision(6)))),
    );
  }
  svg.append(
    el("text", { x: (left + width) / 2, y: height - 4, "text-anchor": "middle" }, axes[0]),
    el("text", { transform: `translate(11 ${(height - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, axes[1]),
  );
  series.forEach(({ name, points }, k) => {
    let pen = "M";
    let path = "";
    for (const point of points) {
      if (fits(point)) path += `${pen}${x(point[0]).toFixed(1)} ${y(place(point[1])).toFixed(1)}`;
      pen = fits(point) ? "L" : "M";
    }
    const color = CURVES[k % CURVES.length];
    svg.append(el("path", { d: path, fill: "none", stroke: color, "stroke-width": 1.6, "stroke-linejoin": "round" }, el("title", {}, name)));
  });
  const entry = ({ name }, k) => el("span", {}, el("i", { style: `background: ${CURVES[k % CURVES.length]}` }), name);
  return el("section.card", {}, el("h3", {}, title), svg, el("div.legend", {}, ...series.map(entry)));
}
