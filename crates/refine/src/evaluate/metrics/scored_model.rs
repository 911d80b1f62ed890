//! The metrics of a pose that follow from the object's points alone: pose errors, the average distance of corresponding and
//! nearest points (Hinterstoisser et al., ACCV 2012), and the maximum up to symmetry (Hodaň et al., "BOP Challenge 2020",
//! ECCVW 2020).

use nalgebra::{Isometry3, Point3};
use prehend_geometry::KdTree;
use prehend_render::Camera;

use super::pose_error::{oe_deg, oe_symmetric_deg, pe_cm};
use super::score::PoseScore;
use crate::MM_PER_M;
use crate::symmetry::Symmetries;

/// Vertices and symmetries of an object, prepared once for scoring many poses.
#[derive(Debug)]
pub struct ScoredModel {
    points: Vec<Point3<f64>>,
    /// `None` without points.
    tree: Option<KdTree>,
    symmetries: Symmetries,
    transforms: Vec<Isometry3<f64>>,
}

impl ScoredModel {
    /// A model by its vertices \[m\], as the mesh file lists them (BOP weighs repeated vertices by their
    /// number), and its symmetries.
    pub fn new(points: Vec<Point3<f64>>, symmetries: Symmetries) -> Self {
        let tree = KdTree::new(&points).ok();
        Self { tree, transforms: symmetries.transforms(), points, symmetries }
    }

    /// All metrics that need no hand. Those of points are none without points or where they are no number, MSPD also where a point is
    /// behind the camera.
    pub fn score(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        camera: &Camera,
    ) -> PoseScore {
        let of_points =
            |value: f64| Some(value).filter(|v| v.is_finite() && !self.points.is_empty());
        PoseScore {
            pe_cm: Some(pe_cm(estimate, truth)),
            oe_deg: Some(oe_deg(estimate, truth)),
            oe_symmetric_deg: Some(oe_symmetric_deg(estimate, truth, &self.symmetries)),
            add_mm: of_points(MM_PER_M * self.add(estimate, truth)),
            adi_mm: of_points(MM_PER_M * self.adi(estimate, truth)),
            mssd_mm: of_points(MM_PER_M * self.mssd(estimate, truth)),
            mspd_px: of_points(self.mspd(estimate, truth, camera)),
            ..PoseScore::default()
        }
    }

    /// ADD: the mean distance between corresponding points in the two poses \[m\]; NaN without points.
    fn add(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        let sum: f64 = self.points.iter().map(|p| (estimate * p - truth * p).norm()).sum();
        sum / self.points.len() as f64
    }

    /// ADI (also ADD-S): the mean distance from each point in the true pose to the nearest point in the estimated pose \[m\];
    /// NaN without points.
    fn adi(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        // Seen from the estimated model frame the searched points never move, so one tree serves all poses.
        let t_estimate_truth = estimate.inverse() * truth;
        let distance = |p: &Point3<f64>| {
            let nearest = self.tree.as_ref()?.nearest(&(t_estimate_truth * p), f64::INFINITY);
            Some(nearest?.distance_squared.sqrt())
        };
        let sum: f64 = self.points.iter().map(|p| distance(p).unwrap_or(f64::INFINITY)).sum();
        sum / self.points.len() as f64
    }

    /// MSSD: the least over the symmetries (see [`Symmetries::transforms`]) of the largest distance between corresponding
    /// points \[m\].
    pub(crate) fn mssd(&self, estimate: &Isometry3<f64>, truth: &Isometry3<f64>) -> f64 {
        let estimated: Vec<_> = self.points.iter().map(|p| estimate * p).collect();
        self.least_maximum(truth, |k, p| (p - estimated[k]).norm_squared())
    }

    /// MSPD: the same for the projections of the points into the image \[px\]; infinite when a point lies
    /// behind the camera in the estimated pose or in every symmetric true pose.
    pub(crate) fn mspd(
        &self,
        estimate: &Isometry3<f64>,
        truth: &Isometry3<f64>,
        camera: &Camera,
    ) -> f64 {
        let estimated: Vec<_> =
            self.points.iter().map(|p| camera.project(&(estimate * p))).collect();
        self.least_maximum(truth, |k, p| match (camera.project(&p), &estimated[k]) {
            (Some(a), Some(b)) => (a.x - b.x).powi(2) + (a.y - b.y).powi(2),
            _ => f64::INFINITY,
        })
    }

    /// The least over the symmetries of the largest distance of a point, whose square is `square(index, true point)`.
    fn least_maximum(
        &self,
        truth: &Isometry3<f64>,
        square: impl Fn(usize, Point3<f64>) -> f64,
    ) -> f64 {
        let mut least = f64::INFINITY;
        for symmetry in &self.transforms {
            let t_cam_model = truth * symmetry;
            let mut largest = 0.0_f64;
            for (k, point) in self.points.iter().enumerate() {
                largest = largest.max(square(k, t_cam_model * point));
                if largest >= least {
                    break;
                }
            }
            least = least.min(largest);
        }
        least.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::symmetry::ContinuousSymmetry;
    use nalgebra::Vector3;

    const CAMERA: Camera =
        Camera { fx: 600.0, fy: 500.0, cx: 320.0, cy: 240.0, width: 640, height: 480 };

    /// The corners of a cube with edges of one meter.
    fn cube(symmetries: Symmetries) -> ScoredModel {
        let corner = |i: u8| [i & 1, i >> 1 & 1, i >> 2].map(|side| f64::from(side) - 0.5);
        ScoredModel::new((0..8).map(|i| Point3::from(corner(i))).collect(), symmetries)
    }

    fn somewhere() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.1, -0.2, 4.0), Vector3::new(0.3, 0.1, 0.2))
    }

    #[test]
    fn a_shift_moves_every_point_equally() {
        let (model, truth) = (cube(Symmetries::default()), somewhere());
        let shifted = Isometry3::translation(0.0, 0.4, 0.0) * truth;
        assert!((model.add(&shifted, &truth) - 0.4).abs() < 1e-14);
        assert!((model.mssd(&shifted, &truth) - 0.4).abs() < 1e-14);
        // A vertical shift by 0.4 at depth z is 0.4 · 500 / z pixels: largest for the nearest corner.
        let nearest = model.points.iter().map(|p| (truth * p).z).fold(f64::INFINITY, f64::min);
        assert!((model.mspd(&shifted, &truth, &CAMERA) - 200.0 / nearest).abs() < 1e-10);
    }

    #[test]
    fn the_nearest_point_is_sought_from_the_truth() {
        // Points 0 and 1 on a line, the estimate shifted by 0.8: from the truth 0 → 0.8, 1 → 0.8 (0.2).
        let points = [0.0, 1.0, 5.0].map(|x| Point3::new(x, 0.0, 0.0)).to_vec();
        let model = ScoredModel::new(points, Symmetries::default());
        let (at, near) = (Isometry3::identity(), Isometry3::translation(0.8, 0.0, 0.0));
        assert!((model.adi(&near, &at) - (0.8 + 0.2 + 0.8) / 3.0).abs() < 1e-15);
        // From the truth: 0 → 3, 1 → 3 (2), 5 → 4 (1); the other way round it would be 2, 1, 3.
        let far = Isometry3::translation(3.0, 0.0, 0.0);
        assert!((model.adi(&far, &at) - 2.0).abs() < 1e-15);
        assert!((model.adi(&at, &far) - 2.0).abs() < 1e-15);
        assert!(ScoredModel::new(Vec::new(), Symmetries::default()).adi(&at, &far).is_nan());
    }

    #[test]
    fn symmetric_poses_count_as_equal() {
        let truth = somewhere();
        let quarter = Isometry3::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2);
        let estimate = truth * quarter;
        let plain = cube(Symmetries::default());
        let symmetric = cube(Symmetries { discrete: vec![quarter], continuous: vec![] });
        assert!((plain.add(&estimate, &truth) - 1.0).abs() < 1e-14);
        assert!(plain.adi(&estimate, &truth) < 1e-14 && plain.mssd(&estimate, &truth) > 0.9);
        assert!(symmetric.mssd(&estimate, &truth) < 1e-14);
        assert!(symmetric.mspd(&estimate, &truth, &CAMERA) < 1e-10);
        let axis = ContinuousSymmetry { axis: Vector3::z_axis(), point: Point3::origin() };
        let round = cube(Symmetries { discrete: vec![], continuous: vec![axis] });
        let spun = truth * Isometry3::rotation(Vector3::z() * 1.234);
        // Half a step of 1.14° at radius 1/√2.
        let half_step = 0.00999 * std::f64::consts::FRAC_1_SQRT_2;
        assert!(round.mssd(&spun, &truth) < half_step + 1e-6);
    }

    #[test]
    fn without_points_or_in_front_of_the_camera_metrics_are_unknown() {
        let [front, behind] = [4.0, -4.0].map(|z| Isometry3::translation(0.0, 0.0, z));
        let score = cube(Symmetries::default()).score(&behind, &front, &CAMERA);
        assert_eq!((score.mspd_px, score.add_mm), (None, Some(8e3)));
        let empty = ScoredModel::new(Vec::new(), Symmetries::default());
        let score = empty.score(&behind, &front, &CAMERA);
        assert_eq!((score.add_mm, score.adi_mm, score.mssd_mm), (None, None, None));
        assert_eq!((score.mspd_px, score.pe_cm), (None, Some(800.0)));
    }

    #[test]
    fn a_point_behind_the_camera_is_infinitely_wrong() {
        let [front, behind] = [4.0, -4.0].map(|z| Isometry3::translation(0.0, 0.0, z));
        for (estimate, truth) in [(behind, front), (front, behind)] {
            let found = cube(Symmetries::default()).mspd(&estimate, &truth, &CAMERA);
            assert_eq!(found, f64::INFINITY);
        }
    }
}
