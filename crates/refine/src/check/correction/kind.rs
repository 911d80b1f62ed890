//! Mistakes in inputs by name: what would correct them, and what to say of them.

use strum::EnumMessage;

/// A mistake in a frame's inputs that has a name, by what corrects it, with its message for `message`. Those that are more common come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, EnumMessage)]
pub enum Correction {
    /// Translations of poses are in another unit.
    #[strum(message = "{poses}: {t}: translations are in another unit; multiply {t} by {times}")]
    PoseUnit,
    /// The mesh is in another unit.
    #[strum(message = "{mesh}: the mesh is in another unit; multiply its vertices by {times}")]
    ModelUnit,
    /// Depth is in another unit.
    #[strum(
        message = "{camera}: {depth_scale}: depth is in another unit; multiply {depth_scale} by {times}"
    )]
    DepthUnit,
    /// Mesh and translations of poses are both in another unit.
    #[strum(
        message = "{mesh} and {poses}: {t}: mesh and translations are both in another unit; multiply vertices and {t} by {times}"
    )]
    ModelAndPoseUnit,
    /// Poses map the camera into the object.
    #[strum(
        message = "{poses}: {R} and {t}: poses are inverted (camera in the object's frame, inverted extrinsics); invert them: R ← Rᵀ, t ← −Rᵀt"
    )]
    PoseInverted,
    /// Rotations are transposed.
    #[strum(message = "{poses}: {R}: rotations are transposed; write R row by row, R ← Rᵀ")]
    RotationTransposed,
    /// Quaternions (x, y, z, w) were read as (w, x, y, z).
    #[strum(
        message = "{poses}: {R}: quaternions are in the other order: (x, y, z, w) was taken for (w, x, y, z) where {R} was made; convert them again"
    )]
    QuaternionXyzw,
    /// Quaternions (w, x, y, z) were read as (x, y, z, w).
    #[strum(
        message = "{poses}: {R}: quaternions are in the other order: (w, x, y, z) was taken for (x, y, z, w) where {R} was made; convert them again"
    )]
    QuaternionWxyz,
    /// Poses are in the axes of graphics engines: x right, y up, z back.
    #[strum(
        message = "{poses}: {R} and {t}: the camera has the axes of OpenGL (y up, z back), not of OpenCV; negate the second and third row of R and of t"
    )]
    OpenGlAxes,
    /// Rotations alone are in these axes.
    #[strum(
        message = "{poses}: {R}: the camera has the axes of OpenGL (y up, z back), not of OpenCV; negate the second and third row of R"
    )]
    OpenGlRotation,
    /// Poses map such a camera into the object.
    #[strum(
        message = "{poses}: {R} and {t}: poses are inverted, of a camera with axes of OpenGL in the object's frame; invert them (R ← Rᵀ, t ← −Rᵀt), then negate the second and third row of R and of t"
    )]
    PoseInvertedOpenGl,
    /// Masks are set where the object is not.
    #[strum(
        message = "{masks}: masks are inverted; make pixels of the object non-zero and all others zero"
    )]
    MaskInverted,
    /// The two coordinates of the principal point are exchanged.
    #[strum(
        message = "{camera}: {K}: cx and cy are swapped; exchange them (cx is entry 2 and cy entry 5, counted from 0)"
    )]
    PrincipalPointSwapped,
    /// Intrinsics are of images of another size.
    #[strum(
        message = "{camera}: {K}: intrinsics are of images of another size; multiply fx, fy, cx and cy by {times}"
    )]
    CameraOfOtherSize,
    /// Depth is off by a factor.
    #[strum(
        message = "{camera}: {depth_scale}: depth is in another unit; multiply {depth_scale} by {times}"
    )]
    DepthScale,
    /// Translations of poses are wrong.
    #[strum(
        message = "{poses}: {t}: translations are wrong while rotations fit; check their unit, and that they are of the model's origin in the camera frame"
    )]
    Translation,
    /// The model is too small or too large.
    #[strum(message = "{mesh}: the model is too {size}; multiply its vertices by {times}")]
    ModelScale,
    /// Focal lengths are wrong.
    #[strum(
        message = "{camera}: {K}: the focal length is too {focal}; multiply fx and fy by {times}"
    )]
    FocalLength,
}

/// Powers of ten that units differ by.
const UNITS: [f64; 6] = [1e-3, 1e-2, 1e-1, 1e1, 1e2, 1e3];

/// Factors between common sizes of images.
const SIZES: [f64; 2] = [0.5, 2.0];

/// Logarithm of a factor between sizes that is none.
const NEARLY: f64 = 0.1;

/// Inputs that have a mistake in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scope {
    Poses,
    Object,
    Scene,
}

/// Corrections that are tried, each with its factor; `to_fit` makes the principal point that of the image's middle, and depth has to be multiplied by
/// `depth` to be that of the pose.
pub(super) fn candidates(to_fit: f64, depth: Option<f64>) -> Vec<(Correction, f64)> {
    use Correction::*;
    let units = [PoseUnit, ModelUnit, DepthUnit, ModelAndPoseUnit];
    let units = units.into_iter().flat_map(|unit| UNITS.map(|factor| (unit, factor)));
    let plain = [
        PoseInverted,
        RotationTransposed,
        QuaternionXyzw,
        QuaternionWxyz,
        OpenGlAxes,
        OpenGlRotation,
        PoseInvertedOpenGl,
        MaskInverted,
        PrincipalPointSwapped,
    ];
    // One that is nearly there is of this size.
    let to_fit = Some(to_fit).filter(|factor| factor.ln().abs() > NEARLY).unwrap_or(f64::NAN);
    let sizes = SIZES.into_iter().chain([to_fit]).map(|factor| (CameraOfOtherSize, factor));
    let last = [(DepthScale, depth.unwrap_or(f64::NAN)), (Translation, 1.0)];
    units.chain(plain.map(|kind| (kind, 1.0))).chain(sizes).chain(last).collect()
}

/// Number of candidates, in each frame the same.
pub(super) fn candidate_count() -> usize {
    candidates(1.0, None).len()
}

/// Files and fields that inputs come from, as they are called.
#[derive(Clone, Debug)]
pub struct FieldNames {
    /// File of the poses.
    pub poses: String,
    /// Their rotation and translation.
    pub rotation: &'static str,
    /// Their translation.
    pub translation: &'static str,
    /// The mesh.
    pub mesh: String,
    /// File of the camera.
    pub camera: String,
    /// Intrinsics.
    pub intrinsics: &'static str,
    /// The factor of depth.
    pub depth_scale: &'static str,
    /// Masks.
    pub masks: String,
}

impl Correction {
    /// Inputs that have the mistake in common.
    pub(super) fn scope(self) -> Scope {
        match self {
            Self::ModelUnit | Self::ModelScale => Scope::Object,
            Self::DepthUnit
            | Self::DepthScale
            | Self::MaskInverted
            | Self::PrincipalPointSwapped
            | Self::CameraOfOtherSize
            | Self::FocalLength => Scope::Scene,
            _ => Scope::Poses,
        }
    }

    /// A rotation alone: an object that looks much the same from two sides agrees nearly as well without.
    pub(super) fn is_rotation(self) -> bool {
        matches!(
            self,
            Self::RotationTransposed
                | Self::QuaternionXyzw
                | Self::QuaternionWxyz
                | Self::OpenGlRotation
        )
    }

    /// A value that is not known beforehand: what has a name explains as well.
    pub(super) fn is_unnamed(self) -> bool {
        matches!(self, Self::DepthScale | Self::Translation)
    }

    /// Message: the mistake with file and field, and what to do about it.
    pub(super) fn message(self, names: &FieldNames, factor: f64) -> String {
        let (size, focal) = if factor > 1.0 { ("small", "short") } else { ("large", "long") };
        let words: [(&str, &str); 11] = [
            ("{times}", &digits(factor)),
            ("{size}", size),
            ("{focal}", focal),
            ("{R}", names.rotation),
            ("{t}", names.translation),
            ("{K}", names.intrinsics),
            ("{depth_scale}", names.depth_scale),
            ("{poses}", &names.poses),
            ("{mesh}", &names.mesh),
            ("{camera}", &names.camera),
            ("{masks}", &names.masks),
        ];
        words
            .iter()
            .fold(self.get_message().unwrap_or_default().to_owned(), |text, (name, word)| {
                text.replace(name, word)
            })
    }
}

/// A factor with three digits.
fn digits(factor: f64) -> String {
    let count = (2.0 - factor.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{factor:.count$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}
