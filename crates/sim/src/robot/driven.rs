//! Robots whose joints are driven, as bodies of a world.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::Fwd;
use prehend_geometry::robot::{KinematicTree, RobotShape};

use crate::articulated::joint_state::JointState;
use crate::error::BuildError;
use crate::handle::BodyId;
use crate::state::State;
use crate::world::World;
use crate::world::body::Body;

/// A robot whose joints follow a trajectory.
struct DrivenRobot<C> {
    robot: KinematicTree,
    t_world_base: Isometry3<f64>,
    joints: C,
}

impl<C: Fn(f64) -> JointState> DrivenRobot<C> {
    /// The state of a link at `time` \[s\], not a number where the joints are not as many as they should be.
    fn link(&self, link: usize, time: f64) -> State {
        let JointState { position, velocity } = (self.joints)(time);
        let count = self.robot.joint_names().len();
        if position.len() != count || velocity.len() != count {
            return State {
                linear: Vector3::repeat(f64::NAN),
                ..State::at_rest(self.t_world_base)
            };
        }
        let joints = position.iter().zip(&velocity);
        let joints: Vec<Fwd<1>> =
            joints.map(|(&value, &rate)| Fwd { value, derivative: [rate] }).collect();
        let base: State<Fwd<1>> = State::at_rest(self.t_world_base).cast();
        let moving = State::at_rest(base.pose * self.robot.forward_kinematics(&joints)[link]);
        let rate = moving.sensitivity();
        State {
            linear: rate.fixed_view::<3, 1>(0, 0).into(),
            angular: rate.fixed_view::<3, 1>(3, 0).into(),
            ..moving.value()
        }
    }
}

impl World {
    /// Adds the links of `robot` that have a shape as driven bodies with a distance field, named after them, and returns
    /// each link's body, in the order of [`KinematicTree::links`]. The base stands at `t_world_base`; `joints` says
    /// how the joints are and move at a time \[s\], and limits are not enforced.
    ///
    /// [`World::update_kinematics`] brings states to their start. Distances reach as far as the margin of `shape`.
    ///
    /// # Errors
    /// If `shape` is not the robot's, or `joints` does not have as many entries as the robot at time 0. Should it not later,
    /// the rollout says that the link's state is not finite.
    pub fn add_robot(
        &mut self,
        robot: &KinematicTree,
        shape: &RobotShape,
        t_world_base: &Isometry3<f64>,
        joints: impl Fn(f64) -> JointState + Send + Sync + 'static,
    ) -> Result<Vec<Option<BodyId>>, BuildError> {
        let mismatch = |what, found, expected| BuildError::Robot { what, found, expected };
        let (found, expected) = (shape.links().len(), robot.links().len());
        if found != expected {
            return Err(mismatch("links of the shape", found, expected));
        }
        let start = joints(0.0);
        let expected = robot.joint_names().len();
        for (what, found) in
            [("joint positions", start.position.len()), ("joint velocities", start.velocity.len())]
        {
            if found != expected {
                return Err(mismatch(what, found, expected));
            }
        }
        let driven =
            Arc::new(DrivenRobot { robot: robot.clone(), t_world_base: *t_world_base, joints });
        let bodies = shape.links().iter().enumerate().map(|(link, shape)| {
            shape.grid()?;
            let driven = Arc::clone(&driven);
            let body =
                Body::kinematic(&robot.links()[link].name, move |t: f64| driven.link(link, t));
            Some(self.add(body.with_field(shape.clone())))
        });
        Ok(bodies.collect())
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::lie::so3_log;

    use super::*;
    use crate::SimulationError;
    use crate::scenes::{ellipsoid, penalty};
    use crate::{ContactBodies, GapSmoothing, RigidBody, SemiImplicitEuler, Surface, TimeSteps};

    /// A post on which an arm turns and slides out.
    const ARM: &str = r#"<robot name="arm"><link name="post"/>
        <link name="arm"><collision><origin xyz="0.1 0 0"/><geometry><box size="0.2 0.03 0.03"/></geometry></collision></link>
        <link name="tip"><collision><origin xyz="0.02 0 0"/><geometry><box size="0.04 0.04 0.04"/></geometry></collision></link>
        <joint name="swing" type="continuous"><parent link="post"/><child link="arm"/><origin xyz="0 0 0.1" rpy="0.1 0 0.2"/><axis xyz="0 0 1"/></joint>
        <joint name="slide" type="prismatic"><parent link="arm"/><child link="tip"/><origin xyz="0.2 0 0" rpy="0 0.2 0"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
        </robot>"#;

    fn arm(
        joints: impl Fn(f64) -> JointState + Send + Sync + 'static,
    ) -> (World, Vec<Option<BodyId>>) {
        let robot = KinematicTree::from_urdf_str(ARM, None).unwrap();
        let shape = RobotShape::new(&robot, 0.004, 0.012).unwrap();
        let base = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.0, 0.0, 0.5));
        let mut world = World::new(Vector3::zeros());
        let links = world.add_robot(&robot, &shape, &base, joints).unwrap();
        (world, links)
    }

    fn waving(t: f64) -> JointState {
        JointState {
            position: vec![0.5 * (3.0 * t).sin(), 0.02 * t * t],
            velocity: vec![1.5 * (3.0 * t).cos(), 0.04 * t],
        }
    }

    #[test]
    fn links_move_as_their_poses_do() {
        let (world, links) = arm(waving);
        assert_eq!(links, [None, Some(BodyId(0)), Some(BodyId(1))]);
        assert_eq!(world.bodies[1].name, "tip");
        let at = |time: f64| {
            let mut states = vec![State::at_rest(Isometry3::identity()); 2];
            world.update_kinematics(&mut states, time);
            states
        };
        let (before, now, after) = (at(0.7 - 1e-5), at(0.7), at(0.7 + 1e-5));
        for link in 0..2 {
            let [a, b] = [&before[link].pose, &after[link].pose];
            let linear = (b.translation.vector - a.translation.vector) / 2e-5;
            let angular = so3_log(&(b.rotation * a.rotation.inverse())) / 2e-5;
            assert!((linear - now[link].linear).norm() < 1e-8);
            assert!((angular - now[link].angular).norm() < 1e-8 && angular.norm() > 0.1);
        }
        assert!(now[1].linear.norm() > 0.01);
    }

    #[test]
    fn a_moving_finger_pushes_a_ball() {
        let speed = 0.5;
        let pushing =
            move |t: f64| JointState { position: vec![0.0, speed * t], velocity: vec![0.0, speed] };
        let (mut world, links) = arm(pushing);
        let tip = links[2].unwrap();
        let (radius, mass) = (0.03, 0.1);
        let rigid = RigidBody::ball(mass, radius).unwrap();
        let surface = Surface::uniform(&ellipsoid(400, [radius; 3]), 0.0113).unwrap();
        let ball = world.add(Body::dynamic("ball", rigid).with_surface(surface));
        // Critically damped, or nearly: the ball keeps to the finger rather than bounce off.
        let law = Arc::new(penalty(1e8, 1e6, 0.5, 1e-2));
        let (bodies, smoothing) =
            (ContactBodies { samples: ball, field: tip }, GapSmoothing::Softplus { width: 1e-4 });
        world.add_contact(bodies, law, smoothing).unwrap();
        let mut states = vec![State::at_rest(Isometry3::identity()); 3];
        world.update_kinematics(&mut states, 0.0);
        let ahead = Vector3::new(0.04 + radius + 0.002, 0.0, 0.0);
        states[ball].pose = states[tip].pose * nalgebra::Translation3::from(ahead);
        let axis = states[tip].pose.rotation * Vector3::x();
        let run = world
            .rollout_with(&SemiImplicitEuler, &states, TimeSteps { dt: 1e-4, steps: 1000 })
            .unwrap()
            .states;
        let end = run.last().unwrap();
        assert!(run[20][ball].linear.norm() < 1e-5);
        assert!((end[tip].linear - axis * speed).norm() < 1e-12);
        let pushed = end[ball].linear.dot(&axis);
        assert!(pushed > 0.95 * speed && pushed < 2.0 * speed, "{pushed}");
        assert!((end[ball].linear - axis * pushed).norm() < 0.05 * speed);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let robot = KinematicTree::from_urdf_str(ARM, None).unwrap();
        let shape = RobotShape::new(&robot, 0.01, 0.01).unwrap();
        let mut world = World::new(Vector3::zeros());
        let short = |_: f64| JointState { position: vec![0.0; 2], velocity: vec![0.0] };
        let refused = world.add_robot(&robot, &shape, &Isometry3::identity(), short).unwrap_err();
        assert_eq!(refused, BuildError::Robot { what: "joint velocities", found: 1, expected: 2 });
        let (world, _) = arm(|t| JointState {
            position: vec![0.0; 2],
            velocity: vec![0.0; if t > 0.5 { 1 } else { 2 }],
        });
        let states = vec![State::at_rest(Isometry3::identity()); 2];
        let time_steps = TimeSteps { dt: 0.2, steps: 5 };
        let lost = world.rollout_with(&SemiImplicitEuler, &states, time_steps).unwrap_err();
        assert!(matches!(lost, SimulationError::NotFinite { .. }), "{lost}");
    }
}
