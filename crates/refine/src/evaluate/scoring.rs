//! Scoring poses of a dataset against its truth.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use prehend_geometry::robot::KinematicTree;
use prehend_geometry::{ClosestPoints, SolidUnion, TriMesh};
use prehend_render::DepthImage;

use super::model::EvaluationModel;
use crate::data::bop::{Dataset, DatasetError, GroundTruth, ResultRow, present};
use crate::data::{AssetError, ContactModel, load_robot};
use crate::evaluate::metrics::{Contact, ScoredRow, oe_symmetric_deg, pe_cm};
use crate::symmetry::Symmetries;

/// Truth of the hand and measured depth of one image, for scoring.
pub(super) struct Image {
    scene_and_image: (u32, u32),
    /// `None` until it is asked for; the inner one if the dataset says of no hand, or of several.
    hand: Option<Option<TrueHand>>,
    /// `None` if the dataset has no depth, or nothing of it was measured.
    pub(super) depth: Option<DepthImage>,
}

/// The hand where it truly is in one image, as one body: its parts overlap each other.
struct TrueHand {
    body: SolidUnion,
    surface: ClosestPoints,
    /// Contact of the objects where they truly are, by object and true pose: an image may show one twice.
    truths: Vec<(u32, Isometry3<f64>, Contact)>,
}

/// Scores poses of one dataset.
pub struct Scorer<'a> {
    pub(super) truth: GroundTruth<'a>,
    pub(super) dataset: &'a Dataset,
    trees: HashMap<PathBuf, KinematicTree>,
    pub(super) models: HashMap<u32, EvaluationModel>,
    /// That of the row scored last: rows come image by image, and hands are large.
    pub(super) image: Option<Image>,
}

impl<'a> Scorer<'a> {
    /// A scorer of poses on the split that `dataset` shows.
    pub fn new(dataset: &'a Dataset) -> Self {
        Self {
            truth: GroundTruth::new(dataset),
            dataset,
            trees: HashMap::new(),
            models: HashMap::new(),
            image: None,
        }
    }

    /// Where the object of `row` truly is; among several such objects, the one nearest to the pose of `row`.
    ///
    /// # Errors
    /// If a file that scoring needs is missing or broken, or the image shows no such object.
    pub fn true_pose(&self, row: &ResultRow) -> Result<Isometry3<f64>, AssetError> {
        Ok(self.truth.pose(row.scene_id, row.im_id, row.obj_id, &row.t_cam_model)?)
    }

    /// How far the pose of `row` is from the true one \[m\], and how much it is turned up to symmetry \[rad\]; none where the dataset does not tell the truth.
    ///
    /// # Errors
    /// If a file with the truth is broken, or the image shows no such object.
    pub fn pose_error(&self, row: &ResultRow) -> Result<Option<[f64; 2]>, AssetError> {
        let truth = match self.true_pose(row) {
            Err(AssetError::Dataset(DatasetError::Missing { .. })) => return Ok(None),
            found => found?,
        };
        let info = present(self.truth.models().info(row.obj_id))?;
        let symmetries = info.map_or_else(Symmetries::default, |info| info.symmetries);
        let degrees = oe_symmetric_deg(&row.t_cam_model, &truth, &symmetries);
        Ok(Some([1e-2 * pe_cm(&row.t_cam_model, &truth), degrees.to_radians()]))
    }

    /// The score of `row`; contact metrics only where the scene says where the hand is.
    ///
    /// # Errors
    /// If a file that scoring needs is missing or broken.
    pub fn score(&mut self, row: &ResultRow) -> Result<ScoredRow, AssetError> {
        let (scene_id, im_id, obj_id) = (row.scene_id, row.im_id, row.obj_id);
        let truth = self.true_pose(row)?;
        self.prepare_model(obj_id)?;
        let mut image = self.take_image(scene_id, im_id)?;
        if image.hand.is_none() {
            image.hand = Some(self.true_hand(scene_id, im_id)?);
        }
        let Image { depth, hand, .. } = self.image.insert(image);
        let model = &self.models[&obj_id];
        let (width, height) =
            depth.as_ref().map_or((0, 0), |depth| (depth.width(), depth.height()));
        let camera = self.dataset.frame(scene_id, im_id)?.camera(width, height);
        let mut score = model.points.score(&row.t_cam_model, &truth, &camera);
        if let Some(sensed) = depth {
            let errors = model.vsd(&row.t_cam_model, &truth, &camera, sensed);
            score = score.with_visible_surface(&errors, model.diameter, camera.width);
        }
        if let Some(Some(hand)) = hand {
            let estimate = hand.contact(&model.contact, &row.t_cam_model)?;
            score =
                score.with_contact(estimate, hand.true_contact(obj_id, &model.contact, &truth)?);
        }
        Ok(ScoredRow { scene_id, im_id, obj_id, score })
    }

    pub(super) fn prepare_model(&mut self, id: u32) -> Result<(), AssetError> {
        if !self.models.contains_key(&id) {
            self.models.insert(id, EvaluationModel::new(self.truth.models(), id)?);
        }
        Ok(())
    }

    /// The image, read unless it is the last one.
    pub(super) fn take_image(&mut self, scene: u32, image: u32) -> Result<Image, DatasetError> {
        if let Some(known) = self.image.take_if(|known| known.scene_and_image == (scene, image)) {
            return Ok(known);
        }
        let depth = present(self.dataset.frame(scene, image)?.depth())?;
        Ok(Image { scene_and_image: (scene, image), hand: None, depth })
    }

    fn true_hand(&mut self, scene: u32, image: u32) -> Result<Option<TrueHand>, AssetError> {
        if !self.truth.has_bodies(scene)? {
            return Ok(None);
        }
        let bodies = self.truth.bodies(scene, image)?;
        let mut hands = bodies.bodies.iter().filter_map(|body| Some((body, body.as_hand()?)));
        let (Some((body, (urdf, joints))), None) = (hands.next(), hands.next()) else {
            return Ok(None);
        };
        let tree = self.tree(urdf)?;
        let poses = tree.forward_kinematics(&tree.joint_vector(joints)?);
        let parts: Vec<TriMesh> = tree
            .links()
            .iter()
            .zip(poses)
            .flat_map(|(link, t_base_link)| {
                let pose = body.t_cam_base * t_base_link;
                link.parts.iter().map(move |part| part.transformed(&pose))
            })
            .collect();
        let body = SolidUnion::new(&parts)?;
        let surface = ClosestPoints::new(&body.mesh())?;
        Ok(Some(TrueHand { body, surface, truths: Vec::new() }))
    }

    /// The robot's description alone: contact is measured exactly, so no distance grid is needed.
    fn tree(&mut self, urdf: &Path) -> Result<&KinematicTree, AssetError> {
        if !self.trees.contains_key(urdf) {
            self.trees.insert(urdf.to_owned(), load_robot(urdf)?);
        }
        Ok(&self.trees[urdf])
    }
}

impl TrueHand {
    fn contact(
        &self,
        model: &ContactModel,
        t_cam_model: &Isometry3<f64>,
    ) -> Result<Contact, AssetError> {
        Ok(Contact {
            area_cm2: model.contact_area_cm2(t_cam_model, &self.surface),
            volume_cm3: model.intersection_volume_cm3(t_cam_model, &self.body)?,
        })
    }

    fn true_contact(
        &mut self,
        obj_id: u32,
        model: &ContactModel,
        truth: &Isometry3<f64>,
    ) -> Result<Contact, AssetError> {
        let known = self.truths.iter().find(|(id, pose, _)| *id == obj_id && pose == truth);
        if let Some((.., contact)) = known {
            return Ok(*contact);
        }
        let contact = self.contact(model, truth)?;
        self.truths.push((obj_id, *truth, contact));
        Ok(contact)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::scene::default_scene;
    use crate::synth::write_dataset;

    #[test]
    fn caches_do_not_show_in_the_scores_and_a_broken_list_does() {
        let dir = tempfile::tempdir().unwrap();
        let scenes = [1, 2].map(|seed| default_scene(seed).unwrap());
        write_dataset(dir.path(), &scenes).unwrap();
        let dataset = Dataset::open(dir.path()).unwrap();
        let scene_id = dataset.scenes().next().unwrap().id();
        let images = dataset.scene(scene_id).unwrap().images().unwrap();
        let row = |k: usize, t_cam_model| ResultRow {
            scene_id,
            im_id: images[k],
            obj_id: scenes[k].obj_id,
            score: 1.0,
            t_cam_model,
            time: 1.0,
        };
        // The same image twice, another one, and the first again.
        let rows = [
            row(0, scenes[0].initial),
            row(0, scenes[0].truth),
            row(1, scenes[1].initial),
            row(0, scenes[0].initial),
        ];
        let mut scorer = Scorer::new(&dataset);
        let json = |s: &ScoredRow| serde_json::to_string(s).unwrap();
        for row in &rows {
            let alone = Scorer::new(&dataset).score(row).unwrap();
            assert_eq!(json(&scorer.score(row).unwrap()), json(&alone));
            let hand = scorer.image.as_ref().unwrap().hand.as_ref().unwrap();
            assert_eq!(hand.as_ref().unwrap().truths.len(), 1);
        }

        let info = GroundTruth::new(&dataset).models().dir().join("models_info.json");
        fs::write(&info, "{").unwrap();
        let error = Scorer::new(&dataset).score(&rows[0]).unwrap_err().to_string();
        assert!(error.contains("models_info.json"), "{error}");
        fs::remove_file(&info).unwrap();
        Scorer::new(&dataset).score(&rows[0]).unwrap();
    }
}
