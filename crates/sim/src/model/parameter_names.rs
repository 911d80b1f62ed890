//! Names of a model's parameters.

use std::collections::HashMap;

use prehend_autodiff::Scalar;

use super::Model;
use crate::articulated::link::NUMBER_NAMES;
use crate::handle::BodyId;

const INERTIA: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];
const WRENCH: [&str; 6] = ["force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z"];
const BUSHING: [&str; 4] =
    ["linear_stiffness", "linear_damping", "angular_stiffness", "angular_damping"];

impl<S: Scalar> Model<S> {
    /// A name for each of [`Model::parameters`], in their order, none of them twice.
    ///
    /// | parameter | name |
    /// |---|---|
    /// | of a body | `ball.mass`, `ball.inertia_xy`, `ball.com_x`; external force and torque in the world frame about the center of mass, of a link about the origin of its frame: `ball.force_x`, `ball.torque_z`; dimensions as `ball.radius` |
    /// | of a link and its joint | `elbow.joint_x`, `elbow.joint_qw`, `elbow.mass`, `elbow.com_x`, `elbow.inertia_xy`, `elbow.armature` |
    /// | gravity | `gravity.x` |
    /// | of a contact | samples and field, as `ball/floor.friction` |
    /// | of a group of contacts | `group 0.friction`, by its place in [`Model::contact_groups`] |
    /// | of a force along a joint | the first link, as `elbow.joint.target` |
    /// | of a bushing | both bodies, as `finger-rod.linear_stiffness` |
    ///
    /// The second of a name is `ball/floor.friction#2`, and so on. A parameter of a law that has no name is called by its number.
    pub fn parameter_names(&self) -> Vec<String> {
        let mut names = Vec::new();
        for body in &self.bodies {
            let mut own = |part: &str| names.push(format!("{}.{part}", body.name));
            if body.rigid().is_some() {
                own("mass");
                INERTIA.iter().for_each(|part| own(&format!("inertia_{part}")));
                ["com_x", "com_y", "com_z"].into_iter().for_each(&mut own);
            }
            WRENCH.into_iter().for_each(&mut own);
            let dimensions = body.shape().map(|shape| shape.dimensions()).unwrap_or_default();
            dimensions.iter().for_each(|(name, _)| own(name));
        }
        for link in self.articulations.iter().flat_map(|own| own.tree.links()) {
            names.extend(NUMBER_NAMES.iter().map(|part| format!("{}.{part}", link.name)));
        }
        names.extend(["x", "y", "z"].map(|axis| format!("gravity.{axis}")));
        let mut of_law = |owner: String, parts: Vec<&str>| {
            for (index, part) in parts.into_iter().enumerate() {
                let number = index.to_string();
                let part = if part.is_empty() { &number } else { part };
                names.push(format!("{owner}.{part}"));
            }
        };
        let name = |id: BodyId| &self.bodies[id].name;
        for pair in &self.contacts {
            let owner = format!("{}/{}", name(pair.bodies.samples), name(pair.bodies.field));
            of_law(owner, pair.param_names());
        }
        for (index, group) in self.contact_groups.iter().enumerate() {
            of_law(format!("group {index}"), group.contact.param_names());
        }
        for force in &self.joint_forces {
            let link = force.axes.first().map(|(axis, _)| name(axis.link).as_str());
            of_law(format!("{}.joint", link.unwrap_or_default()), force.law().param_names());
        }
        for bushing in &self.bushings {
            of_law(
                format!("{}-{}", name(bushing.bodies[0]), name(bushing.bodies[1])),
                BUSHING.to_vec(),
            );
        }
        numbered(names)
    }
}

/// The names, those that were there before with how often.
fn numbered(mut names: Vec<String>) -> Vec<String> {
    let mut seen: HashMap<String, usize> = HashMap::new();
    for name in &mut names {
        let times = seen.entry(name.clone()).or_default();
        *times += 1;
        if *times > 1 {
            name.push_str(&format!("#{times}"));
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry3, Vector3};

    use crate::articulated::{Joint, Link};
    use crate::joint_law::JointSpring;
    use crate::scenes::{egg_on, floor, penalty};
    use crate::{
        Body, Bushing, ContactBodies, GapSmoothing, RigidBody, Shape, model::BushingStiffness,
    };

    #[test]
    fn every_parameter_has_a_name_of_its_own() {
        let (mut model, _) = egg_on(floor(), GapSmoothing::Hard);
        let ball = Shape::from_parry(&parry3d_f64::shape::Ball::new(0.1)).unwrap();
        model.add(Body::from_shape("ball", &ball, 1e3).unwrap());
        let rigid = RigidBody::ball(1.0, 0.1).unwrap();
        let hinge = Link::new("door", Joint::Revolute(Vector3::z_axis()), &rigid);
        let door = model.add_articulation(vec![hinge]).unwrap()[0];
        model.add_joint_force(door, JointSpring { stiffness: 7.0, rest: 0.1 }).unwrap();
        model.add_joint_force(door, JointSpring { stiffness: 8.0, rest: 0.1 }).unwrap();
        let [ground, egg] = ["ground", "egg"].map(|name| model.body_named(name).unwrap());
        let frames = [Isometry3::identity(); 2];
        let stiffness = BushingStiffness::critical(1.0, 0.1, 0.1);
        model.add_bushing(Bushing { bodies: [door, egg], frames, stiffness }).unwrap();
        let bodies = ContactBodies { samples: egg, field: ground };
        model
            .add_contact(bodies, Arc::new(penalty(5e6, 2e4, 0.6, 2e-2)), GapSmoothing::Hard)
            .unwrap();

        let (names, values) = (model.parameter_names(), model.parameters());
        assert_eq!(names.len(), values.len());
        let mut sorted = names.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), names.len());
        let value = |name: &str| values[names.iter().position(|own| own == name).unwrap()];
        assert_eq!(value("egg.mass"), model.bodies[egg].rigid().unwrap().mass());
        assert_eq!(value("ball.radius"), 0.1);
        assert_eq!((value("door.mass"), value("door.joint_qw")), (1.0, 1.0));
        assert_eq!(value("gravity.z"), model.gravity.z);
        assert_eq!(value("egg/ground.friction#2"), 0.6);
        assert_eq!(value("door.joint.stiffness"), 7.0);
        assert_eq!(value("door.joint.stiffness#2"), 8.0);
        assert_eq!(value("door-egg.linear_stiffness"), stiffness.numbers()[0]);
    }
}
