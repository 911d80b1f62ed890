//! Articulations and robots.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use prehend_geometry::mjcf::Model as MjcfModel;
use prehend_geometry::robot::{KinematicTree, RobotShape};
use prehend_refine::data::user_cache;
use prehend_sim::articulated::Joint;
use prehend_sim::model::JointAxis;
use prehend_sim::robot::{MjcfOptions, UrdfOptions};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::laws::{joint_law, values_of};
use super::{BodyKey, GRAVITY, PyModel};
use crate::arrays::{Numbers, pose};
use crate::error::Raise;
use crate::link::PyLink;
use crate::read_options::read_options;
use crate::robot::Robot;
use crate::threads::detached;

/// Distance of the grid of a robot's link [m], and how far it reaches.
const LINK_GRID: [f64; 2] = [2e-3, 8e-3];

/// A link, or a link and the place of the axis among those of its joint.
#[derive(FromPyObject)]
enum AxisKey {
    Link(BodyKey),
    Axis(BodyKey, usize),
}

/// One axis, or several with the factors of a weighted sum.
#[derive(FromPyObject)]
enum Axes {
    One(AxisKey),
    Sum(Vec<(AxisKey, f64)>),
}

impl PyModel {
    fn axis(&self, key: &AxisKey) -> PyResult<JointAxis> {
        match key {
            AxisKey::Link(link) => Ok(self.id(link)?.into()),
            AxisKey::Axis(link, index) => Ok(JointAxis { link: self.id(link)?, index: *index }),
        }
    }

    /// Puts a robot among those that were added.
    fn keep(&mut self, py: Python<'_>, robot: Robot) -> PyResult<Py<Robot>> {
        let robot = Py::new(py, robot)?;
        self.robots.push(robot.clone_ref(py));
        Ok(robot)
    }
}

/// A file in MJCF, and options of adding it.
fn read_mjcf(
    path: &Path,
    pose: Option<&Numbers<'_>>,
    floating: bool,
    shapes: bool,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<(MjcfModel, MjcfOptions)> {
    let (t_world_mjcf, read) = (self::pose(pose, "pose")?, read_options(options)?);
    let (base, partial) = (base(floating), read.partial);
    let options = MjcfOptions { t_world_mjcf, base, shapes, partial, ..MjcfOptions::default() };
    Ok((MjcfModel::from_file_with(path, &read).raise()?, options))
}

fn base(floating: bool) -> Joint {
    if floating { Joint::Floating } else { Joint::Fixed }
}

#[pymethods]
impl PyModel {
    /// Adds links, each after its parent, as bodies, and returns their numbers.
    fn add_articulation(&mut self, links: Vec<Py<PyLink>>) -> PyResult<Vec<usize>> {
        let own = links.iter().map(|link| link.get().link.clone()).collect();
        let bodies = self.model.add_articulation(own).raise()?;
        for (body, link) in bodies.iter().zip(&links) {
            if let Some(shape) = &link.get().shape {
                self.model.bodies[*body].surface = shape.surface().cloned();
                self.model.bodies[*body].field = Some(shape.field().clone());
            }
        }
        Ok(bodies.iter().map(|body| body.index()).collect())
    }

    /// Lets a law of that name (`prehend.joint_laws()`) act along the joint of a link, of an axis of it `(link, index)`, or along a weighted sum of
    /// joints `[(link, factor), …]`, as a tendon does. Returns the names of its parameters.
    #[pyo3(signature = (joint, law, **parameters))]
    fn add_joint_force(
        &mut self,
        joint: Axes,
        law: &str,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<BTreeMap<String, String>> {
        let law = joint_law(law, values_of(parameters)?)?;
        let axes = match &joint {
            Axes::One(key) => vec![(self.axis(key)?, 1.0)],
            Axes::Sum(keys) => keys
                .iter()
                .map(|(key, factor)| Ok((self.axis(key)?, *factor)))
                .collect::<PyResult<Vec<_>>>()?,
        };
        self.naming(|model| model.add_coupled_force(&axes, law).map(|_| ()).raise())
    }

    /// Adds a robot in MJCF with its joints, actuators, tendons and loops. With `shapes`, its bodies get their collision shapes. `pose` is where the
    /// file's world is (4 × 4 or a translation). Options of reading are `partial` (leave out what is not supported, with a warning), `root` (folder that
    /// named files may lie in) and `allow_outside` (read them wherever they lie).
    #[pyo3(signature = (path, *, pose=None, floating=false, shapes=true, **options))]
    fn add_mjcf(
        &mut self,
        py: Python<'_>,
        path: PathBuf,
        pose: Option<Numbers<'_>>,
        floating: bool,
        shapes: bool,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<Robot>> {
        let (mjcf, options) = read_mjcf(&path, pose.as_ref(), floating, shapes, options)?;
        let before = self.model.parameter_names();
        let robot = detached(py, || self.model.add_mjcf(&mjcf, &options))?.raise()?;
        self.keep(py, Robot::of_mjcf(&mjcf, robot, &self.model, &before))
    }

    /// Model of a robot or scene in MJCF under the gravity of its file, with contacts between all geoms that collide by `contype`, `conaffinity` and
    /// `<exclude>`, by their sliding friction; options are those of `add_mjcf`.
    #[staticmethod]
    #[pyo3(signature = (path, *, pose=None, floating=false, shapes=true, **options))]
    fn from_mjcf(
        py: Python<'_>,
        path: PathBuf,
        pose: Option<Numbers<'_>>,
        floating: bool,
        shapes: bool,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let (mjcf, options) = read_mjcf(&path, pose.as_ref(), floating, shapes, options)?;
        let built = detached(py, || prehend_sim::Model::from_mjcf(&mjcf, &options))?.raise()?;
        let (mut own, robot) = (Self { model: built.0, robots: Vec::new() }, built.1);
        let robot = Robot::of_mjcf(&mjcf, robot, &own.model, &[]);
        own.keep(py, robot)?;
        Ok(own)
    }

    /// Adds a robot in URDF with its joints, their limits, damping and friction; it has no motors. With `shapes`, its links get their collision
    /// meshes as distance fields, which the samples of other bodies touch. `pose` is where its base is (4 × 4 or a translation). Options of reading
    /// are those of `add_mjcf`, `packages` (folders of ROS packages by name) and `inertia_from_geometry` (replace inertias that no body can have).
    #[pyo3(signature = (path, *, pose=None, floating=false, shapes=true, **options))]
    fn add_urdf(
        &mut self,
        py: Python<'_>,
        path: PathBuf,
        pose: Option<Numbers<'_>>,
        floating: bool,
        shapes: bool,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Py<Robot>> {
        let robot = KinematicTree::from_urdf_file_with(&path, &read_options(options)?).raise()?;
        let [spacing, margin] = LINK_GRID;
        let cache = user_cache();
        let shape = || {
            let shape = || RobotShape::cached(&robot, spacing, margin, cache.as_ref());
            shapes.then(shape).transpose()
        };
        let shape = detached(py, shape)?.raise()?;
        let t_world_base = self::pose(pose.as_ref(), "pose")?;
        let options = UrdfOptions { t_world_base, base: base(floating), ..UrdfOptions::default() };
        let bodies = self.model.add_articulated_robot(&robot, shape.as_ref(), &options).raise()?;
        self.keep(py, Robot::of_urdf(&robot, &bodies))
    }

    /// A model of a robot in URDF under gravity −9.81 m/s² along z, with the options of `add_urdf`.
    #[staticmethod]
    #[pyo3(signature = (path, *, pose=None, floating=false, shapes=true, **options))]
    fn from_urdf(
        py: Python<'_>,
        path: PathBuf,
        pose: Option<Numbers<'_>>,
        floating: bool,
        shapes: bool,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut model = Self::under(GRAVITY.into());
        model.add_urdf(py, path, pose, floating, shapes, options)?;
        Ok(model)
    }

    /// The robots that were added, in their order.
    #[getter]
    pub(super) fn robots(&self, py: Python<'_>) -> Vec<Py<Robot>> {
        self.robots.iter().map(|robot| robot.clone_ref(py)).collect()
    }
}
