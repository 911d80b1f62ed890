//! Positions, velocities and accelerations of all joints in MuJoCo's order and axes.

use nalgebra::{DMatrix, Matrix3, Quaternion, Unit, Vector3};
use prehend_geometry::mjcf::{JointKind, Keyframe, Model as MjcfModel};

use super::{MjcfError, MjcfRobot};
use crate::body_state::BodyState;
use crate::error::BuildError;
use crate::model::Model;
use crate::state::State;

/// Checks the count of numbers.
fn check(what: &'static str, numbers: &[f64], expected: usize) -> Result<(), MjcfError> {
    let given = numbers.len();
    if given == expected { Ok(()) } else { Err(MjcfError::Count { what, given, expected }) }
}

impl MjcfRobot {
    /// Puts joints, activations and controls where the file starts, as MuJoCo's `mj_resetData` does; other bodies of the model stay.
    ///
    /// # Errors
    /// If it is no state of the model.
    pub fn reset(&self, model: &mut Model, state: &mut State) -> Result<(), MjcfError> {
        self.put(model, state, &self.initial)
    }

    /// [`MjcfRobot::reset`] to the keyframe of that name, as MuJoCo's `mj_resetDataKeyframe` does.
    ///
    /// # Errors
    /// If the file has no such keyframe, or it is no state of the model.
    pub fn reset_to(
        &self,
        model: &mut Model,
        state: &mut State,
        keyframe: &str,
    ) -> Result<(), MjcfError> {
        let none = || MjcfError::NoSuch { kind: "keyframe", name: keyframe.to_owned() };
        let found = self.keyframes.iter().find(|own| own.name == keyframe).ok_or_else(none)?;
        self.put(model, state, found)
    }

    fn put(
        &self,
        model: &mut Model,
        state: &mut State,
        keyframe: &Keyframe,
    ) -> Result<(), MjcfError> {
        self.set_positions(model, state, &keyframe.positions)?;
        self.set_velocities(model, state, &keyframe.velocities)?;
        self.set_activations(model, state, &vec![0.0; self.activations.len()])?;
        self.set_controls(model, &keyframe.controls)?;
        state.time = keyframe.time;
        Ok(())
    }

    /// Sets the controls of all actuators, in the file's order and units, MuJoCo's `ctrl`.
    ///
    /// # Errors
    /// If they are too few or too many.
    pub fn set_controls(&self, model: &mut Model, controls: &[f64]) -> Result<(), MjcfError> {
        check("controls", controls, self.actuators.len())?;
        for ((_, id), control) in self.actuators.iter().zip(controls) {
            model.joint_force_mut(*id).set_param("control", *control).map_err(BuildError::Law)?;
        }
        Ok(())
    }

    /// Sets the control of the actuator of that name, in the file's units.
    ///
    /// # Errors
    /// If the file has no such actuator.
    pub fn set_control(
        &self,
        model: &mut Model,
        actuator: &str,
        control: f64,
    ) -> Result<(), MjcfError> {
        let none = || MjcfError::NoSuch { kind: "actuator", name: actuator.to_owned() };
        let force = model.joint_force_mut(self.actuator(actuator).ok_or_else(none)?);
        Ok(force.set_param("control", control).map_err(BuildError::Law)?)
    }

    /// Sets all joints to positions in MuJoCo's order, its `qpos`, at rest: a keyframe's, for instance.
    ///
    /// # Errors
    /// If they are too few or too many, or it is no state of the model.
    pub fn set_positions(
        &self,
        model: &Model,
        state: &mut State,
        positions: &[f64],
    ) -> Result<(), MjcfError> {
        let expected = self.moved.iter().map(|(kind, _)| kind.positions()).sum();
        check("positions", positions, expected)?;
        let mut rest = positions;
        for (kind, link) in &self.moved {
            let (own, after) = rest.split_at(kind.positions());
            rest = after;
            let turned = |q: &[f64]| {
                let turn = Unit::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
                [turn.i, turn.j, turn.k, turn.w]
            };
            let position = match kind {
                JointKind::Hinge | JointKind::Slide => own.to_vec(),
                JointKind::Ball => turned(own).to_vec(),
                JointKind::Free => own[..3].iter().copied().chain(turned(&own[3..])).collect(),
            };
            model.write_joint(state.rows_mut(), *link, &position, &vec![0.0; kind.velocities()])?;
        }
        model.forward_kinematics(state.rows_mut());
        Ok(())
    }

    /// Sets the velocities of all joints in MuJoCo's order and axes, its `qvel`: a free joint's velocity is along the axes of the file's world, its
    /// angular velocity along the body's.
    ///
    /// # Errors
    /// If they are too few or too many, or it is no state of the model.
    pub fn set_velocities(
        &self,
        model: &Model,
        state: &mut State,
        velocities: &[f64],
    ) -> Result<(), MjcfError> {
        let expected = self.moved.iter().map(|(kind, _)| kind.velocities()).sum();
        check("velocities", velocities, expected)?;
        let mut rest = velocities;
        for (kind, link) in &self.moved {
            let (own, after) = rest.split_at(kind.velocities());
            rest = after;
            let joint = model.joint(state, *link)?;
            let mut velocity = own.to_vec();
            if *kind == JointKind::Free {
                let along =
                    axes(&joint.position).transpose() * Vector3::from_column_slice(&own[..3]);
                velocity[..3].copy_from_slice(along.as_slice());
            }
            model.write_joint(state.rows_mut(), *link, &joint.position, &velocity)?;
        }
        model.forward_kinematics(state.rows_mut());
        Ok(())
    }

    /// Sets the states of actuators that have one, MuJoCo's `act`.
    ///
    /// # Errors
    /// If they are too few or too many, or it is no state of the model.
    pub fn set_activations(
        &self,
        model: &Model,
        state: &mut State,
        activations: &[f64],
    ) -> Result<(), MjcfError> {
        check("activations", activations, self.activations.len())?;
        for (link, activation) in self.activations.iter().zip(activations) {
            model.write_joint(state.rows_mut(), *link, &[0.0], &[*activation])?;
        }
        Ok(())
    }

    /// Accelerations of all joints in MuJoCo's order and axes, its `qacc`.
    ///
    /// # Panics
    /// If it is no state of the model.
    pub fn accelerations(&self, model: &Model, state: &State) -> Vec<f64> {
        let states = state.rows();
        let wrenches = model.wrenches_of(states, 0);
        let mut all = Vec::new();
        for (kind, link) in &self.moved {
            let Ok((place, joint)) = model.joint_place(states, *link) else { continue };
            let mut own = joint.accelerations(&wrenches[place]);
            if *kind == JointKind::Free {
                let BodyState { pose, linear, angular } = &states[place];
                let along = Vector3::from_column_slice(&own[..3]) + angular.cross(linear);
                own[..3].copy_from_slice((pose.rotation * along).as_slice());
            }
            all.extend(own);
        }
        all
    }

    /// The mass matrix in MuJoCo's order and axes, with the armature of joints and tendons.
    ///
    /// # Panics
    /// If it is no state of the model.
    pub fn mass_matrix(&self, model: &Model, state: &State) -> DMatrix<f64> {
        let Some(Ok((articulation, _))) = self.moved.first().map(|(_, link)| model.link_of(*link))
        else {
            return DMatrix::zeros(0, 0);
        };
        let own = model.mass_matrix_of(articulation, state.rows());
        let count = self.moved.iter().map(|(kind, _)| kind.velocities()).sum();
        // Velocities of the articulation by MuJoCo's.
        let mut turned = DMatrix::zeros(own.nrows(), count);
        let mut column = 0;
        for (kind, link) in &self.moved {
            let Ok((_, link_index)) = model.link_of(*link) else { continue };
            let [_, dofs] = model.articulations[articulation].tree.range(link_index);
            let n = kind.velocities();
            turned.view_mut((dofs.start, column), (n, n)).fill_with_identity();
            if let (JointKind::Free, Ok(joint)) = (kind, model.joint(state, *link)) {
                let axes = axes(&joint.position).transpose();
                turned.view_mut((dofs.start, column), (3, 3)).copy_from(&axes);
            }
            column += n;
        }
        turned.transpose() * own * turned
    }
}

impl Model {
    /// Coordinates of the last articulation, which is `robot`'s, with all joints at their references and at those of their springs.
    pub(super) fn reference_coordinates(
        &self,
        mjcf: &MjcfModel,
        robot: &MjcfRobot,
    ) -> Result<[Vec<f64>; 2], MjcfError> {
        let reference = mjcf.reference_positions();
        let mut slack = reference.clone();
        let mut at = 0;
        for joint in mjcf.joint_indices().map(|index| mjcf.joint(index)) {
            if matches!(joint.kind, JointKind::Hinge | JointKind::Slide) {
                slack[at] = joint.spring_reference;
            }
            at += joint.kind.positions();
        }
        let own = self.articulations.len() - 1;
        let mut state = self.neutral_state();
        let mut coordinates = |positions: &[f64]| -> Result<Vec<f64>, MjcfError> {
            robot.set_positions(self, &mut state, positions)?;
            let [q, _] = self.articulations[own].coordinates(&state.rows()[self.joint_range(own)]);
            Ok(q)
        };
        Ok([coordinates(&reference)?, coordinates(&slack)?])
    }
}

/// Axes of a free link in the frame of its joint.
fn axes(position: &[f64]) -> Matrix3<f64> {
    let turn = Quaternion::new(position[6], position[3], position[4], position[5]);
    Unit::new_normalize(turn).to_rotation_matrix().into_inner()
}
