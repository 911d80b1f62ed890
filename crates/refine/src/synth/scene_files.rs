//! The JSON files of a scene: one entry an image.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use crate::data::bop::{DatasetError, write_atomically};

/// What one image adds to each of its scene's files: the file's name and the entry as JSON.
pub(super) type Entries = Vec<(&'static str, String)>;

/// The files that have an entry for each image. The camera's comes last: a scene that has it has all.
pub(super) const NAMES: [&str; 6] = [
    "scene_gt.json",
    "scene_gt_info.json",
    "scene_bodies.json",
    "scene_bodies_gt.json",
    "scene_tactile.json",
    "scene_camera.json",
];

/// The files of a scene in the making, with one line an image as BOP's own tools write them.
#[derive(Default)]
pub(super) struct SceneFiles {
    text: BTreeMap<&'static str, String>,
}

impl SceneFiles {
    /// Adds an image; images come in ascending order.
    pub(super) fn add(&mut self, im_id: u32, entries: &Entries) {
        for (name, entry) in entries {
            let text = self.text.entry(name).or_default();
            let separator = if text.is_empty() { "{\n" } else { ",\n" };
            // Writing to a string cannot fail.
            let _ = write!(text, "{separator}  \"{im_id}\": {entry}");
        }
    }

    /// Writes those files that have entries, each of them whole or not at all.
    ///
    /// # Errors
    /// When one cannot be written.
    pub(super) fn write(&self, scene_dir: &Path) -> Result<(), DatasetError> {
        for name in NAMES {
            if let Some(text) = self.text.get(name) {
                write_atomically(&scene_dir.join(name), format!("{text}\n}}\n").as_bytes())?;
            }
        }
        Ok(())
    }
}

/// Entries as the text of a file that [`from_text`] reads.
pub(super) fn to_text(entries: &Entries) -> String {
    entries.iter().fold(String::new(), |text, (name, entry)| text + name + "\t" + entry + "\n")
}

/// The entries of such a text; `None` of any other.
pub(super) fn from_text(text: &str) -> Option<Entries> {
    let entry = |line: &str| {
        let (name, entry) = line.split_once('\t')?;
        Some((NAMES.into_iter().find(|known| *known == name)?, entry.to_owned()))
    };
    text.lines().map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_json_with_a_line_an_image() {
        let dir = tempfile::tempdir().unwrap();
        let mut files = SceneFiles::default();
        let entries = vec![
            ("scene_gt.json", "[{\"a\":1}]".to_owned()),
            ("scene_camera.json", "{}".to_owned()),
        ];
        assert_eq!(from_text(&to_text(&entries)), Some(entries.clone()));
        assert_eq!(from_text("other.json\t{}"), None);
        files.add(9, &entries);
        files.add(10, &entries);
        files.write(dir.path()).unwrap();
        let text = std::fs::read_to_string(dir.path().join("scene_gt.json")).unwrap();
        assert_eq!(text, "{\n  \"9\": [{\"a\":1}],\n  \"10\": [{\"a\":1}]\n}\n");
        assert!(!dir.path().join("scene_tactile.json").exists());
    }
}
