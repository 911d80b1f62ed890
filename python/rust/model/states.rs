//! Rows of states.

use numpy::ndarray::ArrayView1;
use numpy::{PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use prehend_sim::{BodyState, Motion, State};
use pyo3::prelude::*;

use super::{BodyKey, Model};
use crate::arrays::{Array, Numbers, array, in_order, matrix, pose, vector_or};
use crate::error::{Raise, wrong};
use crate::rollout::STATE;

/// State of `model` in the rows of an array.
pub(crate) fn state(model: &prehend_sim::Model, rows: &Numbers<'_>) -> PyResult<State> {
    match rows.shape() {
        [_, STATE] => {
            let numbers = in_order(rows);
            let rows = numbers.as_chunks().0.iter().map(BodyState::from_coordinates);
            model.state_of_rows(rows.collect(), 0.0).raise()
        }
        shape => Err(wrong(format!("states: an array of n × 13 is expected, not {shape:?}"))),
    }
}

/// Lets `edit` change the state of `model` in the rows of an array, which stays as it was if that fails.
pub(crate) fn change(
    model: &prehend_sim::Model,
    rows: &Bound<'_, PyAny>,
    edit: impl FnOnce(&mut State) -> PyResult<()>,
) -> PyResult<()> {
    let rows = rows.cast::<PyArray2<f64>>().map_err(|_| {
        wrong("states: an array of n × 13 in double precision is expected, which is written to")
    })?;
    let mut rows = rows.try_readwrite().raise()?;
    let mut array = rows.as_array_mut();
    if array.ncols() != STATE {
        return Err(wrong(format!(
            "states: an array of n × 13 is expected, not {:?}",
            array.shape()
        )));
    }
    let row =
        |row: ArrayView1<'_, f64>| BodyState::from_coordinates(&std::array::from_fn(|k| row[k]));
    let states = array.rows().into_iter().map(row).collect();
    let mut state = model.state_of_rows(states, 0.0).raise()?;
    edit(&mut state)?;
    for (mut row, state) in array.rows_mut().into_iter().zip(state.rows()) {
        row.iter_mut().zip(state.coordinates()).for_each(|(to, x)| *to = x);
    }
    Ok(())
}

/// Positions and velocities apart from arrays that may be views of the states.
fn owned(position: Numbers<'_>, velocity: Option<Numbers<'_>>) -> (Vec<f64>, Option<Vec<f64>>) {
    let copy = |numbers: Numbers<'_>| in_order(&numbers).into_owned();
    (copy(position), velocity.map(copy))
}

#[pymethods]
impl Model {
    /// States in which everything is at rest, frames of bodies at the origin and joints at their neutral coordinates: a row of 13 for
    /// each body, then for each joint, then for each contact with bristles, which is not deflected.
    fn neutral_states<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let state = self.model.neutral_state();
        let rows = state.rows();
        array(py, rows.iter().flat_map(BodyState::coordinates).collect(), &[rows.len(), STATE])
    }

    /// Writes the row of a body in `states`: the pose of its frame (4 × 4 or a translation), velocity of its center of mass (of a fixed body of its
    /// frame's origin) [m/s] and angular velocity [rad/s]. Links are put by `set_joint`.
    #[pyo3(signature = (states, body, pose, *, velocity=None, angular_velocity=None))]
    fn set_pose(
        &self,
        states: &Bound<'_, PyAny>,
        body: BodyKey,
        pose: Numbers<'_>,
        velocity: Option<Numbers<'_>>,
        angular_velocity: Option<Numbers<'_>>,
    ) -> PyResult<()> {
        let id = self.id(&body)?;
        if matches!(self.model.bodies[id].motion, Motion::Link) {
            let name = &self.model.bodies[id].name;
            return Err(wrong(format!(
                "body '{name}' is a link, which its joints put where it is: use set_joint"
            )));
        }
        let at = self::pose(Some(&pose), "pose")?;
        let mut state = match self.model.bodies[id].rigid() {
            Some(rigid) => rigid.at_rest(&at),
            None => BodyState::at_rest(at),
        };
        state.linear = vector_or(velocity.as_ref(), [0.0; 3], "velocity")?;
        state.angular = vector_or(angular_velocity.as_ref(), [0.0; 3], "angular_velocity")?;
        // They may be views of the states.
        drop((pose, velocity, angular_velocity));
        change(&self.model, states, |all| {
            all[id] = state;
            Ok(())
        })
    }

    /// The pose of a body's frame in a row of states, 4 × 4.
    fn pose<'py>(
        &self,
        py: Python<'py>,
        states: Numbers<'py>,
        body: BodyKey,
    ) -> PyResult<Array<'py>> {
        let (id, state) = (self.id(&body)?, self::state(&self.model, &states)?);
        matrix(py, &self.model.pose(&state, id))
    }

    /// Writes coordinates [m, rad] and velocities of the joint of a link into `states`, with those of joints that mimic it in URDF, and where the links are then. A spherical joint has a
    /// quaternion (x, y, z, w), a floating one a place before it.
    #[pyo3(signature = (states, link, position, velocity=None))]
    fn set_joint(
        &self,
        states: &Bound<'_, PyAny>,
        link: BodyKey,
        position: Numbers<'_>,
        velocity: Option<Numbers<'_>>,
    ) -> PyResult<()> {
        let id = self.id(&link)?;
        let (position, velocity) = owned(position, velocity);
        change(&self.model, states, |all| {
            let still = vec![0.0; self.model.joint(all, id).raise()?.velocity.len()];
            self.model.set_joint(all, id, &position, &velocity.unwrap_or(still)).raise()
        })
    }

    /// Coordinates [m, rad] and velocities of the joint of a link.
    fn joint(&self, states: Numbers<'_>, link: BodyKey) -> PyResult<(Vec<f64>, Vec<f64>)> {
        let joint =
            self.model.joint(&self::state(&self.model, &states)?, self.id(&link)?).raise()?;
        Ok((joint.position, joint.velocity))
    }

    /// Generalized positions [m, rad] and velocities of free bodies (center of mass, quaternion x, y, z, w), then of joints: MuJoCo's `qpos` and `qvel`.
    fn generalized_coordinates<'py>(
        &self,
        py: Python<'py>,
        states: Numbers<'py>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let all = self.model.generalized_coordinates(&self::state(&self.model, &states)?);
        let (nq, nv) = (all.position.len(), all.velocity.len());
        Ok((array(py, all.position, &[nq])?, array(py, all.velocity, &[nv])?))
    }

    /// Writes generalized coordinates into `states`, and where the links are then. Velocities are zero by default.
    #[pyo3(signature = (states, position, velocity=None))]
    fn set_generalized_coordinates(
        &self,
        states: &Bound<'_, PyAny>,
        position: Numbers<'_>,
        velocity: Option<Numbers<'_>>,
    ) -> PyResult<()> {
        let (position, velocity) = owned(position, velocity);
        let velocity = velocity.unwrap_or_else(|| vec![0.0; self.model.degrees_of_freedom()]);
        change(&self.model, states, |all| {
            self.model.set_generalized_coordinates(all, &position, &velocity).raise()
        })
    }
}
