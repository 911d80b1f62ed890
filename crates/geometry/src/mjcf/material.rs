//! Materials, of which the color is read.

use std::collections::BTreeMap;

use super::class::{Classes, MAIN};
use super::element::Element;
use super::error::Result;

/// The color of a material.
#[derive(Clone, Copy, Debug)]
pub(super) struct MaterialSpec {
    pub(super) rgba: [f32; 4],
}

impl Default for MaterialSpec {
    fn default() -> Self {
        Self { rgba: [1.0; 4] }
    }
}

impl MaterialSpec {
    pub(super) fn read(&mut self, e: &Element) -> Result<()> {
        self.rgba = rgba(e)?.unwrap_or(self.rgba);
        Ok(())
    }
}

/// The attribute `rgba`.
pub(super) fn rgba(e: &Element) -> Result<Option<[f32; 4]>> {
    Ok(e.numbers::<4>("rgba")?.map(|c| c.map(|x| x as f32)))
}

/// Colors of the materials by name.
pub(super) fn read(root: &Element, classes: &Classes) -> Result<BTreeMap<String, [f32; 4]>> {
    let mut all = BTreeMap::new();
    for e in root.in_sections("asset").filter(|e| e.tag == "material") {
        e.take();
        let mut spec = classes.of(e, MAIN)?.material;
        spec.read(e)?;
        if all.insert(e.name(), spec.rgba).is_some() {
            return Err(e.duplicate("material"));
        }
    }
    Ok(all)
}
