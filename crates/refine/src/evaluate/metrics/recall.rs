//! Recalls of the BOP challenge's three metrics (Hodaň et al., "BOP Challenge 2020 on 6D Object Localization", ECCVW 2020).

use serde::{Deserialize, Serialize};

use super::vsd::VSD_TOLERANCES;

/// The thresholds that a normalized error has to stay below: 0.05, 0.1 … 0.5.
///
/// Those of the challenge's reference implementation to the last digit: VSD is a ratio of small numbers of pixels and may
/// equal one.
pub(crate) const THRESHOLDS: [f64; 10] =
    [0.05, 0.1, 0.15000000000000002, 0.2, 0.25, 0.3, 0.35000000000000003, 0.4, 0.45, 0.5];

/// The width of the image in which MSPD's thresholds are those below \[px\].
const REFERENCE_WIDTH: f64 = 640.0;
/// The thresholds that MSPD has to stay below \[px\].
pub(crate) const PIXEL_THRESHOLDS: [f64; 10] =
    [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0];

/// Errors of one pose, scaled as their thresholds are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NormalizedErrors {
    /// VSD (0..=1) for each of its ten tolerances.
    pub(crate) vsd: [f64; VSD_TOLERANCES.len()],
    /// MSSD in diameters of the object.
    pub(crate) mssd: f64,
    /// MSPD in an image 640 px wide \[px\].
    pub(crate) mspd: f64,
}

impl NormalizedErrors {
    /// Normalized errors: VSD for each tolerance, MSSD and `diameter` \[m\], MSPD \[px\] and the image's `width` \[px\].
    pub(crate) fn new(
        vsd: &[f64; VSD_TOLERANCES.len()],
        mssd: f64,
        diameter: f64,
        mspd: f64,
        width: usize,
    ) -> Self {
        let mspd = mspd * (REFERENCE_WIDTH / width as f64);
        Self { vsd: *vsd, mssd: mssd / diameter, mspd }
    }

    /// The fractions of the thresholds that the errors stay below.
    pub(crate) fn recall(&self) -> Recall {
        let below = |error: f64, thresholds: &[f64]| {
            let below = thresholds.iter().filter(|&&threshold| error < threshold).count();
            below as f64 / thresholds.len() as f64
        };
        let recall = |error: f64| below(error, &THRESHOLDS);
        Recall {
            vsd: self.vsd.iter().map(|&e| recall(e)).sum::<f64>() / self.vsd.len() as f64,
            mssd: recall(self.mssd),
            mspd: below(self.mspd, &PIXEL_THRESHOLDS),
        }
    }
}

/// Recalls, each the mean over its metric's thresholds (0..=1): of one pose, the fraction of thresholds it stays below.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Recall {
    /// Recall of VSD: below 0.05, 0.1 … 0.5, for each of its ten tolerances.
    pub(crate) vsd: f64,
    /// Recall of MSSD: below 0.05, 0.1 … 0.5 of the diameter.
    pub(crate) mssd: f64,
    /// Recall of MSPD: below 5, 10 … 50 px in an image 640 px wide.
    pub(crate) mspd: f64,
}

impl Recall {
    /// BOP's AR: the mean of the three.
    pub(crate) fn average(&self) -> f64 {
        (self.vsd + self.mssd + self.mspd) / 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_strict_and_scale_with_object_and_image() {
        let recall = |vsd: &[f64; 10], mssd, mspd, width| {
            NormalizedErrors::new(vsd, mssd, 0.2, mspd, width).recall()
        };
        let mut errors = [0.31; 10];
        errors[9] = 0.0;
        let of_wide = recall(&errors, 0.021, 12.0, 1280);
        // 0.31 is below 0.35 … 0.5; 2.1 cm is below 3 cm … 10 cm; 12 px are below 20 … 100.
        assert!((of_wide.vsd - (9.0 * 0.4 + 1.0) / 10.0).abs() < 1e-12, "{of_wide:?}");
        assert_eq!((of_wide.mssd, of_wide.mspd), (0.8, 0.9));
        assert!((of_wide.average() - (0.46 + 0.8 + 0.9) / 3.0).abs() < 1e-12);
        assert_eq!(recall(&[0.0; 10], 0.0, 0.0, 640).average(), 1.0);
        assert_eq!(recall(&[1.0; 10], 1.0, 1e9, 640).average(), 0.0);
        // An error that equals a threshold is above it.
        let at = recall(&[0.5; 10], 0.1, 50.0, 640);
        assert_eq!((at.vsd, at.mssd, at.mspd), (0.0, 0.0, 0.0));
        for (k, pixels) in (0..10).zip(PIXEL_THRESHOLDS) {
            let found = recall(&[1.0; 10], 1.0, pixels, 640).mspd;
            assert!((found - f64::from(9 - k) / 10.0).abs() < 1e-12, "{pixels}: {found}");
        }
    }
}
