//! From the text of files to one tree of elements.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::element::Element;
use super::error::{MjcfError, Result};
use crate::io::folder::Folder;
use crate::io::read_plain;
use crate::limits::{MAX_MJCF_BYTES, MAX_MJCF_DEPTH, MAX_MJCF_ELEMENTS};

/// The text of `path`.
pub(super) fn read(path: &Path) -> Result<String> {
    let error = |source| MjcfError::Read { path: path.into(), source };
    let bytes = read_plain(path, MAX_MJCF_BYTES).map_err(error)?;
    String::from_utf8(bytes).map_err(|e| error(io::Error::new(io::ErrorKind::InvalidData, e)))
}

/// The model of `xml`, with the files that it includes in the place of its `include` elements.
///
/// They are looked for in `folder`, then beside the file that names them, and never outside of `folder`.
pub(super) fn parse(xml: &str, file: Option<&Path>, folder: Option<&Folder>) -> Result<Element> {
    let mut source = MjcfSource { folder, included: BTreeSet::new(), bytes: 0, elements: 0 };
    let root = source.document(xml, file.map(Arc::from), Path::new(""), 0)?;
    if root.tag != "mujoco" {
        let message = format!("the outermost element is '{}', not 'mujoco'", root.tag);
        return Err(MjcfError::Xml { file: file.map(Path::to_path_buf), message });
    }
    root.take();
    Ok(root)
}

struct MjcfSource<'a> {
    folder: Option<&'a Folder>,
    /// Files that have been included, with respect to the folder.
    included: BTreeSet<PathBuf>,
    bytes: usize,
    elements: usize,
}

fn within(what: &'static str, count: usize, limit: usize) -> Result<()> {
    if count <= limit { Ok(()) } else { Err(MjcfError::TooLarge { what, count, limit }) }
}

impl MjcfSource<'_> {
    /// The outermost element of `xml`, which lies in `beside` within the folder.
    fn document(
        &mut self,
        xml: &str,
        file: Option<Arc<Path>>,
        beside: &Path,
        depth: usize,
    ) -> Result<Element> {
        self.bytes += xml.len();
        within("bytes", self.bytes, MAX_MJCF_BYTES)?;
        // What comes before the first tag is blank in some files.
        let trimmed = xml.trim_start_matches('\u{feff}').trim_start();
        let options = roxmltree::ParsingOptions {
            nodes_limit: 4 * MAX_MJCF_ELEMENTS as u32,
            ..Default::default()
        };
        let document = roxmltree::Document::parse_with_options(trimmed, options).map_err(|e| {
            MjcfError::Xml { file: file.as_deref().map(Path::to_path_buf), message: e.to_string() }
        })?;
        let lines = Lines::new(xml, xml.len() - trimmed.len());
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
    ) -> Result<()> {
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

    /// Children of the outermost element of the file that `element` names.
    fn include(&mut self, element: &Element, beside: &Path, depth: usize) -> Result<Vec<Element>> {
        let name = element.text("file").ok_or_else(|| element.missing("file"))?;
        let error = |reason: &str| element.unusable(name, reason);
        let Some(folder) = self.folder else {
            return Err(error("included files need a folder to be looked for in"));
        };
        let places = [PathBuf::from(name), beside.join(name)];
        let mut reason = "no such file";
        for relative in places {
            let path = match folder.file(&relative.to_string_lossy()) {
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
struct Lines {
    starts: Vec<usize>,
    /// Bytes before those that are counted.
    before: usize,
}

impl Lines {
    fn new(text: &str, before: usize) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let starts = std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect();
        Self { starts, before }
    }

    /// The number, from 1, of the line that holds the byte `at`.
    fn number(&self, at: usize) -> u32 {
        self.starts.partition_point(|&start| start <= at + self.before) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::super::Model;
    use super::*;

    #[test]
    fn included_files_stand_in_place_of_their_element() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("robot");
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("sub/a.xml", "<mujoco><body name=\"a\"/>\n<include file=\"b.xml\"/></mujoco>");
        write("sub/b.xml", "<any><body name=\"b\"/></any>");
        std::fs::write(root.path().join("c.xml"), "<mujoco/>").unwrap();
        let read = |includes: &str| {
            let xml =
                format!("<mujoco><worldbody>{includes}<body name=\"z\"/></worldbody></mujoco>");
            write("model.xml", &xml);
            let model = Model::from_file(folder.join("model.xml")).map_err(|e| e.to_string())?;
            Ok(model.bodies.into_iter().map(|b| b.name).collect::<Vec<_>>())
        };
        let include = |file: &str| format!("<include file=\"{file}\"/>");
        assert_eq!(read(&include("sub/a.xml")).unwrap(), ["a", "b", "z"]);
        let fails = |includes: String, part: &str| {
            let error: String = read(&includes).unwrap_err();
            assert!(
                error.contains(part) && error.contains("model.xml:1: include: file"),
                "{error}"
            );
        };
        fails(include("sub/b.xml").repeat(2), "is included already");
        fails(include("../c.xml"), "leaves the folder");
        fails(include("none.xml"), "no such file");
        write("loop.xml", &format!("<mujoco>{}</mujoco>", include("loop.xml")));
        assert!(read(&include("loop.xml")).unwrap_err().contains("is included already"));
        // Errors in an included file name it.
        write("sub/b.xml", "<any>\n<body name=\"b\" pos=\"x\"/></any>");
        let error = read(&include("sub/a.xml")).unwrap_err();
        assert!(error.contains("b.xml:2: body 'b': pos has 'x'"), "{error}");
        let xml = "<mujoco><include file=\"a.xml\"/></mujoco>";
        assert!(matches!(Model::from_str(xml, None), Err(MjcfError::File { .. })));
    }

    #[test]
    fn what_is_no_model_is_refused() {
        for xml in ["", "<mujoco>", "<robot/>", "<mujoco><a></b></mujoco>", "text"] {
            assert!(matches!(Model::from_str(xml, None), Err(MjcfError::Xml { .. })), "{xml}");
        }
        // Entities could unfold without end.
        let entity = "<!DOCTYPE a [<!ENTITY b \"c\">]><mujoco model=\"&b;\"/>";
        assert!(matches!(Model::from_str(entity, None), Err(MjcfError::Xml { .. })));
        assert!(matches!(Model::from_file("/nowhere/x.xml"), Err(MjcfError::Read { .. })));
        assert_eq!(Model::from_str("<mujoco model=\"m\"/>", None).unwrap().name, "m");
    }

    #[test]
    fn numbers_beyond_bounds_are_refused() {
        let mesh = |scale: &str, kind: &str| {
            let xml = format!(
                "<mujoco><asset><mesh name=\"t\" vertex=\"0 0 0 1 0 0 0 1 0 0 0 1\" face=\"0 2 1 0 1 3 1 2 3 0 3 2\" \
                scale=\"{scale}\"/></asset><worldbody><body><geom type=\"{kind}\" mesh=\"t\" pos=\"1e30 0 0\"/></body>\
                </worldbody></mujoco>"
            );
            Model::from_str(&xml, None)
        };
        assert!(mesh("1 1 1", "mesh").is_ok());
        assert!(mesh("1e30 1e30 1e30", "box").is_ok());
        for (scale, kind) in [("1e31 1 1", "mesh"), ("inf 1 1", "box"), ("1e-200 1e-200 1", "box")]
        {
            assert!(matches!(mesh(scale, kind), Err(MjcfError::Value { .. })), "{scale} {kind}");
        }
    }

    #[test]
    fn deep_nests_are_read_and_deeper_ones_refused() {
        let nest = |tag: &str, depth: usize| {
            let inside = format!("<{tag}>").repeat(depth) + &format!("</{tag}>").repeat(depth);
            Model::from_str(&format!("<mujoco><worldbody>{inside}</worldbody></mujoco>"), None)
        };
        let deepest = MAX_MJCF_DEPTH - 1;
        assert_eq!(nest("body", deepest).unwrap().bodies.len(), deepest);
        assert!(nest("frame", deepest).is_ok());
        for depth in [deepest + 1, 100_000] {
            let error = nest("body", depth).unwrap_err();
            assert!(matches!(error, MjcfError::TooLarge { what: "levels of tags", .. }), "{error}");
        }
        let many = "<a/>".repeat(MAX_MJCF_ELEMENTS);
        let error = Model::from_str(&format!("<mujoco>{many}</mujoco>"), None).unwrap_err();
        assert!(matches!(error, MjcfError::TooLarge { what: "elements", .. }), "{error}");
    }
}
