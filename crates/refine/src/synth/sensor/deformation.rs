//! An object model that is not quite the object.

use nalgebra::{Point3, Vector3};
use prehend_geometry::{SplitMix64, TriMesh};

use super::settings::ModelSettings;

impl ModelSettings {
    /// A model of `truth` as someone might have made it, the same for the same `noise`.
    ///
    /// Places move by a sum of plane waves, which does not depend on the mesh: seams stay closed.
    pub(in crate::synth) fn perturb_model(
        &self,
        truth: &TriMesh,
        noise: &mut SplitMix64,
    ) -> TriMesh {
        const WAVES: usize = 24;
        let scale = 1.0 + self.scale * noise.normal();
        let waves: Vec<_> = (0..WAVES)
            .map(|_| {
                let number = std::f64::consts::TAU / self.wavelength.max(1e-6);
                let mut direction = || Vector3::from_fn(|_, _| noise.normal());
                // Lengths between 0.6 and 2 times the one asked for.
                let (wave, displacement) = (direction().normalize(), direction());
                let (length, phase) = (0.5 + 1.1 * noise.uniform(), noise.uniform());
                (wave * (number * length), std::f64::consts::TAU * phase, displacement)
            })
            .collect();
        let strength = self.deviation * (2.0 / WAVES as f64).sqrt();
        let displace = |p: &Point3<f64>| -> Point3<f64> {
            let shift: Vector3<f64> =
                waves.iter().map(|(k, phase, d)| d * (k.dot(&p.coords) + phase).sin()).sum();
            Point3::from(p.coords * scale) + shift * strength
        };
        let mut mesh = truth.clone();
        if self.deviation > 0.0 || self.scale > 0.0 {
            mesh.vertices.iter_mut().for_each(|p| *p = displace(p));
            // They would be slightly wrong, and readers compute their own.
            mesh.normals = None;
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;
    use prehend_geometry::mass::mass_properties;
    use prehend_geometry::objects::YcbObject;
    use prehend_geometry::sample::surface_samples;

    #[test]
    fn models_deviate_by_as_much_as_asked_for_and_stay_closed() {
        let truth = YcbObject::SugarBox.mesh();
        let settings = ModelSettings { scale: 0.0, ..SensorSettings::realistic().model };
        let (mut square, mut volumes) = (0.0, 0.0);
        for seed in 0..6 {
            let model = settings.perturb_model(&truth, &mut SplitMix64::new(seed));
            assert!(mass_properties(&model.cleaned().0, 500.0).is_ok());
            // The same numbers pick the same places on both, as the faces' areas hardly change.
            for sample in surface_samples(&truth, 400, 1) {
                let [a, b, c] = model.triangle(sample.face as usize);
                let w = sample.barycentric;
                let moved = a.coords * w[0] + b.coords * w[1] + c.coords * w[2];
                let along = (moved - sample.point.coords).dot(&sample.normal);
                square += along * along / 2400.0;
            }
            volumes += model.area() / truth.area() / 6.0;
        }
        assert!((square.sqrt() - 7e-4).abs() < 2e-4, "{}", square.sqrt());
        assert!((volumes - 1.0).abs() < 0.02, "{volumes}");
        let exact = SensorSettings::clean().model.perturb_model(&truth, &mut SplitMix64::new(3));
        assert_eq!(exact.vertices, truth.vertices);
    }
}
