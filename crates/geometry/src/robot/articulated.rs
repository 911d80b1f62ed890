//! Distances to a robot with their derivatives by its joints and the pose of its base.

use std::sync::Arc;

use nalgebra::{DVector, Isometry3, Point3, Vector3, Vector6};
use prehend_autodiff::lie::twist_row;

use super::{KinematicTree, PosedRobot, RobotError, RobotShape, Screw};
use crate::field::{DistanceField, FieldSample};

/// A robot posed by its base and its joints: a [`PosedRobot`] that knows how each link moves.
///
/// ```
/// # use std::sync::Arc;
/// # use nalgebra::{Isometry3, Point3};
/// # use prehend_geometry::robot::{ArticulatedRobot, KinematicTree, RobotShape};
/// let robot = KinematicTree::from_urdf_str(r#"<robot name="lever"><link name="base"/>
///     <link name="arm"><collision><geometry><box size="0.2 0.02 0.02"/></geometry></collision></link>
///     <joint name="q" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
///     </robot>"#, None)?;
/// let shape = Arc::new(RobotShape::new(&robot, 0.002, 0.02)?);
/// let posed = ArticulatedRobot::new(&robot, shape, &Isometry3::identity(), &[0.0])?;
/// let sample = posed.distance_with_gradient(&Point3::new(0.05, 0.02, 0.0), 0.02).ok_or("out of reach")?;
/// // The arm, 5 cm from its joint, comes nearer by 5 cm a radian.
/// assert!((sample.field.distance - 0.01).abs() < 1e-4 && (sample.joints[0] + 0.05).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ArticulatedRobot {
    posed: PosedRobot,
    center: Point3<f64>,
    /// Joints that move, in the world.
    screws: Vec<Screw>,
    /// For each link the screws that move it, from the link to the base.
    paths: Vec<Vec<usize>>,
    variables: usize,
}

/// A signed distance to a robot and its gradient by all that can move.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotSample {
    /// The nearest link.
    pub link: usize,
    /// The signed distance and its derivatives by the query point, in the world frame.
    pub field: FieldSample,
    /// Gradient by a left twist of the base (translation \[1\], then rotation \[m\]) about the base's own origin, as
    /// [`prehend_autodiff::lie::perturb_about`] has it.
    pub base: Vector6<f64>,
    /// Gradient by the joint vector \[m/rad or 1\]; zero for joints that do not move the link.
    pub joints: DVector<f64>,
}

impl ArticulatedRobot {
    /// Poses `robot` with its base at `t_world_base` and its joints at `joints` \[rad or m\], limits not enforced
    /// ([`KinematicTree::check_joints`] tells).
    ///
    /// # Errors
    /// [`RobotError::JointCount`] or [`RobotError::Number`] for the joints, [`RobotError::PoseCount`] where `shape` is
    /// that of another robot, [`RobotError::Number`] for a base that is not finite.
    pub fn new(
        robot: &KinematicTree,
        shape: Arc<RobotShape>,
        t_world_base: &Isometry3<f64>,
        joints: &[f64],
    ) -> Result<Self, RobotError> {
        robot.check_finite(joints)?;
        let poses: Vec<Isometry3<f64>> =
            robot.forward_kinematics(joints).iter().map(|t| t_world_base * t).collect();
        let (screws, paths) = (robot.screws(&poses), robot.paths());
        let posed = PosedRobot::new(shape, poses)?;
        let center = Point3::from(t_world_base.translation.vector);
        Ok(Self { posed, center, screws, paths, variables: joints.len() })
    }

    /// The robot in its pose, for everything but derivatives.
    pub fn posed(&self) -> &PosedRobot {
        &self.posed
    }

    /// As [`PosedRobot::sample_link`], with the gradient by the pose of the base and by the joints; `None` beyond
    /// `reach` \[m\].
    ///
    /// A link that moves by v at the point changes the distance by −∇φ·v. Exact for the links' grids; where
    /// two links are equally near the gradient is that of one of them.
    pub fn distance_with_gradient(&self, point: &Point3<f64>, reach: f64) -> Option<RobotSample> {
        let (link, field) = self.posed.sample_link(point, reach)?;
        let g = field.gradient;
        let base = -twist_row(&(point - self.center), &g);
        let mut joints = DVector::zeros(self.variables);
        for (variable, velocity) in self.point_jacobian(link, point) {
            joints[variable] -= g.dot(&velocity);
        }
        Some(RobotSample { link, field, base, joints })
    }

    /// Velocity of a point fixed to link `link` \[m/rad or 1\] by each joint that moves it, as (entry of the joint vector,
    /// velocity); `point` and the velocities are in the world frame.
    ///
    /// # Panics
    /// If there is no such link.
    pub fn point_jacobian(
        &self,
        link: usize,
        point: &Point3<f64>,
    ) -> impl Iterator<Item = (usize, Vector3<f64>)> {
        let screws = self.paths[link].iter().rev().map(|&s| &self.screws[s]);
        let point = *point;
        screws.map(move |s| (s.variable, s.velocity(&point)))
    }
}

impl DistanceField for ArticulatedRobot {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        self.posed.sample(point, reach)
    }

    fn thickness(&self) -> f64 {
        self.posed.thickness()
    }
}

#[cfg(test)]
mod tests {
    use prehend_autodiff::lie::perturb_about;

    use super::*;
    use crate::random::SplitMix64;

    /// A tilted base, a swing, a slide, and a finger that bends twice as one joint says.
    const ARM: &str = r#"<robot name="arm"><link name="base"/>
        <link name="palm"><collision><geometry><box size="0.05 0.07 0.06"/></geometry></collision></link>
        <link name="slide"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.02 0.03 0.06"/></geometry></collision></link>
        <link name="tip"><collision><origin xyz="0 0 0.03"/><geometry><cylinder radius="0.012" length="0.06"/></geometry></collision></link>
        <joint name="mount" type="fixed"><parent link="base"/><child link="palm"/><origin xyz="0.01 0 0.02" rpy="0.3 -0.2 0.5"/></joint>
        <joint name="swing" type="continuous"><parent link="palm"/><child link="root"/><origin xyz="0 0 0.04" rpy="0.1 0 0"/><axis xyz="0 1 0.3"/></joint>
        <link name="root"/>
        <joint name="push" type="prismatic"><parent link="root"/><child link="slide"/><axis xyz="0.1 0 1"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
        <joint name="bend" type="revolute"><parent link="slide"/><child link="tip"/><origin xyz="0 0 0.07"/><axis xyz="1 0 0"/>
          <mimic joint="swing" multiplier="0.6" offset="0.2"/><limit lower="-9" upper="9" effort="1" velocity="1"/></joint>
        </robot>"#;

    struct Setting {
        robot: KinematicTree,
        shape: Arc<RobotShape>,
        base: Isometry3<f64>,
        joints: [f64; 2],
    }

    impl Setting {
        fn new(joints: [f64; 2]) -> Self {
            let robot = KinematicTree::from_urdf_str(ARM, None).unwrap();
            let shape = Arc::new(RobotShape::new(&robot, 0.004, 0.02).unwrap());
            let base = Isometry3::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.4, 1.0, -0.7));
            Self { robot, shape, base, joints }
        }

        /// The robot moved by a twist of its base and by changes of its joints: entries 3 and up of `x`.
        fn at(&self, x: &[f64; 11]) -> ArticulatedRobot {
            let twist = Vector6::from_column_slice(&x[3..9]);
            let base = perturb_about(&self.base, &self.base.translation.vector, &twist);
            let joints = [self.joints[0] + x[9], self.joints[1] + x[10]];
            ArticulatedRobot::new(&self.robot, self.shape.clone(), &base, &joints).unwrap()
        }

        /// Points around every link.
        fn points(&self) -> Vec<Point3<f64>> {
            let mut random = SplitMix64::new(3);
            let posed = self.at(&[0.0; 11]);
            let links = posed.posed().t_world_links().to_vec();
            (0..240)
                .map(|i| {
                    let mut unit = || random.uniform() - 0.5;
                    links[i % links.len()] * Point3::new(0.09 * unit(), 0.1 * unit(), 0.14 * unit())
                })
                .collect()
        }
    }

    #[test]
    fn the_gradient_matches_differences_in_all_that_moves() {
        for joints in [[0.0, 0.0], [0.5, 0.02], [-1.1, 0.05]] {
            let setting = Setting::new(joints);
            let robot = setting.at(&[0.0; 11]);
            let (mut checked, mut of_link) = (0, [0; 5]);
            for point in setting.points() {
                let Some(sample) = robot.distance_with_gradient(&point, 0.02) else { continue };
                let gradient = |s: &RobotSample| {
                    let mut all = s.field.gradient.as_slice().to_vec();
                    all.extend(s.base.iter().chain(s.joints.iter()));
                    all
                };
                let exact = gradient(&sample);
                for i in 0..11 {
                    let step = 1e-6;
                    let moved = |sign: f64| {
                        let mut x = [0.0; 11];
                        x[i] = sign * step;
                        let p = point + Vector3::new(x[0], x[1], x[2]);
                        let s = setting.at(&x).distance_with_gradient(&p, 0.021);
                        s.filter(|s| s.link == sample.link)
                    };
                    // Next to a crease between links there is no derivative.
                    let (Some(plus), Some(minus)) = (moved(1.0), moved(-1.0)) else { continue };
                    let slope = (plus.field.distance - minus.field.distance) / (2.0 * step);
                    assert!((slope - exact[i]).abs() < 1e-7, "{i}: {slope} {}", exact[i]);
                    checked += 1;
                }
                of_link[sample.link] += 1;
            }
            assert!(
                checked > 1000 && of_link[1].min(of_link[2]).min(of_link[3]) > 5,
                "{of_link:?}"
            );
        }
    }

    #[test]
    fn bad_states_are_errors() {
        let s = Setting::new([0.0; 2]);
        let new = |base: &Isometry3<f64>, joints: &[f64]| {
            ArticulatedRobot::new(&s.robot, s.shape.clone(), base, joints).map(|_| ())
        };
        assert!(matches!(new(&s.base, &[0.0]), Err(RobotError::JointCount { .. })));
        assert!(matches!(new(&s.base, &[0.0, f64::NAN]), Err(RobotError::Number { .. })));
        let far = Isometry3::translation(f64::INFINITY, 0.0, 0.0);
        assert!(matches!(new(&far, &[0.0; 2]), Err(RobotError::Number { .. })));
    }
}
