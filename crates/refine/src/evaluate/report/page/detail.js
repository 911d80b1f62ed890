// Everything about the frame that is chosen.

function drawResiduals(residuals) {
  const rows = residuals.flatMap(({ sensor, unit, before, after }) => {
    const most = Math.max(before ?? 0, after, 1e-9);
    const bar = (value, color) => el("i", { style: `width: ${(100 * value) / most}%; background: var(--${color})`, title: `${short(value)} ${unit}` });
    const bars = [before === null ? null : bar(before, "before"), bar(after, "after")];
    const said = before === null ? `${short(after)} ${unit}` : `${short(before)} → ${short(after)} ${unit}`;
    return [el("span", {}, sensor), el("span.pair", {}, ...bars), el("span", {}, said)];
  });
  return el("section.card", {}, el("h3", {}, "Median residuals"), el("div.bars", {}, ...rows));
}

function drawPosterior(posterior) {
  const list = (values, digits) => values.map((v) => shown(v, digits)).join(", ");
  const rows = [
    ["probability of being right (5 mm, 5°)", shown(posterior.probability, 3)],
    ["σ of the center along the camera's x, y, z", `${list(posterior.deviation_mm, 2)} mm`],
    ["σ of the rotation about them", `${list(posterior.deviation_deg, 2)}°`],
  ];
  if (posterior.weights.length > 1) rows.push(["shares of the poses found", list(posterior.weights, 2)]);
  if (posterior.unobservable_mm.length) rows.push(["σ along unobservable directions", `${list(posterior.unobservable_mm, 1)} mm`]);
  for (const [what, z] of posterior.misfits) rows.push([`probability that this is of something else: ${what}`, shown(z, 2)]);
  for (const [what, z] of posterior.inconsistencies) rows.push([`inconsistent: ${what}`, `${shown(z, 1)} σ`]);
  for (const [what, scale] of posterior.scales) rows.push([`errors over their nominal size: ${what}`, shown(scale, 2)]);
  rows.push(["termination", posterior.termination]);
  const table = el("table", {}, ...rows.map(([what, value]) => el("tr", {}, el("td.words", {}, what), el("td", {}, value))));
  return el("section.card", {}, el("h3", {}, "Confidence"), table);
}

/** The cards of a frame. */
function drawDetail(data, view, frame) {
  const figures = data.columns.filter(({ key }) => key in frame.figures).map(({ key, name, unit, digits }) =>
    el("div", {}, el("span", {}, `${name} `), `${shown(frame.figures[key], digits)}${unit && unit !== "°" ? ` ${unit}` : unit}`));
  const head = el(
    "section.card", {}, el("h2", {}, frame.name), el("div.figures", {}, frame.status ? el("div", {}, frame.status) : null, ...figures),
    ...flags(frame), frame.remarks.length ? el("ul", {}, ...frame.remarks.map((remark) => el("li", {}, remark))) : null,
  );
  const drawing = frame.drawing;
  if (!drawing) return [head, frame.posterior ? drawPosterior(frame.posterior) : null].filter(Boolean);
  const hand = drawing.scene.hand === null ? null : data.hands[drawing.scene.hand];
  const cards = [
    el("section.card", {}, el("h3", {}, "Outline"), drawSlider(drawing.pictures)),
    view.card(drawing.scene),
    drawing.residuals.length ? drawResiduals(drawing.residuals) : null,
    frame.posterior ? drawPosterior(frame.posterior) : null,
    hand && hand.taxels.length && drawing.scene.forces.length ? drawTaxels(hand, drawing.scene.forces) : null,
    drawing.chart ? drawChart(drawing.chart) : null,
  ];
  return [head, el("div.cards", { style: "margin-top: 1rem" }, ...cards)];
}
