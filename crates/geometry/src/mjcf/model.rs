//! A whole model, and how it is read.

use std::path::Path;

use nalgebra::{Isometry3, Vector3};

use super::actuator::{self, Actuator};
use super::asset::Files;
use super::body::{self, Body};
use super::class::Classes;
use super::compiler::Compiler;
use super::contact;
use super::element::Element;
use super::equality::{self, Equality};
use super::error::MjcfError;
use super::flags::Flags;
use super::geom::{Geom, GeomAssets};
use super::height_field::HeightFields;
use super::joint::{Joint, JointKind};
use super::keyframe::{self, Keyframe};
use super::mesh::Meshes;
use super::names::Names;
use super::sensor::{self, Sensor};
use super::site::Site;
use super::tendon::{self, Tendon};
use super::warning::{self, Warning};
use super::{material, source, submodel};
use crate::io::folder::Folder;
use crate::read_options::ReadOptions;

/// A joint of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointIndex {
    /// Index of the body that it moves.
    pub body: usize,
    /// Index among that body's joints.
    pub joint: usize,
}

/// A model in SI units and radians.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its name.
    pub name: String,
    /// Acceleration of free fall \[m/s²\].
    pub gravity: Vector3<f64>,
    /// The time step that its author meant \[s\].
    pub time_step: f64,
    /// The bodies, each after the one that carries it, depth first: MuJoCo's order without the world.
    pub bodies: Vec<Body>,
    /// Shapes fixed to the world.
    pub world_geoms: Vec<Geom>,
    /// Marked places of the world.
    pub world_sites: Vec<Site>,
    /// Its actuators.
    pub actuators: Vec<Actuator>,
    /// Its tendons.
    pub tendons: Vec<Tendon>,
    /// Constraints between its bodies and joints.
    pub equalities: Vec<Equality>,
    /// Pairs of bodies that do not collide, beside those that a joint connects; `None` is the world.
    pub exclusions: Vec<[Option<usize>; 2]>,
    /// States that it comes with.
    pub keyframes: Vec<Keyframe>,
    /// Sensors whose readings follow from a state.
    pub sensors: Vec<Sensor>,
    /// Parts that have not been read.
    pub warnings: Vec<Warning>,
}

impl Model {
    /// Reads an MJCF file. Meshes and included files are looked for in its folder, below, and in its package ([`ReadOptions::root`]).
    ///
    /// # Errors
    /// [`MjcfError`], naming file, element and attribute: [`MjcfError::Unsupported`] of what changes masses, degrees of freedom, contacts or actuation and
    /// is not supported.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, MjcfError> {
        Self::from_file_with(path, &ReadOptions::default())
    }

    /// [`from_file`](Self::from_file) with options.
    ///
    /// # Errors
    /// [`MjcfError`], naming file, element and attribute.
    pub fn from_file_with(
        path: impl AsRef<Path>,
        options: &ReadOptions,
    ) -> Result<Self, MjcfError> {
        let path = path.as_ref();
        let folder = options.folder(path);
        let root = source::parse(&source::read(path)?, Some(path), Some(&folder))?;
        Self::from_tree(root, Some(&folder), options.partial)
    }

    /// Reads MJCF text. Meshes and included files are looked for in `asset_dir` and never outside of it.
    ///
    /// # Errors
    /// [`MjcfError`], naming element and attribute.
    pub fn from_str(xml: &str, asset_dir: Option<&Path>) -> Result<Self, MjcfError> {
        Self::from_str_with(xml, asset_dir, &ReadOptions::default())
    }

    /// [`from_str`](Self::from_str) with options, of which only `partial` matters.
    ///
    /// # Errors
    /// [`MjcfError`], naming element and attribute.
    pub fn from_str_with(
        xml: &str,
        asset_dir: Option<&Path>,
        options: &ReadOptions,
    ) -> Result<Self, MjcfError> {
        let folder = asset_dir.map(Folder::own);
        let root = source::parse(xml, None, folder.as_ref())?;
        Self::from_tree(root, folder.as_ref(), options.partial)
    }

    fn from_tree(
        mut root: Element,
        folder: Option<&Folder>,
        partial: bool,
    ) -> Result<Self, MjcfError> {
        let compilers = submodel::unfold(&mut root, folder)?;
        let root = &root;
        let classes = Classes::read(root, &compilers)?;
        let files = Files { folder, compilers: &compilers };
        let assets = GeomAssets {
            meshes: Meshes::new(root, &classes, files)?,
            height_fields: HeightFields::new(root, files)?,
            materials: material::read(root, &classes)?,
        };
        let tree = body::read(root, &compilers, &classes, &assets)?;
        let mut model = Self {
            name: root.text("model").unwrap_or("MuJoCo Model").to_owned(),
            gravity: Vector3::new(0.0, 0.0, -9.81),
            time_step: 0.002,
            bodies: tree.bodies,
            world_geoms: tree.geoms,
            world_sites: tree.sites,
            actuators: Vec::new(),
            tendons: Vec::new(),
            equalities: Vec::new(),
            exclusions: Vec::new(),
            keyframes: Vec::new(),
            sensors: Vec::new(),
            warnings: Vec::new(),
        };
        for e in root.sections("option") {
            model.gravity = e.numbers("gravity")?.map_or(model.gravity, Vector3::from);
            model.time_step = e.number("timestep")?.unwrap_or(model.time_step);
        }
        let flags = Flags::read(root)?;
        if flags.no_gravity {
            model.gravity = Vector3::zeros();
        }
        model.scale_masses(&compilers.0[0]);
        let mut names = Names::new(&model);
        model.exclusions = contact::exclusions(root, &names)?;
        model.tendons = tendon::read(root, &compilers, &classes, &model, &names)?;
        names.add_tendons(root, &model.tendons);
        model.equalities = equality::read(root, &classes, &model, &names)?;
        let (actuators, written) = actuator::read(root, &compilers, &classes, &model, &names)?;
        model.actuators = actuators;
        flags.apply(&mut model);
        model.keyframes = keyframe::read(root, &model, &written)?;
        model.sensors = sensor::read(root, &model, &names)?;
        model.warnings = warning::warnings(root);
        match model.warnings.iter().find(|warning| warning.changes && !partial) {
            Some(warning) => Err(MjcfError::Unsupported(Box::new(warning.clone()))),
            // It may be what was left out that has the mass.
            None => tree.massless.filter(|_| !partial).map_or(Ok(model), Err),
        }
    }

    fn scale_masses(&mut self, compiler: &Compiler) {
        let inertials = || self.bodies.iter().filter_map(|b| b.inertial);
        let sum: f64 = inertials().map(|i| i.mass).sum();
        let Some(total) = compiler.total_mass.filter(|_| sum > 0.0) else { return };
        for inertial in self.bodies.iter_mut().filter_map(|b| b.inertial.as_mut()) {
            inertial.mass *= total / sum;
            inertial.inertia *= total / sum;
        }
    }

    /// Index of the joint of that name.
    pub fn joint_index(&self, name: &str) -> Option<JointIndex> {
        self.joint_indices().find(|&index| self.joint(index).name == name)
    }

    /// Indices of all joints in the order of [`Keyframe::positions`].
    pub fn joint_indices(&self) -> impl Iterator<Item = JointIndex> {
        let of = |(body, b): (usize, &Body)| {
            (0..b.joints.len()).map(move |joint| JointIndex { body, joint })
        };
        self.bodies.iter().enumerate().flat_map(of)
    }

    /// The joint of that index.
    ///
    /// # Panics
    /// If there is none.
    pub fn joint(&self, index: JointIndex) -> &Joint {
        &self.bodies[index.body].joints[index.joint]
    }

    /// Body frames → world, with all joints at their references.
    pub fn reference_poses(&self) -> Vec<Isometry3<f64>> {
        let mut poses: Vec<Isometry3<f64>> = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            let t_world_parent = body.parent.map_or(Isometry3::identity(), |p| poses[p]);
            poses.push(t_world_parent * body.t_parent_body);
        }
        poses
    }

    /// State that the model starts in, MuJoCo's after `mj_resetData`: joints at their references and at rest, controls zero.
    pub fn reference_state(&self) -> Keyframe {
        let velocities =
            self.bodies.iter().flat_map(|b| &b.joints).map(|j| j.kind.velocities()).sum();
        Keyframe {
            name: String::new(),
            time: 0.0,
            positions: self.reference_positions(),
            velocities: vec![0.0; velocities],
            controls: vec![0.0; self.actuators.len()],
        }
    }

    /// Positions of all joints at their references, laid out as in [`Keyframe::positions`].
    pub fn reference_positions(&self) -> Vec<f64> {
        let mut positions = Vec::new();
        for body in &self.bodies {
            for joint in &body.joints {
                let q = body.t_parent_body.rotation;
                match joint.kind {
                    JointKind::Hinge | JointKind::Slide => positions.push(joint.reference),
                    JointKind::Ball => positions.extend([1.0, 0.0, 0.0, 0.0]),
                    JointKind::Free => {
                        positions.extend(body.t_parent_body.translation.vector.iter());
                        positions.extend([q.w, q.i, q.j, q.k]);
                    }
                }
            }
        }
        positions
    }
}
