//! MJCF models against MuJoCo: `benches/peers/sim/mjcf_golden.py` has made the values.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use prehend_geometry::ReadOptions;
use prehend_geometry::mjcf::{
    Actuator, Body, Dynamics, Equality, EqualityKind, Geom, Joint, JointIndex, JointKind, Model,
    Shape, SolverParameters, Tendon, Transmission,
};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/mjcf.json");

fn golden() -> Value {
    serde_json::from_str(GOLDEN).unwrap()
}

/// All numbers in `value`, however nested.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap()
}

/// Largest differences by what has been compared.
#[derive(Default)]
struct Differences(BTreeMap<&'static str, f64>);

impl Differences {
    /// Compares with the numbers of `expected`, relative to the largest of them and at least to `scale`.
    fn add(&mut self, what: &'static str, scale: f64, found: &[f64], expected: &Value) {
        let expected = numbers(expected);
        assert_eq!(found.len(), expected.len(), "{what}");
        let size = expected.iter().fold(scale, |size, x| size.max(x.abs()));
        let worst = self.0.entry(what).or_insert(0.0);
        for (a, b) in found.iter().zip(&expected) {
            let difference = (a - b).abs() / size;
            assert!(difference.is_finite(), "{what}: {a}");
            *worst = worst.max(difference);
        }
    }

    /// As `add`, of a range that may be absent.
    fn range(&mut self, what: &'static str, found: Option<(f64, f64)>, expected: &Value) {
        assert_eq!(found.is_some(), !expected.is_null(), "{what}: {found:?} {expected}");
        if let Some((low, high)) = found {
            self.add(what, 1.0, &[low, high], expected);
        }
    }

    fn rotation(&mut self, what: &'static str, found: &UnitQuaternion<f64>, expected: &Value) {
        let matrix = found.to_rotation_matrix();
        let rows = matrix.matrix().transpose();
        self.add(what, 1.0, rows.as_slice(), expected);
    }

    fn pose(&mut self, what: [&'static str; 2], found: &Isometry3<f64>, expected: &Value) {
        self.add(what[0], 1.0, found.translation.vector.as_slice(), &expected["pos"]);
        let q = numbers(&expected["quat"]);
        let expected =
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]));
        let angle = found.rotation.rotation_to(&expected).imag().norm();
        let worst = self.0.entry(what[1]).or_insert(0.0);
        *worst = worst.max(2.0 * angle);
    }

    fn solver(&mut self, found: &SolverParameters, expected: &Value) {
        let all: Vec<f64> = found.reference.iter().chain(&found.impedance).copied().collect();
        self.add("solver parameters", 1.0, &all, expected);
    }

    fn bodies(&mut self, found: &[Body], expected: &Value) {
        let expected = expected.as_array().unwrap();
        assert_eq!(found.len(), expected.len());
        for (body, golden) in found.iter().zip(expected) {
            assert_eq!(body.name, text(&golden["name"]));
            let parent = body.parent.map_or(-1, |p| p as i64);
            assert_eq!(parent, golden["parent"].as_i64().unwrap(), "{}", body.name);
            self.pose(["body position", "body rotation"], &body.t_parent_body, golden);
            self.add(
                "gravity compensation",
                1.0,
                &[body.gravity_compensation],
                &golden["gravcomp"],
            );
            let Some(inertial) = body.inertial else {
                assert_eq!(golden["mass"].as_f64(), Some(0.0), "{}", body.name);
                continue;
            };
            let [mass, com, inertia] = match golden["by_mesh"].as_bool().unwrap() {
                // A difference quotient there, its limit here.
                _ if body.name == "egg" => ["body mass", "body center of mass", "ellipsoid shell"],
                true => ["mass of meshes", "center of mass of meshes", "inertia of meshes"],
                false => ["body mass", "body center of mass", "body inertia"],
            };
            self.add(mass, 0.0, &[inertial.mass], &golden["mass"]);
            self.add(com, 0.1, inertial.com.coords.as_slice(), &golden["com"]);
            self.add(inertia, 0.0, inertial.inertia.as_slice(), &golden["inertia"]);
        }
    }

    fn joint(&mut self, joint: &Joint, golden: &Value) {
        assert_eq!(joint.name, text(&golden["name"]));
        let kind = match joint.kind {
            JointKind::Free => "free",
            JointKind::Ball => "ball",
            JointKind::Slide => "slide",
            JointKind::Hinge => "hinge",
        };
        assert_eq!(kind, text(&golden["kind"]), "{}", joint.name);
        if joint.kind != JointKind::Free {
            self.add("joint anchor", 1.0, joint.anchor.coords.as_slice(), &golden["pos"]);
        }
        if matches!(joint.kind, JointKind::Hinge | JointKind::Slide) {
            self.add("joint axis", 1.0, joint.axis.as_slice(), &golden["axis"]);
        }
        self.range("joint range", joint.range, &golden["range"]);
        self.range("joint force range", joint.actuator_force_range, &golden["force"]);
        for (key, value) in [
            ("ref", joint.reference),
            ("springref", joint.spring_reference),
            ("stiffness", joint.stiffness),
            ("damping", joint.damping),
            ("armature", joint.armature),
            ("frictionloss", joint.friction_loss),
        ] {
            self.add(key, 1e-3, &[value], &golden[key]);
        }
        self.solver(&joint.limit_solver, &golden["solver"]);
    }

    fn geom(&mut self, geom: &Geom, golden: &Value) {
        assert_eq!(geom.name, text(&golden["name"]));
        let [contact, affinity] =
            [geom.contact_type, geom.contact_affinity].map(|bits| f64::from(bits.cast_signed()));
        let told = [
            contact,
            affinity,
            f64::from(geom.contact_dimensions),
            f64::from(geom.priority),
            f64::from(geom.group),
        ];
        self.add("geom contact", 1.0, &told, &golden["contact"]);
        let solver = geom.solver.reference.iter().chain(&geom.solver.impedance);
        let mut all: Vec<f64> = geom.friction.iter().chain(solver).copied().collect();
        all.push(geom.margin);
        self.add("geom numbers", 1e-3, &all, &golden["numbers"]);
        let (kind, size) = match &geom.shape {
            Shape::Plane { half_extents: [x, y] } => ("plane", vec![*x, *y]),
            Shape::Sphere { radius } => ("sphere", vec![*radius]),
            Shape::Capsule { radius, half_length } => ("capsule", vec![*radius, *half_length]),
            Shape::Cylinder { radius, half_length } => ("cylinder", vec![*radius, *half_length]),
            Shape::Ellipsoid { radii } => ("ellipsoid", radii.as_slice().to_vec()),
            Shape::Box { half_extents } => ("box", half_extents.as_slice().to_vec()),
            Shape::Mesh(mesh) => {
                assert_eq!(text(&golden["kind"]), "mesh");
                let (low, high) = mesh.transformed(&geom.t_body_geom).bounds().unwrap();
                let bounds: Vec<f64> = low.iter().chain(high.iter()).copied().collect();
                self.add("mesh bounds", 0.1, &bounds, &golden["bounds"]);
                return;
            }
            Shape::HeightField(_) => ("hfield", Vec::new()),
        };
        assert_eq!(kind, text(&golden["kind"]));
        let expected = numbers(&golden["size"])[..size.len()].to_vec();
        let [what_size, position, rotation] = match golden["fitted"].as_bool().unwrap() {
            true => ["fitted size", "fitted position", "fitted rotation"],
            false => ["geom size", "geom position", "geom rotation"],
        };
        self.add(what_size, 1e-3, &size, &expected.into());
        self.add(position, 0.1, geom.t_body_geom.translation.vector.as_slice(), &golden["pos"]);
        let turn = geom.t_body_geom.rotation.to_rotation_matrix();
        let outer = turn.matrix()
            * Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0))
            * turn.matrix().transpose();
        self.add(rotation, 1.0, outer.as_slice(), &golden["outer"]);
    }

    fn actuator(&mut self, model: &Model, actuator: &Actuator, golden: &Value) {
        let name = &actuator.name;
        assert_eq!(name, text(&golden["name"]));
        let (kind, target) = match actuator.transmission {
            Transmission::Joint { joint, .. } => ("joint", &model.joint(joint).name),
            Transmission::Tendon(tendon) => ("tendon", &model.tendons[tendon].name),
            other => panic!("{other:?}"),
        };
        assert_eq!(
            (kind, target.as_str()),
            (text(&golden["kind"]), text(&golden["target"])),
            "{name}"
        );
        let filter = match actuator.dynamics {
            Dynamics::Filter(constant) => Value::from(constant),
            _ => Value::Null,
        };
        assert_eq!(filter.as_f64(), golden["filter"].as_f64(), "{name}");
        assert_eq!(
            actuator.dynamics == Dynamics::Integrator,
            golden["integrates"].as_bool().unwrap(),
            "{name}"
        );
        self.add("actuator gear", 1.0, &actuator.gear[..1], &golden["gear"]);
        self.add("actuator gain", 0.1, &actuator.gain, &golden["gain"]);
        // What damps by a ratio follows in the simulator, and is compared there.
        let mut bias = golden["bias"].clone();
        if actuator.damping_ratio.is_some() {
            bias[2] = 0.0.into();
        }
        self.add("actuator bias", 0.1, &actuator.bias, &bias);
        self.range("control range", actuator.control_range, &golden["control"]);
        self.range("force range", actuator.force_range, &golden["force"]);
        self.range("activation range", actuator.activation_range, &golden["activation"]);
    }

    fn tendon(&mut self, model: &Model, tendon: &Tendon, golden: &Value) {
        assert_eq!(tendon.name, text(&golden["name"]));
        let names: Vec<&str> =
            tendon.joints.iter().map(|t| model.joint(t.joint).name.as_str()).collect();
        let expected: Vec<&str> = golden["joints"].as_array().unwrap().iter().map(text).collect();
        assert_eq!(names, expected);
        let coefficients: Vec<f64> = tendon.joints.iter().map(|t| t.coefficient).collect();
        self.add("tendon coefficients", 1.0, &coefficients, &golden["coefficients"]);
        self.range("tendon range", tendon.range, &golden["range"]);
        self.add(
            "tendon spring",
            1.0,
            &tendon.spring_range.map_or([f64::NAN; 2], |(low, high)| [low, high]),
            &golden["spring"],
        );
        let told = [tendon.stiffness, tendon.damping, tendon.friction_loss, tendon.armature];
        self.add("tendon numbers", 1.0, &told, &golden["numbers"]);
    }

    fn equality(&mut self, model: &Model, equality: &Equality, golden: &Value) {
        assert_eq!(equality.name, text(&golden["name"]));
        assert_eq!(equality.active, golden["active"].as_bool().unwrap());
        self.solver(&equality.solver, &golden["solver"]);
        let bodies =
            |bodies: &[Option<usize>; 2]| bodies.map(|b| b.map_or(-1.0, |b| b as f64)).to_vec();
        let both = |points: &[Point3<f64>; 2]| -> Vec<f64> {
            points.iter().flat_map(|p| p.iter().copied()).collect()
        };
        let kind = text(&golden["kind"]);
        match &equality.kind {
            EqualityKind::Tendon { .. } => panic!("not among the golden values"),
            EqualityKind::Connect { bodies: of, anchors } => {
                assert_eq!(kind, "connect");
                assert_eq!(bodies(of), numbers(&golden["bodies"]));
                self.add("connect anchors", 1.0, &both(anchors), &golden["anchors"]);
            }
            EqualityKind::Weld { bodies: of, anchors, rotation, torque_scale } => {
                assert_eq!(kind, "weld");
                assert_eq!(bodies(of), numbers(&golden["bodies"]));
                self.add("weld anchors", 1.0, &both(anchors), &golden["anchors"]);
                self.rotation("weld rotation", rotation, &golden["rotation"]);
                self.add("weld scale", 1.0, &[*torque_scale], &golden["scale"]);
            }
            EqualityKind::Joint { joints: (first, second), polynomial } => {
                assert_eq!(kind, "joint");
                let name = |joint: &JointIndex| model.joint(*joint).name.as_str();
                assert_eq!(name(first), text(&golden["joints"][0]));
                assert_eq!(second.as_ref().map_or("", name), text(&golden["joints"][1]));
                self.add("joint polynomial", 1.0, polynomial, &golden["numbers"]);
            }
        }
    }

    fn model(&mut self, model: &Model, golden: &Value) {
        self.add("gravity", 1.0, model.gravity.as_slice(), &golden["gravity"]);
        self.bodies(&model.bodies, &golden["bodies"]);
        let list = |key: &str| golden[key].as_array().unwrap();

        let joints: Vec<JointIndex> = model.joint_indices().collect();
        assert_eq!(joints.len(), list("joints").len());
        for (&joint, golden) in joints.iter().zip(list("joints")) {
            assert_eq!(joint.body as i64, golden["body"].as_i64().unwrap());
            self.joint(model.joint(joint), golden);
        }

        let bodies = || model.bodies.iter().enumerate().map(|(b, body)| (b as i64, body));
        let of_bodies = bodies().flat_map(|(b, body)| body.geoms.iter().map(move |g| (b, g)));
        let geoms: Vec<_> = model.world_geoms.iter().map(|g| (-1, g)).chain(of_bodies).collect();
        assert_eq!(geoms.len(), list("geoms").len());
        for ((body, geom), golden) in geoms.into_iter().zip(list("geoms")) {
            assert_eq!(body, golden["body"].as_i64().unwrap());
            self.geom(geom, golden);
        }

        let of_bodies = bodies().flat_map(|(b, body)| body.sites.iter().map(move |s| (b, s)));
        let sites: Vec<_> = model.world_sites.iter().map(|s| (-1, s)).chain(of_bodies).collect();
        assert_eq!(sites.len(), list("sites").len());
        for ((body, site), golden) in sites.into_iter().zip(list("sites")) {
            assert_eq!(
                (body, site.name.as_str()),
                (golden["body"].as_i64().unwrap(), text(&golden["name"]))
            );
            self.pose(["site position", "site rotation"], &site.t_body_site, golden);
        }

        assert_eq!(model.actuators.len(), list("actuators").len());
        for (actuator, golden) in model.actuators.iter().zip(list("actuators")) {
            self.actuator(model, actuator, golden);
        }
        assert_eq!(model.tendons.len(), list("tendons").len());
        for (tendon, golden) in model.tendons.iter().zip(list("tendons")) {
            self.tendon(model, tendon, golden);
        }
        assert_eq!(model.equalities.len(), list("equalities").len());
        for (equality, golden) in model.equalities.iter().zip(list("equalities")) {
            self.equality(model, equality, golden);
        }

        let mut exclusions: Vec<[i64; 2]> =
            model.exclusions.iter().map(|pair| pair.map(|b| b.map_or(-1, |b| b as i64))).collect();
        exclusions.iter_mut().for_each(|pair| pair.sort());
        exclusions.sort();
        let expected: Vec<f64> = list("exclusions").iter().flat_map(numbers).collect();
        assert_eq!(exclusions.concat().iter().map(|&b| b as f64).collect::<Vec<_>>(), expected);

        assert_eq!(model.keyframes.len(), list("keyframes").len());
        for (frame, golden) in model.keyframes.iter().zip(list("keyframes")) {
            assert_eq!(frame.name, text(&golden["name"]));
            self.add("keyframe time", 1.0, &[frame.time], &golden["time"]);
            self.add("keyframe positions", 1.0, &frame.positions, &golden["positions"]);
            self.add("keyframe velocities", 1.0, &frame.velocities, &golden["velocities"]);
            self.add("keyframe controls", 1.0, &frame.controls, &golden["controls"]);
        }
    }

    /// Prints the differences and asserts that they are small.
    fn check(self, file: &str) {
        println!("{file}");
        for (what, worst) in &self.0 {
            println!("  {what}: {worst:.1e}");
            // MuJoCo keeps the vertices of meshes in single precision, and what follows from them.
            let single = [
                "mesh bounds",
                "mass of meshes",
                "center of mass of meshes",
                "inertia of meshes",
                "fitted size",
                "fitted position",
                "fitted rotation",
            ];
            let bound = match *what {
                "ellipsoid shell" => 1e-4,
                _ if single.contains(what) => 1e-6,
                _ => 1e-9,
            };
            assert!(*worst <= bound, "{file}: {what}: {worst:e}");
        }
    }
}

fn compare(folder: &Path, golden: &Value) -> Model {
    let file = text(&golden["file"]);
    let partial = ReadOptions { partial: true, ..ReadOptions::default() };
    let mut model = Model::from_file_with(folder.join(file), &partial).unwrap();
    // What came later is compared in the simulator's tests.
    let known: Vec<&str> =
        golden["actuators"].as_array().unwrap().iter().map(|a| text(&a["name"])).collect();
    let mask: Vec<bool> =
        model.actuators.iter().map(|own| known.contains(&own.name.as_str())).collect();
    for key in &mut model.keyframes {
        let mut keep = mask.iter();
        key.controls.retain(|_| *keep.next().unwrap());
    }
    model.actuators.retain(|own| known.contains(&own.name.as_str()));
    model.equalities.retain(|own| !matches!(own.kind, EqualityKind::Tendon { .. }));
    model.tendons.retain(|own| own.parts.is_empty());
    let mut differences = Differences::default();
    differences.model(&model, golden);
    differences.check(file);
    model
}

fn authored() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/mjcf")
}

#[test]
fn a_model_that_uses_all_that_is_read_is_as_mujoco_has_it() {
    let model = compare(&authored(), &golden()["authored"]);
    assert_eq!(model.time_step, 0.001);
    // All that it has beside is named.
    let left_out: Vec<(&str, Option<&str>)> =
        model.warnings.iter().map(|w| (w.place.element.as_str(), w.attribute.as_deref())).collect();
    let expected = [("geom", Some("fluidshape")), ("general", None)];
    assert_eq!(left_out, expected);
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn robots_are_as_mujoco_has_them() {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = PathBuf::from(std::env::var("PREHEND_DATA").unwrap_or_else(|_| default.into()));
    for golden in golden()["robots"].as_array().unwrap() {
        let model = compare(&data.join("robots"), golden);
        for warning in &model.warnings {
            println!("  {warning}");
        }
    }
}
