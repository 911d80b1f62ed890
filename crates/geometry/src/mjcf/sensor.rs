//! Sensors whose readings follow from a state.

use nalgebra::Isometry3;

use super::actuator::PlacedFrame;
use super::element::Element;
use super::error::Result;
use super::names::Names;
use super::shape::Shape;
use super::{JointIndex, Model};

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Its name, empty where it has none.
    pub name: String,
    /// Measured quantity.
    pub quantity: Quantity,
    /// Largest size of each number that it shows; of rotations and axes there is none.
    pub cutoff: f64,
}

/// A measured quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// Angle \[rad\], displacement \[m\], or, of a ball, quaternion (w, x, y, z).
    JointPosition(JointIndex),
    /// Its rate, of a ball the angular velocity along the body's axes \[rad/s\].
    JointVelocity(JointIndex),
    /// Length of a tendon \[m\].
    TendonLength(usize),
    /// Its rate.
    TendonVelocity(usize),
    /// Length of what an actuator pulls at, gear included.
    ActuatorLength(usize),
    /// Its rate.
    ActuatorVelocity(usize),
    /// Pose or velocity of a frame in another, or else in the world.
    Frame {
        /// Which of them.
        part: FramePart,
        /// The frame.
        frame: PlacedFrame,
        /// The frame that it is measured in.
        reference: Option<PlacedFrame>,
    },
    /// Velocity of a frame's origin along its axes \[m/s\].
    Velocimeter(PlacedFrame),
    /// Angular velocity along a frame's axes \[rad/s\].
    Gyro(PlacedFrame),
    /// Acceleration of a frame's origin less that of free fall, along its axes \[m/s²\].
    Accelerometer(PlacedFrame),
    /// Center of mass of a body and all that it carries \[m\]; `None` is the world.
    SubtreeCenter(Option<usize>),
    /// Its velocity \[m/s\].
    SubtreeVelocity(Option<usize>),
    /// Angular momentum about it \[kg m²/s\].
    SubtreeMomentum(Option<usize>),
}

/// A part of a frame's pose or velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FramePart {
    /// \[m\]
    Position,
    /// Quaternion (w, x, y, z).
    Orientation,
    /// Unit vector along x (0), y or z.
    Axis(usize),
    /// \[m/s\]
    LinearVelocity,
    /// \[rad/s\]
    AngularVelocity,
}

impl FramePart {
    const WORDS: [(&str, Self); 7] = [
        ("framepos", Self::Position),
        ("framequat", Self::Orientation),
        ("framexaxis", Self::Axis(0)),
        ("frameyaxis", Self::Axis(1)),
        ("framezaxis", Self::Axis(2)),
        ("framelinvel", Self::LinearVelocity),
        ("frameangvel", Self::AngularVelocity),
    ];

    fn turns(self) -> bool {
        matches!(self, Self::Orientation | Self::Axis(_))
    }
}

/// The sensors of `root` that a state determines; others are logged.
pub(super) fn read(root: &Element, model: &Model, names: &Names) -> Result<Vec<Sensor>> {
    let mut all = Vec::new();
    for e in root.in_sections("sensor") {
        let Some(quantity) = quantity(e, root, model, names)? else {
            log::info!("{}: passed over, as more than the state determines it", e.place());
            continue;
        };
        let free = matches!(quantity, Quantity::Frame { part, .. } if part.turns());
        let cutoff = e.magnitude("cutoff")?.filter(|cutoff| *cutoff > 0.0 && !free);
        all.push(Sensor { name: e.name(), quantity, cutoff: cutoff.unwrap_or(f64::INFINITY) });
    }
    Ok(all)
}

/// The quantity that `e` measures; `None` where it is not read, or what it is measured of is not.
fn quantity(e: &Element, root: &Element, model: &Model, names: &Names) -> Result<Option<Quantity>> {
    let joint = || names.joints.get(e, "joint");
    let tendon = || names.tendons.get(e, "tendon");
    let body = || names.bodies.get(e, "body");
    let site = || -> Result<PlacedFrame> {
        let (body, t_body_frame) = names.sites.get(e, "site")?;
        Ok(PlacedFrame { body, t_body_frame })
    };
    let actuator = || -> Result<Option<usize>> {
        let name = e.text("actuator").ok_or_else(|| e.missing("actuator"))?;
        let is_written = || root.in_sections("actuator").any(|own| own.peek("name") == Some(name));
        match model.actuators.iter().position(|own| own.name == name) {
            None if !is_written() => Err(e.unknown("actuator", name)),
            found => Ok(found),
        }
    };
    Ok(Some(match e.tag.as_str() {
        "jointpos" | "ballquat" => Quantity::JointPosition(joint()?),
        "jointvel" | "ballangvel" => Quantity::JointVelocity(joint()?),
        "tendonpos" => return Ok(tendon()?.map(Quantity::TendonLength)),
        "tendonvel" => return Ok(tendon()?.map(Quantity::TendonVelocity)),
        "actuatorpos" => return Ok(actuator()?.map(Quantity::ActuatorLength)),
        "actuatorvel" => return Ok(actuator()?.map(Quantity::ActuatorVelocity)),
        "velocimeter" => Quantity::Velocimeter(site()?),
        "gyro" => Quantity::Gyro(site()?),
        "accelerometer" => Quantity::Accelerometer(site()?),
        "subtreecom" => Quantity::SubtreeCenter(body()?),
        "subtreelinvel" => Quantity::SubtreeVelocity(body()?),
        "subtreeangmom" => Quantity::SubtreeMomentum(body()?),
        tag => {
            let Some((_, part)) = FramePart::WORDS.into_iter().find(|(word, _)| *word == tag)
            else {
                return Ok(None);
            };
            let found = frame(e, ["objtype", "objname"], part, model, names)?;
            let Some(frame) = found else { return Ok(None) };
            let mut reference = None;
            if e.has("reftype") {
                let found = self::frame(e, ["reftype", "refname"], part, model, names)?;
                let Some(found) = found else { return Ok(None) };
                reference = Some(found);
            }
            Quantity::Frame { part, frame, reference }
        }
    }))
}

/// The frame that attributes name; `None` of a camera, and of a mesh or a body's inertia, whose axes are MuJoCo's choice.
fn frame(
    e: &Element,
    [kind, name]: [&'static str; 2],
    part: FramePart,
    model: &Model,
    names: &Names,
) -> Result<Option<PlacedFrame>> {
    let (body, t_body_frame) = match e.text(kind) {
        Some("site") => names.sites.get(e, name)?,
        Some("xbody") => (names.bodies.get(e, name)?, Isometry3::identity()),
        Some("body") => {
            let body = names.bodies.get(e, name)?;
            let inertial = body.and_then(|body| model.bodies[body].inertial);
            let center = inertial.map_or(Isometry3::identity(), |own| own.com.coords.into());
            if part.turns() || kind == "reftype" {
                return Ok(None);
            }
            (body, center)
        }
        Some("geom") => match names.geom(e, name, model)? {
            (_, geom) if matches!(geom.shape, Shape::Mesh(_)) => return Ok(None),
            (body, geom) => (body, geom.t_body_geom),
        },
        _ => return Ok(None),
    };
    Ok(Some(PlacedFrame { body, t_body_frame }))
}
