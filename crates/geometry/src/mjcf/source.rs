//! From the text of files to one tree of elements.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::element::Element;
use super::error::MjcfError;
use crate::io::folder::{inside, read_limited};
use crate::limits::{MAX_MJCF_BYTES, MAX_MJCF_DEPTH, MAX_MJCF_ELEMENTS};

/// The text of `path`.
pub(super) fn read(path: &Path) -> Result<String, MjcfError> {
    let error = |source| MjcfError::Read { path: path.into(), source };
    let bytes = read_limited(path, MAX_MJCF_BYTES).map_err(error)?;
    String::from_utf8(bytes).map_err(|e| error(io::Error::new(io::ErrorKind::InvalidData, e)))
}

/// The model of `xml`, with the files that it includes in the place of its `include` elements.
///
/// They are looked for in `folder`, then beside the file that names them, and never outside of `folder`.
pub(super) fn parse(
    xml: &str,
    file: Option<&Path>,
    folder: Option<&Path>,
) -> Result<Element, MjcfError> {
    let mut source = Source { folder, included: BTreeSet::new(), bytes: 0, elements: 0 };
    let root = source.document(xml, file.map(Arc::from), Path::new(""), 0)?;
    if root.tag != "mujoco" {
        let message = format!("the outermost element is '{}', not 'mujoco'", root.tag);
        return Err(MjcfError::Xml { file: file.map(Path::to_path_buf), message });
    }
    root.take();
    Ok(root)
}

struct Source<'a> {
    folder: Option<&'a Path>,
    /// Files that have been included, with respect to the folder.
    included: BTreeSet<PathBuf>,
    bytes: usize,
    elements: usize,
}

fn within(what: &'static str, count: usize, limit: usize) -> Result<(), MjcfError> {
    if count <= limit { Ok(()) } else { Err(MjcfError::TooLarge { what, count, limit }) }
}

impl Source<'_> {
    /// The outermost element of `xml`, which lies in `beside` within the folder.
    fn document(
        &mut self,
        xml: &str,
        file: Option<Arc<Path>>,
        beside: &Path,
        depth: usize,
    ) -> Result<Element, MjcfError> {
        self.bytes += xml.len();
        within("bytes", self.bytes, MAX_MJCF_BYTES)?;
        let options = roxmltree::ParsingOptions {
            nodes_limit: 4 * MAX_MJCF_ELEMENTS as u32,
            ..Default::default()
        };
        let document = roxmltree::Document::parse_with_options(xml, options).map_err(|e| {
            MjcfError::Xml { file: file.as_deref().map(Path::to_path_buf), message: e.to_string() }
        })?;
        let lines = Lines::new(xml);
        let mut found = Vec::new();
        self.element(document.root_element(), &file, &lines, beside, depth, &mut found)?;
        let nothing = || MjcfError::Xml {
            file: file.as_deref().map(Path::to_path_buf),
            message: "the outermost element is an include".into(),
        };
        found.pop().ok_or_else(nothing)
    }

    /// Appends the element `node` to `siblings`, or what it includes.
    fn element(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        file: &Option<Arc<Path>>,
        lines: &Lines,
        beside: &Path,
        depth: usize,
        siblings: &mut Vec<Element>,
    ) -> Result<(), MjcfError> {
        self.elements += 1;
        within("elements", self.elements, MAX_MJCF_ELEMENTS)?;
        within("levels of tags", depth, MAX_MJCF_DEPTH)?;
        let line = lines.number(node.range().start);
        let mut element = Element::new(node, file.clone(), line);
        if element.tag == "include" {
            siblings.extend(self.include(&element, beside, depth)?);
            return Ok(());
        }
        for child in node.children().filter(roxmltree::Node::is_element) {
            self.element(child, file, lines, beside, depth + 1, &mut element.children)?;
        }
        siblings.push(element);
        Ok(())
    }

    /// What is in the outermost element of the file that `element` names.
    fn include(
        &mut self,
        element: &Element,
        beside: &Path,
        depth: usize,
    ) -> Result<Vec<Element>, MjcfError> {
        let name = element.text("file").ok_or_else(|| element.missing("file"))?;
        let error = |reason: &str| element.unusable(name, reason);
        let Some(folder) = self.folder else {
            return Err(error("included files need a folder to be looked for in"));
        };
        let places = [PathBuf::from(name), beside.join(name)];
        let mut reason = "no such file";
        for relative in places {
            let path = match inside(folder, &relative.to_string_lossy()) {
                Ok(path) if path.is_file() => path,
                Ok(_) => continue,
                Err(outside) => {
                    reason = outside;
                    continue;
                }
            };
            if !self.included.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
                return Err(error("is included already"));
            }
            let text = read(&path)?;
            let beside = relative.parent().unwrap_or(Path::new(""));
            let root = self.document(&text, Some(Arc::from(path.as_path())), beside, depth)?;
            return Ok(root.children);
        }
        Err(error(reason))
    }
}

/// Where the lines of a text begin.
struct Lines(Vec<usize>);

impl Lines {
    fn new(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        Self(std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect())
    }

    /// The number, from 1, of the line that holds the byte `at`.
    fn number(&self, at: usize) -> u32 {
        self.0.partition_point(|&start| start <= at) as u32
    }
}
