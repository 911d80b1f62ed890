//! The robot hand, prepared once and shared by all frames.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::{
    ArticulatedRobot, KinematicTree, Motion, PosedRobot, RobotError, RobotShape,
};
use prehend_geometry::{GridCache, ReadOptions};
use prehend_render::RenderModel;

use super::HandMeasurement;
use crate::error::RefineError;

/// A robot hand: kinematics, shape and skin.
pub struct Hand {
    /// Joints and links.
    pub tree: KinematicTree,
    /// Collision geometry with one cached distance grid a link.
    pub shape: Arc<RobotShape>,
    /// Tactile sensors, in link frames; empty without a skin.
    pub taxels: Vec<Taxel>,
    /// Every collision body with the index of its link, for drawing.
    bodies: Vec<(usize, RenderModel)>,
}

/// Beyond this no position of a joint is one \[rad or m\]: its sine would be noise.
const FARTHEST_JOINT: f64 = 1e6;

impl Hand {
    /// Prepares the shape of `tree`; this builds a distance grid for every link.
    ///
    /// # Errors
    /// If the geometry of a link cannot be used.
    pub fn new(tree: KinematicTree, taxels: Vec<Taxel>) -> Result<Self, RobotError> {
        Self::cached(tree, taxels, None)
    }

    /// Hand of a URDF or MJCF file, with the taxels of a table ([`load_taxels`]) and distance grids of a `cache`, where they are given.
    ///
    /// # Errors
    /// If a file cannot be read, or the geometry of a link cannot be used.
    pub fn load(
        description: &Path,
        taxels: Option<&Path>,
        cache: Option<&GridCache>,
    ) -> Result<Self, RefineError> {
        Self::load_with(description, taxels, cache, &ReadOptions::default())
    }

    /// [`load`](Self::load) with options of reading the description.
    ///
    /// # Errors
    /// See there.
    pub fn load_with(
        description: &Path,
        taxels: Option<&Path>,
        cache: Option<&GridCache>,
        options: &ReadOptions,
    ) -> Result<Self, RefineError> {
        let tree = KinematicTree::from_file_with(description, options)?;
        let taxels = taxels.map(load_taxels).transpose()?.unwrap_or_default();
        Ok(Self::cached(tree, taxels, cache)?)
    }

    /// As [`Self::new`] has it, with distance grids from `cache` where it holds them; others are left there.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn cached(
        tree: KinematicTree,
        taxels: Vec<Taxel>,
        cache: Option<&GridCache>,
    ) -> Result<Self, RobotError> {
        let (spacing, margin) = (RobotShape::DEFAULT_SPACING, RobotShape::DEFAULT_MARGIN);
        let shape = Arc::new(RobotShape::cached(&tree, spacing, margin, cache)?);
        let links = tree.links().iter().enumerate();
        let bodies = links
            .flat_map(|(index, link)| link.parts.iter().map(move |part| (index, part)))
            .map(|(index, part)| {
                let fault = |e: prehend_render::ModelError| RobotError::Shape {
                    link: tree.links()[index].name.clone(),
                    reason: e.to_string(),
                };
                Ok((index, RenderModel::new(&part.clone().faced_outward()).map_err(fault)?))
            })
            .collect::<Result<_, RobotError>>()?;
        Ok(Self { tree, shape, taxels, bodies })
    }

    /// Measurement of this hand without touch, its base at `t_cam_hand` \[m\] and its joints at `joints` \[rad\].
    pub fn measured(
        self: &Arc<Self>,
        t_cam_hand: Isometry3<f64>,
        joints: Vec<f64>,
    ) -> HandMeasurement {
        HandMeasurement::new(Arc::clone(self), t_cam_hand, joints)
    }

    /// The hand with its base at `t_cam_hand` and its joints at `joints` \[rad\].
    ///
    /// # Errors
    /// If there is not one joint position a joint, or a pose is not finite.
    pub fn posed(
        &self,
        t_cam_hand: &Isometry3<f64>,
        joints: &[f64],
    ) -> Result<PosedRobot, RobotError> {
        self.check_joints(joints)?;
        PosedRobot::new(Arc::clone(&self.shape), self.link_poses(t_cam_hand, joints))
    }

    /// The hand with its base at `t_cam_hand` and its joints at `joints` \[rad\], knowing how each link moves.
    ///
    /// # Errors
    /// If there is not one joint position a joint, or a number is not finite.
    pub fn articulated(
        &self,
        t_cam_hand: &Isometry3<f64>,
        joints: &[f64],
    ) -> Result<ArticulatedRobot, RobotError> {
        ArticulatedRobot::new(&self.tree, Arc::clone(&self.shape), t_cam_hand, joints)
    }

    /// Whether `joints` has one position for each of [`joint_names`](KinematicTree::joint_names), and each is a number that a joint may have.
    ///
    /// # Errors
    /// [`RobotError::JointCount`] or [`RobotError::Number`].
    pub fn check_joints(&self, joints: &[f64]) -> Result<(), RobotError> {
        let (given, expected) = (joints.len(), self.tree.joint_names().len());
        if given != expected {
            return Err(RobotError::JointCount { given, expected });
        }
        let is_wrong = |position: &f64| position.is_nan() || position.abs() > FARTHEST_JOINT;
        let wrong = joints.iter().position(is_wrong);
        wrong.map_or(Ok(()), |at| {
            Err(RobotError::Number {
                owner: format!("joint '{}'", self.tree.joint_names()[at]),
                field: "position",
                requirement: "a number within ±1e6",
            })
        })
    }

    /// Whether `forces` has one for each taxel.
    pub(crate) fn check_forces(&self, forces: &[Vector3<f64>]) -> Result<(), RefineError> {
        let (forces, taxels) = (forces.len(), self.taxels.len());
        if forces == taxels { Ok(()) } else { Err(RefineError::TaxelCount { forces, taxels }) }
    }

    /// The link that carries `taxel`.
    pub(crate) fn link_of(&self, taxel: &Taxel) -> Result<usize, RefineError> {
        let link = self.tree.link_index(&taxel.link);
        link.ok_or_else(|| RefineError::TaxelLink { link: taxel.link.clone() })
    }

    /// Render models of the hand's links, with link → camera poses.
    ///
    /// # Panics
    /// If there is not one joint position a joint: see [`check_joints`](Self::check_joints).
    pub fn render_bodies(
        &self,
        t_cam_hand: &Isometry3<f64>,
        joints: &[f64],
    ) -> Vec<(&RenderModel, Isometry3<f64>)> {
        let poses = self.link_poses(t_cam_hand, joints);
        self.bodies.iter().map(|(link, model)| (model, poses[*link])).collect()
    }

    fn link_poses(&self, t_cam_hand: &Isometry3<f64>, joints: &[f64]) -> Vec<Isometry3<f64>> {
        self.tree.forward_kinematics(joints).iter().map(|t| t_cam_hand * t).collect()
    }
}

/// True for each of the [`joint_names`](KinematicTree::joint_names) that is prismatic.
pub(crate) fn prismatic_joints(tree: &KinematicTree) -> Vec<bool> {
    let slides = |name: &String| {
        tree.joints().iter().any(|j| j.name == *name && j.motion == Motion::Prismatic)
    };
    tree.joint_names().iter().map(slides).collect()
}

impl fmt::Debug for Hand {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (links, taxels) = (self.tree.links().len(), self.taxels.len());
        formatter.debug_struct("Hand").field("links", &links).field("taxels", &taxels).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::check_frame;
    use crate::estimator::Estimator;
    use crate::factor::PriorSettings;
    use crate::pose_finder::Hypotheses;
    use crate::problem::Block;
    use crate::scene::{Frame, PreparedFrame, default_scene};

    #[test]
    fn a_wrong_number_of_joints_is_an_error() {
        let scene = default_scene(1).unwrap();
        let mut observation = scene.frame.clone();
        observation.hand.as_mut().unwrap().joints.pop();
        let refused = PreparedFrame::new(&observation, &scene.object).map(|_| ()).unwrap_err();
        let expected = RobotError::JointCount { given: 15, expected: 16 }.to_string();
        assert_eq!(refused.to_string(), expected);
        let posed = scene.hand.posed(&Isometry3::identity(), &[0.0; 17]);
        assert!(matches!(posed, Err(RobotError::JointCount { given: 17, expected: 16 })));
        let warnings = check_frame(&observation, &scene.object, &scene.initial);
        assert!(warnings.iter().any(|w| w.message.contains("15 joint positions")), "{warnings:?}");
    }

    #[test]
    fn a_hand_in_mjcf_refines_as_the_same_in_urdf() {
        let dir = tempfile::tempdir().unwrap();
        let written = |name: &str, text: &str| {
            let file = dir.path().join(name);
            std::fs::write(&file, text).unwrap();
            Arc::new(Hand::load(&file, None, None).unwrap())
        };
        let urdf = r#"<robot name="gripper">
            <link name="palm"><collision><origin xyz="0 0 -0.02"/><geometry><box size="0.14 0.06 0.04"/></geometry></collision></link>
            <link name="left"><collision><origin xyz="-0.005 0 0.04"/><geometry><box size="0.01 0.03 0.08"/></geometry></collision></link>
            <link name="right"><collision><origin xyz="0 0 0.04"/><geometry><cylinder radius="0.01" length="0.08"/></geometry></collision></link>
            <joint name="slide" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="1 0 0"/></joint>
            <joint name="turn" type="revolute"><origin xyz="0.05 0 0" rpy="0 0 0.5"/><parent link="palm"/><child link="right"/>
                <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"#;
        let mjcf = r#"<mujoco model="gripper"><compiler angle="radian" eulerseq="XYZ"/><worldbody><body name="palm" pos="0.3 0 0">
            <geom type="box" size="0.07 0.03 0.02" pos="0 0 -0.02"/>
            <body name="left"><joint name="slide" type="slide" axis="1 0 0"/>
                <geom type="box" size="0.005 0.015 0.04" pos="-0.005 0 0.04"/></body>
            <body name="right" pos="0.05 0 0" euler="0 0 0.5"><joint name="turn" axis="0 1 0" range="-1 1"/>
                <geom type="cylinder" size="0.01 0.04" pos="0 0 0.04"/></body></body></worldbody></mujoco>"#;
        let scene = default_scene(1).unwrap();
        let object = Arc::clone(&scene.object);
        let center = scene.initial * object.center;
        let t_cam_hand = Isometry3::translation(center.x, center.y, center.z + 0.05);
        let refined = |hand: Arc<Hand>| {
            let mut measured = hand.measured(t_cam_hand, vec![-0.04, 0.1]);
            let prior = PriorSettings::default();
            let sigmas = |m: &HandMeasurement| prior.of_hand(Some(m)).sigmas(Block::Joints(2));
            assert_eq!(sigmas(&measured), [prior.prismatic_joints, prior.joints]);
            measured.joint_sigmas = vec![Some(0.1)];
            assert_eq!(sigmas(&measured), [0.1, prior.joints]);
            measured.joint_sigmas.clear();
            let frame = Frame { hand: Some(measured), ..scene.frame.clone() };
            let estimator = Estimator::new(Arc::clone(&object));
            let initial = Hypotheses::from(scene.initial);
            *estimator.refine(&frame, &initial).unwrap().t_cam_object()
        };
        let [a, b] = [written("a.urdf", urdf), written("b.xml", mjcf)].map(refined);
        let apart = (a.to_homogeneous() - b.to_homogeneous()).norm();
        assert!(apart < 1e-9, "{apart}");
        // The hand counts.
        let estimator = Estimator::new(Arc::clone(&object));
        let bare = Frame { hand: None, ..scene.frame.clone() };
        let alone =
            *estimator.refine(&bare, &Hypotheses::from(scene.initial)).unwrap().t_cam_object();
        assert!((a.to_homogeneous() - alone.to_homogeneous()).norm() > 1e-6);
    }

    #[test]
    fn a_part_that_cannot_be_drawn_is_an_error() {
        // A flat triangle without any area, as a mesh file may hold.
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
            .unwrap();
        let urdf = r#"<robot name="r"><link name="palm"><collision><geometry>
            <mesh filename="flat.obj"/></geometry></collision></link></robot>"#;
        let refused = KinematicTree::from_urdf_str(urdf, Some(dir.path()))
            .and_then(|tree| Hand::new(tree, Vec::new()).map(|_| ()));
        assert!(refused.unwrap_err().to_string().contains("link 'palm'"));
    }
}
