//! The files of one image.

use std::path::Path;

use nalgebra::Isometry3;
use prehend_render::Mask;

use super::annotation;
use super::hand_files::{TAXELS, URDF};
use super::scene_files::Entries;
use crate::data::AssetError;
use crate::data::bop::DatasetError;
use crate::scene::Observation;

/// The folders of a scene.
pub(super) const FRAME_FOLDERS: [&str; 4] = ["rgb", "depth", "mask", "mask_visib"];

/// One image with all that a dataset says of it.
pub(super) struct Recorded<'a> {
    /// What the estimator may know.
    pub(super) told: &'a Observation,
    pub(super) obj_id: u32,
    /// Object → camera.
    pub(super) truth: &'a Isometry3<f64>,
    /// Hand base → camera and joint positions, where they are to be told from what the estimator knows.
    pub(super) true_hand: Option<(&'a Isometry3<f64>, &'a [f64])>,
    /// World → camera, where there is a world.
    pub(super) world: Option<&'a Isometry3<f64>>,
    /// The silhouette that nothing hides.
    pub(super) whole: &'a Mask,
    /// What is truly seen of it.
    pub(super) visible: &'a Mask,
    pub(super) joint_names: &'a [String],
}

impl Recorded<'_> {
    /// Writes the images to the scene's folders, color as JPEG of that quality or, if that is 0, as PNG.
    ///
    /// # Errors
    /// When one cannot be written; those before it are there then.
    pub(super) fn write(
        &self,
        scene_dir: &Path,
        im_id: u32,
        jpeg_quality: u8,
    ) -> Result<Entries, AssetError> {
        let (image, instance) = (format!("{im_id:06}.png"), format!("{im_id:06}_000000.png"));
        let unit = annotation::DEPTH_SCALE * 1e-3;
        let rgb = scene_dir.join("rgb").join(&image);
        match jpeg_quality {
            0 => self.told.color.save(&rgb),
            quality => self.told.color.save_jpeg(&rgb.with_extension("jpg"), quality),
        }
        .map_err(DatasetError::from)?;
        let depth = scene_dir.join("depth").join(&image);
        self.told.depth.save(&depth, unit).map_err(DatasetError::from)?;
        let mask = |folder: &str, mask: &Mask| {
            mask.save(&scene_dir.join(folder).join(&instance)).map_err(DatasetError::from)
        };
        mask("mask_visib", &self.told.mask)?;
        mask("mask", self.whole)?;
        Ok(self.entries())
    }

    fn entries(&self) -> Entries {
        let told = self.told;
        let mut entries = vec![
            ("scene_gt.json", annotation::truth(self.obj_id, self.truth)),
            ("scene_gt_info.json", annotation::visibility(self.visible, self.whole, &told.depth)),
            ("scene_camera.json", annotation::camera(&told.camera, self.world)),
        ];
        let gravity = told.gravity.unwrap_or_default();
        let bodies = |t_cam_hand: &Isometry3<f64>, joints: &[f64]| {
            annotation::bodies(&gravity, t_cam_hand, self.joint_names, joints, URDF)
        };
        if let Some(hand) = &told.hand {
            entries.push(("scene_bodies.json", bodies(&hand.t_cam_hand, &hand.joints)));
            if !hand.forces.is_empty() {
                entries.push(("scene_tactile.json", annotation::touch(&hand.forces, TAXELS)));
            }
        }
        if let Some((t_cam_hand, joints)) = self.true_hand {
            entries.push(("scene_bodies_gt.json", bodies(t_cam_hand, joints)));
        }
        entries.into_iter().map(|(name, entry)| (name, entry.to_string())).collect()
    }
}
