// Elements, numbers and colors.

/** An element with attributes (functions are handlers of events) and children (strings are text). */
function el(name, attributes = {}, ...children) {
  const [tag, ...classes] = name.split(".");
  const svg = ["svg", "g", "path", "line", "rect", "circle", "text", "title"].includes(tag);
  const node = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  if (classes.length) node.setAttribute("class", classes.join(" "));
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(key, value);
    else if (value !== undefined && value !== null && value !== false) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

const byId = (id) => document.getElementById(id);

/** A number with so many decimal places; a dash where there is none. */
const shown = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–");

/** A number with two significant digits, or a power of ten where it is very small or large. */
function short(value) {
  if (value === 0 || !Number.isFinite(value)) return value === 0 ? "0" : "–";
  const size = Math.abs(value);
  return size < 1e-3 || size >= 1e5 ? value.toExponential(0) : String(Number(value.toPrecision(2)));
}

/** Bytes of base64. */
const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

/** The color between the nearest of stops [place, [r, g, b]], which rise; colors in 0..1. */
function between(stops, at) {
  const k = stops.findIndex(([place]) => place >= at);
  if (k <= 0) return stops[k === 0 ? 0 : stops.length - 1][1];
  const [[low, from], [high, to]] = [stops[k - 1], stops[k]];
  const part = (at - low) / (high - low);
  return from.map((c, i) => c + part * (to[i] - c));
}

const css = (color) => `rgb(${color.map((c) => Math.round(255 * c)).join(" ")})`;

/** A strip of all colors of stops, for a legend. */
function strip(stops) {
  const [first, last] = [stops[0][0], stops[stops.length - 1][0]];
  const colors = stops.map(([at, color]) => `${css(color)} ${(100 * (at - first)) / (last - first)}%`);
  return el("i", { style: `background: linear-gradient(to right, ${colors.join(", ")})` });
}

function flags(frame) {
  return frame.flags.map((flag) => el("span.flag", {}, flag));
}
