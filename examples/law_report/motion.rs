//! A body on a law: rest, bounces, slides, and how long its steps may be.

use std::sync::Arc;

use prehend::nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend::sim::prelude::*;

use super::curves::Curve;
use super::finding::{Finding, Verdict};
use super::point_contact::{AREA, DEPTH, PointContact};

/// Gravity \[m/s²\].
pub(crate) const GRAVITY: f64 = 9.81;

/// A body that does not turn, of one sample, and rests half a millimeter deep.
pub(crate) struct Specimen<'a> {
    pub(crate) law: &'a Arc<dyn DynContactLaw>,
    /// Mass \[kg\].
    pub(crate) mass: f64,
}

/// Index of the body, on a plane at whose distance the law begins.
const BODY: usize = 1;
/// Speed of slides \[m/s\].
const SLIDE: f64 = 0.5;

impl Specimen<'_> {
    pub(crate) fn findings(
        &self,
        contact_point: &PointContact<'_>,
    ) -> Result<Vec<Finding>, SimulationError> {
        let mut findings = vec![self.rest()?];
        for speed in [0.1, 0.5, 1.0] {
            findings.push(self.restitution(speed)?);
        }
        let friction = contact_point.force(DEPTH, 0.0, Vector3::x() * 1e3).tangential.x.abs()
            / (self.mass * GRAVITY);
        if friction > 0.0 {
            findings.push(Finding {
                what: "friction coefficient at high slip".to_owned(),
                measured: friction,
                verdict: Verdict::Note,
                remark: String::new(),
            });
            findings.push(self.stop(friction)?);
            findings.push(self.creep(friction)?);
        }
        findings.extend(self.steps()?);
        Ok(findings)
    }

    /// Height over time of a bounce at 0.5 m/s.
    pub(crate) fn bounce_curve(&self) -> Result<Curve, SimulationError> {
        let (model, start) = self.model(Vector3::zeros(), 0.0, Vector3::z() * -0.5)?;
        let dt = 2.0 * duration() / 200.0;
        let mut points = Vec::new();
        let mut add = |time: f64, states: &State| {
            points.push([time * 1e3, states[BODY].pose.translation.z * 1e3]);
        };
        let time_steps = TimeSteps { dt, steps: 200 };
        let end = unaudited(&model, &start, time_steps, |step, states| add(step.start, states))?;
        add(200.0 * dt, &end);
        let name = "bounce at 0.5 m/s, without gravity".to_owned();
        Ok(Curve { name, axes: ["ms", "height [mm]"], points })
    }

    /// The body above the surface, or `depth` \[m\] deep, with a velocity.
    fn model(
        &self,
        gravity: Vector3<f64>,
        depth: f64,
        velocity: Vector3<f64>,
    ) -> Result<(Model, State), SimulationError> {
        let failed = |error| BuildError::Body { body: "specimen".to_owned(), error };
        // Nothing here turns it.
        let inertia = Matrix3::identity() * self.mass;
        let rigid = RigidBody::new(self.mass, inertia, Point3::origin()).map_err(failed)?;
        let surface = Surface::uniform(&[Point3::origin()], AREA).map_err(failed)?;
        let mut model = Model::new(gravity);
        let plane = HalfSpace { normal: Vector3::z_axis(), height: -self.law.cutoff() };
        let field = model.add(Body::fixed("plane").with_field(Arc::new(plane)));
        let samples = model.add(Body::dynamic("specimen", rigid).with_surface(surface));
        let bodies = ContactBodies { samples, field };
        model.add_contact(bodies, Arc::clone(self.law), GapSmoothing::Hard)?;
        let mut state = rigid.at_rest(&Isometry3::translation(0.0, 0.0, -depth));
        state.linear = velocity;
        Ok((model, State::new([BodyState::at_rest(Isometry3::identity()), state])))
    }

    fn rest(&self) -> Result<Finding, SimulationError> {
        let (model, start) = self.model(down(), 1.1 * DEPTH, Vector3::zeros())?;
        let end = simulate(&model, &start, 40.0 * duration())?[BODY];
        let off = (end.pose.translation.z + DEPTH).abs() / DEPTH;
        Ok(Finding {
            what: "off its rest after 40 half periods, of its depth".to_owned(),
            measured: off,
            verdict: match off {
                _ if off < 1e-3 => Verdict::Sound,
                _ if off < 0.11 => Verdict::Note,
                _ => Verdict::Wrong,
            },
            remark: "0 if damped; began 0.1 off".to_owned(),
        })
    }

    fn restitution(&self, speed: f64) -> Result<Finding, SimulationError> {
        let (model, start) = self.model(Vector3::zeros(), 0.0, Vector3::z() * -speed)?;
        let restitution = simulate(&model, &start, 20.0 * duration())?[BODY].linear.z / speed;
        Ok(Finding {
            what: format!("restitution at {speed} m/s"),
            measured: restitution,
            verdict: Verdict::when((-1e-6..=1.0 + 1e-3).contains(&restitution)),
            remark: "0 to 1".to_owned(),
        })
    }

    fn stop(&self, friction: f64) -> Result<Finding, SimulationError> {
        let (model, start) = self.model(down(), DEPTH, Vector3::x() * SLIDE)?;
        let time = 2.0 * SLIDE / (friction * GRAVITY);
        let end = simulate(&model, &start, time)?[BODY].pose.translation.x;
        let expected = SLIDE * SLIDE / (2.0 * friction * GRAVITY);
        let ratio = end / expected;
        Ok(Finding {
            what: "distance of a slide at 0.5 m/s, of v²/2μg".to_owned(),
            measured: ratio,
            verdict: if (ratio - 1.0).abs() < 0.05 { Verdict::Sound } else { Verdict::Note },
            remark: "1 if friction does not depend on slip".to_owned(),
        })
    }

    /// Mean speed on an incline that takes half of the friction, after a while.
    fn creep(&self, friction: f64) -> Result<Finding, SimulationError> {
        let angle = (0.5 * friction).atan();
        let gravity = Vector3::new(angle.sin(), 0.0, -angle.cos()) * GRAVITY;
        let (model, start) = self.model(gravity, DEPTH, Vector3::zeros())?;
        let half = 40.0 * duration();
        let settled = simulate(&model, &start, half)?;
        let end = simulate(&model, &settled, half)?;
        let [settled, end] = [settled, end].map(|states| states[BODY].pose.translation.x);
        let speed = (end - settled) / half;
        Ok(Finding {
            what: "creep at half of the friction [m/s]".to_owned(),
            measured: speed,
            verdict: if speed.abs() < 1e-6 { Verdict::Sound } else { Verdict::Note },
            remark: "0 if it sticks".to_owned(),
        })
    }

    fn steps(&self) -> Result<[Finding; 2], SimulationError> {
        let (model, start) = self.model(down(), DEPTH, Vector3::zeros())?;
        let rate = model.contact_frequency(&start);
        let note = |what: &str, measured: f64, remark: &str| Finding {
            what: what.to_owned(),
            measured,
            verdict: Verdict::Note,
            remark: remark.to_owned(),
        };
        Ok([
            note("fastest rate at rest: stiffness, damping or friction [1/s]", rate, ""),
            note(
                "longest stable step of semi-implicit Euler [s]",
                SemiImplicitEuler.stability_limit() / rate,
                "a tenth of it for derivatives",
            ),
        ])
    }
}

/// The states after `time` \[s\].
fn simulate(model: &Model, start: &State, time: f64) -> Result<State, SimulationError> {
    unaudited(model, start, TimeSteps { dt: time, steps: 1 }, |_, _| ())
}

/// The states at the end, those at the beginning of each step handed to `visit`: whether energy is made is a finding, not an error.
fn unaudited(
    model: &Model,
    start: &State,
    time_steps: TimeSteps,
    mut visit: impl FnMut(Step, &State),
) -> Result<State, SimulationError> {
    let control = |step: Step, _: &mut Model, states: &mut State| visit(step, states);
    Ok(model.simulate_controlled(&Adaptive::default(), start, time_steps, control)?.states)
}

/// Half a period of the contact that rests \[s\].
fn duration() -> f64 {
    std::f64::consts::PI * (DEPTH / GRAVITY).sqrt()
}

fn down() -> Vector3<f64> {
    Vector3::z() * -GRAVITY
}
