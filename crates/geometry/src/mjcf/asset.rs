//! Assets in files or in the model itself: each read once, when the first geom asks for it.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::compiler::Compilers;
use super::element::Element;
use super::error::Result;
use super::submodel;
use crate::io::folder::Folder;

/// Where the files of assets are.
#[derive(Clone, Copy)]
pub(super) struct Files<'a> {
    pub(super) folder: Option<&'a Folder>,
    pub(super) compilers: &'a Compilers,
}

impl Files<'_> {
    /// The file `name` of an asset.
    pub(super) fn path(&self, e: &Element, name: &str) -> Result<PathBuf> {
        let Some(folder) = self.folder else {
            return Err(e.unusable(name, "files of assets need a folder to be looked for in"));
        };
        let compiler = self.compilers.of(e);
        let file = match Path::new(name).file_name() {
            Some(file) if compiler.strip_path => Path::new(file),
            _ => Path::new(name),
        };
        let relative = Path::new(&compiler.mesh_folder).join(file);
        // Assets of an included file may lie beside it.
        submodel::found(folder, e, &relative).map_err(|reason| e.unusable(name, reason))
    }
}

/// The assets of one kind by name.
pub(super) struct Assets<'a, T> {
    kind: &'static str,
    elements: BTreeMap<String, &'a Element>,
    read: RefCell<BTreeMap<String, T>>,
}

impl<'a, T: Clone> Assets<'a, T> {
    /// Those of `root` with the tag `kind`, named after their files where they have no name. `fields` are read later on.
    pub(super) fn new(root: &'a Element, kind: &'static str, fields: &[&str]) -> Result<Self> {
        let mut elements = BTreeMap::new();
        for e in root.in_sections("asset").filter(|e| e.tag == kind) {
            e.take();
            let name = match e.text("name") {
                Some(name) => name.to_owned(),
                None => {
                    let file = e.text("file").ok_or_else(|| e.missing("name"))?;
                    let stem = Path::new(file).file_stem().unwrap_or_default();
                    stem.to_string_lossy().into_owned()
                }
            };
            fields.iter().for_each(|field| _ = e.text(field));
            if elements.insert(name, e).is_some() {
                return Err(e.duplicate(kind));
            }
        }
        Ok(Self { kind, elements, read: RefCell::default() })
    }

    /// The asset that `geom` names, read by `read` unless it has been.
    pub(super) fn get(
        &self,
        geom: &Element,
        name: &str,
        read: impl FnOnce(&'a Element) -> Result<T>,
    ) -> Result<T> {
        if let Some(known) = self.read.borrow().get(name) {
            return Ok(known.clone());
        }
        let asset = self.elements.get(name).ok_or_else(|| geom.unknown(self.kind, name))?;
        let read = read(asset)?;
        self.read.borrow_mut().insert(name.to_owned(), read.clone());
        Ok(read)
    }

    /// All elements.
    pub(super) fn elements(&self) -> impl Iterator<Item = &'a Element> {
        self.elements.values().copied()
    }
}
