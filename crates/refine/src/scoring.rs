//! Scoring poses of a dataset against its truth.

use std::collections::HashMap;

use nalgebra::Point3;
use prehend_geometry::{ClosestPoints, UnionBody};

use crate::assets::{AssetError, Assets, load_mesh};
use crate::bop::{Dataset, GroundTruth, ResultRow};
use crate::metrics::{CONTACT_DISTANCE, ContactModel, ScoredModel, ScoredRow};

/// An evaluation model, prepared once.
struct Model {
    scored: ScoredModel,
    contact: ContactModel,
}

/// The hand where it truly is in one image, as one body: its parts overlap each other.
struct TrueHand {
    body: UnionBody,
    surface: ClosestPoints,
}

/// Scores poses of one dataset.
pub struct Scorer<'a> {
    truth: GroundTruth<'a>,
    dataset: &'a Dataset,
    assets: Assets<'a>,
    models: HashMap<u32, Model>,
}

impl<'a> Scorer<'a> {
    /// A scorer of poses on the split that `dataset` shows.
    pub fn new(dataset: &'a Dataset) -> Self {
        Self {
            truth: GroundTruth::new(dataset),
            dataset,
            assets: Assets::new(dataset, 0),
            models: HashMap::new(),
        }
    }

    /// The score of `row`; contact metrics only where the scene says where the hand is.
    ///
    /// # Errors
    /// If a file that scoring needs is missing or broken.
    pub fn score(&mut self, row: &ResultRow) -> Result<ScoredRow, AssetError> {
        let (scene, image) = (row.scene_id, row.im_id);
        let truth = self.truth.pose(scene, image, row.obj_id, &row.t_cam_model)?;
        let hand = self.hand(scene, image)?;
        let camera = self.dataset.frame(scene, image)?.intrinsics;
        let model = self.model(row.obj_id)?;
        let mut score = model.scored.score(&row.t_cam_model, &truth, &camera);
        if let Some(hand) = hand {
            let distance = |p: &Point3<f64>| {
                hand.surface.closest(p, CONTACT_DISTANCE).map_or(f64::INFINITY, |c| c.distance)
            };
            let area = |pose| model.contact.contact_area_cm2(pose, &distance);
            let volume = |pose| model.contact.intersection_volume_cm3(pose, &hand.body);
            let estimate = &row.t_cam_model;
            score = score.with_contact(
                area(estimate),
                volume(estimate)?,
                area(&truth),
                volume(&truth)?,
            );
        }
        Ok(ScoredRow { scene_id: scene, im_id: image, obj_id: row.obj_id, score })
    }

    fn model(&mut self, id: u32) -> Result<&Model, AssetError> {
        if !self.models.contains_key(&id) {
            let mesh = load_mesh(self.truth.models(), id)?;
            let symmetries = self.truth.models().info(id).map(|i| i.symmetries);
            let contact = ContactModel::new(&mesh);
            let scored = ScoredModel::new(mesh.vertices, symmetries.unwrap_or_default());
            self.models.insert(id, Model { scored, contact });
        }
        Ok(&self.models[&id])
    }

    fn hand(&mut self, scene: u32, image: u32) -> Result<Option<TrueHand>, AssetError> {
        if !self.truth.has_bodies(scene)? {
            return Ok(None);
        }
        let bodies = self.truth.bodies(scene, image)?;
        let [body] = bodies.bodies.as_slice() else { return Ok(None) };
        let robot = self.assets.robot(&body.urdf, None)?;
        let hand = robot.posed(&body.t_cam_base, &robot.tree.joint_vector(&body.joints)?)?;
        let body = UnionBody::new(&hand.mesh_parts())?;
        let surface = ClosestPoints::new(&body.mesh())?;
        Ok(Some(TrueHand { body, surface }))
    }
}
