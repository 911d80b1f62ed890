//! How descriptions of robots are read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::io::folder::Folder;

/// How a robot or a scene is read, where the file leaves a choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Whether to go on without elements that are not supported though they change masses, degrees of freedom, contacts or actuation: they become
    /// warnings instead of errors.
    pub partial: bool,
    /// The folder that files which the description names may lie in. Without it, that is the next folder above the description with a
    /// `package.xml` or a `.git`, or else the description's own, and for `package://` names those above it that are called like the package.
    pub root: Option<PathBuf>,
    /// Whether files that a description names may lie anywhere.
    pub allow_outside: bool,
    /// Folders of ROS packages, by name, for `package://` names; others are looked for in [`package_paths`](Self::package_paths), and then in the
    /// folders above the description.
    pub packages: BTreeMap<String, PathBuf>,
    /// Folders that ROS packages lie in, up to two levels below.
    pub package_paths: Vec<PathBuf>,
    /// Whether inertias that no body can have are replaced by those of the collision shapes with the mass that is given.
    pub inertia_from_geometry: bool,
}

impl ReadOptions {
    /// With the packages that ROS has: in the folders of `ROS_PACKAGE_PATH`, and in `share` of those of `AMENT_PREFIX_PATH`.
    pub fn with_ros_packages(mut self) -> Self {
        for (variable, below) in [("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")] {
            let folders = std::env::var_os(variable).unwrap_or_default();
            let folders = std::env::split_paths(&folders).filter(|f| !f.as_os_str().is_empty());
            self.package_paths.extend(folders.map(|folder| folder.join(below)));
        }
        self
    }

    /// The folder of the package of that name.
    pub(crate) fn package(&self, name: &str) -> Option<PathBuf> {
        let is_package = |folder: &PathBuf| folder.ends_with(name) && folder.is_dir();
        let below = |folder: &PathBuf| -> Vec<PathBuf> {
            let entries = folder.read_dir().into_iter().flatten().flatten();
            entries.map(|entry| entry.path().join(name)).collect()
        };
        let within = |folder: &PathBuf| {
            let near = [folder.clone(), folder.join(name)];
            near.into_iter().find(is_package).or_else(|| below(folder).into_iter().find(is_package))
        };
        let known = self.packages.get(name).cloned();
        known.or_else(|| self.package_paths.iter().find_map(within))
    }

    /// The folder of the description at `path`, and what may be read beside it.
    pub(crate) fn folder(&self, path: &Path) -> Folder {
        let own = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if self.allow_outside {
            return Folder::anywhere(own);
        }
        match self.root.clone().or_else(|| package_root(own)) {
            Some(root) => Folder::within(own, &root),
            None => Folder::in_packages(own),
        }
    }
}

/// The next folder from `folder` upwards with a `package.xml` or a `.git`.
fn package_root(folder: &Path) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    let is_root = |f: &&Path| ["package.xml", ".git"].iter().any(|name| f.join(name).exists());
    folder.ancestors().find(is_root).map(Path::to_path_buf)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_lie_in_the_folders_of_their_paths() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        for name in ["work/src/arm", "opt/share/hand"] {
            std::fs::create_dir_all(at(name)).unwrap();
        }
        let package_paths = vec![at("none"), at("work"), at("opt/share")];
        let packages = BTreeMap::from([("own".to_owned(), at("opt"))]);
        let options = ReadOptions { packages, package_paths, ..ReadOptions::default() };
        let found = ["arm", "hand", "own", "other"].map(|name| options.package(name));
        let expected =
            [Some(at("work/src/arm")), Some(at("opt/share/hand")), Some(at("opt")), None];
        assert_eq!(found, expected);
    }
}
