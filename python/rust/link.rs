//! Links of articulations.

use nalgebra::{Matrix3, Point3, Unit};
use prehend_sim::articulated::{Joint, Link as SimLink};
use pyo3::prelude::*;

use crate::arrays::{Numbers, inertia, pose, vector_or};
use crate::error::{Raise, wrong};
use crate::shape::PyShape;

/// A link of an articulation and the joint that it hangs on.
///
/// `joint` is "fixed", "revolute", "prismatic", "spherical" or "floating", along `axis` in the link's frame; `parent` is the place of the parent
/// in the list given to `Model.add_articulation`, None for the world; `at` is the pose of the joint in the parent's frame (4 × 4 or a
/// translation). Mass properties are given as `mass` [kg], `com` [m] and `inertia` [kg m²] about the center of mass (3 × 3 or its diagonal), or
/// follow from `shape` and `density` [kg/m³] or `mass`; with a shape the link touches others.
#[pyclass(name = "Link", frozen, module = "prehend")]
pub(crate) struct PyLink {
    pub(crate) link: SimLink,
    pub(crate) shape: Option<prehend_sim::Shape>,
}

#[pymethods]
impl PyLink {
    #[new]
    #[pyo3(signature = (name, joint="revolute", *, axis=None, parent=None, at=None, mass=None, com=None, inertia=None, shape=None, density=None, armature=0.0))]
    #[allow(clippy::too_many_arguments)] // as many as Python names
    fn new(
        name: &str,
        joint: &str,
        axis: Option<Numbers<'_>>,
        parent: Option<usize>,
        at: Option<Numbers<'_>>,
        mass: Option<f64>,
        com: Option<Numbers<'_>>,
        inertia: Option<Numbers<'_>>,
        shape: Option<&PyShape>,
        density: Option<f64>,
        armature: f64,
    ) -> PyResult<Self> {
        let axis = vector_or(axis.as_ref(), [0.0, 0.0, 1.0], "axis")?;
        let axis = || {
            let axis = Unit::try_new(axis, 0.0).filter(|axis| axis.iter().all(|x| x.is_finite()));
            axis.ok_or_else(|| wrong(format!("link '{name}': axis has no direction")))
        };
        let joint = match joint {
            "fixed" => Joint::Fixed,
            "revolute" => Joint::Revolute(axis()?),
            "prismatic" => Joint::Prismatic(axis()?),
            "spherical" => Joint::Spherical,
            "floating" => Joint::Floating,
            _ => {
                let known = "fixed, revolute, prismatic, spherical, floating";
                return Err(wrong(format!(
                    "link '{name}': there is no joint '{joint}': one of {known}"
                )));
            }
        };
        let shape = shape.map(|shape| shape.shape.clone());
        let matter = Matter::of(mass, com.as_ref(), inertia.as_ref(), shape.as_ref(), density)?;
        let Matter { mass, com, inertia } = matter.unwrap_or_default();
        let t_parent_joint = pose(at.as_ref(), "at")?;
        let massless = SimLink::massless(name, joint);
        let link = SimLink { parent, t_parent_joint, mass, com, inertia, armature, ..massless };
        Ok(Self { link, shape })
    }

    fn __repr__(&self) -> String {
        format!("Link({:?}, {:?})", self.link.name, self.link.joint)
    }
}

/// Density of what none is given of, that of water [kg/m³].
const DENSITY: f64 = 1000.0;

/// Mass properties.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matter {
    pub(crate) mass: f64,
    pub(crate) com: Point3<f64>,
    pub(crate) inertia: Matrix3<f64>,
}

impl Default for Matter {
    fn default() -> Self {
        Self { mass: 0.0, com: Point3::origin(), inertia: Matrix3::zeros() }
    }
}

impl Matter {
    /// As given, or those of a shape of uniform density; none if nothing is given.
    pub(crate) fn of(
        mass: Option<f64>,
        com: Option<&Numbers<'_>>,
        inertia: Option<&Numbers<'_>>,
        shape: Option<&prehend_sim::Shape>,
        density: Option<f64>,
    ) -> PyResult<Option<Self>> {
        if let Some(moments) = inertia {
            let mass = mass.ok_or_else(|| wrong("an inertia is given, but no mass"))?;
            if density.is_some() {
                return Err(wrong("density and inertia are given: one of them"));
            }
            let com = vector_or(com, [0.0; 3], "com")?;
            return Ok(Some(Self { mass, com: com.into(), inertia: self::inertia(moments)? }));
        }
        let Some(shape) = shape else {
            return match (mass, density) {
                (None, None) if com.is_none() => Ok(None),
                // A point: links may be such.
                (Some(mass), None) => {
                    let com = vector_or(com, [0.0; 3], "com")?.into();
                    Ok(Some(Self { mass, com, inertia: Matrix3::zeros() }))
                }
                (None, None) => Err(wrong("a com is given, but no mass")),
                _ => Err(wrong("a density is given, but no shape")),
            };
        };
        if com.is_some() {
            return Err(wrong(
                "a com is given, but no inertia: that of the shape is about another",
            ));
        }
        let moments = shape.moments().ok_or_else(|| wrong("the shape has no mass"));
        let density = match (mass, density) {
            (Some(_), Some(_)) => return Err(wrong("mass and density are given: one of them")),
            (None, None) => DENSITY,
            (Some(mass), None) => {
                mass / moments.as_ref().map_or(f64::NAN, |moments| moments.volume)
            }
            (None, Some(density)) => density,
        };
        let (mass, com, inertia) = moments?.of_density(density);
        prehend_sim::RigidBody::new(mass, inertia, com).raise()?;
        Ok(Some(Self { mass, com, inertia }))
    }
}
