//! Poses of the camera.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_render::{Camera, RenderModel, depth_map, look_at};

use super::settings::ViewpointSettings;

impl ViewpointSettings {
    /// The true camera of an image of that size.
    pub(in crate::synth) fn camera(&self, width: usize, height: usize) -> Camera {
        let focal = self.focal_width_ratio * width as f64;
        let (cx, cy) = (0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0));
        Camera { fx: focal, fy: focal, cx, cy, width, height }
    }

    /// A pose hand base → camera from which the first of `bodies` (in hand base coordinates) is well seen, among the
    /// first tries; else the one from which most of it is seen.
    pub(super) fn choose(
        &self,
        camera: &Camera,
        bodies: &[(&RenderModel, Isometry3<f64>)],
        gravity: &Vector3<f64>,
        noise: &mut SplitMix64,
    ) -> Isometry3<f64> {
        let Some((object, t_hand_object)) = bodies.first() else { return Isometry3::identity() };
        let center = t_hand_object * object.center();
        let coarse = camera.scaled(COARSE_WIDTH / camera.width as f64);
        let mut best = (-1.0, Isometry3::identity());
        for _ in 0..TRIES {
            let candidate = self.candidate(&center, gravity, noise);
            let seen = visible_share(&coarse, bodies, &candidate);
            if seen >= 1.0 - self.hidden_share {
                return candidate;
            }
            if seen > best.0 {
                best = (seen, candidate);
            }
        }
        best.1
    }

    fn candidate(
        &self,
        center: &Point3<f64>,
        gravity: &Vector3<f64>,
        noise: &mut SplitMix64,
    ) -> Isometry3<f64> {
        let mut spread = |scale: f64| Vector3::from_fn(|_, _| scale * noise.normal());
        let (towards, aim) = (spread(1.0), center + spread(self.aim));
        let distance = self.nearest + (self.farthest - self.nearest) * noise.uniform();
        let away = towards.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        let roll = (self.roll_deg * noise.normal()).to_radians();
        look_at(&(aim + away * distance), &aim, &-gravity, roll)
    }
}

/// Views tried, and the columns of their pictures.
const TRIES: usize = 24;
const COARSE_WIDTH: f64 = 120.0;

/// Visible part of the first body's silhouette past the others, as a share of what an unbounded image would show if
/// nothing hid it (to the border's coarseness).
fn visible_share(
    coarse: &Camera,
    bodies: &[(&RenderModel, Isometry3<f64>)],
    t_cam_hand: &Isometry3<f64>,
) -> f64 {
    let border = coarse.width / 2;
    let wide = Camera {
        cx: coarse.cx + border as f64,
        cy: coarse.cy + border as f64,
        width: coarse.width + 2 * border,
        height: coarse.height + 2 * border,
        ..*coarse
    };
    let posed: Vec<_> = bodies.iter().map(|(model, pose)| (*model, t_cam_hand * pose)).collect();
    let (alone, others) = (depth_map(&wide, &posed[..1]), depth_map(&wide, &posed[1..]));
    let (mut all, mut seen) = (0usize, 0usize);
    for (i, (z, front)) in alone.pixels().iter().zip(others.pixels()).enumerate() {
        let (x, y) = (i % wide.width, i / wide.width);
        let inside = (border..border + coarse.width).contains(&x)
            && (border..border + coarse.height).contains(&y);
        all += usize::from(*z > 0.0);
        seen += usize::from(*z > 0.0 && inside && !(*front > 0.0 && front < z));
    }
    seen as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;
    use prehend_geometry::shapes::cuboid;

    #[test]
    fn views_past_the_hand_are_preferred() {
        let model = RenderModel::new(&cuboid(Vector3::repeat(0.05))).unwrap();
        let wall = RenderModel::new(&cuboid(Vector3::new(0.01, 0.3, 0.3))).unwrap();
        let bodies =
            [(&model, Isometry3::identity()), (&wall, Isometry3::translation(0.06, 0.0, 0.0))];
        let settings = SensorSettings::clean().viewpoint;
        let camera = settings.camera(640, 480);
        let mut noise = SplitMix64::new(1);
        for _ in 0..10 {
            let pose = settings.choose(&camera, &bodies, &(-9.81 * Vector3::z()), &mut noise);
            let eye = pose.inverse() * Point3::origin();
            assert!(eye.x < 0.1, "{eye}");
            let distance = eye.coords.norm();
            assert!((0.3..0.7).contains(&distance), "{distance}");
            assert!(visible_share(&camera.scaled(0.2), &bodies, &pose) > 0.44);
        }
    }
}
