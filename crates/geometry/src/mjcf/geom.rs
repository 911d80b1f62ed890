//! Shapes on bodies: what collides, what is seen, what weighs.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::compiler::Compiler;
use super::element::Element;
use super::error::Result;
use super::height_field::HeightFields;
use super::mesh::Meshes;
use super::shape::{Kind, Shape};
use super::solver::SolverParameters;
use super::{fit, mass, material, orientation};
use crate::inertial::Inertial;

/// A shape fixed to a body.
#[derive(Clone, Debug)]
pub struct Geom {
    /// Its name, empty where it has none.
    pub name: String,
    /// Its shape.
    pub shape: Shape,
    /// The shape's frame → body frame.
    pub t_body_geom: Isometry3<f64>,
    /// Bits that another's `contact_affinity` is compared with: two collide where one of the comparisons finds a bit in common.
    pub contact_type: u32,
    /// Bits that another's `contact_type` is compared with.
    pub contact_affinity: u32,
    /// Dimensions of its contacts: 1 without friction, 3 with sliding, 4 with torsional, 6 with rolling friction.
    pub contact_dimensions: u32,
    /// Contact priority: of two geoms, the one of higher priority sets the contact parameters.
    pub priority: i32,
    /// Coefficients of sliding \[1\], torsional \[m\] and rolling \[m\] friction.
    pub friction: [f64; 3],
    /// How softly its contacts give way.
    pub solver: SolverParameters,
    /// The distance at which contacts begin \[m\].
    pub margin: f64,
    /// Its group: by custom 2 holds what is seen and 3 what collides.
    pub group: i32,
    /// Its color, or its material's, as stored in image files, and its opacity.
    pub rgba: [f32; 4],
}

impl Geom {
    /// Whether it can collide with anything; else it is there to be seen, or to weigh.
    pub fn collides(&self) -> bool {
        self.contact_type != 0 || self.contact_affinity != 0
    }
}

/// Attributes of a geom: the defaults of its class, replaced by those of its element.
#[derive(Clone)]
pub(super) struct GeomSpec {
    kind: Kind,
    size: [f64; 3],
    position: Option<Vector3<f64>>,
    rotation: UnitQuaternion<f64>,
    ends: Option<[f64; 6]>,
    mesh: Option<String>,
    height_field: Option<String>,
    fit_scale: f64,
    mass: Option<f64>,
    density: f64,
    is_shell: bool,
    contact_type: u32,
    contact_affinity: u32,
    contact_dimensions: u32,
    priority: i32,
    friction: [f64; 3],
    solver: SolverParameters,
    margin: f64,
    group: i32,
    material: Option<String>,
    rgba: Option<[f32; 4]>,
}

impl Default for GeomSpec {
    fn default() -> Self {
        Self {
            kind: Kind::Sphere,
            size: [0.0; 3],
            position: None,
            rotation: UnitQuaternion::identity(),
            ends: None,
            mesh: None,
            height_field: None,
            fit_scale: 1.0,
            mass: None,
            density: 1000.0,
            is_shell: false,
            contact_type: 1,
            contact_affinity: 1,
            contact_dimensions: 3,
            priority: 0,
            friction: [1.0, 0.005, 0.0001],
            solver: SolverParameters::default(),
            margin: 0.0,
            group: 0,
            material: None,
            rgba: None,
        }
    }
}

impl GeomSpec {
    pub(super) fn read(&mut self, e: &Element, compiler: &Compiler) -> Result<()> {
        self.kind = e.keyword("type", &Kind::WORDS)?.unwrap_or(self.kind);
        e.leading("size", &mut self.size)?;
        self.position = e.numbers("pos")?.map(Vector3::from).or(self.position);
        self.rotation = orientation::read(e, compiler)?.unwrap_or(self.rotation);
        self.ends = e.numbers("fromto")?.or(self.ends);
        self.mesh = e.text("mesh").map(str::to_owned).or_else(|| self.mesh.take());
        self.height_field =
            e.text("hfield").map(str::to_owned).or_else(|| self.height_field.take());
        self.fit_scale = e.number("fitscale")?.unwrap_or(self.fit_scale);
        self.mass = e.magnitude("mass")?.or(self.mass);
        self.density = e.magnitude("density")?.unwrap_or(self.density);
        self.is_shell = e.switch("shellinertia")?.unwrap_or(self.is_shell);
        // Bits are written as signed numbers, too.
        let bits = |field| e.integer::<i32>(field).map(|x| x.map(i32::cast_unsigned));
        self.contact_type = bits("contype")?.unwrap_or(self.contact_type);
        self.contact_affinity = bits("conaffinity")?.unwrap_or(self.contact_affinity);
        self.contact_dimensions = e.integer("condim")?.unwrap_or(self.contact_dimensions);
        self.priority = e.integer("priority")?.unwrap_or(self.priority);
        e.leading("friction", &mut self.friction)?;
        self.solver.read(e, ["solref", "solimp"])?;
        self.margin = e.number("margin")?.unwrap_or(self.margin);
        self.group = e.integer("group")?.unwrap_or(self.group);
        self.material = e.text("material").map(str::to_owned).or_else(|| self.material.take());
        self.rgba = material::rgba(e)?.or(self.rgba);
        Ok(())
    }

    /// The geom of `e`, which lies in a frame of its body's, and, where it `weighs`, its part of the body in the body's
    /// frame.
    pub(super) fn build(
        self,
        e: &Element,
        compiler: &Compiler,
        assets: &GeomAssets<'_>,
        t_body_frame: &Isometry3<f64>,
        weighs: bool,
    ) -> Result<(Geom, Option<Inertial>)> {
        let (t_frame_geom, size) = self.placed(e)?;
        let mut t_body_geom = t_body_frame * t_frame_geom;
        let shape = if self.kind == Kind::HeightField {
            let name = self.height_field.as_deref().ok_or_else(|| e.missing("hfield"))?;
            Shape::HeightField(assets.height_fields.get(e, name)?)
        } else if let Some(name) = &self.mesh {
            let mesh = assets.meshes.get(e, name)?;
            if self.kind == Kind::Mesh {
                Shape::Mesh(mesh.mesh.clone())
            } else {
                let fitted = fit::shape(self.kind, &mesh, self.fit_scale, compiler.fit_bounds);
                let (shape, t_mesh_shape) = fitted.ok_or_else(|| {
                    e.invalid("mesh", format!("'{name}' holds no volume to fit a shape to"))
                })?;
                t_body_geom *= t_mesh_shape;
                shape
            }
        } else if self.kind == Kind::Mesh {
            return Err(e.missing("mesh"));
        } else {
            let shape = self.kind.of_size(size);
            shape.ok_or_else(|| e.invalid("size", "must be positive"))?
        };
        let inertial = match weighs && self.counts(compiler) {
            true => self.inertial(e, assets, &shape)?,
            false => None,
        };
        let own = self.material.as_ref().map(|name| {
            let color = assets.materials.get(name);
            color.copied().ok_or_else(|| e.unknown("material", name))
        });
        let geom = Geom {
            name: e.name(),
            shape,
            t_body_geom,
            contact_type: self.contact_type,
            contact_affinity: self.contact_affinity,
            contact_dimensions: self.contact_dimensions,
            priority: self.priority,
            friction: self.friction,
            solver: self.solver,
            margin: self.margin,
            group: self.group,
            rgba: self.rgba.or(own.transpose()?).unwrap_or([0.5, 0.5, 0.5, 1.0]),
        };
        Ok((geom, inertial.map(|i| i.moved(&t_body_geom))))
    }

    /// Whether its mass is part of its body's.
    fn counts(&self, compiler: &Compiler) -> bool {
        let [first, last] = compiler.inertia_groups;
        (first..=last).contains(&f64::from(self.group))
            && self.mass != Some(0.0)
            && self.kind != Kind::Plane
    }

    /// Mass and inertia of a geom of this `shape`, in the shape's frame; `None` up to 1e-15 kg.
    fn inertial(
        &self,
        e: &Element,
        assets: &GeomAssets<'_>,
        shape: &Shape,
    ) -> Result<Option<Inertial>> {
        let unit = match (&self.mesh, self.kind) {
            (Some(name), Kind::Mesh) => {
                if self.is_shell {
                    e.refuse_attribute("shellinertia", "is for the mesh to say, not for its geom");
                }
                assets.meshes.get(e, name)?.of_unit_density()
            }
            _ => mass::of_unit_density(shape, self.is_shell),
        };
        let Some(unit) = unit else {
            return Err(e.invalid("mesh", "holds no volume: it weighs nothing"));
        };
        let density = self.mass.map_or(self.density, |mass| mass / unit.mass);
        let mass = self.mass.unwrap_or(self.density * unit.mass);
        let all = Inertial { mass, inertia: unit.inertia * density, ..unit };
        if !(mass.is_finite() && all.inertia.iter().chain(all.com.iter()).all(|x| x.is_finite())) {
            return Err(e.invalid("mass", "or size is beyond all bounds"));
        }
        Ok((mass > 1e-15).then_some(all))
    }

    /// Where the geom is in its frame, and its size.
    fn placed(&self, e: &Element) -> Result<(Isometry3<f64>, [f64; 3])> {
        let Some(ends) = self.ends else {
            let position = self.position.unwrap_or_default();
            return Ok((Isometry3::from_parts(position.into(), self.rotation), self.size));
        };
        if self.position.is_some_and(|position| position != Vector3::zeros()) {
            return Err(e.invalid("fromto", "is given beside pos: one place too many"));
        }
        if !self.kind.has_ends() {
            return Err(e.invalid("fromto", "is for capsules, cylinders, ellipsoids and boxes"));
        }
        let (frame, half) =
            orientation::between(ends).ok_or_else(|| e.invalid("fromto", "has no length"))?;
        let radius = self.size[0];
        let size = match self.kind {
            Kind::Capsule | Kind::Cylinder => [radius, half, 0.0],
            _ => [radius, radius, half],
        };
        Ok((frame, size))
    }
}

/// Assets that geoms refer to by name; `materials` are their colors.
pub(super) struct GeomAssets<'a> {
    pub(super) meshes: Meshes<'a>,
    pub(super) height_fields: HeightFields<'a>,
    pub(super) materials: BTreeMap<String, [f32; 4]>,
}
