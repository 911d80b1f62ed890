//! Forward kinematics over any scalar.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::lift;

use super::{Drive, Joint, KinematicTree, Motion};

impl KinematicTree {
    /// Pose `t_base_link` of every link in the frame of the root link, in the order of [`KinematicTree::links`].
    ///
    /// `joints` are the positions \[rad or m\] in the order of [`KinematicTree::joint_names`]; limits are not enforced.
    /// Derivatives pass through exactly, at zero too.
    ///
    /// # Panics
    /// If `joints` has not one entry a name ([`KinematicTree::joint_vector`] makes one that has).
    pub fn forward_kinematics<S: Scalar>(&self, joints: &[S]) -> Vec<Isometry3<S>> {
        assert_eq!(joints.len(), self.variables.len(), "one position a joint name");
        let mut poses = vec![Isometry3::identity(); self.links.len()];
        for &j in &self.order {
            let joint = &self.joints[j];
            poses[joint.child] = poses[joint.parent] * t_parent_child(joint, joints);
        }
        poses
    }
}

/// Child frame → parent frame \[m\].
pub(super) fn t_parent_child<S: Scalar>(joint: &Joint, joints: &[S]) -> Isometry3<S> {
    let fixed = lift(&joint.t_parent_joint);
    let Drive::Variable { index, multiplier, offset } = joint.drive else { return fixed };
    let position = joints[index] * S::constant(multiplier) + S::constant(offset);
    let axis = joint.axis.into_inner().map(S::constant);
    match joint.motion {
        Motion::Fixed => fixed,
        Motion::Prismatic => fixed * Translation3::from(axis * position),
        // Half-angle form about a constant unit axis: smooth everywhere, unlike a rotation vector at zero.
        Motion::Revolute => {
            let (sin, cos) = (position * S::constant(0.5)).sin_cos();
            fixed
                * UnitQuaternion::new_unchecked(
                    Quaternion::from_imag(axis * sin) + Quaternion::from_real(cos),
                )
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6xX, Point3, Vector3};

    use super::*;
    use prehend_autodiff::{Fwd, Var, gradient};

    /// A finger: yaw, pitch, a slide, and a last phalanx that bends with the second joint.
    const FINGER: &str = r#"<robot name="finger">
        <link name="base"/><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/><link name="tip"/>
        <joint name="tip" type="fixed"><parent link="l3"/><child link="tip"/><origin xyz="0 0 0.0267" rpy="0.1 0.2 0.3"/></joint>
        <joint name="q0" type="revolute"><parent link="base"/><child link="l0"/><origin xyz="0 0.0435 -0.0015" rpy="-0.087 0.3 1.2"/><axis xyz="0 0 1"/><limit lower="-0.47" upper="0.47" velocity="1" effort="1"/></joint>
        <joint name="q1" type="continuous"><parent link="l0"/><child link="l1"/><origin xyz="0 0 0.02"/><axis xyz="0 2 0.5"/></joint>
        <joint name="q2" type="prismatic"><parent link="l1"/><child link="l2"/><origin xyz="0.01 0 0.054"/><axis xyz="-1 0 1"/><limit lower="0" upper="0.01" velocity="1" effort="1"/></joint>
        <joint name="q3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0 0 0.0384"/><axis xyz="0 1 0"/><mimic joint="q1" multiplier="0.7" offset="0.1"/><limit lower="0" upper="2" velocity="1" effort="1"/></joint>
        </robot>"#;

    fn finger() -> KinematicTree {
        KinematicTree::from_urdf_str(FINGER, None).unwrap()
    }

    #[test]
    fn a_planar_chain_has_its_textbook_pose() {
        let robot = KinematicTree::from_urdf_str(
            r#"<robot name="two"><link name="a"/><link name="b"/><link name="c"/>
            <joint name="p" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
            <joint name="q" type="continuous"><parent link="b"/><child link="c"/><origin xyz="2 0 0"/><axis xyz="0 0 1"/></joint></robot>"#,
            None,
        )
        .unwrap();
        let poses = robot.forward_kinematics(&[0.4, -1.1]);
        let tip = poses[robot.link_index("c").unwrap()] * Point3::new(1.0, 0.0, 0.0);
        let expected =
            [2.0 * 0.4f64.cos() + (-0.7f64).cos(), 2.0 * 0.4f64.sin() + (-0.7f64).sin(), 0.0];
        assert!((tip - Point3::from(expected)).norm() < 1e-15);
        assert_eq!(robot.root(), 0);
    }

    #[test]
    fn fixed_axis_angles_turn_about_x_first() {
        let robot = finger();
        let tip = &robot.joints()[0];
        let x = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.1);
        let y = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.2);
        let z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.3);
        assert!(tip.t_parent_joint.rotation.angle_to(&(z * y * x)) < 1e-15);
    }

    /// The geometric Jacobian by the screws of the joints: rows are the velocity of `point` of a link and the angular velocity, columns the joint
    /// positions.
    fn jacobian(
        robot: &KinematicTree,
        joints: &[f64],
        link: usize,
        point: &Point3<f64>,
    ) -> Matrix6xX<f64> {
        let poses = robot.forward_kinematics(joints);
        let (screws, tip) = (robot.screws(&poses), poses[link] * point);
        let mut jacobian = Matrix6xX::zeros(joints.len());
        for screw in robot.paths()[link].iter().map(|&s| &screws[s]) {
            let (linear, mut column) = (screw.velocity(&tip), jacobian.column_mut(screw.variable));
            for i in 0..3 {
                column[i] += linear[i];
                column[i + 3] += screw.angular[i];
            }
        }
        jacobian
    }

    #[test]
    fn the_jacobian_matches_differences_at_zero_and_elsewhere() {
        let robot = finger();
        let tip = robot.link_index("tip").unwrap();
        let point = Point3::new(0.003, -0.002, 0.012);
        let step = 1e-6;
        for q in [[0.0, 0.0, 0.0], [0.3, -0.8, 0.004], [-2.0, 3.0, 0.01]] {
            let jacobian = jacobian(&robot, &q, tip, &point);
            assert_eq!(jacobian.ncols(), robot.joint_names().len());
            for i in 0..3 {
                let at = |sign: f64| {
                    let mut moved = q;
                    moved[i] += sign * step;
                    robot.forward_kinematics(&moved)[tip]
                };
                let (plus, minus) = (at(1.0), at(-1.0));
                let linear = (plus * point - minus * point) / (2.0 * step);
                let angular =
                    (plus.rotation * minus.rotation.inverse()).scaled_axis() / (2.0 * step);
                assert!((jacobian.fixed_view::<3, 1>(0, i) - linear).norm() < 1e-9);
                assert!((jacobian.fixed_view::<3, 1>(3, i) - angular).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn forward_and_reverse_mode_give_the_geometric_jacobian() {
        let robot = finger();
        let tip = robot.link_index("tip").unwrap();
        let point = Point3::new(0.003, -0.002, 0.012);
        for q in [[0.0, 0.0, 0.0], [0.3, -0.8, 0.004], [-2.0, 3.0, 0.01]] {
            let jacobian = jacobian(&robot, &q, tip, &point);
            let seeded: [Fwd<3>; 3] = std::array::from_fn(|i| Fwd::variable(q[i], i));
            let pose = robot.forward_kinematics(&seeded)[tip];
            let moved = pose * point.map(Fwd::<3>::constant);
            let rotation = pose.rotation.to_rotation_matrix().into_inner();
            for i in 0..3 {
                let linear = moved.coords.map(|x| x.derivative[i]);
                assert!((jacobian.fixed_view::<3, 1>(0, i) - linear).norm() < 1e-12);
                // The rate of a rotation is the cross product with the angular velocity, after the rotation.
                let rate =
                    rotation.map(|x| x.derivative[i]) * rotation.map(|x| x.value).transpose();
                let angular = jacobian.fixed_view::<3, 1>(3, i).into_owned();
                assert!((angular.cross_matrix() - rate).norm() < 1e-12);
            }
            // The vector that reverse mode multiplies the Jacobian with picks one row after the other.
            for row in 0..3 {
                let moved = |q: &[Var]| robot.forward_kinematics(q)[tip] * point.map(Var::constant);
                let (_, gradient) = gradient(|q| moved(q)[row], &q);
                for (i, reverse) in gradient.iter().enumerate() {
                    assert!((jacobian[(row, i)] - reverse).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn single_precision_follows_double() {
        let robot = finger();
        let double = robot.forward_kinematics(&[0.3f64, -0.8, 0.004]);
        let single = robot.forward_kinematics(&[0.3f32, -0.8, 0.004]);
        for (d, s) in double.iter().zip(&single) {
            assert!((d.translation.vector - s.translation.vector.map(f64::from)).norm() < 1e-6);
        }
    }
}
