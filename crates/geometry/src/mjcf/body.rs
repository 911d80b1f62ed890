//! The tree of bodies with their joints, geoms and sites.

use nalgebra::Isometry3;

use super::class::{Classes, MAIN};
use super::compiler::{Compilers, InertiaFrom};
use super::element::{Element, Use};
use super::error::{MjcfError, Result};
use super::geom::{Geom, GeomAssets};
use super::inertial;
use super::joint::{self, Joint, JointKind};
use super::names::Taken;
use super::orientation;
use super::site::Site;
use crate::inertial::Inertial;

/// A rigid body.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its name, empty where it has none.
    pub name: String,
    /// The body that carries it, which comes before it; `None` is the world.
    pub parent: Option<usize>,
    /// Body frame → parent's frame, with all joints at their references.
    pub t_parent_body: Isometry3<f64>,
    /// Its joints towards the parent, the first nearest to it; without any it is fixed to the parent.
    pub joints: Vec<Joint>,
    /// Its mass and inertia, as written or as its geoms give it; `None` where it weighs nothing.
    pub inertial: Option<Inertial>,
    /// Its shapes.
    pub geoms: Vec<Geom>,
    /// Its marked places.
    pub sites: Vec<Site>,
    /// The share of its weight that is carried for it \[1\].
    pub gravity_compensation: f64,
    /// True if whoever simulates puts it where it is, as a hand that is tracked: it has no joints and no mass counts.
    pub is_mocap: bool,
}

/// The world and all bodies.
#[derive(Default)]
pub(super) struct Tree {
    pub(super) bodies: Vec<Body>,
    pub(super) geoms: Vec<Geom>,
    pub(super) sites: Vec<Site>,
    /// Error of the first body that moves and weighs nothing.
    pub(super) massless: Option<MjcfError>,
}

/// Where an element is found.
#[derive(Clone, Copy)]
struct Spot {
    /// `None` is the world.
    body: Option<usize>,
    /// Frame of the enclosing `frame` elements → body frame.
    t_body_frame: Isometry3<f64>,
    /// The class of elements that name none.
    class: usize,
}

/// Reads the tree of `root`.
pub(super) fn read(
    root: &Element,
    compilers: &Compilers,
    classes: &Classes,
    assets: &GeomAssets<'_>,
) -> Result<Tree> {
    let mut reader = Reader {
        compilers,
        classes,
        assets,
        tree: Tree::default(),
        weights: Vec::new(),
        body_names: Taken::default(),
        joint_names: Taken::default(),
        geom_names: Taken::default(),
        site_names: Taken::default(),
    };
    for e in root.sections("worldbody") {
        let class = classes.index(e, "childclass", MAIN)?;
        reader.content(e, Spot { body: None, t_body_frame: Isometry3::identity(), class })?;
    }
    Ok(reader.tree)
}

impl Tree {
    /// True if a body, the last but for those that it carries, or one that is fixed to it has a mass and an inertia about each axis.
    fn has_inertia(&self, index: usize) -> bool {
        let mut is_fixed = vec![true];
        for (k, body) in self.bodies.iter().enumerate().skip(index) {
            if k > index {
                let parent = body.parent.and_then(|parent| parent.checked_sub(index));
                let moves = parent.is_some_and(|parent| is_fixed[parent]);
                is_fixed.push(moves && body.joints.is_empty());
            }
            if is_fixed[k - index] && body.inertial.as_ref().is_some_and(inertial::resists) {
                return true;
            }
        }
        false
    }
}

struct Reader<'a> {
    compilers: &'a Compilers,
    classes: &'a Classes,
    assets: &'a GeomAssets<'a>,
    tree: Tree,
    /// Mass and inertia of the geoms of each body, in its frame; `None` where its own `inertial` element counts.
    weights: Vec<Option<Vec<Inertial>>>,
    body_names: Taken,
    joint_names: Taken,
    geom_names: Taken,
    site_names: Taken,
}

impl Reader<'_> {
    /// Reads the children of a body, of a frame or of the world.
    fn content(&mut self, e: &Element, spot: Spot) -> Result<()> {
        for child in &e.children {
            match child.tag.as_str() {
                "body" => self.body(child, spot)?,
                "frame" => {
                    let class = self.classes.index(child, "childclass", spot.class)?;
                    let t_body_frame =
                        spot.t_body_frame * orientation::pose(child, self.compilers.of(child))?;
                    child.text("name");
                    self.content(child, Spot { t_body_frame, class, ..spot })?;
                }
                "joint" | "freejoint" => self.joint(child, spot)?,
                "geom" => self.geom(child, spot)?,
                "site" => self.site(child, spot)?,
                // Inertials are read with their bodies.
                _ => continue,
            }
            if child.used() == Use::None {
                child.take();
            }
        }
        Ok(())
    }

    fn body(&mut self, e: &Element, spot: Spot) -> Result<()> {
        let compiler = self.compilers.of(e);
        let t_parent_body = spot.t_body_frame * orientation::pose(e, compiler)?;
        self.body_names.add(e, "body")?;
        let name = e.name();
        if name == "world" {
            return Err(e.duplicate("body"));
        }
        let written = inertial::written(e, compiler)?;
        let index = self.tree.bodies.len();
        self.tree.bodies.push(Body {
            name,
            parent: spot.body,
            t_parent_body,
            joints: Vec::new(),
            inertial: None,
            geoms: Vec::new(),
            sites: Vec::new(),
            gravity_compensation: e.number("gravcomp")?.unwrap_or(0.0),
            is_mocap: e.switch("mocap")?.unwrap_or(false),
        });
        // Whose inertia is written need not have shapes that could weigh.
        let infers = match compiler.inertia_from {
            InertiaFrom::Geoms => true,
            InertiaFrom::Either => written.is_none(),
            InertiaFrom::Element => false,
        };
        self.weights.push(infers.then(Vec::new));
        let class = self.classes.index(e, "childclass", spot.class)?;
        let inside = Spot { body: Some(index), t_body_frame: Isometry3::identity(), class };
        self.content(e, inside)?;
        let inertial = match &self.weights[index] {
            Some(parts) => Inertial::joined(parts),
            None => written,
        };
        self.tree.bodies[index].inertial = inertial::bounded(inertial, compiler);
        let body = &self.tree.bodies[index];
        if body.is_mocap && !(body.joints.is_empty() && body.parent.is_none()) {
            return Err(e.misplaced("a mocap body has no joints and is in the world"));
        }
        if !body.joints.is_empty() && !self.tree.has_inertia(index) {
            let needs = "a body that moves needs a mass and an inertia (a geom, or an inertial)";
            self.tree.massless.get_or_insert_with(|| e.misplaced(needs));
        }
        Ok(())
    }

    fn joint(&mut self, e: &Element, spot: Spot) -> Result<()> {
        let Some(index) = spot.body else {
            return Err(e.misplaced("the world has no joints"));
        };
        let joint = if e.tag == "freejoint" {
            joint::JointSpec::free(e, self.compilers.of(e))?
        } else {
            let mut spec = self.classes.of(e, spot.class)?.joint.clone();
            spec.read(e, self.compilers.of(e))?;
            spec.build(e, self.compilers.of(e), &spot.t_body_frame)?
        };
        let body = &self.tree.bodies[index];
        if joint.kind == JointKind::Free && (body.parent.is_some() || !body.joints.is_empty()) {
            return Err(e.misplaced("a free joint must be the only one, of a body in the world"));
        }
        if body.joints.iter().any(|j| j.kind == JointKind::Free) {
            return Err(e.misplaced("a free body has no other joint"));
        }
        let joints = body.joints.iter().chain([&joint]);
        if joints.map(|joint| joint.kind.velocities()).sum::<usize>() > 6 {
            return Err(e.misplaced("a body has at most six degrees of freedom"));
        }
        self.joint_names.add(e, "joint")?;
        self.tree.bodies[index].joints.push(joint);
        Ok(())
    }

    fn geom(&mut self, e: &Element, spot: Spot) -> Result<()> {
        let mut spec = self.classes.of(e, spot.class)?.geom.clone();
        spec.read(e, self.compilers.of(e))?;
        let weighs = spot.body.is_some_and(|b| self.weights[b].is_some());
        let (geom, weight) =
            spec.build(e, self.compilers.of(e), self.assets, &spot.t_body_frame, weighs)?;
        self.geom_names.add(e, "geom")?;
        match spot.body {
            None => self.tree.geoms.push(geom),
            Some(index) => {
                self.tree.bodies[index].geoms.push(geom);
                self.weights[index].iter_mut().for_each(|all| all.extend(weight));
            }
        }
        Ok(())
    }

    fn site(&mut self, e: &Element, spot: Spot) -> Result<()> {
        let mut spec = self.classes.of(e, spot.class)?.site.clone();
        spec.read(e, self.compilers.of(e))?;
        self.site_names.add(e, "site")?;
        let site = spec.build(e, &spot.t_body_frame)?;
        match spot.body {
            None => self.tree.sites.push(site),
            Some(index) => self.tree.bodies[index].sites.push(site),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Model;
    use nalgebra::{Point3, UnitQuaternion, Vector3};

    fn read(worldbody: &str) -> Result<Model, String> {
        let xml = format!("<mujoco><worldbody>{worldbody}</worldbody></mujoco>");
        Model::from_str(&xml, None).map_err(|e| e.to_string())
    }

    #[test]
    fn frames_move_what_is_in_them() {
        let model = read(
            "<frame pos=\"1 2 3\" euler=\"0 0 90\"><body name=\"b\" pos=\"1 0 0\"><geom size=\"1\"/>\
            <frame pos=\"0 0 1\"><frame euler=\"0 90 0\"><site name=\"s\" pos=\"0 0 1\"/>\
            <joint axis=\"0 0 1\" pos=\"0.5 0 0\"/></frame></frame></body><geom size=\"1\"/></frame>",
        )
        .unwrap();
        let body = &model.bodies[0];
        let turn = UnitQuaternion::new(Vector3::z() * std::f64::consts::FRAC_PI_2);
        assert!(
            (body.t_parent_body.translation.vector - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-15
        );
        assert!(body.t_parent_body.rotation.angle_to(&turn) < 1e-15);
        let site = body.sites[0].t_body_site * Point3::origin();
        assert!((site - Point3::new(1.0, 0.0, 1.0)).norm() < 1e-15);
        let joint = &body.joints[0];
        assert!((*joint.axis - Vector3::x()).norm() < 1e-15);
        assert!((joint.anchor - Point3::new(0.0, 0.0, 0.5)).norm() < 1e-15);
        assert_eq!(
            model.world_geoms[0].t_body_geom.translation.vector,
            Vector3::new(1.0, 2.0, 3.0)
        );
    }

    #[test]
    fn bodies_come_depth_first_each_after_its_parent() {
        let model = read(
            "<body name=\"a\"><frame><body name=\"b\"/></frame><body name=\"c\"><body name=\"d\"/></body></body>\
            <body name=\"e\"/>",
        )
        .unwrap();
        let tree: Vec<_> = model.bodies.iter().map(|b| (b.name.as_str(), b.parent)).collect();
        let parents = [("a", None), ("b", Some(0)), ("c", Some(0)), ("d", Some(2)), ("e", None)];
        assert_eq!(tree, parents);
        assert_eq!(model.bodies.iter().position(|b| b.name == "d"), Some(3));
        assert!(model.bodies.iter().all(|b| b.inertial.is_none()));
    }

    #[test]
    fn inertia_is_written_or_that_of_the_geoms_that_count() {
        let mass = |compiler: &str, content: &str| {
            let xml = format!(
                "<mujoco><compiler {compiler}/><worldbody><body>{content}</body></worldbody></mujoco>"
            );
            Model::from_str(&xml, None).unwrap().bodies[0].inertial.map(|i| i.mass)
        };
        let geoms = "<geom size=\"1\" mass=\"2\"/><geom size=\"1\" mass=\"3\" group=\"4\"/><geom size=\"1\" mass=\"0\"/>";
        let both = format!("{geoms}<inertial pos=\"0 0 0\" mass=\"7\" diaginertia=\"1 1 1\"/>");
        assert_eq!(mass("", geoms), Some(5.0));
        assert_eq!(mass("inertiagrouprange=\"0 3\"", geoms), Some(2.0));
        assert_eq!(mass("", &both), Some(7.0));
        assert_eq!(mass("inertiafromgeom=\"true\"", &both), Some(5.0));
        assert_eq!(mass("inertiafromgeom=\"false\"", geoms), None);
        let density = mass("", "<geom type=\"box\" size=\"0.5 0.5 0.5\" density=\"3\"/>");
        assert_eq!(density, Some(3.0));
    }

    #[test]
    fn what_cannot_be_is_named_with_its_place() {
        for (worldbody, part) in [
            ("<joint/>", "line 1: joint: the world has no joints"),
            (
                "<body><geom size=\"1\"/><body><freejoint name=\"f\"/></body></body>",
                "freejoint 'f'",
            ),
            ("<body><joint/><freejoint/></body>", "must be the only one"),
            ("<body><freejoint/><joint/></body>", "no other joint"),
            ("<body name=\"a\"/><body name=\"a\"/>", "body 'a': another body has this name"),
            ("<body name=\"world\"/>", "another body"),
            ("<body><joint name=\"j\"/><joint name=\"j\"/></body>", "another joint"),
            ("<body pos=\"1 2\"/>", "body: pos must have 3 numbers, not 2"),
            ("<geom name=\"g\"/>", "geom 'g': size must be positive"),
            ("<geom size=\"1 2 3 4\"/>", "size has more than 3 numbers"),
            ("<geom size=\"1\" type=\"ball\"/>", "type is 'ball', none of: plane, sphere"),
            ("<geom size=\"1\" contype=\"1.5\"/>", "contype is '1.5', no whole number"),
            ("<geom size=\"1\" mass=\"-1\"/>", "mass must not be negative"),
            ("<geom size=\"1\" material=\"m\"/>", "material names 'm'"),
            ("<geom type=\"mesh\"/>", "mesh is missing"),
            ("<geom type=\"mesh\" mesh=\"m\"/>", "mesh names 'm'"),
            ("<geom type=\"capsule\" size=\"1\" fromto=\"0 0 0 0 0 0\"/>", "fromto has no length"),
            ("<geom size=\"1\" fromto=\"0 0 0 0 0 1\"/>", "fromto is for capsules"),
            ("<geom type=\"box\" size=\"1\" pos=\"0 0 1\" fromto=\"0 0 0 0 0 1\"/>", "beside pos"),
            ("<body><joint axis=\"0 0 0\"/></body>", "axis must not be zero"),
            ("<body><joint damping=\"-1\"/></body>", "damping must not be negative"),
            ("<body><inertial mass=\"1\"/></body>", "inertial: pos is missing"),
            ("<body><inertial pos=\"0 0 0\"/></body>", "inertial: mass is missing"),
        ] {
            let error = read(worldbody).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        // A place at the origin is none.
        let ends = "<geom type=\"box\" size=\"1\" pos=\"0 0 0\" fromto=\"0 0 0 0 0 1\"/>";
        assert!(read(ends).is_ok());
        let inertial = |more: &str| {
            let e = read(&format!("<body><inertial pos=\"0 0 0\" mass=\"1\" {more}/></body>"));
            e.map(|model| model.warnings.len())
        };
        assert!(
            inertial("diaginertia=\"-1 1 1\"").unwrap_err().contains("diaginertia must not be")
        );
        let turned = inertial("fullinertia=\"1 1 1 0 0 0\" euler=\"0 0 1\"");
        assert!(turned.unwrap_err().contains("beside an orientation"));
        assert_eq!(inertial("diaginertia=\"1 1 3\""), Ok(1));
        assert_eq!(inertial("diaginertia=\"1 1 2\""), Ok(0));
    }

    #[test]
    fn a_body_has_six_degrees_of_freedom() {
        let slides = |count: usize| {
            let joints = "<joint type=\"slide\"/>".repeat(count);
            read(&format!("<body><geom size=\"1\"/><joint type=\"ball\"/>{joints}</body>"))
        };
        assert!(slides(3).is_ok());
        let massless = |more: &str| read(&format!("<body name=\"b\"><joint/>{more}</body>"));
        assert!(massless("").unwrap_err().contains("body 'b': a body that moves needs a mass"));
        assert!(massless("<body><joint/><geom size=\"1\"/></body>").is_err());
        assert!(massless("<body><geom size=\"1\"/></body>").is_ok());
        // A mass without an inertia is none, whatever the joint.
        let point = "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"0 1 1\"/>";
        assert!(massless(point).is_err());
        assert!(massless(&format!("{point}<body><geom size=\"1\"/></body>")).is_ok());
        assert!(massless(&point.replace("0 1 1", "1 1 1")).is_ok());
        let mocap = |more: &str| read(&format!("<body mocap=\"true\">{more}</body>"));
        assert!(mocap("").unwrap().bodies[0].is_mocap && mocap("<freejoint/>").is_err());
        assert!(slides(4).unwrap_err().contains("a body has at most six degrees of freedom"));
    }
}
