//! Models within a model: its `model` assets, parts of which are attached to bodies.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::compiler::{Compiler, Compilers};
use super::copies::{self, REFERRING, submodel_part};
use super::element::Element;
use super::error::Result;
use super::reference::{self, Names};
use super::source;
use crate::io::folder::Folder;

/// Most models within each other.
const MOST_LEVELS: usize = 16;

/// Unfolds all copies and attached models in `root`, whose files are looked for in `folder`, and returns the compilers of all.
pub(super) fn unfold(root: &mut Element, folder: Option<&Folder>) -> Result<Compilers> {
    let mut compilers = Compilers(Vec::new());
    unfold_at(root, folder, &mut compilers, 0)?;
    Ok(compilers)
}

fn unfold_at(
    root: &mut Element,
    folder: Option<&Folder>,
    compilers: &mut Compilers,
    level: usize,
) -> Result<()> {
    root.set_scope(compilers.0.len());
    compilers.0.push(Compiler::read(root)?);
    let mut submodels = Submodels::default();
    for asset in root.in_sections("asset").filter(|e| e.tag == "model") {
        asset.take();
        if level == MOST_LEVELS {
            return Err(asset.misplaced("models are within each other without end"));
        }
        let mut model = load(asset, folder)?;
        unfold_at(&mut model, folder, compilers, level + 1)?;
        let name = asset.text("name").or_else(|| model.peek("model")).unwrap_or_default();
        submodels.all.insert(name.to_owned(), model);
    }
    copies::unfold(root, compilers, &submodels)
}

/// The model in the file that `asset` names.
fn load(asset: &Element, folder: Option<&Folder>) -> Result<Element> {
    let name = asset.text("file").ok_or_else(|| asset.missing("file"))?;
    let Some(folder) = folder else {
        return Err(asset.unusable(name, "model files need a folder to be looked for in"));
    };
    let path =
        found(folder, asset, Path::new(name)).map_err(|reason| asset.unusable(name, reason))?;
    source::parse(&source::read(&path)?, Some(&path), Some(folder))
}

/// The file `relative` in `folder`, or beside the file of `e`.
pub(super) fn found(
    folder: &Folder,
    e: &Element,
    relative: &Path,
) -> Result<PathBuf, &'static str> {
    let beside =
        e.file.as_deref().and_then(Path::parent).and_then(|p| p.strip_prefix(&folder.path).ok());
    let mut reason = "no such file";
    for place in [relative.to_path_buf(), beside.unwrap_or(Path::new("")).join(relative)] {
        match folder.file(&place.to_string_lossy()) {
            Ok(path) if path.is_file() => return Ok(path),
            Ok(_) => {}
            Err(outside) => reason = outside,
        }
    }
    Err(reason)
}

/// The models that a model names, unfolded.
#[derive(Default)]
pub(super) struct Submodels {
    all: BTreeMap<String, Element>,
}

impl Submodels {
    /// The frame that stands for `attach`. What the part refers to, and what refers to it alone, is added to `root`.
    pub(super) fn attached(&self, attach: &Element, root: &mut Element) -> Result<Element> {
        let name = attach.text("model").unwrap_or_default();
        let prefix = attach.text("prefix").ok_or_else(|| attach.missing("prefix"))?;
        let model = self.all.get(name).ok_or_else(|| attach.unknown("model", name))?;
        let change = |name: &str| format!("{prefix}{name}");
        let mut frame = submodel_part(model, attach)?;
        let mut names = Names::new();
        reference::collect(&frame, "worldbody", &mut names);
        if frame.peek("childclass").is_none() {
            frame.set("childclass", "main");
        }
        for section in REFERRING {
            let sections = model.children.iter().filter(|own| own.tag == section);
            for e in sections.flat_map(|own| &own.children) {
                if reference::refers(e, &names) != (true, true) {
                    continue;
                }
                reference::collect(e, section, &mut names);
                root.append(section, renamed(e, &change));
            }
        }
        // Assets and classes come once, however often a part of their model is attached by that prefix.
        let class = change("main");
        let known = |e: &Element| e.tag == "default" && e.peek("class") == Some(&class);
        if !root.children.iter().any(known) {
            for own in model.children.iter().filter(|own| own.tag == "asset") {
                for e in own.children.iter().filter(|e| e.tag != "model") {
                    root.append("asset", renamed(e, &change));
                }
            }
            let mut all = model.empty("default");
            for own in model.children.iter().filter(|own| own.tag == "default") {
                if own.scope != model.scope {
                    let mut other = own.clone();
                    reference::rename(&mut other, None, &change);
                    root.children.push(other);
                    continue;
                }
                all.children.extend(own.children.iter().cloned());
                if let Some(name) = own.peek("class").filter(|name| *name != "main") {
                    all.set("alias", change(name));
                }
            }
            for child in &mut all.children {
                reference::rename(child, None, &change);
            }
            all.set("class", class);
            root.children.push(all);
        }
        reference::rename(&mut frame, None, &change);
        Ok(frame)
    }
}

/// `e` under other names, of the model's outermost class where it has none.
fn renamed(e: &Element, change: &dyn Fn(&str) -> String) -> Element {
    let mut copy = e.clone();
    // Meshes without a name have their file's.
    let file = copy.peek("file").filter(|_| copy.peek("name").is_none()).map(|file| {
        let stem = file.rsplit(['/', '\\']).next().unwrap_or(file);
        stem.rsplit_once('.').map_or(stem, |(stem, _)| stem).to_owned()
    });
    if let Some(stem) = file {
        copy.set("name", stem);
    }
    if copy.peek("class").is_none() {
        copy.set("class", "main");
    }
    reference::rename(&mut copy, None, change);
    copy
}
