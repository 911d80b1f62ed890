//! A robot's bodies, joints and actuators, and its smooth dynamics in given states, as JSON for comparison with other programs.
//!
//! `cargo run --release -p prehend-sim --example robot_dynamics -- robot.xml [--partial] [--root DIR] [--shapes CACHE] < states.jsonl`
//!
//! MJCF by default, URDF by the file's extension. The first line printed describes the model. For each line read, an object of `qpos`, `qvel`, `qacc`,
//! `ctrl` and `act` as MuJoCo has them (of a URDF `q`, `v` and `a` by joint), one is printed with the poses of all bodies, the mass matrix, the
//! accelerations without limits, equalities, dry friction and contacts, and the efforts that `qacc` takes. With `--shapes`, shapes that collide are made,
//! too: convex hulls, and distance grids that are kept in the folder.

use std::collections::BTreeMap;
use std::io::{BufRead, Write};
use std::path::Path;

use anyhow::Context;
use nalgebra::{DMatrix, DVector, Isometry3, Vector3};
use prehend_geometry::mjcf::{EqualityKind, Model as MjcfModel, Transmission};
use prehend_geometry::robot::{Drive, KinematicTree, Motion, RobotShape};
use prehend_geometry::{GridCache, Inertial, ReadOptions};
use prehend_sim::robot::{MjcfOptions, MjcfRobot, UrdfOptions};
use prehend_sim::{BodyId, Model, State};
use serde_json::{Value, json};

/// Degrees of freedom up to which mass matrices are printed.
const LARGEST_PRINTED: usize = 400;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().context("give a robot's file")?;
    let (mut options, mut cache) = (ReadOptions::default(), None);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--partial" => options.partial = true,
            "--inertia-from-geometry" => options.inertia_from_geometry = true,
            "--shapes" => cache = arguments.next(),
            "--root" => options.root = arguments.next().map(Into::into),
            other => anyhow::bail!("unknown option {other}"),
        }
    }
    let mut out = std::io::stdout().lock();
    let robot: Box<dyn Robot> = match Path::new(&file).extension() {
        Some(e) if e == "urdf" => Box::new(Urdf::new(&file, &options, cache)?),
        _ => Box::new(Mjcf::new(&file, &options, cache.is_some())?),
    };
    writeln!(out, "{}", robot.description())?;
    for line in std::io::stdin().lock().lines() {
        writeln!(out, "{}", robot.at(&serde_json::from_str(&line?)?)?)?;
        out.flush()?;
    }
    Ok(())
}

trait Robot {
    fn description(&self) -> Value;
    fn at(&self, state: &Value) -> anyhow::Result<Value>;
}

struct Mjcf {
    mjcf: MjcfModel,
    model: Model,
    robot: MjcfRobot,
}

impl Mjcf {
    fn new(file: &str, read: &ReadOptions, shapes: bool) -> anyhow::Result<Self> {
        let whole = MjcfModel::from_file_with(file, read)?;
        let mut mjcf = whole.clone();
        // Smooth dynamics alone.
        mjcf.equalities.iter_mut().for_each(|e| e.active = false);
        mjcf.tendons.iter_mut().for_each(|t| (t.range, t.friction_loss) = (None, 0.0));
        for joint in mjcf.bodies.iter_mut().flat_map(|b| &mut b.joints) {
            (joint.range, joint.friction_loss) = (None, 0.0);
        }
        let mut model = Model::new(mjcf.gravity);
        let partial = read.partial;
        let options = MjcfOptions { shapes, partial, ..MjcfOptions::default() };
        let robot = model.add_mjcf(&mjcf, &options)?;
        // Ranges are part of the description.
        Ok(Self { mjcf: whole, model, robot })
    }
}

impl Robot for Mjcf {
    fn description(&self) -> Value {
        let bodies = self.mjcf.bodies.iter().map(|b| body(&b.name, b.inertial.as_ref()));
        let joints =
            self.mjcf.bodies.iter().flat_map(|b| &b.joints).map(
                |j| json!({"name": j.name, "kind": format!("{:?}", j.kind), "range": j.range}),
            );
        let actuators = self.mjcf.actuators.iter().map(|a| {
            let transmission = match a.transmission {
                Transmission::Joint { .. } => "joint",
                Transmission::Tendon(_) => "tendon",
                Transmission::Site { .. } => "site",
                Transmission::SliderCrank { .. } => "slider-crank",
                Transmission::Adhesion(_) => "adhesion",
            };
            json!({"name": a.name, "transmission": transmission, "control": a.control_range})
        });
        let warnings = self.mjcf.warnings.iter().map(ToString::to_string);
        json!({
            "bodies": bodies.collect::<Vec<_>>(),
            "joints": joints.collect::<Vec<_>>(),
            "actuators": actuators.collect::<Vec<_>>(),
            "tendons": self.mjcf.tendons.len(),
            "equalities": self.mjcf.equalities.iter().map(|e| match e.kind {
                EqualityKind::Connect { .. } => "connect",
                EqualityKind::Weld { .. } => "weld",
                EqualityKind::Joint { .. } => "joint",
                EqualityKind::Tendon { .. } => "tendon",
            }).collect::<Vec<_>>(),
            "keyframes": self.mjcf.keyframes.len(),
            "warnings": warnings.chain(self.robot.warnings.iter().cloned()).collect::<Vec<_>>(),
        })
    }

    fn at(&self, state: &Value) -> anyhow::Result<Value> {
        let [qpos, qvel, qacc, ctrl, act] =
            ["qpos", "qvel", "qacc", "ctrl", "act"].map(|key| numbers(&state[key]));
        let mut model = self.model.clone();
        for ((_, id), control) in self.robot.actuators.iter().zip(ctrl) {
            model.joint_force_mut(*id).set_param("control", control)?;
        }
        let mut states = model.neutral_state();
        self.robot.set_positions(&model, &mut states, &qpos)?;
        self.robot.set_velocities(&model, &mut states, &qvel)?;
        self.robot.set_activations(&model, &mut states, &act)?;
        let acceleration = self.robot.accelerations(&model, &states);
        let mass = self.robot.mass_matrix(&model, &states);
        let effort = &mass * (DVector::from_vec(qacc) - DVector::from_column_slice(&acceleration));
        Ok(output(&states, &self.robot.bodies, &mass, &acceleration, effort.as_slice()))
    }
}

struct Urdf {
    tree: KinematicTree,
    model: Model,
    bodies: Vec<BodyId>,
}

impl Urdf {
    fn new(file: &str, read: &ReadOptions, cache: Option<String>) -> anyhow::Result<Self> {
        let tree = KinematicTree::from_urdf_file_with(file, read)?;
        if let Some(folder) = cache {
            let (spacing, margin) = (RobotShape::DEFAULT_SPACING, RobotShape::DEFAULT_MARGIN);
            RobotShape::cached(&tree, spacing, margin, Some(&GridCache::new(folder)))?;
        }
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        // Where joints move no mass, next to none.
        let [plain, least] =
            [0.0, 1e-9].map(|armature| UrdfOptions { armature, ..UrdfOptions::default() });
        let bodies = model
            .add_articulated_robot(&tree, None, &plain)
            .or_else(|_| model.add_articulated_robot(&tree, None, &least))?;
        model.joint_forces.clear();
        Ok(Self { tree, model, bodies })
    }
}

impl Robot for Urdf {
    fn description(&self) -> Value {
        let bodies = self.tree.links().iter().map(|l| body(&l.name, l.inertial.as_ref()));
        let moving = self.tree.joints().iter().filter(|j| j.motion != Motion::Fixed);
        let joints = moving.map(|j| {
            let mimics = !matches!(j.drive, Drive::Variable { index, .. } if self.tree.joint_names()[index] == j.name);
            json!({"name": j.name, "range": j.limits, "mimics": mimics})
        });
        json!({"bodies": bodies.collect::<Vec<_>>(), "joints": joints.collect::<Vec<_>>()})
    }

    fn at(&self, state: &Value) -> anyhow::Result<Value> {
        let mut states = self.model.neutral_state();
        let own = &self.model.articulations[0];
        let (n, mut order) = (own.tree.nv(), Vec::new());
        let [mut q, mut v, mut a] = [(); 3].map(|()| vec![0.0; n]);
        // Followers after what they mimic, to be where they are told.
        let mut joints: Vec<_> =
            self.tree.joints().iter().filter(|joint| joint.motion != Motion::Fixed).collect();
        joints.sort_by_key(|joint| !self.tree.joint_names().contains(&joint.name));
        for joint in joints {
            let body = self.bodies[joint.child];
            let place = own.bodies().iter().position(|link| *link == body).context("no link")?;
            let dof = own.tree.range(place)[1].start;
            for (to, key) in [(&mut q, "q"), (&mut v, "v"), (&mut a, "a")] {
                to[dof] = state[key][&joint.name].as_f64().context("a joint without a value")?;
            }
            order.push((joint.name.clone(), dof));
            self.model.set_joint(&mut states, body, &[q[dof]], &[v[dof]])?;
        }
        let at = own.tree.kinematics(&q, &v).under(self.model.gravity);
        let (mass, effort) = (at.mass_matrix(), at.inverse_dynamics(&a));
        let acceleration = at.forward_dynamics(&vec![0.0; n]);
        let mut all =
            output(&states, &self.bodies, &mass, acceleration.as_slice(), effort.as_slice());
        all["order"] = json!(order.into_iter().collect::<BTreeMap<_, _>>());
        Ok(all)
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

fn body(name: &str, inertial: Option<&Inertial>) -> Value {
    let inertia = inertial.map(|i| i.inertia.iter().copied().collect::<Vec<f64>>());
    let com = inertial.map(|i| i.com.coords.iter().copied().collect::<Vec<f64>>());
    json!({"name": name, "mass": inertial.map_or(0.0, |i| i.mass), "com": com, "inertia": inertia})
}

fn output(
    states: &State,
    bodies: &[BodyId],
    mass: &DMatrix<f64>,
    acceleration: &[f64],
    effort: &[f64],
) -> Value {
    let pose = |t: Isometry3<f64>| t.to_homogeneous().iter().copied().collect::<Vec<f64>>();
    let poses: Vec<_> = bodies.iter().map(|body| pose(states[*body].pose)).collect();
    json!({
        "poses": poses,
        "mass": if mass.nrows() > LARGEST_PRINTED { &[] } else { mass.as_slice() },
        "acceleration": acceleration,
        "effort": effort,
    })
}
