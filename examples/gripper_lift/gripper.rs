//! The gripper, of MJCF where that is at hand, of URDF otherwise.

use std::path::Path;

use anyhow::Context;
use nalgebra::{Isometry3, Point3, Vector3};
use prehend::geometry::mjcf::Model as MjcfModel;
use prehend::geometry::robot::{KinematicTree, RobotShape};
use prehend::sim::contact::LawError;
use prehend::sim::prelude::*;

/// Two fingers that slide towards each other under a plate.
const URDF: &str = r#"<robot name="slides">
  <link name="plate">
    <inertial><origin xyz="0 0 0"/><mass value="0.5"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial>
    <collision><geometry><box size="0.04 0.13 0.02"/></geometry></collision>
  </link>
  <link name="left">
    <inertial><origin xyz="0 0 0.05"/><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-5"/></inertial>
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.024 0.01 0.1"/></geometry></collision>
  </link>
  <link name="right">
    <inertial><origin xyz="0 0 0.05"/><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-5"/></inertial>
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.024 0.01 0.1"/></geometry></collision>
  </link>
  <joint name="left" type="prismatic"><parent link="plate"/><child link="left"/><origin xyz="0 0.05 0"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.05" effort="20" velocity="1"/><dynamics damping="5"/></joint>
  <joint name="right" type="prismatic"><parent link="plate"/><child link="right"/><origin xyz="0 -0.05 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.05" effort="20" velocity="1"/><dynamics damping="5"/></joint>
</robot>"#;

/// A gripper that hangs on a lift, over the origin.
pub(crate) struct Gripper {
    pub(crate) name: String,
    /// Base, which the lift moves.
    pub(crate) base: BodyId,
    /// Pads, which press.
    pub(crate) pads: [BodyId; 2],
    /// Corners of each body that is drawn.
    pub(crate) corners: Vec<(BodyId, Vec<Point3<f64>>)>,
    lift: JointForceId,
    /// Joint forces that close it, with the parameter to set and its value when closed.
    closers: Vec<(JointForceId, &'static str, f64)>,
}

impl Gripper {
    pub(crate) fn add(model: &mut Model) -> anyhow::Result<Self> {
        let data = std::env::var_os("PREHEND_DATA").unwrap_or_else(|| "../shared/data".into());
        let file = Path::new(&data).join("robots/robotiq_2f85/2f85.xml");
        if file.is_file() { Self::from_mjcf(model, &file) } else { Self::from_urdf(model) }
    }

    /// The gripper of the file, upside down: 0.16 m from its base to where it pinches.
    fn from_mjcf(model: &mut Model, file: &Path) -> anyhow::Result<Self> {
        let mjcf = MjcfModel::from_file(file)?;
        // Up is the model's −z.
        let base = Joint::Prismatic(-Vector3::z_axis());
        let t_world_mjcf = over(0.19);
        let options = MjcfOptions { t_world_mjcf, base, ..MjcfOptions::default() };
        let robot = model.add_mjcf(&mjcf, &options)?;
        for warning in &robot.warnings {
            println!("not read: {warning}");
        }
        let body = |name: &str| robot.body(name).with_context(|| format!("no body {name}"));
        let base = body("base_mount")?;
        let closer = robot.actuator("fingers_actuator").context("no actuator")?;
        let corners = robot.bodies.iter().filter_map(|&body| {
            let surface = model.bodies[body].surface.as_ref()?;
            Some((body, surface.points().iter().map(|point| point.position).collect()))
        });
        Ok(Self {
            name: mjcf.name.clone(),
            base,
            pads: [body("left_pad")?, body("right_pad")?],
            corners: corners.collect(),
            lift: lift(model, base)?,
            closers: vec![(closer, "control", 255.0)],
        })
    }

    fn from_urdf(model: &mut Model) -> anyhow::Result<Self> {
        let robot = KinematicTree::from_urdf_str(URDF, None)?;
        let shape = RobotShape::new(&robot, 2e-3, 8e-3)?;
        let base = Joint::Prismatic(-Vector3::z_axis());
        let options = UrdfOptions { t_world_base: over(0.12), base, ..UrdfOptions::default() };
        let links = model.add_articulated_robot(&robot, Some(&shape), &options)?;
        let link = |name: &str| {
            Ok::<_, anyhow::Error>(links[robot.link_index(name).context("no such link")?])
        };
        let pads = [link("left")?, link("right")?];
        let servo = PositionServo { target: 0.0, stiffness: 1e3, damping: 30.0, max_effort: 10.0 };
        let closers = pads.map(|pad| model.add_joint_force(pad, servo)).into_iter();
        let closers = closers.map(|id| Ok((id?, "target", 0.05)));
        let parts = robot.links().iter().zip(&links);
        let corners = parts.map(|(link, body)| {
            (*body, link.parts.iter().flat_map(|part| part.vertices.clone()).collect())
        });
        let base = link("plate")?;
        Ok(Self {
            name: robot.name().to_owned(),
            base,
            pads,
            corners: corners.collect(),
            closers: closers.collect::<anyhow::Result<_>>()?,
            lift: lift(model, base)?,
        })
    }

    /// Closes by a part of all it can, and goes to a height \[m\] over that at the start.
    pub(crate) fn command(
        &self,
        model: &mut Model,
        closed: f64,
        height: f64,
    ) -> Result<(), LawError> {
        for (id, param, most) in &self.closers {
            model.joint_force_mut(*id).set_param(param, closed * most)?;
        }
        model.joint_force_mut(self.lift).set_param("target", height)
    }
}

/// Upside down at this height \[m\].
fn over(height: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.0, 0.0, height), Vector3::x() * std::f64::consts::PI)
}

/// A stiff servo that carries the gripper.
fn lift(model: &mut Model, base: BodyId) -> anyhow::Result<JointForceId> {
    let servo =
        PositionServo { target: 0.0, stiffness: 2e4, damping: 4e2, max_effort: f64::INFINITY };
    Ok(model.add_joint_force(base, servo)?)
}
