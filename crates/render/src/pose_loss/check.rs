//! Which settings of a loss make sense.

use super::options::LossOptions;
use super::{MOST_SAMPLES, PoseLoss};
use crate::mode::{ContourOptions, Mode, SoftRasOptions};

/// A setting out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} is {value}, expected {expected}")]
pub struct OptionError {
    /// The setting, such as `"depth.scale"`.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Range that it should be in.
    pub expected: &'static str,
}

fn check(
    name: &'static str,
    value: f64,
    expected: &'static str,
    holds: bool,
) -> Result<(), OptionError> {
    if holds { Ok(()) } else { Err(OptionError { name, value, expected }) }
}

/// Smaller ones than its inverse vanish when squared in single precision, and larger ones leave its range.
const LARGEST: f64 = 1e15;

fn positive(name: &'static str, value: f64) -> Result<(), OptionError> {
    let holds = (1.0 / LARGEST..=LARGEST).contains(&value);
    check(name, value, "a number from 1e-15 to 1e15", holds)
}

fn weight(name: &'static str, value: f64) -> Result<(), OptionError> {
    // Squares of derivatives are multiplied by it, in single precision.
    check(name, value, "a number from 0 to 1e12", (0.0..=1e12).contains(&value))
}

impl PoseLoss {
    /// Whether all settings are in their ranges. With others a loss says nothing, although it is computed.
    ///
    /// # Errors
    /// Names the first setting that is not.
    pub fn check(&self) -> Result<(), OptionError> {
        let few = (1..=MOST_SAMPLES).contains(&self.samples);
        check("samples", self.samples as f64, "1 to 16", few)?;
        match &self.mode {
            Mode::Contour(options) => {
                let w = options.half_width;
                check("half_width", w, "0.05 to 64 px", ContourOptions::HALF_WIDTHS.contains(&w))?;
            }
            Mode::SoftRas(options) => options.check()?,
        }
        self.options.check()
    }
}

impl SoftRasOptions {
    fn check(&self) -> Result<(), OptionError> {
        weight("blur_radius", self.blur_radius)?;
        positive("sigma", self.sigma)?;
        positive("gamma", self.gamma)?;
        let faces = self.faces_per_pixel;
        let few = (1..=Self::MOST_FACES).contains(&faces);
        check("faces_per_pixel", faces as f64, "1 to 64", few)?;
        let (near, far) = (self.z_near, self.z_far);
        check("z_near", near, "a number within ±1e15", near.abs() <= LARGEST)?;
        check("z_far", far, "above z_near and at most 1e15", far > near && far <= LARGEST)
    }
}

impl LossOptions {
    fn check(&self) -> Result<(), OptionError> {
        weight("color_weight", self.color_weight)?;
        weight("mask_weight", self.mask_weight)?;
        if let Some(depth) = self.depth {
            weight("depth.weight", depth.weight)?;
            let scale = depth.scale;
            let holds = (1e-9..=LARGEST).contains(&scale);
            check("depth.scale", scale, "a number from 1e-9 to 1e15", holds)?;
            let limit = depth.truncation;
            check("depth.truncation", limit, "above 0, or infinite", limit > 0.0)?;
        }
        self.kernel.scale().map_or(Ok(()), |scale| positive("kernel.scale", scale))
    }
}

#[cfg(test)]
mod tests {
    use prehend_geometry::RobustKernel;

    use super::*;
    use crate::pose_loss::DepthOptions;

    #[test]
    fn settings_out_of_range_are_named() {
        let soft = Mode::SoftRas(SoftRasOptions::default());
        let plain = LossOptions::default();
        assert_eq!(PoseLoss::default().check(), Ok(()));
        assert_eq!(PoseLoss::new(soft, plain).check(), Ok(()));
        let named = |mode: Mode, options: LossOptions| {
            PoseLoss::new(mode, options).check().unwrap_err().name
        };
        for half_width in [f64::NAN, 0.0, -3.0, 1000.0] {
            let mode = Mode::Contour(ContourOptions { half_width, ..ContourOptions::default() });
            assert_eq!(named(mode, plain), "half_width");
        }
        for scale in [0.0, -1.0, f64::NAN, 1e-25, 1e20] {
            for kernel in [RobustKernel::Huber { scale }, RobustKernel::Cauchy { scale }] {
                assert_eq!(named(soft, LossOptions { kernel, ..plain }), "kernel.scale");
            }
        }
        let depth = DepthOptions { weight: 1.0, scale: 0.02, truncation: f64::INFINITY };
        let with = |depth: DepthOptions| LossOptions { depth: Some(depth), ..plain };
        assert_eq!(PoseLoss::new(soft, with(depth)).check(), Ok(()));
        assert_eq!(named(soft, with(DepthOptions { weight: -1.0, ..depth })), "depth.weight");
        assert_eq!(named(soft, with(DepthOptions { scale: 0.0, ..depth })), "depth.scale");
        assert_eq!(
            named(soft, with(DepthOptions { truncation: -0.1, ..depth })),
            "depth.truncation"
        );
        assert_eq!(named(soft, LossOptions { mask_weight: 1e300, ..plain }), "mask_weight");
        let nan = LossOptions { color_weight: f64::NAN, ..plain };
        assert_eq!(named(soft, nan), "color_weight");
        let of = |change: fn(&mut SoftRasOptions)| {
            let mut options = SoftRasOptions::default();
            change(&mut options);
            named(Mode::SoftRas(options), plain)
        };
        assert_eq!(of(|o| o.faces_per_pixel = 100), "faces_per_pixel");
        assert_eq!(of(|o| o.z_near = 200.0), "z_far");
        assert_eq!((of(|o| o.sigma = 0.0), of(|o| o.gamma = -1.0)), ("sigma", "gamma"));
        assert_eq!(PoseLoss::default().with_samples(0).check().unwrap_err().name, "samples");
        let error = PoseLoss::new(soft, nan).check().unwrap_err();
        assert_eq!(error.to_string(), "color_weight is NaN, expected a number from 0 to 1e12");
    }
}
