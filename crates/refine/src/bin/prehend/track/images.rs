//! A scene that grows while it is tracked.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{anyhow, bail};
use prehend_refine::data::Assets;
use prehend_refine::data::bop::DatasetScene;

use crate::options::Selection;

/// Time between two looks at a folder.
const POLL: Duration = Duration::from_millis(5);

/// Time after which an image that has not arrived may be one that never will: if a later one is there.
const PATIENCE: Duration = Duration::from_millis(100);

/// Is set when Ctrl-C is pressed; pressed again, it ends the process.
pub(super) fn stop_on_ctrl_c() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if pressed.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })?;
    Ok(stop)
}

/// A scene into which another process writes images.
pub(super) struct Watch {
    scene_id: u32,
    /// The first image to come.
    next: u32,
    /// The end is reached without an image for so long,
    idle: Duration,
    /// has been reached so,
    over: bool,
    /// or somebody says so.
    stop: Arc<AtomicBool>,
    /// Of the JSON files that were read, and the images that they list.
    stamps: Option<[Option<(u64, SystemTime)>; 3]>,
    listed: Vec<u32>,
    /// An image that is there already: those before it are not waited for.
    arrived: u32,
}

impl Watch {
    /// From the image `first` on, until none comes for `idle` or Ctrl-C is pressed; pressed again, it ends the process.
    pub(super) fn new(scene_id: u32, first: u32, idle: Duration) -> anyhow::Result<Self> {
        let stop = stop_on_ctrl_c()?;
        let (stamps, listed) = (None, Vec::new());
        Ok(Self { scene_id, next: first, idle, over: false, stop, stamps, listed, arrived: 0 })
    }

    /// Waits for the next image until all of it is there. One that is overtaken by a later one comes as it is, and so does what has been
    /// begun when the time is up: reading it says what is wrong.
    pub(super) fn next(&mut self, assets: &mut Assets) -> Option<u32> {
        let mut last_look = Instant::now();
        let start = last_look;
        while !self.stop.load(Ordering::Relaxed) {
            self.reread(assets);
            self.over |= start.elapsed() >= self.idle;
            let awaited = &self.listed[self.listed.partition_point(|id| *id < self.next)..];
            if let [id, later @ ..] = awaited {
                let dataset = assets.dataset();
                let has_arrived = |id: &u32| dataset.has_arrived(self.scene_id, *id);
                if last_look.elapsed() >= PATIENCE || self.over {
                    self.arrived = later.iter().copied().find(has_arrived).unwrap_or(0);
                    last_look = Instant::now();
                }
                let begun = || self.over && dataset.has_begun(self.scene_id, *id);
                if *id < self.arrived || has_arrived(id) || begun() {
                    self.next = id + 1;
                    return Some(*id);
                }
            }
            if self.over {
                return None;
            }
            sleep(POLL);
        }
        None
    }

    /// Reads the scene's JSON files if they are not what they were.
    fn reread(&mut self, assets: &mut Assets) {
        let stamps = assets.dataset().scene(self.scene_id).map(DatasetScene::stamps).ok();
        if stamps == self.stamps {
            return;
        }
        self.stamps = stamps;
        let dataset = assets.dataset().reread();
        // One that is being written is not readable for a moment.
        let listed = dataset.scene(self.scene_id).and_then(DatasetScene::moments);
        self.listed = listed.unwrap_or_default();
        assets.replace_dataset(dataset);
    }
}

/// Lets `selection` be of the scene in `folder`, which must be one of its dataset's; returns its id.
pub(super) fn select_scene(selection: &mut Selection, folder: &Path) -> anyhow::Result<u32> {
    let fault = |e: std::io::Error| anyhow!("{}: {e}", folder.display());
    let place = folder.canonicalize().map_err(fault)?;
    let root = selection.dataset.canonicalize().map_err(fault)?;
    let name = |path: &Path| Some(path.file_name()?.to_str()?.to_owned());
    let split = place.parent().filter(|split| split.parent() == Some(&root)).and_then(name);
    let id = name(&place).and_then(|name| name.parse().ok());
    let (Some(split), Some(id)) = (split, id) else {
        let dataset = selection.dataset.display();
        bail!("--watch: {} is no scene folder of {dataset}, such as test/000001", folder.display());
    };
    (selection.split, selection.scene) = (Some(split), vec![id]);
    Ok(id)
}
