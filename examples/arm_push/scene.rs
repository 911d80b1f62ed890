//! An arm at a table with a box.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};
use prehend::sim::contact::Bounce;
use prehend::sim::prelude::*;

/// Lengths of upper arm and forearm, and the height at which they turn above the table \[m\].
pub(crate) const LINKS: [f64; 2] = [0.3, 0.25];
const HEIGHT: f64 = 0.12;
/// Radius of the peg that hangs from the end of the forearm \[m\].
pub(crate) const PEG: f64 = 0.012;
/// Half of the edges of the box, and how deep it sinks into the table \[m\].
pub(crate) const HALF: [f64; 3] = [0.05, 0.04, 0.03];
const DEPTH: f64 = 2e-4;
/// Where the box stands at first \[m\].
pub(crate) const BOX: [f64; 2] = [0.27, 0.16];

/// The model, what to look at in it, and its states at the start.
pub(crate) struct Scene {
    pub(crate) model: Model,
    pub(crate) arm: [BodyId; 2],
    pub(crate) servos: [JointForceId; 2],
    pub(crate) pushed: BodyId,
    pub(crate) start: State,
    /// Angles of shoulder and elbow at the start \[rad\].
    pub(crate) first: [f64; 2],
}

impl Scene {
    pub(crate) fn new() -> anyhow::Result<Self> {
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        let table = model.add(Body::fixed("table").with_field(Arc::new(HalfSpace::floor())));

        let mass = 0.5;
        let rigid = RigidBody::cuboid(mass, HALF)?;
        // One sample in the middle of each square of 2 cm.
        let row =
            |i| (0..4).map(move |j| Point3::new(0.02 * i, 0.02 * f64::from(j) - 0.03, -HALF[2]));
        let bottom: Vec<_> = (-2..=2).flat_map(|i| row(f64::from(i))).collect();
        let area = 4.0 * HALF[0] * HALF[1];
        let sides = Cuboid { half_extents: HALF.into(), rounding: 2e-3 };
        let pushed = Body::dynamic("box", rigid).with_field(Arc::new(sides));
        let pushed = model.add(pushed.with_surface(Surface::uniform(&bottom, area)?));

        let rod = |name, length: f64| -> anyhow::Result<Link> {
            let rod = RigidBody::cuboid(2.0 * length, [0.5 * length, 0.02, 0.015])?;
            let rod = rod.moved(&Isometry3::translation(0.5 * length, 0.0, 0.0));
            Ok(Link::new(name, Joint::Revolute(Vector3::z_axis()), &rod).with_armature(0.01))
        };
        let links = model.add_articulation(vec![
            rod("upper arm", LINKS[0])?.at(Isometry3::translation(0.0, 0.0, HEIGHT)),
            rod("forearm", LINKS[1])?.on(0, Isometry3::translation(LINKS[0], 0.0, 0.0)),
        ])?;
        let arm = [links[0], links[1]];
        let tip = Isometry3::translation(LINKS[1], 0.0, HALF[2] - HEIGHT);
        let peg = Surface::ball(PEG)?.moved(&tip);
        let peg_area = peg.area();
        model.bodies[arm[1]].surface = Some(Arc::new(peg));
        let servo = PositionServo { target: 0.0, stiffness: 60.0, damping: 5.0, max_effort: 10.0 };
        let servos = [model.add_joint_force(arm[0], servo)?, model.add_joint_force(arm[1], servo)?];

        let normal = |penetration: f64, contact_area: f64| {
            let target = ContactCalibration { mass, gravity: 9.81, penetration, contact_area };
            HuntCrossley::from_target(&target, 1.0, Bounce { restitution: 0.2, impact_speed: 0.1 })
        };
        for (samples, field, normal, friction) in [
            (pushed, table, normal(DEPTH, area)?, 0.35),
            (arm[1], pushed, normal(5e-4, peg_area)?, 0.2),
        ] {
            let law = Law::new(normal, Coulomb { friction, slip_scale: 5e-3 })?;
            let bodies = ContactBodies { samples, field };
            model.add_contact(bodies, Arc::new(law), GapSmoothing::Hard)?;
        }

        let mut start = model.neutral_state();
        let first = [2.0, -2.2];
        for (link, angle) in arm.into_iter().zip(first) {
            model.set_joint(&mut start, link, &[angle], &[0.0])?;
        }
        start[pushed] = rigid.at_rest(&Isometry3::translation(BOX[0], BOX[1], HALF[2] - DEPTH));
        Ok(Self { model, arm, servos, pushed, start, first })
    }
}

/// Angles of shoulder and elbow, which bends to the right, that put the peg at `place`.
pub(crate) fn angles([x, y]: [f64; 2]) -> [f64; 2] {
    let [a, b] = LINKS;
    let elbow = -((x * x + y * y - a * a - b * b) / (2.0 * a * b)).clamp(-1.0, 1.0).acos();
    [y.atan2(x) - (b * elbow.sin()).atan2(a + b * elbow.cos()), elbow]
}
