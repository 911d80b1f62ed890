//! Robots in URDF that forces move.

use nalgebra::Isometry3;
use prehend_geometry::robot::{Drive, KinematicTree, Motion, RobotShape};

use crate::articulated::{Joint, Link};
use crate::error::BuildError;
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::joint_force::JointAxis;
use crate::model::transmission::Coupling;

/// Options of reading a robot in URDF that forces move.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfOptions {
    /// Base → world.
    pub t_world_base: Isometry3<f64>,
    /// Joint between the model and the base.
    pub base: Joint,
    /// Time constant of limits and of joints that mimic others \[s\].
    pub time_constant: f64,
    /// Inertia behind the gears of each joint \[kg m² or kg\], of which URDF says nothing.
    pub armature: f64,
}

impl Default for UrdfOptions {
    /// A base fixed at the world's origin, limits that give way for 5 ms.
    fn default() -> Self {
        let t_world_base = Isometry3::identity();
        Self { t_world_base, base: Joint::Fixed, time_constant: 5e-3, armature: 0.0 }
    }
}

impl Model {
    /// Adds the links of `robot` as those of an articulation that forces move, with the damping, friction and limits of position of its joints,
    /// and returns each link's body, in the order of [`KinematicTree::links`]. With a shape, links have its distance fields; samples are the
    /// caller's to give.
    ///
    /// Limits of effort and speed are not used, and there are no motors: add them by [`Model::add_joint_force`]. Joints that mimic others follow
    /// them by springs.
    ///
    /// # Errors
    /// If `shape` is not the robot's, or a link weighs nothing and yet should move. The model is then as it was.
    pub fn add_articulated_robot(
        &mut self,
        robot: &KinematicTree,
        shape: Option<&RobotShape>,
        options: &UrdfOptions,
    ) -> Result<Vec<BodyId>, BuildError> {
        let (found, expected) = (shape.map(|shape| shape.links().len()), robot.links().len());
        if let Some(found) = found.filter(|found| *found != expected) {
            return Err(BuildError::Robot { what: "links of the shape", found, expected });
        }
        let mut grown = self.clone();
        let bodies = grown.insert_robot(robot, shape, options)?;
        *self = grown;
        Ok(bodies)
    }

    /// [`Model::add_articulated_robot`], which on an error leaves a part behind.
    fn insert_robot(
        &mut self,
        robot: &KinematicTree,
        shape: Option<&RobotShape>,
        options: &UrdfOptions,
    ) -> Result<Vec<BodyId>, BuildError> {
        let (links, order) = links(robot, options);
        let added = self.add_articulation(links)?;
        let mut bodies = vec![BodyId(0); robot.links().len()];
        order.iter().zip(&added).for_each(|(link, body)| bodies[*link] = *body);
        if let Some(shape) = shape {
            for (body, shape) in bodies.iter().zip(shape.links()) {
                if shape.grid().is_some() {
                    self.bodies[*body].field = Some(shape.clone());
                }
            }
        }
        self.add_joint_properties(robot, &bodies, options)?;
        Ok(bodies)
    }

    fn add_joint_properties(
        &mut self,
        robot: &KinematicTree,
        bodies: &[BodyId],
        options: &UrdfOptions,
    ) -> Result<(), BuildError> {
        let tree = &self.articulations[self.articulations.len() - 1].tree;
        let mobility = self.mobility(&tree.neutral());
        for joint in robot.joints().iter().filter(|joint| joint.motion != Motion::Fixed) {
            let axis = JointAxis::from(bodies[joint.child]);
            let own = [(axis, 1.0)];
            let [damping, friction] =
                [joint.damping, joint.friction].map(Option::unwrap_or_default);
            self.add_losses(&own, damping, friction)?;
            if let Some(range) = joint.limits {
                let inertia = self.inertia_along(&mobility, &own);
                self.add_limits(&own, range, inertia / options.time_constant.powi(2))?;
            }
            let Drive::Variable { index, multiplier, offset } = joint.drive else { continue };
            let leader = robot.joints().iter().find(|other| {
                let own = Drive::Variable { index, multiplier: 1.0, offset: 0.0 };
                other.drive == own && other.name == robot.joint_names()[index]
            });
            if let Some(leader) = leader.filter(|leader| leader.name != joint.name) {
                let axes = [(axis, 1.0), (bodies[leader.child].into(), -multiplier)];
                let inertia = self.inertia_along(&mobility, &axes);
                let stiffness = inertia / options.time_constant.powi(2);
                let damping = 2.0 * inertia / options.time_constant;
                self.add_coupling(&axes, offset, [stiffness, damping])?;
                let leader = JointAxis::from(bodies[leader.child]);
                let coupling = Coupling { follower: axis, leader, slope: multiplier, offset };
                self.transmissions.couplings.push(coupling);
            }
        }
        Ok(())
    }
}

/// The links, each after its parent, and which of the robot's each of them is.
fn links(robot: &KinematicTree, options: &UrdfOptions) -> (Vec<Link>, Vec<usize>) {
    let (mut links, mut order) = (Vec::new(), vec![robot.root()]);
    let (mut parents, mut at) = (vec![None], vec![options.t_world_base]);
    let mut kinds = vec![options.base.clone()];
    let mut next = 0;
    while next < order.len() {
        let index = order[next];
        let own = &robot.links()[index];
        let (parent, t_parent_joint) = (parents[next], at[next]);
        let massless = Link::massless(&own.name, kinds[next].clone());
        let mut link = Link { parent, t_parent_joint, ..massless };
        if next > 0 && !matches!(link.joint, Joint::Fixed) {
            link.armature = options.armature;
        }
        if let Some(inertial) = &own.inertial {
            (link.mass, link.com, link.inertia) = (inertial.mass, inertial.com, inertial.inertia);
        }
        links.push(link);
        for joint in robot.joints().iter().filter(|joint| joint.parent == index) {
            order.push(joint.child);
            parents.push(Some(next));
            at.push(joint.t_parent_joint);
            kinds.push(match joint.motion {
                Motion::Fixed => Joint::Fixed,
                Motion::Revolute => Joint::Revolute(joint.axis),
                Motion::Prismatic => Joint::Prismatic(joint.axis),
            });
        }
        next += 1;
    }
    (links, order)
}
