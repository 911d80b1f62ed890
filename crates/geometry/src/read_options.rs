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
    /// `package.xml` or a `.git`, or else the description's own.
    pub root: Option<PathBuf>,
    /// Whether files that a description names may lie anywhere.
    pub allow_outside: bool,
    /// Folders of ROS packages, by name, for `package://` names; without one they are looked for in the folders above the description.
    pub packages: BTreeMap<String, PathBuf>,
    /// Whether inertias that no body can have are replaced by those of the collision shapes with the mass that is given.
    pub inertia_from_geometry: bool,
}

impl ReadOptions {
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
            None => Folder::own(own),
        }
    }
}

/// The next folder from `folder` upwards with a `package.xml` or a `.git`.
fn package_root(folder: &Path) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    let is_root = |f: &&Path| ["package.xml", ".git"].iter().any(|name| f.join(name).exists());
    folder.ancestors().find(is_root).map(Path::to_path_buf)
}
