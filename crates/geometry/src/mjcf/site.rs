//! Marked places on bodies.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::compiler::Compiler;
use super::element::Element;
use super::error::Result;
use super::orientation;

/// A frame fixed to a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Its name, empty where it has none.
    pub name: String,
    /// Site frame → body frame.
    pub t_body_site: Isometry3<f64>,
}

/// Attributes of a site: the defaults of its class, replaced by those of its element.
#[derive(Clone, Default)]
pub(super) struct SiteSpec {
    position: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    ends: Option<[f64; 6]>,
}

impl SiteSpec {
    pub(super) fn read(&mut self, e: &Element, compiler: &Compiler) -> Result<()> {
        self.position = e.numbers("pos")?.map_or(self.position, Vector3::from);
        self.rotation = orientation::read(e, compiler)?.unwrap_or(self.rotation);
        self.ends = e.numbers("fromto")?.or(self.ends);
        // The size of its mark.
        e.text("size");
        e.text("type");
        Ok(())
    }

    /// The site of `e`, which lies in a frame of its body's.
    pub(super) fn build(self, e: &Element, t_body_frame: &Isometry3<f64>) -> Result<Site> {
        let t_frame_site = match self.ends {
            Some(ends) => {
                orientation::between(ends).ok_or_else(|| e.invalid("fromto", "has no length"))?.0
            }
            None => Isometry3::from_parts(self.position.into(), self.rotation),
        };
        Ok(Site { name: e.name(), t_body_site: t_body_frame * t_frame_site })
    }
}
