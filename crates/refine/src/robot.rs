//! The robot hand, prepared once and shared by all frames.

use std::sync::Arc;

use nalgebra::Isometry3;
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::{PosedRobot, Robot as KinematicTree, RobotError, RobotShape};
use prehend_render::RenderModel;

/// A robot hand: kinematics, shape and skin.
pub struct Robot {
    /// Joints and links.
    pub tree: KinematicTree,
    /// Collision geometry with one cached distance grid a link.
    pub shape: Arc<RobotShape>,
    /// Tactile sensors, in link frames; empty without a skin.
    pub taxels: Vec<Taxel>,
    /// Every collision body with the index of its link, for drawing.
    bodies: Vec<(usize, RenderModel)>,
}

impl Robot {
    /// Prepares the shape of `tree`; this builds a distance grid for every link.
    ///
    /// # Errors
    /// If the geometry of a link cannot be used.
    pub fn new(tree: KinematicTree, taxels: Vec<Taxel>) -> Result<Self, RobotError> {
        let shape = Arc::new(RobotShape::new(
            &tree,
            RobotShape::DEFAULT_SPACING,
            RobotShape::DEFAULT_MARGIN,
        )?);
        let links = tree.links().iter().enumerate();
        let bodies = links
            .flat_map(|(index, link)| link.parts.iter().map(move |part| (index, part)))
            .filter_map(|(index, part)| Some((index, RenderModel::new(part).ok()?)))
            .collect();
        Ok(Self { tree, shape, taxels, bodies })
    }

    /// The hand with its base at `t_cam_hand` and its joints at `joints` \[rad\].
    ///
    /// # Errors
    /// If a pose is not finite.
    pub fn posed(
        &self,
        t_cam_hand: &Isometry3<f64>,
        joints: &[f64],
    ) -> Result<PosedRobot, RobotError> {
        PosedRobot::new(Arc::clone(&self.shape), self.link_poses(t_cam_hand, joints))
    }

    /// What there is to draw of the hand, with link → camera poses.
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
