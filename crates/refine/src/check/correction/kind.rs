//! Mistakes in inputs by name: what would correct them, and what to say of them.

use strum::{EnumIter, EnumMessage, IntoEnumIterator};

/// A mistake in a frame's inputs that has a name, by what corrects it. The documentation of each is its message, with the names of files and fields left open
/// ([`FieldNames`]). Those that are more common come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, EnumIter, EnumMessage)]
pub(super) enum Correction {
    /// {poses}: {t}: translations are in another unit; multiply {t} by {times}
    PoseUnit,
    /// {mesh}: the mesh is in another unit; multiply its vertices by {times}
    ModelUnit,
    /// {camera}: {depth_scale}: depth is in another unit; multiply {depth_scale} by {times}
    DepthUnit,
    /// {mesh} and {poses}: {t}: mesh and translations are both in another unit; multiply vertices and {t} by {times}
    ModelAndPoseUnit,
    /// {poses}: {R} and {t}: poses are inverted (camera in the object's frame, inverted extrinsics); invert them: R ← Rᵀ, t ← −Rᵀt
    PoseInverted,
    /// {poses}: {R}: rotations are transposed; write R row by row, R ← Rᵀ
    RotationTransposed,
    /// {poses}: {R}: quaternions are in the other order: (x, y, z, w) was taken for (w, x, y, z) where {R} was made; convert them again
    QuaternionXyzw,
    /// {poses}: {R}: quaternions are in the other order: (w, x, y, z) was taken for (x, y, z, w) where {R} was made; convert them again
    QuaternionWxyz,
    /// {poses}: {R} and {t}: the camera has the axes of OpenGL (y up, z back), not of OpenCV; negate the second and third row of R and of t
    OpenGlAxes,
    /// {poses}: {R}: the camera has the axes of OpenGL (y up, z back), not of OpenCV; negate the second and third row of R
    OpenGlRotation,
    /// {poses}: {R} and {t}: poses are inverted, of a camera with axes of OpenGL in the object's frame; invert them (R ← Rᵀ, t ← −Rᵀt), then negate the second and third row of R and of t
    PoseInvertedOpenGl,
    /// {poses}: {R}: rotations are wrong while translations fit; check their convention (transposed, order of quaternions, axes of OpenGL), and which way up images are
    Rotation,
    /// {masks}: masks are inverted; make pixels of the object non-zero and all others zero
    MaskInverted,
    /// {camera}: {K}: cx and cy are swapped; exchange them (cx is entry 2 and cy entry 5, counted from 0), and fx, fy and poses if images were turned since
    PrincipalPointSwapped,
    /// {camera}: {K}: intrinsics are of images of another size; multiply fx, fy, cx and cy by {times}
    CameraOfOtherSize,
    /// {camera}: {depth_scale}: depth is in another unit; multiply {depth_scale} by {times}
    DepthScale,
    /// {poses}: {t}: translations are wrong while rotations fit; check their unit, and that they are of the model's origin in the camera frame
    Translation,
    /// {mesh}: the model is too {size}; multiply its vertices by {times}
    ModelScale,
    /// {camera}: {K}: the focal length is too {focal}; multiply fx and fy by {times}
    FocalLength,
    /// {colors}: red and blue are swapped (BGR was taken for RGB); exchange the first and third channel, unless the model has colors that are not the object's
    ChannelsSwapped,
}

/// Powers of ten that units differ by.
const UNITS: [f64; 6] = [1e-3, 1e-2, 1e-1, 1e1, 1e2, 1e3];

/// Scales of models that are fitted from: a model of another size may fit nowhere near its own.
const SIZES: [f64; 4] = [0.5, 0.7, 1.4, 2.0];

/// True of a factor between sizes that is none.
pub(super) fn is_nearly_one(factor: f64) -> bool {
    factor.ln().abs() <= 0.1
}

/// Corrections that are tried, each with its factor; `to_fit` makes the principal point that of the image's middle, and depth has to be multiplied by
/// `depth` to be that of the pose. In each frame they are the same ones.
pub(super) fn candidates(to_fit: f64, depth: Option<f64>) -> Vec<(Correction, f64)> {
    use Correction::*;
    let factors = |kind: Correction| match kind {
        PoseUnit | ModelUnit | DepthUnit | ModelAndPoseUnit => UNITS.to_vec(),
        // Those between common sizes of images; one that is nearly there is of this size.
        CameraOfOtherSize => {
            vec![0.5, 2.0, if is_nearly_one(to_fit) { f64::NAN } else { to_fit }]
        }
        DepthScale => vec![depth.unwrap_or(f64::NAN)],
        ModelScale => SIZES.to_vec(),
        FocalLength | Rotation => Vec::new(),
        _ => vec![1.0],
    };
    let all = |kind| factors(kind).into_iter().map(move |factor| (kind, factor));
    Correction::iter().flat_map(all).collect()
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
    /// Color images.
    pub colors: String,
}

impl Correction {
    /// A mistake that all frames of a scene have in common.
    pub(super) fn is_of_scene(self) -> bool {
        use Correction::*;
        matches!(
            self,
            DepthUnit | DepthScale | MaskInverted | PrincipalPointSwapped | CameraOfOtherSize
        )
    }

    /// A mistake that all frames of an object have in common.
    pub(super) fn is_of_model(self) -> bool {
        matches!(self, Self::ModelUnit | Self::ModelScale)
    }

    /// A rotation alone: an object that looks much the same from two sides agrees nearly as well without.
    pub(super) fn is_rotation(self) -> bool {
        use Correction::*;
        matches!(
            self,
            RotationTransposed | QuaternionXyzw | QuaternionWxyz | OpenGlRotation | Rotation
        )
    }

    /// A value that is not known beforehand: what has a name explains as well.
    pub(super) fn is_unnamed(self) -> bool {
        matches!(self, Self::DepthScale | Self::Translation)
    }

    /// Message: the mistake with file and field, and what to do about it.
    pub(super) fn message(self, names: &FieldNames, factor: f64) -> String {
        let (size, focal) = if factor > 1.0 { ("small", "short") } else { ("large", "long") };
        let words: [(&str, &str); 12] = [
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
            ("{colors}", &names.colors),
        ];
        let template = self.get_documentation().unwrap_or_default().to_owned();
        words.iter().fold(template, |text, (name, word)| text.replace(name, word))
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
