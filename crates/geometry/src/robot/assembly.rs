//! Several bodies as one robot.

use nalgebra::{Isometry3, Unit, Vector3};

use super::{Drive, Joint, KinematicTree, Link, Motion, Result, limits, tree};
use crate::mesh::TriMesh;

/// Joints by which a body floats beside another: three that slide, three that turn it to where it is, and three that turn it from there.
const FLOATING: [(&str, Motion, usize); 9] = [
    ("x", Motion::Prismatic, 0),
    ("y", Motion::Prismatic, 1),
    ("z", Motion::Prismatic, 2),
    ("yaw", Motion::Revolute, 2),
    ("pitch", Motion::Revolute, 1),
    ("roll", Motion::Revolute, 0),
    ("turn_x", Motion::Revolute, 0),
    ("turn_y", Motion::Revolute, 1),
    ("turn_z", Motion::Revolute, 2),
];

impl KinematicTree {
    /// A body without joints \[m\].
    pub fn rigid(name: &str, parts: Vec<TriMesh>) -> Self {
        let link = Link { name: name.to_owned(), parts, inertial: None };
        Self {
            name: name.to_owned(),
            links: vec![link],
            joints: Vec::new(),
            order: Vec::new(),
            root: 0,
            variables: Vec::new(),
            ranges: Vec::new(),
            floating: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// The robot with `body` floating beside its base. The body's links and joints are called `{name}/…`; in the joint vector come first the nine
    /// joints of [`floating_joints`](Self::floating_joints), and then the body's own, after all that there were.
    ///
    /// # Errors
    /// If the two cannot be told apart by their names.
    pub fn with_floating(mut self, name: &str, body: &Self) -> Result<Self> {
        let named = |part: &str| format!("{name}/{part}");
        let first = self.links.len() + FLOATING.len() - 1;
        let base = self.root;
        for (k, (joint, motion, axis)) in FLOATING.into_iter().enumerate() {
            let last = k + 1 == FLOATING.len();
            let child = if last { first + body.root } else { self.links.len() };
            let parent = if k == 0 { base } else { self.links.len() - 1 };
            let index = self.variables.len();
            self.variables.push(named(joint));
            self.joints.push(Joint {
                name: named(joint),
                motion,
                parent,
                child,
                t_parent_joint: Isometry3::identity(),
                axis: Unit::new_unchecked(Vector3::ith(axis, 1.0)),
                limits: None,
                drive: Drive::Variable { index, multiplier: 1.0, offset: 0.0 },
                damping: None,
                friction: None,
                velocity_limit: None,
                effort_limit: None,
            });
            if !last {
                self.links.push(Link { name: named(joint), parts: Vec::new(), inertial: None });
            }
        }
        let variables = self.variables.len();
        self.floating.push(first);
        self.links.extend(body.links.iter().map(|l| Link { name: named(&l.name), ..l.clone() }));
        self.joints.extend(body.joints.iter().map(|joint| Joint {
            name: named(&joint.name),
            parent: first + joint.parent,
            child: first + joint.child,
            drive: joint.drive.after(variables),
            ..joint.clone()
        }));
        self.variables.extend(body.variables.iter().map(|joint| named(joint)));
        tree::unique("link", self.links.iter().map(|link| &link.name))?;
        (self.order, self.root) = tree::order(&self.links, &self.joints)?;
        self.ranges = limits::ranges(&self.joints, &self.variables)?;
        Ok(self)
    }

    /// Positions of the joints of a body that floats where `t_base_body` places it: x, y, z \[m\], yaw, pitch, roll \[rad\], and three turns
    /// about the body's own axes, which are zero: small ones are a small rotation vector, whatever the angles before them are.
    pub fn floating_joints(t_base_body: &Isometry3<f64>) -> [f64; 9] {
        let [x, y, z] = t_base_body.translation.vector.into();
        let (roll, pitch, yaw) = t_base_body.rotation.euler_angles();
        [x, y, z, yaw, pitch, roll, 0.0, 0.0, 0.0]
    }
}

impl Drive {
    /// Drive in a joint vector with `entries` entries before its own.
    fn after(self, entries: usize) -> Self {
        match self {
            Self::None => Self::None,
            Self::Variable { index, multiplier, offset } => {
                Self::Variable { index: index + entries, multiplier, offset }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitQuaternion};

    use super::super::RobotError;
    use super::*;
    use crate::shapes::cuboid;

    const FINGER: &str = r#"<robot name="finger"><link name="palm"/><link name="tip"/>
        <joint name="bend" type="revolute"><parent link="palm"/><child link="tip"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="2" effort="1" velocity="1"/></joint></robot>"#;

    fn finger() -> KinematicTree {
        KinematicTree::from_urdf_str(FINGER, None).unwrap()
    }

    #[test]
    fn floating_bodies_are_where_they_are_placed() {
        let table = KinematicTree::rigid("table", vec![cuboid(Vector3::new(1.0, 1.0, 0.1))]);
        let both = finger().with_floating("second", &finger()).unwrap();
        let all = both.with_floating("table", &table).unwrap();
        assert_eq!(all.joint_names().len(), 2 + 2 * 9);
        assert_eq!(all.joint_names()[10], "second/bend");
        let [second, last] = all.floating_bodies() else { panic!("not two bodies") };
        assert_eq!(
            (all.links()[*second].name.as_str(), *last),
            ("second/palm", all.links().len() - 1)
        );
        assert_eq!((all.joint_limits()[10], all.root()), ((-1.0, 2.0), finger().root()));
        // A pitch of a right angle, too.
        for pitch in [0.3, std::f64::consts::FRAC_PI_2] {
            let second = Isometry3::from_parts(
                [0.2, -0.1, 0.3].into(),
                UnitQuaternion::from_euler_angles(0.4, pitch, -2.0),
            );
            let place = Isometry3::translation(0.0, 0.0, -0.2);
            let mut joints = vec![0.5];
            joints.extend(KinematicTree::floating_joints(&second));
            joints.push(-0.7);
            joints.extend(KinematicTree::floating_joints(&place));
            let poses = all.forward_kinematics(&joints);
            let of = |name: &str| poses[all.link_index(name).unwrap()];
            let bent = |q: f64| finger().forward_kinematics(&[q])[1];
            let near = |a: Isometry3<f64>, b: Isometry3<f64>| {
                let off = a.inverse() * b;
                assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-7);
            };
            near(of("tip"), bent(0.5));
            near(of("second/palm"), second);
            near(of("second/tip"), second * bent(-0.7));
            near(of("table/table"), place);
            // A small turn is a small rotation about the body's own axis.
            joints[1 + 6] = 1e-3;
            let turned = all.forward_kinematics(&joints)[all.link_index("second/palm").unwrap()];
            let point = Point3::new(0.0, 0.1, 0.0);
            let moved = turned * point - second * point;
            assert!((moved.norm() - 1e-4).abs() < 1e-9);
        }
    }

    #[test]
    fn equal_names_are_an_error() {
        let twice = finger().with_floating("a", &finger()).unwrap().with_floating("a", &finger());
        assert!(matches!(twice, Err(RobotError::Structure { .. })));
    }
}
