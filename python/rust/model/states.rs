//! States of a model, in arrays.

use std::ops::Range;

use numpy::{PyArrayDyn, PyArrayMethods};
use prehend_sim::{BodyState, Motion, State};
use pyo3::prelude::*;
use pyo3::types::{PyEllipsis, PySlice};

use super::{BodyKey, PyModel};
use crate::arrays::{Array, Numbers, array, in_order, pose, rows, vector_or};
use crate::batch::{joined, with_batch};
use crate::error::{Raise, wrong};
use crate::layout::{FIELDS, ROW, StateLayout, States, state_arrays};
use crate::rollout::neutral_state;

/// An array, of `shape`, of what `measure` says of a state, with the batch's length in front.
pub(crate) fn measured<'py>(
    model: &prehend_sim::Model,
    state: &Bound<'py, PyAny>,
    shape: Option<&[usize]>,
    measure: impl Fn(&State) -> PyResult<Vec<f64>>,
) -> PyResult<Array<'py>> {
    let (layout, arrays) = (StateLayout::new(model), state_arrays(state)?);
    let states = States::new(model, &layout, &arrays)?;
    let all = states.each().map(|state| measure(&state?)).collect::<PyResult<Vec<_>>>()?;
    let count = [all.first().map_or(0, Vec::len)];
    let shape = with_batch(states.batch, shape.unwrap_or(&count));
    array(state.py(), joined(all), &shape)
}

/// Lets `edit` change a state in its arrays, of a batch each; they stay as they were if that fails.
pub(crate) fn change(
    model: &prehend_sim::Model,
    state: &Bound<'_, PyAny>,
    mut edit: impl FnMut(&mut State) -> PyResult<()>,
) -> PyResult<()> {
    let layout = StateLayout::new(model);
    let changed = {
        let arrays = state_arrays(state)?;
        let states = States::new(model, &layout, &arrays)?;
        let inputs = &states.inputs;
        let mut all: Vec<Vec<f64>> = inputs.iter().map(|own| own.numbers.to_vec()).collect();
        for (world, state) in states.each().enumerate() {
            let mut state = state?;
            edit(&mut state)?;
            let numbers: Vec<f64> = state.rows().iter().flat_map(BodyState::coordinates).collect();
            for (field, input) in inputs.iter().enumerate() {
                let to = &mut all[field][input.start(world)..][..input.width];
                to.copy_from_slice(&layout.read(field, &numbers));
            }
        }
        all
    };
    let arrays = FIELDS.map(|name| {
        let array = state.getattr(name)?.cast_into::<PyArrayDyn<f64>>().map_err(|_| {
            wrong(format!("state.{name}: an array of NumPy in double precision is expected, which is written to"))
        })?;
        array.try_readwrite().raise()
    });
    let arrays = arrays.into_iter().collect::<PyResult<Vec<_>>>()?;
    // `as_array_mut` panics at the strides of an empty array in debug builds.
    for (mut array, numbers) in
        arrays.into_iter().zip(changed).filter(|(_, numbers)| !numbers.is_empty())
    {
        array.as_array_mut().iter_mut().zip(numbers).for_each(|(to, x)| *to = x);
    }
    Ok(())
}

impl PyModel {
    /// Ranges of a body's coordinates among positions and velocities.
    fn ranges(&self, body: &BodyKey) -> PyResult<[Range<usize>; 2]> {
        let id = self.id(body)?;
        let name = &self.model.bodies[id].name;
        let fixed = || wrong(format!("body '{name}' has no coordinates: no force moves it"));
        self.model.coordinate_ranges(id).ok_or_else(fixed)
    }
}

fn slice<'py>(py: Python<'py>, range: &Range<usize>) -> Bound<'py, PySlice> {
    PySlice::new(py, range.start as isize, range.end as isize, 1)
}

#[pymethods]
impl PyModel {
    /// Number of generalized positions, `state.q`: seven of each free body, and those of joints.
    #[getter]
    fn nq(&self) -> usize {
        self.model.state_places().positions.len()
    }

    /// Number of generalized velocities, `state.v`: six of each free body, and those of joints.
    #[getter]
    fn nv(&self) -> usize {
        self.model.degrees_of_freedom()
    }

    /// Number of activations, `state.act`: six of each contact with bristles.
    #[getter]
    fn na(&self) -> usize {
        self.model.state_places().deflections.len()
    }

    /// The `State` in which everything is at rest: frames of free and fixed bodies at the origin, joints at their neutral coordinates, mocap bodies
    /// where their file has them, contacts not deflected.
    fn neutral_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        neutral_state(py, &StateLayout::new(&self.model))
    }

    /// Places of the positions of a free body, or of a link's joint, in `state.q`: MuJoCo's `jnt_qposadr`.
    fn q_slice<'py>(&self, py: Python<'py>, body: BodyKey) -> PyResult<Bound<'py, PySlice>> {
        let [q, _] = self.ranges(&body)?;
        Ok(slice(py, &q))
    }

    /// Places of the velocities of a free body, or of a link's joint, in `state.v`: MuJoCo's `jnt_dofadr`.
    fn v_slice<'py>(&self, py: Python<'py>, body: BodyKey) -> PyResult<Bound<'py, PySlice>> {
        let [_, v] = self.ranges(&body)?;
        Ok(slice(py, &v))
    }

    /// Row of a fixed or mocap body in `state.fixed`.
    fn fixed_row(&self, body: BodyKey) -> PyResult<usize> {
        let id = self.id(&body)?;
        let moves = || wrong(format!("forces move body '{}'", self.model.bodies[id].name));
        self.model.fixed_row(id).ok_or_else(moves)
    }

    /// Writes the pose of a body's frame (4 × 4 or a translation), velocity of its center of mass (of a fixed body of its frame's origin) [m/s] and
    /// angular velocity [rad/s] into the arrays of `state`. Links are put by `set_joint`; mocap bodies have no velocity.
    #[pyo3(signature = (state, body, pose, velocity=None, angular_velocity=None))]
    fn set_pose(
        &self,
        state: &Bound<'_, PyAny>,
        body: BodyKey,
        pose: Numbers<'_>,
        velocity: Option<Numbers<'_>>,
        angular_velocity: Option<Numbers<'_>>,
    ) -> PyResult<()> {
        let id = self.id(&body)?;
        let is_link = matches!(self.model.bodies[id].motion, Motion::Link);
        if is_link && velocity.as_ref().or(angular_velocity.as_ref()).is_some() {
            return Err(wrong(format!(
                "link '{}': joints have velocities",
                self.model.bodies[id].name
            )));
        }
        let at = self::pose(Some(&pose), "pose")?;
        let linear = vector_or(velocity.as_ref(), [0.0; 3], "velocity")?;
        let angular = vector_or(angular_velocity.as_ref(), [0.0; 3], "angular_velocity")?;
        // They may be views of the state.
        drop((pose, velocity, angular_velocity));
        change(&self.model, state, |all| {
            self.model.set_pose(all, id, &at).raise()?;
            if !is_link {
                (all[id].linear, all[id].angular) = (linear, angular);
            }
            Ok(())
        })
    }

    /// The pose of a body's frame, 4 × 4.
    fn pose<'py>(&self, state: &Bound<'py, PyAny>, body: BodyKey) -> PyResult<Array<'py>> {
        let id = self.id(&body)?;
        let pose = |state: &State| Ok(rows(&self.model.pose(state, id)).to_vec());
        measured(&self.model, state, Some(&[4, 4]), pose)
    }

    /// Poses and velocities of all bodies at a state, (bodies, 13), as `Run.bodies` has them.
    fn forward_kinematics<'py>(&self, state: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        let bodies =
            |state: &State| Ok(state.bodies().iter().flat_map(BodyState::coordinates).collect());
        measured(&self.model, state, Some(&[self.model.bodies.len(), ROW]), bodies)
    }

    /// Writes positions [m, rad] and velocities of the joint of a link into the arrays of `state`, with those of joints that mimic it in URDF. A
    /// spherical joint has a quaternion (x, y, z, w), a floating one a place before it. Velocities are zero by default.
    #[pyo3(signature = (state, link, q, v=None))]
    fn set_joint(
        &self,
        state: &Bound<'_, PyAny>,
        link: BodyKey,
        q: Numbers<'_>,
        v: Option<Numbers<'_>>,
    ) -> PyResult<()> {
        let id = self.id(&link)?;
        // They may be views of the state.
        let (position, velocity) = {
            let copy = |numbers: Numbers<'_>| in_order(&numbers).into_owned();
            (copy(q), v.map(copy))
        };
        change(&self.model, state, |all| {
            let still = vec![0.0; self.model.joint(all, id).raise()?.velocity.len()];
            let velocity = velocity.as_ref().unwrap_or(&still);
            self.model.set_joint(all, id, &position, velocity).raise()
        })
    }

    /// Positions [m, rad] and velocities of the joint of a link: `state.q[..., model.q_slice(link)]`, and of `v`.
    fn joint<'py>(
        &self,
        py: Python<'py>,
        state: &Bound<'py, PyAny>,
        link: BodyKey,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let [q, v] = self.ranges(&link)?;
        let own = |name: &str, range: &Range<usize>| {
            state.getattr(name)?.get_item((PyEllipsis::get(py), slice(py, range)))
        };
        Ok((own("q", &q)?, own("v", &v)?))
    }
}
