//! The elements of a model's files, joined to one tree by their `include` elements.
//!
//! They keep book of what has been asked for, so that the rest can be named in warnings.

use std::cell::Cell;
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use nalgebra::Isometry3;

use super::error::{MjcfError, Place};

/// Whether an element or an attribute was read, left out or not asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Use {
    /// Nothing has asked for it.
    None,
    /// It has been read.
    Read,
    /// It has been looked at and left out, wholly or in part, for this reason.
    Refused(&'static str),
}

#[derive(Clone, Debug)]
struct Attribute {
    name: String,
    value: String,
    used: Cell<Use>,
}

/// An element with what is below it.
#[derive(Clone, Debug)]
pub(super) struct Element {
    /// Its tag.
    pub(super) tag: String,
    attributes: Vec<Attribute>,
    /// The elements in it.
    pub(super) children: Vec<Element>,
    /// The file that it comes from.
    pub(super) file: Option<Arc<Path>>,
    line: u32,
    /// Which of the models it is from, whose compiler it is read with: the first is the whole.
    pub(super) scope: usize,
    used: Cell<Use>,
}

impl Element {
    /// The element `node` itself, without its children.
    pub(super) fn new(node: roxmltree::Node<'_, '_>, file: Option<Arc<Path>>, line: u32) -> Self {
        let attribute = |a: roxmltree::Attribute<'_, '_>| Attribute {
            name: a.name().to_owned(),
            value: a.value().to_owned(),
            used: Cell::new(Use::None),
        };
        Self {
            tag: node.tag_name().name().to_owned(),
            attributes: node.attributes().map(attribute).collect(),
            children: Vec::new(),
            file,
            line,
            scope: 0,
            used: Cell::new(Use::None),
        }
    }

    /// An element without attributes in the place of this one.
    pub(super) fn empty(&self, tag: &str) -> Self {
        let (file, line, scope) = (self.file.clone(), self.line, self.scope);
        let (attributes, children) = (Vec::new(), Vec::new());
        Self {
            tag: tag.to_owned(),
            attributes,
            children,
            file,
            line,
            scope,
            used: Cell::new(Use::None),
        }
    }

    /// Gives it and all in it the scope of one model.
    pub(super) fn set_scope(&mut self, scope: usize) {
        self.scope = scope;
        self.children.iter_mut().for_each(|child| child.set_scope(scope));
    }

    /// How many elements it is with all in it.
    pub(super) fn count(&self) -> usize {
        1 + self.children.iter().map(Self::count).sum::<usize>()
    }

    /// Gives an attribute this value.
    pub(super) fn set(&mut self, name: &str, value: impl Into<String>) {
        let value = value.into();
        match self.attributes.iter_mut().find(|a| a.name == name) {
            Some(attribute) => attribute.value = value,
            None => {
                let (name, used) = (name.to_owned(), Cell::new(Use::Read));
                self.attributes.push(Attribute { name, value, used });
            }
        }
    }

    /// Gives it the attributes `pos` and `quat` of a pose.
    pub(super) fn place_at(&mut self, pose: &Isometry3<f64>) {
        let (t, q) = (pose.translation.vector, pose.rotation);
        self.set("pos", format!("{:e} {:e} {:e}", t.x, t.y, t.z));
        self.set("quat", format!("{:e} {:e} {:e} {:e}", q.w, q.i, q.j, q.k));
    }

    /// Adds `child` to the last child called `section`, which is made where there is none.
    pub(super) fn append(&mut self, section: &str, child: Element) {
        if !self.children.iter().any(|own| own.tag == section) {
            let own = self.empty(section);
            self.children.push(own);
        }
        if let Some(own) = self.children.iter_mut().rfind(|own| own.tag == section) {
            own.children.push(child);
        }
    }

    /// The element at the end of the way `path`, child by child.
    pub(super) fn at(&self, path: &[usize]) -> &Self {
        path.iter().fold(self, |e, place| &e.children[*place])
    }

    /// [`at`](Self::at), to be changed.
    pub(super) fn at_mut(&mut self, path: &[usize]) -> &mut Self {
        path.iter().fold(self, |e, place| &mut e.children[*place])
    }

    /// The text of an attribute, which does not count as reading it.
    pub(super) fn peek(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|a| a.name == name).map(|a| a.value.as_str())
    }

    /// Where it is.
    pub(super) fn place(&self) -> Place {
        let name = self.attributes.iter().find(|a| a.name == "name");
        Place {
            file: self.file.as_deref().map(Path::to_path_buf),
            line: self.line,
            element: self.tag.clone(),
            name: name.map(|a| a.value.clone()).unwrap_or_default(),
        }
    }

    /// Marks it as read.
    pub(super) fn take(&self) {
        self.used.set(Use::Read);
    }

    /// Marks it as left out.
    pub(super) fn refuse(&self, reason: &'static str) {
        self.used.set(Use::Refused(reason));
    }

    /// Marks an attribute as left out, at least in part.
    pub(super) fn refuse_attribute(&self, name: &str, reason: &'static str) {
        let named = self.attributes.iter().filter(|a| a.name == name);
        named.for_each(|a| a.used.set(Use::Refused(reason)));
    }

    pub(super) fn used(&self) -> Use {
        self.used.get()
    }

    /// Names of the attributes and what has become of them.
    pub(super) fn attributes(&self) -> impl Iterator<Item = (&str, Use)> {
        self.attributes.iter().map(|a| (a.name.as_str(), a.used.get()))
    }

    /// Whether it has the attribute, which does not count as reading it.
    pub(super) fn has(&self, name: &str) -> bool {
        self.attributes.iter().any(|a| a.name == name)
    }

    /// The text of an attribute.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        let attribute = self.attributes.iter().find(|a| a.name == name)?;
        attribute.used.set(Use::Read);
        Some(attribute.value.as_str())
    }

    /// The `name` attribute, empty without one.
    pub(super) fn name(&self) -> String {
        self.text("name").unwrap_or_default().to_owned()
    }

    /// The children of all children called `section`, which are marked as read; what is in them is not.
    pub(super) fn in_sections<'a>(&'a self, section: &'a str) -> impl Iterator<Item = &'a Element> {
        self.sections(section).flat_map(|s| &s.children)
    }

    /// The children called `section`, which are marked as read.
    pub(super) fn sections<'a>(&'a self, section: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |c| c.tag == section).inspect(|c| c.take())
    }

    /// [`MjcfError::Value`] of an attribute.
    pub(super) fn invalid(&self, field: &'static str, reason: impl Into<String>) -> MjcfError {
        MjcfError::Value { place: Box::new(self.place()), field, reason: reason.into() }
    }

    /// [`MjcfError::Value`] of an attribute that is not there.
    pub(super) fn missing(&self, field: &'static str) -> MjcfError {
        self.invalid(field, "is missing")
    }

    /// [`MjcfError::Value`] of an attribute that refers to something that does not exist.
    pub(super) fn unknown(&self, field: &'static str, name: impl Display) -> MjcfError {
        self.invalid(field, format!("names '{name}', which does not exist"))
    }

    /// [`MjcfError::Structure`] of an element that has the name of another of this `kind`.
    pub(super) fn duplicate(&self, kind: &str) -> MjcfError {
        self.misplaced(format!("another {kind} has this name"))
    }

    /// [`MjcfError::Structure`] of the element.
    pub(super) fn misplaced(&self, reason: impl Into<String>) -> MjcfError {
        MjcfError::Structure { place: Box::new(self.place()), reason: reason.into() }
    }

    /// [`MjcfError::File`] of a file that the element names.
    pub(super) fn unusable(&self, file: &str, reason: impl Into<String>) -> MjcfError {
        let file = file.to_owned();
        MjcfError::File { place: Box::new(self.place()), file, reason: reason.into() }
    }
}
