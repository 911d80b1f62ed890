// Forces on the skin, patch by patch, each flattened onto its mean plane.

/** Places in newtons on a logarithmic scale: touch begins at some hundredths. */
const FORCE = [[-2, [0.86, 0.87, 0.89]], [-1, [0.98, 0.8, 0.35]], [0, [0.9, 0.33, 0.13]], [1, [0.45, 0.02, 0.25]]];
const forceColor = (newton) => between(FORCE, Math.log10(Math.max(newton, 1e-9)));

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const norm = (a) => Math.sqrt(dot(a, a));
const unit = (a) => scaled(a, 1 / (norm(a) || 1));
const mean = (list) => scaled(list.reduce(plus, [0, 0, 0]), 1 / list.length);

/** Coordinates of taxels in the plane across their mean normal [mm], the link's z axis up where it can be. */
function flattened(taxels) {
  const center = mean(taxels.map((t) => t.position));
  const out = unit(mean(taxels.map((t) => t.normal)));
  const seed = Math.abs(out[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const right = unit(cross(seed, out));
  const up = cross(out, right);
  return taxels.map(({ position, normal }) => {
    const from = minus(position, center);
    // What is behind the bend lies farther out than its projection.
    const stretch = 1 + 0.6 * (1 - Math.max(dot(normal, out), 0));
    return [1e3 * stretch * dot(from, right), -1e3 * stretch * dot(from, up)];
  });
}

function drawTaxels(hand, forces) {
  const patches = new Map();
  hand.taxels.forEach((taxel, k) => {
    if (!patches.has(taxel.patch)) patches.set(taxel.patch, []);
    patches.get(taxel.patch).push(k);
  });
  const figures = [];
  for (const [name, members] of patches) {
    const places = flattened(members.map((k) => hand.taxels[k]));
    const [xs, ys] = [0, 1].map((i) => places.map((p) => p[i]));
    const [x0, x1, y0, y1] = [Math.min(...xs) - 3, Math.max(...xs) + 3, Math.min(...ys) - 3, Math.max(...ys) + 3];
    const svg = el("svg", { viewBox: `${x0} ${y0} ${x1 - x0} ${y1 - y0}`, width: 2.6 * (x1 - x0), height: 2.6 * (y1 - y0) });
    members.forEach((k, i) => {
      const force = forces[k];
      const known = Array.isArray(force);
      const [cx, cy] = places[i];
      const said = known ? `taxel ${k}: ${short(norm(force))} N` : `taxel ${k}: unknown`;
      const paint = known ? { fill: css(forceColor(norm(force))) } : { fill: "none", "stroke-dasharray": "0.6 0.6" };
      svg.append(el("circle", { cx, cy, r: 1.9, stroke: "currentColor", "stroke-width": 0.15, ...paint }, el("title", {}, said)));
    });
    const known = members.map((k) => forces[k]).filter(Array.isArray);
    const total = known.length ? `${short(norm(known.reduce(plus, [0, 0, 0])))} N` : "unknown";
    const part = known.length && known.length < members.length ? ` (${known.length} of ${members.length} taxels)` : "";
    figures.push(el("figure", {}, svg, el("figcaption", {}, `${name}: ${total}${part}`)));
  }
  return el(
    "section.card.wide", {}, el("h3", {}, "Touch"),
    el("div.scale", {}, "0.01 N", strip(FORCE), "10 N"),
    el("div.patches", {}, ...figures),
  );
}
