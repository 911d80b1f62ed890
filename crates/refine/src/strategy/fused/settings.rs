//! Settings of the fused estimator.

use super::confidence::CovarianceInflation;
use crate::factor::{
    ContactSettings, FreeSpaceSettings, HandDepthSettings, ModelErrorSettings, PenetrationSettings,
    PointToPlaneSettings, PriorSettings, RenderingSettings, SupportSettings, TactileSettings,
    TouchModel,
};
use crate::problem::{Block, State};

/// A kind of evidence that the fused estimator weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Evidence {
    /// Colors on the object.
    Color,
    /// The outline of the object's mask.
    Silhouette,
    /// Depth on the object.
    Depth,
    /// Depth on the hand.
    HandDepth,
    /// Depth behind where the object is not.
    FreeSpace,
    /// Taxels that feel a force.
    Touch,
    /// Taxels that feel none.
    Quiet,
    /// Hand and object are not in the same place.
    Penetration,
    /// Contact forces within their friction cones hold the object.
    Support,
}

impl Evidence {
    /// All kinds.
    pub const ALL: [Self; 9] = [
        Self::Color,
        Self::Silhouette,
        Self::Depth,
        Self::HandDepth,
        Self::FreeSpace,
        Self::Touch,
        Self::Quiet,
        Self::Penetration,
        Self::Support,
    ];

    /// The name used in reports and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Silhouette => "silhouette",
            Self::Depth => "depth",
            Self::HandDepth => "hand-depth",
            Self::FreeSpace => "free-space",
            Self::Touch => "touch",
            Self::Quiet => "quiet",
            Self::Penetration => "penetration",
            Self::Support => "support",
        }
    }
}

/// A group of quantities that are estimated beside the pose because they are not known exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Nuisance {
    /// The hand's pose in the camera frame.
    HandPose,
    /// The hand's joint positions.
    Joints,
    /// Depth scale and bias, center of projection and size of images.
    Camera,
    /// How the object differs from its model.
    Model,
}

impl Nuisance {
    /// All groups.
    pub const ALL: [Self; 4] = [Self::HandPose, Self::Joints, Self::Camera, Self::Model];

    /// The name used in reports and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::HandPose => "hand-pose",
            Self::Joints => "joints",
            Self::Camera => "camera",
            Self::Model => "model",
        }
    }

    /// Its block for a hand of `joints` joints; none of the model's, whose size depends on what is seen of the object.
    fn block(self, joints: usize) -> Option<Block> {
        match self {
            Self::HandPose => Some(Block::HandPose),
            Self::Joints => Some(Block::Joints(joints)),
            Self::Camera => Some(Block::Camera),
            Self::Model => None,
        }
    }
}

/// One level of the way from coarse to fine.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Images are made smaller by this factor.
    pub downsample: usize,
    /// Depth points used at most.
    pub points: usize,
    /// Distances and color differences count as outliers only from so many times their final limits on.
    pub tolerance: f64,
    /// Iterations at most.
    pub iterations: usize,
    /// The stage ends when the next step promises less than so many nats.
    pub min_decrease: f64,
    /// How many of the best hypotheses the stage takes up.
    pub hypotheses: usize,
    /// Whether colors are compared, which have many minima.
    pub color: bool,
    /// Whether the scatter of depth points about the best solution so far says how much depth is to be trusted.
    pub measured_scatter: bool,
    /// Whether the object may differ from its model, where it is asked: [`Nuisance::Model`].
    pub model_deviates: bool,
    /// Whether hand and object may not be in the same place, which bars ways that lead through the hand.
    pub contact: bool,
}

/// Settings of [`Fused`](super::Fused).
#[derive(Clone, Debug, PartialEq)]
pub struct FusedSettings {
    /// Evidence to use, where the observation brings it.
    pub evidence: Vec<Evidence>,
    /// What is estimated beside the pose; the rest is believed as it is said to be.
    pub nuisances: Vec<Nuisance>,
    /// Stated accuracies.
    pub accuracy: PriorSettings,
    /// From coarse to fine.
    pub stages: Vec<Stage>,
    /// Angle of the turns about three axes, both ways, that hypotheses start with beside the initial pose where that alone leaves
    /// something open \[rad\]; zero for none.
    pub turns: f64,
    /// Where the first stage leaves the pose open, further hypotheses are tried at this distance \[m of surface motion\].
    pub spread: f64,
    /// Whether to ask the evidence if calibrations are exact.
    pub exactness: bool,
    /// Independent measurements that depth points amount to beside the errors that neighbors share, where both were measured.
    pub max_effective_samples: f64,
    /// Hypotheses that are so much behind the best one after a stage, colors considered, are given up \[nat\].
    pub prune_margin: f64,
    /// What makes the posterior as wide as errors are.
    pub width: CovarianceInflation,
    /// How far the object's surface may be from the model's, patch by patch, with [`Nuisance::Model`].
    pub model: ModelErrorSettings,
    /// Color and silhouette.
    pub rendering: RenderingSettings,
    /// Depth on the object. Its deviations and number of effective points are overwritten by what is measured, in stages with
    /// [`Stage::measured_scatter`] and where calibrations are exact.
    pub depth: PointToPlaneSettings,
    /// Depth on the hand.
    pub hand_depth: HandDepthSettings,
    /// Free space.
    pub free_space: FreeSpaceSettings,
    /// Taxels.
    pub tactile: TactileSettings,
    /// Non-penetration.
    pub penetration: PenetrationSettings,
    /// Feasibility of contact forces.
    pub support: SupportSettings,
}

impl FusedSettings {
    /// What is solved for from `state` that it holds; of a hand that is not `known`, nothing.
    pub(super) fn blocks(&self, known: bool, state: &State) -> Vec<Block> {
        let nuisances = self.nuisances.iter().filter(|n| known || **n == Nuisance::Camera);
        let blocks = nuisances.filter_map(|nuisance| nuisance.block(state.joints.len()));
        std::iter::once(Block::ObjectPose).chain(blocks).collect()
    }
}

impl Default for FusedSettings {
    fn default() -> Self {
        Self {
            evidence: Evidence::ALL.to_vec(),
            nuisances: Nuisance::ALL.to_vec(),
            accuracy: PriorSettings::default(),
            stages: vec![
                Stage {
                    downsample: 4,
                    points: 200,
                    tolerance: 8.0,
                    iterations: 10,
                    min_decrease: 1.0,
                    hypotheses: 7,
                    color: false,
                    measured_scatter: false,
                    model_deviates: false,
                    contact: false,
                },
                Stage {
                    downsample: 4,
                    points: 250,
                    tolerance: 4.0,
                    iterations: 5,
                    min_decrease: 0.3,
                    hypotheses: 14,
                    color: true,
                    measured_scatter: false,
                    model_deviates: false,
                    contact: true,
                },
                Stage {
                    downsample: 4,
                    points: 600,
                    tolerance: 2.0,
                    iterations: 8,
                    min_decrease: 0.1,
                    hypotheses: 5,
                    color: true,
                    measured_scatter: true,
                    model_deviates: false,
                    contact: true,
                },
                Stage {
                    downsample: 2,
                    points: 1200,
                    tolerance: 1.0,
                    iterations: 10,
                    min_decrease: 0.02,
                    hypotheses: 3,
                    color: true,
                    measured_scatter: true,
                    model_deviates: true,
                    contact: true,
                },
            ],
            turns: 20f64.to_radians(),
            spread: 10e-3,
            exactness: true,
            max_effective_samples: 50.0,
            prune_margin: 15.0,
            width: CovarianceInflation::default(),
            model: ModelErrorSettings::default(),
            rendering: RenderingSettings {
                downsample: 1,
                effective_pixels: 80.0,
                mask_sigma: 0.6,
                ..RenderingSettings::default()
            },
            depth: PointToPlaneSettings {
                effective_points: 20.0,
                ..PointToPlaneSettings::default()
            },
            hand_depth: HandDepthSettings {
                effective_points: 200.0,
                ..HandDepthSettings::default()
            },
            free_space: FreeSpaceSettings::default(),
            tactile: TactileSettings {
                felt: TouchModel::Contacts(ContactSettings::default()),
                ..TactileSettings::default()
            },
            penetration: PenetrationSettings::default(),
            support: SupportSettings::default(),
        }
    }
}
