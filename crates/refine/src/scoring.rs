//! Scoring poses of a dataset against its truth.

use std::collections::HashMap;
use std::path::PathBuf;

use nalgebra::{Isometry3, Point3};
use prehend_geometry::robot::PosedRobot;
use prehend_geometry::sample::surface_samples;
use prehend_geometry::{TriMesh, UnionBody};

use crate::assets::{AssetError, Assets, load_mesh};
use crate::bop::{Dataset, GroundTruth, ResultRow};
use crate::metrics::{
    CONTACT_DISTANCE, CONTACT_SAMPLES, PoseScore, ScoredModel, ScoredRow, contact_area_cm2,
};

/// An evaluation model, prepared once.
struct Model {
    scored: ScoredModel,
    /// Cleaned surface \[m\].
    surface: TriMesh,
    samples: Vec<Point3<f64>>,
}

/// The hand where it truly is in one image, and how the object truly touches it.
struct TrueGrasp {
    hand: PosedRobot,
    body: UnionBody,
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
        let grasp = self.grasp(scene, image)?;
        let camera = self.dataset.frame(scene, image)?.intrinsics;
        let model = self.model(row.obj_id)?;
        let mut score = model.scored.score(&row.t_cam_model, &truth, &camera);
        if let Some(grasp) = grasp {
            score = with_contact(score, model, &grasp, &row.t_cam_model, &truth)?;
        }
        Ok(ScoredRow { scene_id: scene, im_id: image, obj_id: row.obj_id, score })
    }

    fn model(&mut self, id: u32) -> Result<&Model, AssetError> {
        if !self.models.contains_key(&id) {
            let mesh = load_mesh(self.truth.models(), id)?;
            let symmetries = self.truth.models().info(id).map(|i| i.symmetries);
            let surface = mesh.cleaned().0;
            let samples = surface_samples(&surface, CONTACT_SAMPLES, 0);
            let model = Model {
                scored: ScoredModel::new(mesh.vertices, symmetries.unwrap_or_default()),
                samples: samples.iter().map(|s| s.point).collect(),
                surface,
            };
            self.models.insert(id, model);
        }
        Ok(&self.models[&id])
    }

    fn grasp(&mut self, scene: u32, image: u32) -> Result<Option<TrueGrasp>, AssetError> {
        let bodies_exist = ["scene_bodies.json", "scene_bodies_gt.json"].iter().any(|name| {
            let dir: Option<PathBuf> = self.dataset.scene(scene).ok().map(|s| s.dir().join(name));
            dir.is_some_and(|file| file.is_file())
        });
        if !bodies_exist {
            return Ok(None);
        }
        let bodies = self.truth.bodies(scene, image)?;
        let [body] = bodies.bodies.as_slice() else { return Ok(None) };
        let robot = self.assets.robot(&body.urdf, None)?;
        let hand = robot.posed(&body.t_cam_base, &robot.tree.joint_vector(&body.joints)?);
        let body = UnionBody::new(&hand.mesh_parts())?;
        Ok(Some(TrueGrasp { hand, body }))
    }
}

fn with_contact(
    score: PoseScore,
    model: &Model,
    grasp: &TrueGrasp,
    estimate: &Isometry3<f64>,
    truth: &Isometry3<f64>,
) -> Result<PoseScore, AssetError> {
    let distance = |p: &Point3<f64>| {
        grasp.hand.surface_distance(p, CONTACT_DISTANCE).unwrap_or(f64::INFINITY)
    };
    let area = model.surface.area();
    let contact = |pose: &Isometry3<f64>| contact_area_cm2(&model.samples, area, pose, &distance);
    let volume = |pose: &Isometry3<f64>| {
        grasp.body.intersection_volume(&model.surface.transformed(pose)).map(|v| v * 1e6)
    };
    Ok(score.with_contact(contact(estimate), volume(estimate)?, contact(truth), volume(truth)?))
}
