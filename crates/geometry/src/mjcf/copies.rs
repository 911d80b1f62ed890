//! Elements that stand for many: `replicate` and `attach`, unfolded before anything is read.
//!
//! Copies get frames, and suffixes or prefixes to their names; what refers to them from elsewhere, actuators and tendons for instance, is copied
//! with them and comes last in its section, copy after copy.

use nalgebra::{Isometry3, Vector3};

use super::compiler::Compilers;
use super::element::Element;
use super::error::{MjcfError, Result};
use super::orientation;
use super::reference::{self, Names};
use super::submodel::Submodels;
use crate::limits::{MAX_MJCF_DEPTH, MAX_MJCF_ELEMENTS};

/// Sections whose elements refer to others, each after those that it may refer to.
pub(super) const REFERRING: [&str; 5] = ["tendon", "actuator", "equality", "contact", "sensor"];

/// Unfolds all copies in `root`.
pub(super) fn unfold(
    root: &mut Element,
    compilers: &Compilers,
    submodels: &Submodels,
) -> Result<()> {
    let mut copier = Copier { compilers, submodels, elements: root.count() };
    let worlds = root.children.iter().enumerate().filter(|(_, e)| e.tag == "worldbody");
    for place in worlds.map(|(place, _)| place).collect::<Vec<_>>() {
        let content = std::mem::take(&mut root.children[place].children);
        root.children[place].children = copier.unfolded(content, root, 0)?;
    }
    copier.attach_own(root)
}

struct Copier<'a> {
    compilers: &'a Compilers,
    submodels: &'a Submodels,
    elements: usize,
}

impl Copier<'_> {
    fn grow(&mut self, by: usize) -> Result<()> {
        self.elements += by;
        let (what, limit) = ("elements", MAX_MJCF_ELEMENTS);
        if self.elements > limit {
            return Err(MjcfError::TooLarge { what, count: self.elements, limit });
        }
        Ok(())
    }

    /// `content` with all copies in it; `root` is the model without its bodies.
    fn unfolded(
        &mut self,
        content: Vec<Element>,
        root: &mut Element,
        depth: usize,
    ) -> Result<Vec<Element>> {
        if depth > MAX_MJCF_DEPTH {
            let (what, limit) = ("levels of tags", MAX_MJCF_DEPTH);
            return Err(MjcfError::TooLarge { what, count: depth, limit });
        }
        let mut unfolded = Vec::with_capacity(content.len());
        for mut e in content {
            let inside = std::mem::take(&mut e.children);
            e.children = self.unfolded(inside, root, depth + 1)?;
            match e.tag.as_str() {
                "replicate" => self.replicate(&e, root, &mut unfolded)?,
                "attach" if e.has("model") => {
                    let frame = self.submodels.attached(&e, root)?;
                    self.grow(frame.count())?;
                    unfolded.push(frame);
                }
                _ => unfolded.push(e),
            }
        }
        Ok(unfolded)
    }

    fn replicate(
        &mut self,
        e: &Element,
        root: &mut Element,
        unfolded: &mut Vec<Element>,
    ) -> Result<()> {
        let count: usize = e.integer("count")?.ok_or_else(|| e.missing("count"))?;
        if count == 0 {
            return Err(e.invalid("count", "must be positive"));
        }
        let separator = e.text("sep").unwrap_or_default();
        if let Some(joint) =
            e.children.iter().find(|c| matches!(c.tag.as_str(), "joint" | "freejoint"))
        {
            return Err(joint.misplaced("a replicate has no joints but those of bodies in it"));
        }
        self.grow((count - 1) * e.count())?;
        let offset = Vector3::from(e.numbers::<3>("offset")?.unwrap_or_default());
        let turn = orientation::read(e, self.compilers.of(e))?.unwrap_or_default();
        let step = Isometry3::from_parts(offset.into(), turn);
        let digits = (count - 1).to_string().len();
        let suffixes: Vec<String> =
            (0..count).map(|k| format!("{separator}{k:0digits$}")).collect();
        let mut names = Names::new();
        e.children.iter().for_each(|child| reference::collect(child, "worldbody", &mut names));
        let mut t_parent_copy = Isometry3::identity();
        for suffix in &suffixes {
            let mut frame = e.empty("frame");
            frame.place_at(&t_parent_copy);
            frame.children.clone_from(&e.children);
            for child in &mut frame.children {
                reference::rename(child, Some(&names), &|name| format!("{name}{suffix}"));
            }
            unfolded.push(frame);
            t_parent_copy *= step;
        }
        self.replicate_references(root, names, &suffixes)
    }

    /// Copies with each suffix all that refers to `names`, and moves it to the end of its section.
    fn replicate_references(
        &mut self,
        root: &mut Element,
        mut names: Names,
        suffixes: &[String],
    ) -> Result<()> {
        for section in REFERRING {
            let mut referring = Vec::new();
            for own in root.children.iter_mut().filter(|own| own.tag == section) {
                let (some, others) =
                    own.children.drain(..).partition(|e| reference::refers(e, &names).0);
                own.children = others;
                let some: Vec<Element> = some;
                referring.extend(some);
            }
            if referring.is_empty() {
                continue;
            }
            referring.iter().for_each(|e| reference::collect(e, section, &mut names));
            for suffix in suffixes {
                for e in &referring {
                    self.grow(e.count())?;
                    let mut copy = e.clone();
                    reference::rename(&mut copy, Some(&names), &|name| format!("{name}{suffix}"));
                    root.append(section, copy);
                }
            }
        }
        Ok(())
    }

    /// Puts copies of the model's own bodies and frames where `attach` elements name them, in their order.
    fn attach_own(&mut self, root: &mut Element) -> Result<()> {
        while let Some(path) = find(root, &|e| e.tag == "attach") {
            let e = root.at(&path).clone();
            let prefix = e.text("prefix").unwrap_or_default().to_owned();
            let mut frame = submodel_part(root, &e)?;
            if find(&frame, &|e| e.tag == "attach").is_some() {
                return Err(e.misplaced("attaches what itself attaches something"));
            }
            self.grow(frame.count())?;
            let mut names = Names::new();
            reference::collect(&frame, "worldbody", &mut names);
            let change = |name: &str| format!("{prefix}{name}");
            for section in REFERRING {
                let sections = root.children.iter().filter(|own| own.tag == section);
                let referring = sections
                    .flat_map(|own| &own.children)
                    .filter(|e| reference::refers(e, &names) == (true, true));
                let referring: Vec<Element> = referring.cloned().collect();
                referring.iter().for_each(|e| reference::collect(e, section, &mut names));
                for mut copy in referring {
                    self.grow(copy.count())?;
                    reference::rename(&mut copy, Some(&names), &change);
                    root.append(section, copy);
                }
            }
            reference::rename(&mut frame, Some(&names), &change);
            *root.at_mut(&path) = frame;
        }
        Ok(())
    }
}

/// The way, child by child, to the first element below `root` that is wanted.
fn find(root: &Element, wanted: &dyn Fn(&Element) -> bool) -> Option<Vec<usize>> {
    if wanted(root) {
        return Some(Vec::new());
    }
    root.children.iter().enumerate().find_map(|(place, child)| {
        let mut path = find(child, wanted)?;
        path.insert(0, place);
        Some(path)
    })
}

/// A frame with what `attach` names in `root`: a body, the content of a frame, or all that is in the world.
pub(super) fn submodel_part(root: &Element, attach: &Element) -> Result<Element> {
    let mut frame = attach.empty("frame");
    let wanted = ["body", "frame"].into_iter().find_map(|tag| Some((tag, attach.text(tag)?)));
    let worlds = || root.children.iter().filter(|e| e.tag == "worldbody");
    let Some((tag, name)) = wanted else {
        frame.children = worlds().flat_map(|world| &world.children).cloned().collect();
        return Ok(frame);
    };
    if attach.has("body") && attach.has("frame") {
        return Err(attach.invalid("frame", "is given beside body"));
    }
    let field = if tag == "body" { "body" } else { "frame" };
    let found = worlds().find_map(|world| {
        let path = find(world, &|e| e.tag == tag && e.peek("name") == Some(name))?;
        // The class of the nearest that has one.
        let mut class = None;
        let mut at = world;
        for place in &path {
            class = at.peek("childclass").or(class);
            at = &at.children[*place];
        }
        Some((at, class))
    });
    let (found, class) = found.ok_or_else(|| attach.unknown(field, name))?;
    if let Some(class) = class {
        frame.set("childclass", class);
    }
    frame.children = vec![found.clone()];
    Ok(frame)
}
