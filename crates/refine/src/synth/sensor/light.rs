//! Lamps, materials and shadows.

use nalgebra::{Isometry3, Point3, Vector3};
use prehend_geometry::SplitMix64;
use prehend_render::{Camera, DepthImage, RenderModel, SurfacePoint, depth_map, look_at};

use super::settings::LightSettings;

impl LightSettings {
    /// Random lamps about `bodies`, which are in camera coordinates.
    pub(super) fn draw(
        &self,
        bodies: &[(&RenderModel, Isometry3<f64>)],
        up: &Vector3<f64>,
        noise: &mut SplitMix64,
    ) -> Lights {
        let up = up.try_normalize(1e-9).unwrap_or_else(|| -Vector3::y());
        let mut lamps: Vec<SensorLamp> =
            (0..self.lamps).map(|k| self.lamp(k, &up, noise)).collect();
        let total: f32 = lamps.iter().map(|l| l.strength.iter().sum::<f32>() / 3.0).sum();
        let share = 1.0 - self.ambient_share as f32;
        // A surface faces its lamps by half, say: as bright in all as under light from everywhere.
        lamps.iter_mut().flat_map(|l| &mut l.strength).for_each(|s| *s *= 1.6 * share / total);
        let ambient = self.tinted(self.ambient_share, noise);
        let shadow = match (lamps.first(), bodies.first()) {
            (Some(lamp), Some((object, pose))) if self.shadow_share > 0.0 => {
                Some(Shadow::new(&lamp.towards.cast(), &(pose * object.center()), bodies))
            }
            _ => None,
        };
        let (shadow_share, gloss) = (self.shadow_share as f32, self.gloss as f32);
        Lights { up: up.cast(), ambient, lamps, gloss, shadow, shadow_share }
    }

    fn lamp(&self, index: u32, up: &Vector3<f64>, noise: &mut SplitMix64) -> SensorLamp {
        let spread = Vector3::from_fn(|_, _| noise.normal());
        // Mostly from above and from the camera's side, so that what is seen is lit.
        let towards = spread.normalize() + up * 0.7 - Vector3::z() * 0.7;
        let strength = if index == 0 { 1.0 } else { 0.2 + 0.4 * noise.uniform() };
        SensorLamp { towards: towards.normalize().cast(), strength: self.tinted(strength, noise) }
    }

    fn tinted(&self, strength: f64, noise: &mut SplitMix64) -> [f32; 3] {
        [0; 3].map(|_| (strength * (1.0 + self.tint * noise.normal()).max(0.0)) as f32)
    }
}

/// The light of one picture, camera frame.
pub(super) struct Lights {
    up: Vector3<f32>,
    ambient: [f32; 3],
    lamps: Vec<SensorLamp>,
    gloss: f32,
    shadow: Option<Shadow>,
    shadow_share: f32,
}

/// A lamp far away.
struct SensorLamp {
    towards: Vector3<f32>,
    strength: [f32; 3],
}

/// Exponent of the highlights.
const SHININESS: i32 = 24;

impl Lights {
    /// The color of a point of unlit color `albedo`.
    pub(super) fn shade(&self, point: &SurfacePoint<f32>, albedo: [f32; 3]) -> [f32; 3] {
        let normal = point.normal;
        // The ground gives back less light than the sky gives.
        let sky = 0.85 + 0.25 * normal.dot(&self.up);
        let mut color = [0, 1, 2].map(|c| albedo[c] * self.ambient[c] * sky);
        let to_eye = -point.position.try_normalize(1e-9).unwrap_or_else(Vector3::z);
        for (index, lamp) in self.lamps.iter().enumerate() {
            let facing = normal.dot(&lamp.towards);
            if facing <= 0.0 {
                continue;
            }
            let lit = match &self.shadow {
                Some(shadow) if index == 0 => {
                    1.0 - self.shadow_share * shadow.depth_of(&point.position)
                }
                _ => 1.0,
            };
            let half = (lamp.towards + to_eye).try_normalize(1e-6).unwrap_or(normal);
            let shine = self.gloss * normal.dot(&half).max(0.0).powi(SHININESS);
            for c in 0..3 {
                color[c] += lit * facing * lamp.strength[c] * (albedo[c] + shine);
            }
        }
        color
    }
}

/// Depth that a lamp sees of the scene: all else is in shadow.
struct Shadow {
    t_lamp_cam: Isometry3<f32>,
    camera: Camera,
    seen: DepthImage,
}

impl Shadow {
    /// Distance of the lamp from the object \[m\], and how deep below what it sees shadows begin.
    const DISTANCE: f64 = 1.2;
    const BIAS: f32 = 4e-3;
    /// Pixels along each side of the lamp's picture, which spans half a meter.
    const PIXELS: usize = 320;

    fn new(
        towards: &Vector3<f64>,
        center: &Point3<f64>,
        bodies: &[(&RenderModel, Isometry3<f64>)],
    ) -> Self {
        let up = Vector3::new(0.3, -1.0, 0.1);
        let t_lamp_cam = look_at(&(center + towards * Self::DISTANCE), center, &up, 0.0);
        let focal = Self::PIXELS as f64 * Self::DISTANCE / 0.5;
        let (middle, size) = (0.5 * (Self::PIXELS as f64 - 1.0), Self::PIXELS);
        let camera =
            Camera { fx: focal, fy: focal, cx: middle, cy: middle, width: size, height: size };
        let posed: Vec<_> = bodies.iter().map(|(model, p)| (*model, t_lamp_cam * p)).collect();
        Self { seen: depth_map(&camera, &posed), t_lamp_cam: t_lamp_cam.cast(), camera }
    }

    /// Share of a small disc about the point that lies in shadow, 0..=1.
    fn depth_of(&self, point: &Vector3<f32>) -> f32 {
        let p = self.t_lamp_cam * Point3::from(*point);
        let (fx, cx) = (self.camera.fx as f32, self.camera.cx as f32);
        let (u, v) = (fx * p.x / p.z + cx, fx * p.y / p.z + cx);
        let mut dark = 0.0;
        for (du, dv) in [(-1.5, -0.5), (0.5, -1.5), (1.5, 0.5), (-0.5, 1.5), (0.0, 0.0)] {
            let (x, y) = ((u + du).round(), (v + dv).round());
            if x < 0.0 || y < 0.0 {
                continue;
            }
            let front = self.seen.get(x as usize, y as usize).unwrap_or(0.0);
            dark += if front > 0.0 && front + Self::BIAS < p.z { 0.2 } else { 0.0 };
        }
        dark
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::sensor::settings::SensorSettings;
    use prehend_geometry::shapes::cuboid;

    #[test]
    fn what_lies_behind_something_is_dark() {
        let model = RenderModel::new(&cuboid(Vector3::repeat(0.05))).unwrap();
        let bodies = [(&model, Isometry3::translation(0.0, 0.0, 0.5))];
        let shadow = Shadow::new(&-Vector3::z(), &Point3::new(0.0, 0.0, 0.5), &bodies);
        assert_eq!(shadow.depth_of(&Vector3::new(0.0, 0.0, 0.475)), 0.0);
        assert!((shadow.depth_of(&Vector3::new(0.0, 0.0, 0.6)) - 1.0).abs() < 1e-6);
        assert_eq!(shadow.depth_of(&Vector3::new(0.1, 0.0, 0.6)), 0.0);
    }

    #[test]
    fn a_white_surface_is_about_as_bright_as_the_paper_it_is_drawn_on() {
        let mut noise = SplitMix64::new(5);
        for settings in [SensorSettings::clean().light, SensorSettings::realistic().light] {
            let mut mean = 0.0;
            for _ in 0..50 {
                let lights = settings.draw(&[], &-Vector3::y(), &mut noise);
                let (position, normal) = (Vector3::z() * 0.5, -Vector3::z());
                let point = SurfacePoint { position, normal, albedo: [1.0; 3] };
                let color = lights.shade(&point, [1.0; 3]);
                assert!(color.iter().all(|c| (0.2..2.5).contains(c)), "{color:?}");
                mean += color[1] / 50.0;
            }
            assert!((0.6..1.3).contains(&mean), "{mean}");
        }
    }
}
