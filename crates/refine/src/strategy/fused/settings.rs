//! Settings of the fused estimator.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

use super::fit::FitSettings;
use super::model_scale::ModelScaleSettings;
use super::posterior::PosteriorSettings;
use crate::defaults::settings;
use crate::factor::{
    BinaryTouchSettings, ContactPatchSettings, FreeSpaceSettings, HandDepthSettings,
    PenetrationSettings, PointToPlaneSettings, PriorSettings, ProximitySettings, RegionSettings,
    RenderingSettings, ScaleSettings, SupportSettings, TactileSettings,
};
use crate::problem::{Block, Solver, State};
use crate::scene::{ModelErrorSettings, PreparedFrame};

/// A sensor modality, or a constraint, that the fused estimator weighs.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, IntoStaticStr, VariantArray, Serialize, Deserialize,
)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
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
    /// Touch: taxels with a force, contact, proximity and patches of the surface.
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
    pub const ALL: &'static [Self] = Self::VARIANTS;

    /// The name used in reports and on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A group of quantities that are estimated beside the pose because they are not known exactly.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, IntoStaticStr, VariantArray, Serialize, Deserialize,
)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
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
    pub const ALL: &'static [Self] = Self::VARIANTS;

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
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Factor by which images are made smaller.
    pub downsample: usize,
    /// Number of depth points at most.
    pub points: usize,
    /// Width of the kernels of depth, color and touch, as a multiple of that at the end: graduated non-convexity (Blake and Zisserman, 1987).
    pub kernel_scale: f64,
    /// Solver, and when it ends.
    pub solver: Solver,
    /// Number of hypotheses, the best ones, that the stage takes up.
    pub hypotheses: usize,
    /// True if colors are compared, which have many minima.
    pub color: bool,
    /// True if the scatter of depth points about the best solution so far takes the place of their nominal noise.
    pub measured_noise: bool,
    /// True if the object may differ from its model, where that is estimated: [`Nuisance::Model`].
    pub model_error: bool,
    /// True if hand and object may not be in the same place, which bars ways that lead through the hand.
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

settings! {
    /// Settings of the hypotheses from which the estimator starts, and of which it keeps the best.
    #[derive(Copy)]
    pub struct HypothesisSettings {
        /// Angle of the turns about three axes, both ways, that hypotheses start with beside the initial pose where that alone leaves
        /// something open \[rad\]; zero for none.
        pub restart_angle: f64 = 20f64.to_radians(),
        /// Distance of further hypotheses where the first stage leaves the pose open \[m of surface motion\]. EXPERIMENTS: More restarts.
        pub spacing: f64 = 10e-3,
        /// Reach of these to both sides, in standard deviations of the pose and in multiples of the distance. Wide, since first solutions of hardly any
        /// difference in cost lie farther apart than the curvature about the best of them has it. EXPERIMENTS: More restarts.
        pub reach: f64 = 4.0,
        /// Standard deviation of the pose \[m of surface motion\] below which the first solution needs no others beside it, if depth scatters about the
        /// surface by less than its nominal noise. EXPERIMENTS: Restarts only where the first solution leaves a direction open.
        pub settled_sigma: f64 = 6e-3,
        /// Cost behind the best hypothesis after a stage, colors considered, from which another is given up \[nat\]: its weight would be 3·10⁻⁷. EXPERIMENTS:
        /// Pruning of unconverged hypotheses 15 nat behind.
        pub prune_margin: f64 = 15.0,
        /// Factor by which color and silhouette tell more of distinct modes than of the pose in one of them: what neighboring pixels have in common, such as
        /// errors of light and shape, is nearly the same in all modes. EXPERIMENTS: Weight of the image between modes.
        pub image_between_modes: f64 = 2.0,
        /// Surface motion below which two poses are the same solution \[m\].
        pub same: f64 = 2e-3,
        /// Angle from which a rotation is that of another mode \[rad\].
        pub another: f64 = 0.2,
        /// Number of steps of geometry alone that a pose of another convention of rotations is given before it is compared.
        pub alternative_steps: usize = 4,
        /// Number of steps that the hypotheses of a search are given before half of them are given up, while they are more than a stage solves to the end.
        pub shortlist_steps: usize = 1,
        /// Ratio of the cost of a pose of another convention to that of the best one from which it is given up.
        pub hopeless: f64 = 4.0,
    }
}

settings! {
    /// Settings of [`Fused`](super::Fused).
    pub struct FusedSettings {
        /// Modalities to use, where the observation brings them.
        pub modalities: Vec<Modality> = Modality::ALL.to_vec(),
        /// True if other cameras' images are used, where there are any.
        pub views: bool = true,
        /// Groups of quantities that are estimated beside the pose; the rest is believed as it is said to be.
        pub nuisances: Vec<Nuisance> = Nuisance::ALL.to_vec(),
        /// Prior: nominal standard deviations of the initial pose and of calibrations.
        pub prior: PriorSettings = PriorSettings::default(),
        /// Stages, from coarse to fine.
        pub stages: Vec<Stage> = Stage::coarse_to_fine(),
        /// Initial and alternative poses.
        pub hypotheses: HypothesisSettings = HypothesisSettings::default(),
        /// Smallest standard deviation of depth points that is believed when measured \[m\]: a rendered image has none.
        pub min_depth_sigma: f64 = 2e-4,
        /// Effective sample size of depth points at most, beside the errors that neighbors share. EXPERIMENTS: Settings of the depth field.
        pub max_effective_samples: f64 = 50.0,
        /// Effective sample size of the hand's depth in frames of a known rig: what depth is off by in all frames is in the rig. EXPERIMENTS: Depth points of
        /// the hand near edges left out.
        pub samples_with_rig: f64 = 200.0,
        /// True if contact says less of the pose where the surface may be elsewhere than the model has it; a rig has the surface as it is.
        pub blurred_contact: bool = true,
        /// True if nothing is known of the object's rotation: near symmetries of its shape are then tried, too.
        pub rotation_unknown: bool = false,
        /// Hyperprior of scales: factors by which errors may be larger or smaller than their nominal sizes.
        pub scales: ScaleSettings = ScaleSettings::default(),
        /// Test of fit.
        pub fit: FitSettings = FitSettings::default(),
        /// Posterior.
        pub posterior: PosteriorSettings = PosteriorSettings::default(),
        /// Patches of the surface: how far that may be from the model's, with [`Nuisance::Model`].
        pub patches: ModelErrorSettings = ModelErrorSettings::default(),
        /// Size of the object beside the model's.
        pub model_scale: ModelScaleSettings = ModelScaleSettings::default(),
        /// Color and silhouette.
        pub rendering: RenderingSettings = RenderingSettings::default(),
        /// Regions within and around the outline, where no depth tells it.
        pub region: RegionSettings = RegionSettings::default(),
        /// Depth on the object. In stages with [`Stage::measured_noise`], what is measured takes the place of its standard deviations and effective sample
        /// size, from this number of points; stages have a number of their own.
        pub depth: PointToPlaneSettings = PointToPlaneSettings::default(),
        /// Depth on the hand.
        pub hand_depth: HandDepthSettings = HandDepthSettings::default(),
        /// Free space.
        pub free_space: FreeSpaceSettings = FreeSpaceSettings::default(),
        /// Taxels that feel forces.
        pub tactile: TactileSettings = TactileSettings::default(),
        /// Touch sensors that feel contact alone.
        pub binary_touch: BinaryTouchSettings = BinaryTouchSettings::default(),
        /// Proximity.
        pub proximity: ProximitySettings = ProximitySettings::default(),
        /// Contact patches.
        pub contact_patch: ContactPatchSettings = ContactPatchSettings::default(),
        /// Non-penetration.
        pub penetration: PenetrationSettings = PenetrationSettings::default(),
        /// Feasibility of contact forces.
        pub support: SupportSettings = SupportSettings::default(),
    }
}

impl FusedSettings {
    /// These settings with the accuracy of the model of `frame`, and of a rig if that `is_rig_known`.
    pub(crate) fn for_frame(&self, frame: &PreparedFrame<'_>, is_rig_known: bool) -> Self {
        let mut settings = self.clone();
        if let Some(deviation) = &frame.object().deviation {
            settings.patches.sigma = settings.patches.sigma.min(deviation.left());
        }
        if is_rig_known {
            settings.hand_depth.noise.effective_samples = settings.samples_with_rig;
            settings.blurred_contact = false;
        }
        settings.prior = settings.prior.of_hand(frame.observation().hand.as_ref());
        settings
    }

    /// Blocks of `state` that are solved for; those of the hand only if it is `known`.
    pub(super) fn blocks(&self, known: bool, state: &State) -> Vec<Block> {
        let nuisances = self.nuisances.iter().filter(|n| known || **n == Nuisance::Camera);
        let blocks = nuisances.filter_map(|nuisance| nuisance.block(state.joints.len()));
        let views = if self.nuisances.contains(&Nuisance::Camera) { state.views.len() } else { 0 };
        let views = (0..views).map(Block::View);
        std::iter::once(Block::ObjectPose).chain(blocks).chain(views).collect()
    }
}
