//! A hand with the files that describe it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use prehend_geometry::hand::{ALLEGRO_XELA_URDF, Taxel, load_taxels, taxels};
use prehend_geometry::limits::MAX_FILE_BYTES;
use prehend_geometry::read_plain;
use prehend_geometry::robot::{KinematicTree, outermost_element};

use crate::data::AssetError;
use crate::data::bop::{DatasetError, create_folder, read_text, write_atomically};
use crate::scene::Hand;

/// The hand's files, relative to the dataset.
pub(super) const URDF: &str = "hand/hand.urdf";
pub(super) const TAXELS: &str = "hand/taxels.csv";

/// A hand, and what is needed to describe it in a dataset.
pub struct HandFiles {
    /// The hand.
    pub robot: Arc<Hand>,
    /// Its URDF.
    pub(super) urdf: String,
    /// Mesh files that the URDF names: relative to its folder, and their content.
    pub(super) meshes: Vec<(PathBuf, Vec<u8>)>,
}

impl HandFiles {
    /// The built-in hand: an Allegro hand with XELA pads.
    ///
    /// # Errors
    /// If it cannot be prepared.
    pub fn built_in() -> Result<Self, AssetError> {
        let tree = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None)?;
        let robot = Arc::new(Hand::new(tree, taxels())?);
        Ok(Self { robot, urdf: ALLEGRO_XELA_URDF.into(), meshes: Vec::new() })
    }

    /// The hand of a URDF file, with the skin of a taxel table.
    ///
    /// Files that the URDF names are taken into datasets if they are within its folder.
    ///
    /// # Errors
    /// If a file is missing or broken.
    pub fn load(urdf: &Path, taxels: Option<&Path>) -> Result<Self, AssetError> {
        let text = read_text(urdf)?;
        if outermost_element(&text) == Some("mujoco") {
            let problem = "is MJCF: datasets are made with hands in URDF alone";
            return Err(DatasetError::unusable(urdf, problem).into());
        }
        let tree = KinematicTree::from_urdf_file(urdf)?;
        let skin = taxels.map(load_taxels).transpose()?.unwrap_or_default();
        let folder = urdf.parent().unwrap_or(Path::new(""));
        let mut meshes: Vec<(PathBuf, Vec<u8>)> = Vec::new();
        for name in named_files(&text) {
            let Some(relative) = within(folder, name) else { continue };
            let file = folder.join(&relative);
            if !meshes.iter().any(|(known, _)| *known == relative) {
                let content = read_plain(&file, MAX_FILE_BYTES);
                let content = content.map_err(|e| DatasetError::reading(&file, &e))?;
                meshes.push((relative, content));
            }
        }
        let robot = Hand::new(tree, skin).map_err(|e| DatasetError::unusable(urdf, e))?;
        let robot = Arc::new(robot);
        let table = taxels.unwrap_or(urdf);
        robot
            .taxels
            .iter()
            .try_for_each(|taxel| robot.link_of(taxel).map(|_| ()))
            .map_err(|e| DatasetError::unusable(table, e))?;
        Ok(Self { robot, urdf: text, meshes })
    }

    /// Writes the hand's files to the dataset at `root`.
    pub(super) fn write(&self, root: &Path) -> Result<(), DatasetError> {
        for (relative, content) in &self.meshes {
            let file = root.join("hand").join(relative);
            create_folder(file.parent().unwrap_or(root))?;
            write_atomically(&file, content)?;
        }
        create_folder(&root.join("hand"))?;
        if !self.robot.taxels.is_empty() {
            write_atomically(&root.join(TAXELS), taxel_table(&self.robot.taxels).as_bytes())?;
        }
        write_atomically(&root.join(URDF), self.urdf.as_bytes())
    }

    /// All that describes the hand, to be compared.
    pub(super) fn content(&self) -> impl Iterator<Item = u8> + '_ {
        let meshes = self.meshes.iter().flat_map(|(_, content)| content.iter().copied());
        let table = taxel_table(&self.robot.taxels).into_bytes();
        self.urdf.bytes().chain(table).chain(meshes)
    }
}

/// Values of the `filename` attributes of a URDF.
fn named_files(urdf: &str) -> impl Iterator<Item = &str> {
    urdf.split("filename").skip(1).filter_map(|rest| {
        let rest = rest.trim_start().strip_prefix('=')?.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        rest[1..].split(quote).next()
    })
}

/// The file of that name relative to `folder`, if it lies inside: `package://name/path` is `path` or `name/path`.
fn within(folder: &Path, name: &str) -> Option<PathBuf> {
    let inside = |relative: &str| {
        let path = PathBuf::from(relative);
        let plain = path.components().all(|c| matches!(c, std::path::Component::Normal(_)));
        (plain && folder.join(&path).is_file()).then_some(path)
    };
    match name.strip_prefix("package://") {
        Some(rest) => {
            rest.split_once('/').and_then(|(_, path)| inside(path)).or_else(|| inside(rest))
        }
        None => inside(name.strip_prefix("./").unwrap_or(name)),
    }
}

/// The columns that [`prehend_geometry::hand::load_taxels`] reads.
fn taxel_table(taxels: &[Taxel]) -> String {
    let mut text = "idx,patch,link,x_m,y_m,z_m,nx,ny,nz\n".to_owned();
    for Taxel { index, patch, link, position: p, normal: n } in taxels {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{index},{patch},{link},{},{},{},{},{},{}",
            p.x, p.y, p.z, n.x, n.y, n.z
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_hand_of_files_is_written_as_it_was_read() {
        let dir = tempfile::tempdir().unwrap();
        let mesh = prehend_geometry::shapes::cuboid([0.05, 0.04, 0.03].into());
        fs::create_dir_all(dir.path().join("meshes")).unwrap();
        mesh.save_ply(&dir.path().join("meshes/palm.ply")).unwrap();
        let urdf = r#"<robot name="r"><link name="palm">
            <visual><geometry><mesh filename="package://r/meshes/absent.dae"/></geometry></visual>
            <collision><geometry><mesh filename = 'package://r/meshes/palm.ply'/></geometry></collision>
            </link></robot>"#;
        let file = dir.path().join("some.urdf");
        fs::write(&file, urdf).unwrap();
        let table = dir.path().join("t.csv");
        fs::write(&table, "idx,patch,link,x_m,y_m,z_m,nx,ny,nz\n0,a,palm,0,0,0.015,0,0,1\n")
            .unwrap();
        let hand = HandFiles::load(&file, Some(&table)).unwrap();
        let out = dir.path().join("out");
        hand.write(&out).unwrap();
        let again = HandFiles::load(&out.join(URDF), Some(&out.join(TAXELS))).unwrap();
        assert!(hand.content().eq(again.content()));
        assert_eq!(again.robot.taxels, hand.robot.taxels);
        fs::write(&table, "idx,patch,link,x_m,y_m,z_m,nx,ny,nz\n0,a,tip,0,0,0,0,0,1\n").unwrap();
        let error = HandFiles::load(&file, Some(&table)).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("tip"), "{error}");
    }
}
