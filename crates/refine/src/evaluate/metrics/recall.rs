//! Average recall of the BOP challenges (Hodaň et al., "BOP Challenge 2020", ECCVW 2020).

use serde::{Deserialize, Serialize};

use super::vsd::VSD_TOLERANCES;

/// The fraction of its thresholds that one pose stays under, by metric; their means over all targets are BOP's
/// average recalls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recall {
    /// Of VSD: below 0.05, 0.1 … 0.5, for each of its ten tolerances.
    pub vsd: f64,
    /// Of MSSD: below 0.05, 0.1 … 0.5 of the diameter.
    pub mssd: f64,
    /// Of MSPD: below 5, 10 … 50 px in an image 640 px wide.
    pub mspd: f64,
}

impl Recall {
    /// The recall of a pose by its errors: VSD for each tolerance, MSSD and `diameter` \[m\], MSPD and the image's
    /// `width` \[px\].
    pub fn new(
        vsd: &[f64; VSD_TOLERANCES.len()],
        mssd: f64,
        diameter: f64,
        mspd: f64,
        width: usize,
    ) -> Self {
        let steps = |unit: f64, error: f64| {
            let below = (1..=10).filter(|&k| error < unit * f64::from(k)).count();
            below as f64 / 10.0
        };
        Self {
            vsd: vsd.iter().map(|&e| steps(0.05, e)).sum::<f64>() / vsd.len() as f64,
            mssd: steps(0.05 * diameter, mssd),
            mspd: steps(5.0 * width as f64 / 640.0, mspd),
        }
    }

    /// BOP's AR: the mean of the three.
    pub fn average(&self) -> f64 {
        (self.vsd + self.mssd + self.mspd) / 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_strict_and_scale_with_object_and_image() {
        let mut errors = [0.31; 10];
        errors[9] = 0.0;
        let recall = Recall::new(&errors, 0.021, 0.2, 12.0, 1280);
        // 0.31 is below 0.35 … 0.5; 2.1 cm is below 3 cm … 10 cm; 12 px are below 20 … 100.
        assert!((recall.vsd - (9.0 * 0.4 + 1.0) / 10.0).abs() < 1e-12, "{recall:?}");
        assert_eq!((recall.mssd, recall.mspd), (0.8, 0.9));
        assert!((recall.average() - (0.46 + 0.8 + 0.9) / 3.0).abs() < 1e-12);
        assert_eq!(Recall::new(&[0.0; 10], 0.0, 0.2, 0.0, 640).average(), 1.0);
        assert_eq!(Recall::new(&[1.0; 10], 1.0, 0.2, 1e9, 640).average(), 0.0);
    }
}
