//! Pairs of bodies that do not collide.

use super::element::Element;
use super::error::Result;
use super::names::Names;

/// The pairs of the `exclude` elements in `root`; `None` is the world.
pub(super) fn exclusions(root: &Element, names: &Names) -> Result<Vec<[Option<usize>; 2]>> {
    let mut all = Vec::new();
    for e in root.in_sections("contact").filter(|e| e.tag == "exclude") {
        e.take();
        e.text("name");
        all.push([names.bodies.get(e, "body1")?, names.bodies.get(e, "body2")?]);
    }
    Ok(all)
}
