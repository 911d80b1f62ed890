//! Evidence of a frame, in the form by which very many hypotheses are scored.

use nalgebra::{Point3, Vector3};
use prehend_geometry::cloud::estimate_normals;
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{KdTree, SplitMix64};
use prehend_render::{Camera, DepthImage};

use super::SearchSettings;
use crate::error::RefineError;
use crate::scene::{Frame, HandMeasurement, PreparedFrame, pixel_distances};

/// Everything in the camera frame \[m\].
pub(super) struct SearchEvidence {
    /// Points on the object's visible surface with their normals (zero where unknown), in no particular order.
    pub(super) points: Vec<(Point3<f64>, Vector3<f64>)>,
    /// Taxels that the object touches.
    pub(super) touched: Vec<Point3<f64>>,
    /// Points of the hand, quiet taxels among them, that are not inside the object.
    pub(super) outside: Vec<Point3<f64>>,
    /// Low-resolution map of the visible object and depth.
    pub(super) map: SightMap,
}

impl SearchEvidence {
    /// Evidence of `frame`; the hand's surface is as many points as stage 2 looks at.
    ///
    /// # Errors
    /// If no pixel of the mask has a depth, or forces and taxels do not match.
    pub(super) fn new(
        frame: &PreparedFrame<'_>,
        settings: &SearchSettings,
    ) -> Result<Self, RefineError> {
        let contact_threshold = settings.estimator.tactile.contact_threshold;
        let places = frame.masked_points(settings.normal_points)?;
        let tree = KdTree::new(&places).map_err(|_| RefineError::NoDepth)?;
        let normals = estimate_normals(&tree, settings.normal_neighbors, &Point3::origin());
        let (mut touched, mut outside) = (Vec::new(), Vec::new());
        if let Some(reading) = frame.hand() {
            let robot = &reading.hand;
            if !reading.forces.is_empty() {
                robot.check_forces(&reading.forces)?;
            }
            let posed = robot.posed(&reading.t_cam_hand, &reading.joints)?;
            let surface = surface_samples(&posed.mesh(), settings.points, 0);
            outside.extend(surface.iter().map(|s| s.point));
            for (taxel, force) in robot.taxels.iter().zip(&reading.forces) {
                let link = posed.t_world_links()[robot.link_of(taxel)?];
                if HandMeasurement::is_unknown(force) {
                    continue;
                }
                let list =
                    if force.norm() > contact_threshold { &mut touched } else { &mut outside };
                list.push(link * taxel.position);
            }
        }
        let map = SightMap::new(frame.observation(), frame.hand_depth(), settings.map_width);
        Ok(Self {
            points: shuffled(places.into_iter().zip(normals).collect()),
            touched,
            outside,
            map,
        })
    }
}

/// `items` in a pseudorandom order that is always the same: beginnings are spread over all of them.
fn shuffled<T>(items: Vec<T>) -> Vec<T> {
    let mut random = SplitMix64::new(0);
    let mut keyed: Vec<(f64, T)> = items.into_iter().map(|item| (random.uniform(), item)).collect();
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
    keyed.into_iter().map(|(_, item)| item).collect()
}

/// Image of the visible object and of depth, at a low resolution.
pub(super) struct SightMap {
    camera: Camera,
    pixels: Vec<SearchView>,
}

struct SearchView {
    /// Whether the object is seen here.
    object: bool,
    /// Nearest depth of anything here \[m\], 0 where unknown.
    depth: f32,
    /// Distance to the nearest pixel of the object \[px\].
    away: f32,
}

impl SightMap {
    fn new(observation: &Frame, hand: &DepthImage, most_columns: usize) -> Self {
        let full = &observation.camera;
        let factor = full.width.div_ceil(most_columns.max(1)).max(1);
        let (width, height) = ((full.width / factor).max(1), (full.height / factor).max(1));
        let at = |x: usize, y: usize| {
            let (x, y) = (x * factor + factor / 2, y * factor + factor / 2);
            let object = observation.mask.get(x, y).unwrap_or(false);
            let measured = observation.depth.get(x, y).unwrap_or(0.0);
            let known = if object { 0.0 } else { hand.get(x, y).unwrap_or(0.0) };
            let depth = match (measured > 0.0, known > 0.0) {
                (true, true) => measured.min(known),
                (true, false) => measured,
                _ => known,
            };
            (object, depth)
        };
        let (object, depths): (Vec<bool>, Vec<f32>) =
            (0..width * height).map(|i| at(i % width, i / width)).unzip();
        let away = pixel_distances(&object, width, true);
        let seen = object.into_iter().zip(depths).zip(away);
        let pixels =
            seen.map(|((object, depth), away)| SearchView { object, depth, away }).collect();
        // Pixel (x, y) of the map is pixel (x factor + factor/2, …) of the image.
        let (scale, middle) = (1.0 / factor as f64, (factor / 2) as f64);
        let camera = Camera {
            fx: full.fx * scale,
            fy: full.fy * scale,
            cx: (full.cx - middle) * scale,
            cy: (full.cy - middle) * scale,
            width,
            height,
        };
        Self { camera, pixels }
    }

    /// How far \[m\] a surface point of the object that faces the camera is from where it could be, by what is seen;
    /// 0 where something hides it, or outside the image.
    #[inline]
    pub(super) fn conflict(&self, point: &Point3<f64>) -> f64 {
        let Some(pixel) = self.camera.project(point) else { return 1.0 };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let (width, height) = (self.camera.width as f64, self.camera.height as f64);
        if u < 0.0 || v < 0.0 || u >= width || v >= height {
            return 0.0;
        }
        let sight = &self.pixels[v as usize * self.camera.width + u as usize];
        let depth = f64::from(sight.depth);
        if sight.object {
            // In front of what is seen it would be seen; behind, a nearer part of the object may hide it.
            let ahead = depth - point.z;
            return match depth > 0.0 {
                true if ahead > 0.0 => ahead,
                true => -0.5 * ahead,
                false => 0.0,
            };
        }
        if depth > 0.0 && depth < point.z {
            return 0.0;
        }
        f64::from(sight.away) * point.z / self.camera.fx
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;

    #[test]
    fn the_truth_is_in_no_conflict_and_a_shifted_pose_is() {
        let scene = default_scene(1).unwrap();
        let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
        let evidence = SearchEvidence::new(&frame, &SearchSettings::default()).unwrap();
        assert!(evidence.points.len() > 1000 && evidence.touched.len() > 3);
        let mean = |shift: Vector3<f64>| {
            let facing = scene.object.samples.iter().filter_map(|s| {
                let (p, n) = (scene.truth * s.point + shift, scene.truth * s.normal);
                (n.dot(&p.coords) < -0.3 * p.coords.norm()).then_some(p)
            });
            let conflicts: Vec<f64> = facing.map(|p| evidence.map.conflict(&p)).collect();
            conflicts.iter().sum::<f64>() / conflicts.len() as f64
        };
        let truth = mean(Vector3::zeros());
        assert!(truth < 3e-3, "{truth}");
        for shift in [Vector3::x() * 0.03, Vector3::y() * -0.03, Vector3::z() * -0.03] {
            assert!(mean(shift) > 3.0 * truth, "{shift}: {}", mean(shift));
        }
        let inside = |p: &Point3<f64>| {
            scene.object.surface.signed_distance(&scene.truth.inverse_transform_point(p)).0 < -3e-3
        };
        let wrong = evidence.outside.iter().filter(|p| inside(p)).count();
        assert!(wrong * 20 < evidence.outside.len(), "{wrong}");
        // A taxel of whose force nothing is known is in neither list.
        let mut observation = scene.frame.clone();
        observation.hand.as_mut().unwrap().forces.fill(HandMeasurement::UNKNOWN_FORCE);
        let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
        let unfelt = SearchEvidence::new(&frame, &SearchSettings::default()).unwrap();
        let taxels = scene.hand.taxels.len();
        let all = evidence.outside.len() + evidence.touched.len();
        assert_eq!((unfelt.outside.len(), unfelt.touched.len()), (all - taxels, 0));
    }
}
