//! Values of depth images that are no measurements.

use prehend_render::DepthImage;

/// Share of an image's pixels from which on it is said that they count as not measured.
const TOLD: f64 = 1e-3;

/// Makes pixels with the largest value of 16 bits, one unit being `unit` meters, not measured: writers put it where they have nothing, and larger values are
/// cut to it. What is to be said of it where there are many.
pub(crate) fn drop_saturated(depth: &mut DepthImage, unit: f64) -> Option<String> {
    let largest = (f64::from(u16::MAX) * unit) as f32;
    let mut count = 0;
    for pixel in depth.pixels_mut().iter_mut().filter(|z| **z >= largest) {
        *pixel = 0.0;
        count += 1;
    }
    let share = f64::from(count) / depth.pixels().len().max(1) as f64;
    (share >= TOLD).then(|| {
        let percent = 1e2 * share;
        format!(
            "{percent:.1} % of the pixels are {}, which counts as not measured, as 0 does",
            u16::MAX
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_value_is_no_measurement() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("depth.png");
        for unit in [1e-3, 1e-4, 2.5e-4] {
            let stored = DepthImage::new(2, 2, vec![0.0, 0.5, 1e3, 1.0]).unwrap();
            stored.save(&path, unit).unwrap();
            let mut depth = DepthImage::load(&path, unit).unwrap();
            let said = drop_saturated(&mut depth, unit).unwrap();
            assert!(said.starts_with("25.0 % of the pixels are 65535"), "{said}");
            assert_eq!(depth.pixels()[2], 0.0);
            assert_eq!(depth.pixels().iter().filter(|z| **z > 0.0).count(), 2);
            assert_eq!(drop_saturated(&mut depth, unit), None);
        }
    }
}
