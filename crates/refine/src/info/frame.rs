//! Frame files.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::InfoError;
use super::lines::{line, spaced};
use super::mesh::MeshInfo;
use crate::data::FrameParts;

/// A frame described by a JSON file.
#[derive(Clone, Debug, Serialize)]
pub struct FrameInfo {
    /// Columns and rows of its images.
    pub image_size: [usize; 2],
    /// Focal lengths \[px\].
    pub focal_px: [f64; 2],
    /// Whether they were taken through a lens.
    pub lens: bool,
    /// Share of pixels with depth, 0 to 1.
    pub depth_share: f64,
    /// Pixels of the mask.
    pub mask_pixels: usize,
    /// File of the object's mesh.
    pub mesh_file: PathBuf,
    /// The object's mesh.
    pub mesh: MeshInfo,
    /// The object's mass \[kg\], where it is said.
    pub mass_kg: Option<f64>,
    /// Where the object is at first, in the camera frame \[m\].
    pub translation_m: [f64; 3],
    /// Gravity in the camera frame \[m/s²\], where it is said.
    pub gravity: Option<[f64; 3]>,
    /// The hand, where it is known.
    pub hand: Option<HandInfo>,
}

/// A hand in a frame.
#[derive(Clone, Debug, Serialize)]
pub struct HandInfo {
    /// Its name.
    pub name: String,
    /// Its joints that have a position of their own.
    pub joints: usize,
    /// Its taxels.
    pub taxels: usize,
    /// Taxels that feel more than 0.1 N; none where forces are not said.
    pub touched: Option<usize>,
}

/// From this force on a taxel counts as touched \[N\].
const TOUCH: f64 = 0.1;

impl FrameInfo {
    pub(super) fn read(path: &Path, warnings: &mut Vec<String>) -> Result<Self, InfoError> {
        let parts = FrameParts::read(path)?;
        let mass_kg = parts.mass();
        if mass_kg.is_none() {
            warnings.push("no mass_kg: 500 kg/m³ are assumed".to_owned());
        }
        let FrameParts { observation, mesh, mesh_file, robot, .. } = &parts;
        let (camera, depth) = (&observation.camera, observation.depth.pixels());
        let forces = observation.hand.as_ref().map(|hand| &hand.forces);
        let forces = forces.filter(|forces| !forces.is_empty());
        let touched =
            |f: &Vec<_>| f.iter().filter(|f: &&nalgebra::Vector3<f64>| f.norm() > TOUCH).count();
        Ok(Self {
            image_size: [camera.width, camera.height],
            focal_px: [camera.fx, camera.fy],
            lens: parts.has_lens(),
            depth_share: depth.iter().filter(|z| **z > 0.0).count() as f64 / depth.len() as f64,
            mask_pixels: observation.mask.count(),
            mesh_file: mesh_file.clone(),
            mesh: MeshInfo::of(mesh, warnings),
            mass_kg,
            translation_m: parts.t_cam_object().translation.vector.into(),
            gravity: observation.gravity.map(Into::into),
            hand: robot.as_ref().map(|(tree, skin)| HandInfo {
                name: tree.name().to_owned(),
                joints: tree.joint_names().len(),
                taxels: skin.len(),
                touched: forces.map(touched),
            }),
        })
    }
}

impl fmt::Display for FrameInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.image_size;
        let lens = if self.lens { ", through a lens" } else { "" };
        let focal = spaced(&self.focal_px, 1);
        line(f, "images", format!("{width}x{height} pixels, focal lengths {focal} px{lens}"))?;
        line(f, "depth", format!("at {:.1} % of the pixels", 100.0 * self.depth_share))?;
        line(f, "mask", format!("{} pixels", self.mask_pixels))?;
        line(f, "mesh", self.mesh_file.display())?;
        line(f, "size", format!("{} m", spaced(&self.mesh.size_m, 4)))?;
        let mass = self.mass_kg.map_or_else(|| "not said".to_owned(), |kg| format!("{kg} kg"));
        line(f, "mass", mass)?;
        line(f, "initial place", format!("{} m", spaced(&self.translation_m, 4)))?;
        let gravity = self.gravity.map(|g| format!("{} m/s²", spaced(&g, 2)));
        line(f, "gravity", gravity.as_deref().unwrap_or("not said"))?;
        let Some(HandInfo { name, joints, taxels, touched }) = &self.hand else {
            return line(f, "hand", "not known");
        };
        line(f, "hand", format!("{name}, {joints} joints"))?;
        match touched {
            Some(touched) => line(f, "touch", format!("{touched} of {taxels} taxels")),
            None => line(f, "touch", "not said"),
        }
    }
}
