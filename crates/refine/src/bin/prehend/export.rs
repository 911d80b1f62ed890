//! `prehend export`.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use nalgebra::Isometry3;
use prehend_refine::data::Assets;
use prehend_refine::data::bop::{Dataset, DatasetError, check_writable};
use prehend_refine::export::SceneFilm;

use crate::options::{InputArgs, Job, open_rig};
use crate::terminal::{cache, progress, say};

/// Images by scene and id, with the poses in each.
type JobsByImage<'a> = BTreeMap<(u32, u32), Vec<&'a Job>>;

#[derive(Args)]
pub(crate) struct Export {
    #[command(flatten)]
    input: InputArgs,
    /// The rig that recorded the frames, as `prehend calibrate` has found it: hand and models are corrected by it
    #[arg(long, value_name = "FILE", help_heading = "Input")]
    rig: Option<PathBuf>,
    /// Write the hand and the objects of one scene here, moving as they do from image to image: glTF (.glb), which viewers, Blender and browsers open
    ///
    /// One node a link and one an object, upright and in meters; the camera is a node, too. The frame is that of the world where scene_camera.json has
    /// cam_R_w2c and cam_t_w2c of all images, else the camera's.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    glb: PathBuf,
    /// Images a second of the film, in order of their ids; ids that are missing count
    #[arg(long, value_name = "HZ", default_value_t = 30.0, help_heading = "Output")]
    rate: f64,
}

impl Export {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let Self { input: InputArgs { selection, poses }, rig, glb, rate } = &self;
        check_writable(glb)?;
        let mut film = SceneFilm::new(*rate)?;
        let dataset = selection.open()?;
        let (jobs, mut failures) = selection.jobs(poses, None)?;
        let mut images = JobsByImage::new();
        for job in &jobs {
            images.entry((job.row.scene_id, job.row.im_id)).or_default().push(job);
        }
        let first = images.keys().next().map(|(scene, _)| *scene);
        if images.keys().any(|(scene, _)| Some(*scene) != first) {
            bail!("--glb has one scene, and there are poses of several: --scene says which");
        }
        let world = world(&dataset, &images)?;
        let mut assets = Assets::new(&dataset, 0).with_cache(cache());
        assets = assets.with_rig(open_rig(rig.as_deref())?).with_optional_masks();
        let mut done = 0;
        for (&(scene_id, im_id), jobs) in
            progress(images.len(), "exporting").wrap_iter(images.iter())
        {
            let mut add = || -> anyhow::Result<()> {
                // All models first: one that is broken must not leave an image half in the film.
                let models: Vec<_> = jobs
                    .iter()
                    .map(|job| assets.object(job.row.obj_id))
                    .collect::<Result<_, _>>()?;
                let observation = assets.observation(&dataset.frame(scene_id, im_id)?, 0, &[])?;
                let t_base_cam = world.as_ref().map(|known| known[&im_id].inverse());
                let t_base_cam = t_base_cam.unwrap_or_else(Isometry3::identity);
                film.add_image(im_id, &observation, &t_base_cam)?;
                for (Job { target, row, .. }, object) in jobs.iter().zip(&models) {
                    film.add_object(target, object, &row.t_cam_model);
                    done += 1;
                }
                Ok(())
            };
            failures.keep(format!("scene {scene_id} image {im_id}"), add());
        }
        if done > 0 {
            film.save(glb)?;
            let frame = if world.is_some() { "the world's frame" } else { "the camera's frame" };
            say(format!("{done} poses in {frame}, written to {}", glb.display()))?;
        }
        Ok(failures.exit_code(done))
    }
}

/// World → camera of each image that there is, by its id, if that is known of all.
fn world(
    dataset: &Dataset,
    images: &JobsByImage<'_>,
) -> Result<Option<BTreeMap<u32, Isometry3<f64>>>, DatasetError> {
    let mut known = BTreeMap::new();
    for &(scene_id, im_id) in images.keys() {
        // One that is not there is told of when its turn comes.
        let Ok(frame) = dataset.frame(scene_id, im_id) else { continue };
        let Some(t_cam_world) = frame.t_cam_world()? else { return Ok(None) };
        known.insert(im_id, t_cam_world);
    }
    Ok(Some(known))
}
