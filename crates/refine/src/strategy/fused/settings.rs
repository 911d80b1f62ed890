//! Settings of the fused estimator.

use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use super::fit::FitSettings;
use crate::factor::{
    BinaryTouchSettings, ContactPatchSettings, FreeSpaceSettings, HandDepthSettings,
    PenetrationSettings, PointToPlaneSettings, PriorSettings, ProximitySettings, RegionSettings,
    RenderingSettings, ScaleSettings, SupportSettings, TactileSettings,
};
use crate::problem::{Block, Solver, State};
use crate::scene::{Frame, ModelErrorSettings};

/// A sensor modality, or a constraint, that the fused estimator weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, IntoStaticStr, Serialize, Deserialize)]
#[strum(serialize_all = "kebab-case")]
#[serde(rename_all = "kebab-case")]
pub enum Modality {
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
    /// What is felt: taxels with a force, contact, proximity and patches of the surface.
    Touch,
    /// Taxels that feel nothing.
    Quiet,
    /// Hand and object are not in the same place.
    Penetration,
    /// Contact forces within their friction cones hold the object.
    Support,
}

impl Modality {
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
        self.into()
    }
}

/// A group of quantities that are estimated beside the pose because they are not known exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, IntoStaticStr, Serialize, Deserialize)]
#[strum(serialize_all = "kebab-case")]
#[serde(rename_all = "kebab-case")]
pub enum Nuisance {
    /// The hand's pose in the camera frame.
    HandPose,
    /// The hand's joint positions.
    Joints,
    /// Depth scale and bias, center of projection and size of images; of other cameras, their places, too.
    Camera,
    /// How the object differs from its model.
    Model,
}

impl Nuisance {
    /// All groups.
    pub const ALL: [Self; 4] = [Self::HandPose, Self::Joints, Self::Camera, Self::Model];

    /// The name used in reports and on the command line.
    pub fn name(self) -> &'static str {
        self.into()
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Images are made smaller by this factor.
    pub downsample: usize,
    /// Depth points used at most.
    pub points: usize,
    /// Kernels of depth, color and touch are so many times as wide as at the end: graduated non-convexity.
    pub kernel_scale: f64,
    /// When a solve ends.
    pub solver: Solver,
    /// How many of the best hypotheses the stage takes up.
    pub hypotheses: usize,
    /// Whether colors are compared, which have many minima.
    pub color: bool,
    /// Whether the scatter of depth points about the best solution so far says how much depth is to be trusted.
    pub measured_noise: bool,
    /// Whether the object may differ from its model, where it is asked: [`Nuisance::Model`].
    pub model_error: bool,
    /// Whether hand and object may not be in the same place, which bars ways that lead through the hand.
    pub contact: bool,
}

impl Stage {
    /// Stage with kernels so many octaves wider than at the end: the wider, the fewer points, the more hypotheses and the sooner a solve ends.
    pub(crate) fn octaves(octaves: u32) -> Self {
        let kernel_scale = f64::from(1 << octaves);
        Self {
            downsample: if octaves == 0 { 2 } else { 4 },
            points: 1200 >> octaves,
            kernel_scale,
            solver: Solver { iterations: 10, min_decrease: 0.02 * kernel_scale.powi(2) },
            hypotheses: 3 << octaves,
            color: true,
            measured_noise: true,
            model_error: octaves == 0,
            contact: true,
        }
    }

    /// Geometry alone, then colors, then measured noise.
    fn coarse_to_fine() -> Vec<Self> {
        let geometry =
            Self { color: false, contact: false, measured_noise: false, ..Self::octaves(3) };
        let colors = Self { measured_noise: false, ..Self::octaves(2) };
        vec![geometry, colors, Self::octaves(1), Self::octaves(0)]
    }
}

/// Settings of [`Fused`](super::Fused).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusedSettings {
    /// Modality to use, where the observation brings it.
    pub modalities: Vec<Modality>,
    /// Whether other cameras' images are used, where there are any.
    pub views: bool,
    /// What is estimated beside the pose; the rest is believed as it is said to be.
    pub nuisances: Vec<Nuisance>,
    /// Stated accuracies.
    pub prior: PriorSettings,
    /// From coarse to fine.
    pub stages: Vec<Stage>,
    /// Angle of the turns about three axes, both ways, that hypotheses start with beside the initial pose where that alone leaves
    /// something open \[rad\]; zero for none.
    pub restart_angle: f64,
    /// Where the first stage leaves the pose open, further hypotheses are tried at this distance \[m of surface motion\].
    pub restart_spacing: f64,
    /// Independent measurements that depth points amount to beside the errors that neighbors share, at most.
    pub max_effective_samples: f64,
    /// Hypotheses that are so much behind the best one after a stage, colors considered, are given up \[nat\].
    pub prune_margin: f64,
    /// By how much more color and silhouette tell of distinct modes than of the pose in one of them: what neighboring pixels have in common, such as errors of
    /// light and shape, is nearly the same in all modes.
    pub image_between_modes: f64,
    /// Independent measurements that the hand's depth amounts to at most in frames of a known rig: what depth is off by in all frames is in the rig.
    pub samples_with_rig: f64,
    /// Where the surface may be elsewhere than the model has it, contact says as much less of the pose; a rig has the surface as it is.
    pub blurred_contact: bool,
    /// Whether nothing is known of the object's rotation: near symmetries of its shape are then tried, too.
    pub rotation_unknown: bool,
    /// By which factors errors may be larger or smaller than their nominal sizes.
    pub scales: ScaleSettings,
    /// The test of fit.
    pub fit: FitSettings,
    /// How far the object's surface may be from the model's, patch by patch, with [`Nuisance::Model`].
    pub model: ModelErrorSettings,
    /// Standard deviation of the model's size as a share of it; zero of a model whose size is known.
    pub model_scale: f64,
    /// Color and silhouette.
    pub rendering: RenderingSettings,
    /// Regions within and around the outline.
    pub region: RegionSettings,
    /// Depth on the object. Its deviations and number of effective points are overwritten by what is measured in stages with
    /// [`Stage::measured_noise`], from this number of points; stages have a number of their own.
    pub depth: PointToPlaneSettings,
    /// Depth on the hand.
    pub hand_depth: HandDepthSettings,
    /// Free space.
    pub free_space: FreeSpaceSettings,
    /// Taxels that feel forces.
    pub tactile: TactileSettings,
    /// Sensors that feel contact alone.
    pub binary_touch: BinaryTouchSettings,
    /// Proximity.
    pub proximity: ProximitySettings,
    /// Contact patches.
    pub contact_patch: ContactPatchSettings,
    /// Non-penetration.
    pub penetration: PenetrationSettings,
    /// Feasibility of contact forces.
    pub support: SupportSettings,
}

impl FusedSettings {
    /// These settings with the accuracy of the model of `frame`, and of a rig if that `is_rig_known`.
    pub(crate) fn for_frame(&self, frame: &Frame<'_>, is_rig_known: bool) -> Self {
        let mut settings = self.clone();
        if let Some(deviation) = &frame.object().deviation {
            settings.model.gp_sigma = settings.model.gp_sigma.min(deviation.left());
        }
        if is_rig_known {
            settings.hand_depth.noise.effective_samples = settings.samples_with_rig;
            settings.blurred_contact = false;
        }
        settings.prior = settings.prior.of_hand(frame.observation().hand.as_ref());
        settings
    }

    /// What is solved for from `state` that it holds; of a hand that is not `known`, nothing.
    pub(super) fn blocks(&self, known: bool, state: &State) -> Vec<Block> {
        let nuisances = self.nuisances.iter().filter(|n| known || **n == Nuisance::Camera);
        let blocks = nuisances.filter_map(|nuisance| nuisance.block(state.joints.len()));
        let views = if self.nuisances.contains(&Nuisance::Camera) { state.views.len() } else { 0 };
        let views = (0..views).map(Block::View);
        std::iter::once(Block::ObjectPose).chain(blocks).chain(views).collect()
    }
}

impl Default for FusedSettings {
    fn default() -> Self {
        Self {
            modalities: Modality::ALL.to_vec(),
            views: true,
            nuisances: Nuisance::ALL.to_vec(),
            prior: PriorSettings::default(),
            stages: Stage::coarse_to_fine(),
            restart_angle: 20f64.to_radians(),
            restart_spacing: 10e-3,
            max_effective_samples: 50.0,
            prune_margin: 15.0,
            image_between_modes: 2.0,
            samples_with_rig: 200.0,
            blurred_contact: true,
            rotation_unknown: false,
            scales: ScaleSettings::default(),
            fit: FitSettings::default(),
            model: ModelErrorSettings::default(),
            model_scale: 0.0,
            rendering: RenderingSettings::default(),
            region: RegionSettings::default(),
            depth: PointToPlaneSettings::default(),
            hand_depth: HandDepthSettings::default(),
            free_space: FreeSpaceSettings::default(),
            tactile: TactileSettings::default(),
            binary_touch: BinaryTouchSettings::default(),
            proximity: ProximitySettings::default(),
            contact_patch: ContactPatchSettings::default(),
            penetration: PenetrationSettings::default(),
            support: SupportSettings::default(),
        }
    }
}
