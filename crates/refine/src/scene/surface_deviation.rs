//! By what the surface of an object differs from its model.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3xX, Point3, Vector3};
use prehend_geometry::TriMesh;

use super::Object;
use super::gaussian_process::{InducingPoints, farthest_points};
use crate::defaults::settings;
use crate::error::RefineError;

settings! {
    /// Deviation of the surface of an object from that of its model.
    pub struct ModelErrorSettings {
        // A scan, or a careful model, of a thing that fits into a hand.
        /// Standard deviation of a place of the surface from where the model has it, in each direction \[m\]; zero if models are exact.
        pub sigma: f64 = 7e-4,
        /// Length scale of its Gaussian process over the surface \[m\]. EXPERIMENTS: Number and smoothness of patches.
        pub length_scale: f64 = 20e-3,
        /// Number of patches of what is seen that would cover the mask if all were full. EXPERIMENTS: Number and smoothness of patches.
        pub patches: f64 = 30.0,
        /// Number of patches at most.
        pub max_patches: usize = 64,
        /// Width of a patch at least, as a share of the length scale: nearer ones are displaced alike.
        pub min_width: f64 = 0.6,
        /// Distance from the object, as a share of its distance from the camera, within which a measured depth is where a patch is; beyond, it is of something else.
        pub near: f64 = 0.2,
    }
}

/// Distance between the places that describe the deviation, as a share of its length scale.
const SPACING: f64 = 0.8;

/// Those places, at most.
const MOST_NODES: usize = 150;

/// Independent part of the variance at inducing points however near they are, as a share; keeps their covariance regular.
const NUGGET: f64 = 1e-6;

/// Independent deviation of patches, as a share of the deviation: what too few places do not describe, and what looks off in one view.
const OWN: f64 = 0.3;

/// Deviation that all of a surface has in common, as a share of the deviation: a model of a wrong size, or with a wrong origin. Frames cannot tell that from
/// the object's place.
const TOGETHER: f64 = 0.5;

/// A smooth field of displacements over the surface of a model, in its coordinates: a Gaussian process through a few places that
/// describe all others (Quiñonero-Candela and Rasmussen, 2005).
#[derive(Clone, Debug)]
pub struct SurfaceDeviation {
    /// Prior.
    pub(crate) settings: ModelErrorSettings,
    process: InducingPoints,
    /// A column for each inducing point: independent, and of unit variance beforehand.
    pub(crate) coefficients: Matrix3xX<f64>,
    /// Covariance of the coefficients in one direction: what is still not known of them.
    pub(crate) covariance: DMatrix<f64>,
    /// Standard deviation of what it leaves, in each direction \[m\].
    left: f64,
}

impl SurfaceDeviation {
    /// None yet, of `object`; `None` if models are exact.
    pub(crate) fn new(object: &Object, settings: &ModelErrorSettings) -> Option<Self> {
        let places: Vec<_> = object.samples.iter().map(|sample| sample.point.coords).collect();
        let nodes = farthest_points(&places, SPACING * settings.length_scale, MOST_NODES);
        let coefficients = Matrix3xX::zeros(nodes.len());
        let covariance = DMatrix::identity(nodes.len(), nodes.len());
        Self::from_parts(settings.clone(), nodes, coefficients, covariance)
    }

    /// A field of its `nodes` and their coefficients, of which there are as many, with their covariance; `None` if that makes none.
    pub(crate) fn from_parts(
        settings: ModelErrorSettings,
        nodes: Vec<Vector3<f64>>,
        coefficients: Matrix3xX<f64>,
        covariance: DMatrix<f64>,
    ) -> Option<Self> {
        let ModelErrorSettings { sigma, length_scale, .. } = settings;
        let sizes = [coefficients.ncols(), covariance.nrows(), covariance.ncols()];
        if sizes != [nodes.len(); 3] {
            return None;
        }
        let process = InducingPoints::new(nodes, sigma, length_scale, NUGGET)?;
        let mut field = Self { settings, process, coefficients, covariance, left: 0.0 };
        field.left = field.mean_left();
        Some(field)
    }

    /// Number of coefficients of a direction.
    pub(crate) fn count(&self) -> usize {
        self.nodes().len()
    }

    /// Places of the inducing points (model coordinates) \[m\].
    pub(crate) fn nodes(&self) -> &[Vector3<f64>] {
        self.process.points()
    }

    /// Variance of what patches of the surface are off by themselves \[m²\].
    pub(crate) fn own_variance(&self) -> f64 {
        (OWN * self.settings.sigma).powi(2)
    }

    /// Factors of the coefficients in the displacement at `place` (model coordinates).
    pub(crate) fn features(&self, place: &Point3<f64>) -> DVector<f64> {
        self.process.features(&[place.coords]).column(0).into_owned()
    }

    /// The displacement at `place` of the model \[m\].
    pub fn at(&self, place: &Point3<f64>) -> Vector3<f64> {
        &self.coefficients * self.features(place)
    }

    /// Changes the coefficients, of each node three, which have this covariance then.
    pub(crate) fn change(&mut self, change: &DVector<f64>, covariance: &DMatrix<f64>) {
        self.coefficients.iter_mut().zip(change).for_each(|(value, change)| *value += change);
        let count = self.count();
        let of_axis = |axis: usize| {
            DMatrix::from_fn(count, count, |r, c| covariance[(3 * r + axis, 3 * c + axis)])
        };
        self.covariance = (of_axis(0) + of_axis(1) + of_axis(2)) / 3.0;
        self.left = self.mean_left();
    }

    /// Covariance of what it leaves at `places` of the model, in each direction \[m²\]: what is not known of the coefficients, and what places are
    /// off by themselves, and all together.
    pub(crate) fn left_covariance(&self, places: &[Vector3<f64>]) -> DMatrix<f64> {
        let features = self.process.features(places);
        let mut covariance = features.tr_mul(&(&self.covariance * &features));
        (0..places.len()).for_each(|k| covariance[(k, k)] += self.own_variance());
        covariance.add_scalar_mut((TOGETHER * self.settings.sigma).powi(2));
        covariance
    }

    /// Standard deviation of what it leaves, in each direction \[m\].
    pub(crate) fn left(&self) -> f64 {
        self.left
    }

    /// Mean of it at the nodes.
    fn mean_left(&self) -> f64 {
        let trace = self.left_covariance(self.nodes()).trace();
        (trace / self.count().max(1) as f64).sqrt()
    }

    /// `mesh` with every vertex displaced.
    pub fn applied(&self, mesh: &TriMesh) -> TriMesh {
        let mut mesh = mesh.clone();
        mesh.vertices.iter_mut().for_each(|vertex| *vertex += self.at(vertex));
        // Readers compute their own.
        mesh.normals = None;
        mesh
    }

    /// The object with its surface displaced, its mass as it was.
    ///
    /// # Errors
    /// If its mesh cannot be used any more.
    pub fn corrected(&self, object: &Object) -> Result<Object, RefineError> {
        object.with_surface(self.applied(&object.mesh), Some(Arc::new(self.clone())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn a_field_has_the_expected_deviation_and_moves_the_surface() {
        let object = default_scene(1).unwrap().object;
        let settings = ModelErrorSettings::default();
        let mut field = SurfaceDeviation::new(&object, &settings).unwrap();
        assert!((20..=MOST_NODES).contains(&field.count()), "{}", field.count());
        // All but a little of the variance is described at places between the nodes, too.
        for sample in object.samples.iter().step_by(97) {
            let part = field.features(&sample.point).norm() / settings.sigma;
            assert!((0.9..1.0001).contains(&part), "{part}");
        }
        assert_eq!(field.at(&object.center), Vector3::zeros());
        let size = 3 * field.count();
        let change = DVector::from_fn(size, |k, _| (k as f64).sin());
        field.change(&change, &(DMatrix::identity(size, size) * 0.01));
        let expected = settings.sigma * (0.01 + OWN * OWN + TOGETHER * TOGETHER).sqrt();
        assert!((field.left() / expected - 1.0).abs() < 0.05, "{}", field.left());
        // Places near each other are off alike, and far ones are not.
        let near = field.nodes()[0] + Vector3::new(2e-3, 0.0, 0.0);
        let places = [field.nodes()[0], near, object.center.coords + Vector3::x()];
        let left = field.left_covariance(&places);
        let together = (TOGETHER * settings.sigma).powi(2);
        let alike = |k: usize| left[(0, k)] - together;
        assert!(alike(1) > 0.9 * (alike(0) - field.own_variance()), "{left}");
        assert!(alike(2).abs() < 1e-12 && left[(2, 2)] >= field.own_variance() + together);
        let corrected = field.corrected(&object).unwrap();
        assert_eq!(corrected.deviation.as_ref().unwrap().left(), field.left());
        let vertex = object.mesh.vertices[10];
        let moved = corrected.mesh.vertices[10] - vertex;
        assert!(moved.norm() > 1e-5 && (moved - field.at(&vertex)).norm() < 1e-15);
    }
}
