//! Robots in a model.

use std::collections::BTreeMap;

use prehend_geometry::mjcf::Model as MjcfModel;
use prehend_geometry::robot::{KinematicTree, Motion};
use prehend_sim::robot::MjcfRobot;
use prehend_sim::{BodyId, State};
use pyo3::prelude::*;

use crate::arrays::{Array, Numbers, in_order, pose as pose_of};
use crate::error::{Raise, wrong};
use crate::model::PyModel;

/// A robot that was added to a model.
#[pyclass(frozen, module = "prehend")]
pub(crate) struct Robot {
    /// The number of each body by its name.
    #[pyo3(get)]
    bodies: BTreeMap<String, usize>,
    /// The number of the link that each joint moves, and which axis of its joint.
    #[pyo3(get)]
    joints: BTreeMap<String, (usize, usize)>,
    /// The parameter that each actuator is driven by.
    #[pyo3(get)]
    actuators: BTreeMap<String, String>,
    /// Parts of the file that have no counterpart, and those that were put right.
    #[pyo3(get)]
    warnings: Vec<String>,
    /// Positions that the file has, in MuJoCo's order.
    reference: Vec<f64>,
    mjcf: Option<MjcfRobot>,
}

impl Robot {
    /// `before` are the names of the parameters before it was added to `model`.
    pub(crate) fn of_mjcf(
        mjcf: &MjcfModel,
        robot: MjcfRobot,
        model: &prehend_sim::Model,
        before: &[String],
    ) -> Self {
        let before: std::collections::HashSet<&String> = before.iter().collect();
        let names = model.parameter_names();
        // Those of actuators, in their order: nothing else is called so.
        let controls = names.iter().filter(|name| !before.contains(name));
        let controls = controls
            .filter(|name| name.rsplit('.').next().is_some_and(|own| own.starts_with("control")));
        let actuators = robot.actuators.iter().enumerate().map(|(k, (name, _))| named(name, k));
        let bodies = mjcf.bodies.iter().zip(&robot.bodies);
        Self {
            bodies: bodies
                .enumerate()
                .map(|(k, (body, id))| (named(&body.name, k), id.index()))
                .collect(),
            joints: robot
                .joints
                .iter()
                .map(|(name, axis)| (name.clone(), (axis.link.index(), axis.index)))
                .collect(),
            actuators: actuators.zip(controls.cloned()).collect(),
            warnings: robot.warnings.clone(),
            reference: mjcf.reference_positions(),
            mjcf: Some(robot),
        }
    }

    pub(crate) fn of_urdf(tree: &KinematicTree, bodies: &[BodyId]) -> Self {
        let links = tree.links().iter().zip(bodies);
        let moving = tree.joints().iter().filter(|joint| joint.motion != Motion::Fixed);
        Self {
            bodies: links.map(|(link, id)| (link.name.clone(), id.index())).collect(),
            joints: moving
                .map(|joint| (joint.name.clone(), (bodies[joint.child].index(), 0)))
                .collect(),
            actuators: BTreeMap::new(),
            warnings: tree.warnings().to_vec(),
            reference: Vec::new(),
            mjcf: None,
        }
    }

    fn of_mujoco(&self, what: &str) -> PyResult<&MjcfRobot> {
        self.mjcf.as_ref().ok_or_else(|| wrong(format!("a robot of URDF has no {what}")))
    }
}

/// The name, or the number of what has none.
fn named(name: &str, number: usize) -> String {
    if name.is_empty() { number.to_string() } else { name.to_owned() }
}

#[pymethods]
impl Robot {
    /// Puts the joints of a robot in MJCF, in the arrays of `state`, to `positions` in MuJoCo's order, its `qpos`, or where the file has them, at rest.
    #[pyo3(signature = (model, state, positions=None))]
    fn set_positions(
        &self,
        model: &PyModel,
        state: &Bound<'_, PyAny>,
        positions: Option<Numbers<'_>>,
    ) -> PyResult<()> {
        let robot = self.of_mujoco("positions in MuJoCo's order")?;
        let positions =
            positions.map_or_else(|| self.reference.clone(), |p| in_order(&p).into_owned());
        crate::model::states::change(&model.model, state, |all| {
            robot.set_positions(&model.model, all, &positions).raise()
        })
    }

    /// Names of the keyframes of a robot in MJCF.
    #[getter]
    fn keyframes(&self) -> Vec<String> {
        let robot = self.mjcf.as_ref();
        robot.into_iter().flat_map(|own| &own.keyframes).map(|key| key.name.clone()).collect()
    }

    /// Puts joints, activations and controls of a robot in MJCF, in the arrays of `state` and the model's parameters, where the file starts, or to a
    /// keyframe: MuJoCo's `mj_resetData` and `mj_resetDataKeyframe`.
    #[pyo3(signature = (model, state, keyframe=None))]
    fn reset(
        &self,
        model: &mut PyModel,
        state: &Bound<'_, PyAny>,
        keyframe: Option<&str>,
    ) -> PyResult<()> {
        let robot = self.of_mujoco("keyframes")?;
        let mut with_controls = model.model.clone();
        let put = |all: &mut State| match keyframe {
            Some(name) => robot.reset_to(&mut with_controls, all, name).raise(),
            None => robot.reset(&mut with_controls, all).raise(),
        };
        crate::model::states::change(&model.model, state, put)?;
        model.model = with_controls;
        Ok(())
    }

    /// Names of the sensors of a robot in MJCF whose readings follow from states.
    #[getter]
    fn sensors(&self) -> Vec<String> {
        let robot = self.mjcf.as_ref();
        robot.into_iter().flat_map(MjcfRobot::sensor_names).map(str::to_owned).collect()
    }

    /// The reading of a sensor, in MuJoCo's order and units, without noise.
    fn sensor<'py>(
        &self,
        model: &PyModel,
        state: &Bound<'py, PyAny>,
        name: &str,
    ) -> PyResult<Array<'py>> {
        let robot = self.of_mujoco("sensors")?;
        crate::model::states::measured(&model.model, state, None, |state| {
            robot.sensor(&model.model, state, name).raise()
        })
    }

    /// Puts a mocap body of a robot in MJCF at `pose` (4 × 4 or a translation), in the arrays of `state`, between steps: it has no velocity.
    fn set_mocap(
        &self,
        model: &PyModel,
        state: &Bound<'_, PyAny>,
        name: &str,
        pose: Numbers<'_>,
    ) -> PyResult<()> {
        let robot = self.of_mujoco("mocap bodies")?;
        let t_world_mocap = pose_of(Some(&pose), "pose")?;
        // It may be a view of the state.
        drop(pose);
        crate::model::states::change(&model.model, state, |all| {
            robot.set_mocap(&model.model, all, name, &t_world_mocap).raise()
        })
    }

    fn __repr__(&self) -> String {
        format!(
            "Robot(bodies={}, joints={:?}, actuators={:?})",
            self.bodies.len(),
            self.joints.keys(),
            self.actuators.keys()
        )
    }
}
