// Two pictures of the same over each other.

function drawSlider([before, after]) {
  const range = el("input", {
    type: "range", min: 0, max: 100, value: 50,
    "aria-label": `${before.label} to the left, ${after.label} to the right`,
    input: () => box.style.setProperty("--at", `${range.value}%`),
  });
  const box = el(
    "div.slider", { style: "--at: 50%" },
    el("img", { src: before.picture, alt: before.label, draggable: "false" }),
    el("img", { src: after.picture, alt: after.label, draggable: "false" }),
    el("b", {}, before.label), el("b", {}, after.label), range,
  );
  return box;
}

/** Shows the one picture whole, then the other. */
function flipSlider(root) {
  const range = root.querySelector(".slider input");
  if (!range) return;
  range.value = Number(range.value) > 50 ? 0 : 100;
  range.dispatchEvent(new Event("input"));
}
