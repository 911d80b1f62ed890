//! Images of a scene that somebody else is still writing.

use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::time::SystemTime;

use prehend_geometry::open_plain;

use super::dataset::{Dataset, DatasetScene};

/// Bytes at the end of a file in which its format says that it ends.
const TAIL: usize = 12;

impl Dataset {
    /// Whether all of the image `im_id` of the scene `scene_id` is there: its entry in `scene_camera.json`, and in `scene_bodies.json` and
    /// `scene_tactile.json` where these files are; color and depth to their ends where the scene has them, and what there is of masks; and the same of images that
    /// other cameras of its rig took with it, if they are listed. A broken file never is.
    pub fn has_arrived(&self, scene_id: u32, im_id: u32) -> bool {
        let Ok(scene) = self.scene(scene_id) else { return false };
        let key = im_id.to_string();
        let told = [&scene.bodies, &scene.tactile].into_iter().all(|file| {
            !file.exists() || file.root().is_ok_and(|entries| entries.contains_key(&key))
        });
        let together = scene.taken_together(im_id);
        let seen = |images: Option<Vec<u32>>| {
            let images = images.unwrap_or_else(|| vec![im_id]);
            images.iter().all(|image| self.is_seen(scene, *image))
        };
        told && together.is_ok_and(seen)
    }

    /// Whether color, depth and masks of one image are there.
    fn is_seen(&self, scene: &DatasetScene, im_id: u32) -> bool {
        let Ok(frame) = self.frame(scene.id(), im_id) else { return false };
        let color = !frame.has_color() || frame.rgb_path().is_ok_and(|file| is_whole(&file));
        let depth = !frame.has_depth() || frame.depth_path().is_ok_and(|file| is_whole(&file));
        let any = frame.has_color() || frame.has_depth();
        // Masks may still be missing.
        any && color && depth && frame.mask_listing().all(|file| is_whole(&file))
    }

    /// Whether any of the image is there.
    pub fn has_begun(&self, scene_id: u32, im_id: u32) -> bool {
        self.frame(scene_id, im_id).is_ok_and(|f| f.rgb_path().is_ok() || f.depth_path().is_ok())
    }
}

impl DatasetScene {
    /// Size \[bytes\] and modification time of each of its JSON files, where they can be read. The files are read once: if these change,
    /// [`Dataset::reread`] is needed.
    pub fn stamps(&self) -> [Option<(u64, SystemTime)>; 3] {
        [&self.camera, &self.bodies, &self.tactile].map(|file| {
            let about = fs::metadata(file.path()).ok()?;
            Some((about.len(), about.modified().ok()?))
        })
    }
}

/// Whether a PNG or JPEG file has its end: decoders fill up what lacks of some pictures without complaint.
fn is_whole(file: &Path) -> bool {
    let tail = || -> std::io::Result<Vec<u8>> {
        let mut file = open_plain(file)?;
        let mut tail = Vec::with_capacity(TAIL);
        let size = file.metadata()?.len();
        file.seek(SeekFrom::Start(size.saturating_sub(TAIL as u64)))?;
        // The file may grow in the meantime.
        file.take(TAIL as u64).read_to_end(&mut tail)?;
        Ok(tail)
    };
    let Ok(tail) = tail() else { return false };
    match file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        true => tail.windows(4).any(|word| word == b"IEND"),
        false => tail.ends_with(&[0xff, 0xd9]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::default_scene;
    use crate::synth::write_dataset;

    #[test]
    fn an_image_has_arrived_when_the_last_of_it_is_there() {
        let dir = tempfile::tempdir().unwrap();
        write_dataset(dir.path(), &[default_scene(1).unwrap()]).unwrap();
        let dataset = || Dataset::open(dir.path()).unwrap();
        assert!(dataset().has_arrived(1, 0) && !dataset().has_arrived(1, 1));
        let scene = dataset().scene(1).unwrap().dir().to_owned();
        for name in ["rgb/000000.png", "depth/000000.png", "mask_visib/000000_000000.png"] {
            let file = scene.join(name);
            let whole = fs::read(&file).unwrap();
            fs::write(&file, &whole[..whole.len() - 13]).unwrap();
            assert!(!dataset().has_arrived(1, 0), "{name}");
            fs::write(&file, &whole).unwrap();
        }
        let (before, now) = (dataset(), dataset());
        let stamps = before.scene(1).unwrap().stamps();
        assert!(now.has_arrived(1, 0) && stamps == now.scene(1).unwrap().stamps());
        fs::write(scene.join("scene_bodies.json"), "{}").unwrap();
        assert_ne!(stamps, now.scene(1).unwrap().stamps());
        // What was read stays as it is.
        assert!(now.has_arrived(1, 0) && !now.reread().has_arrived(1, 0));
        fs::remove_file(scene.join("scene_bodies.json")).unwrap();
        fs::remove_file(scene.join("mask_visib/000000_000000.png")).unwrap();
        assert!(now.reread().has_arrived(1, 0));
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_plain_file_never_arrives() {
        assert!(!is_whole(Path::new("/dev/zero")));
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("0.png");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        // Nobody writes to it: opened, it would be waited for.
        let (sender, told) = std::sync::mpsc::channel();
        std::thread::spawn(move || sender.send(is_whole(&pipe)));
        assert_eq!(told.recv_timeout(std::time::Duration::from_secs(20)), Ok(false));
    }
}
