//! A gripper closes on a box and lifts it.
//!
//! With `PREHEND_DATA`, a folder that holds `robots/robotiq_2f85/2f85.xml` of MuJoCo Menagerie, it is that gripper, whose four-bar linkages are loops
//! closed by springs. Otherwise it is one of two fingers that slide, in URDF.

mod drawing;
mod gripper;
mod hull;

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use prehend::sim::prelude::*;

use gripper::Gripper;

/// The box: half extents \[m\] and mass \[kg\].
const HALF: [f64; 3] = [0.02, 0.02, 0.03];
const MASS: f64 = 0.1;
/// When the gripper has closed, has lifted the box, and has held it \[s\]; by how much \[m\].
const CLOSED: f64 = 0.5;
const LIFTED: f64 = 1.1;
const HELD: f64 = 1.4;
const LIFT: f64 = 0.1;
/// Desired force of each pad \[N\].
const GRIP: f64 = 6.0;

pub(crate) fn main() -> anyhow::Result<()> {
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let gripper = Gripper::add(&mut model)?;
    println!("{}", gripper.name);
    let floor = Body::fixed("floor").with_field(Arc::new(HalfSpace::floor()));
    let floor = model.add(floor);
    let rigid = RigidBody::cuboid(MASS, HALF)?;
    let shape = Cuboid { half_extents: HALF.into(), rounding: 1e-3 };
    let lifted = model.add(Body::dynamic("box", rigid).with_cuboid(shape, 0.01)?);

    let law: Arc<dyn DynContactLaw> = Arc::new(law()?);
    let smoothing = GapSmoothing::Softplus { width: 2e-5 };
    for field in [gripper.pads[0], gripper.pads[1], floor] {
        let bodies = ContactBodies { samples: lifted, field };
        model.add_contact(bodies, law.clone(), smoothing)?;
    }

    let mut start = model.neutral_state();
    start[lifted] = rigid.at_rest(&Isometry3::translation(0.0, 0.0, HALF[2]));
    let time_steps = TimeSteps { dt: 0.02, steps: (HELD / 0.02) as usize };
    let mut closing: f64 = 0.0;
    let control = |step: Step, model: &mut Model, states: &mut State| {
        // Fingers close until they feel the box, and open where they press too much.
        let felt = model.contact_wrench(gripper.pads[0], states)?.fixed_rows::<3>(0).norm();
        let pace = (1.0 - felt / GRIP).clamp(-1.0, 1.0);
        closing = (closing + pace * step.dt / (0.8 * CLOSED)).clamp(0.0, 1.0);
        let rising = ((step.start - CLOSED) / (LIFTED - CLOSED)).clamp(0.0, 1.0);
        // From rest to rest.
        let rising = rising * rising * (3.0 - 2.0 * rising);
        gripper.command(model, closing, LIFT * rising)?;
        Ok::<_, SimulationError>(())
    };
    let began = std::time::Instant::now();
    let run = model.rollout_controlled(&Adaptive::default(), &start, time_steps, control)?.states;
    println!("{HELD} s simulated in {:.1} s", began.elapsed().as_secs_f64());

    let height = |states: &State| states[lifted].pose.translation.z;
    let (before, end) = (&run[(CLOSED / 0.02) as usize], &run[run.len() - 1]);
    let rise = height(end) - height(&start);
    // How the box has moved in the hand since it was gripped.
    let held = |states: &State| states[gripper.base].pose.inverse() * states[lifted].pose;
    let slip = held(before).inverse() * held(end);
    let [force, other] = gripper.pads.map(|pad| model.contact_wrench(pad, end));
    let grip = 0.5 * (force?.fixed_rows::<3>(0).norm() + other?.fixed_rows::<3>(0).norm());
    println!("the box rises by {:.1} mm between pads that press with {grip:.1} N", 1e3 * rise);
    println!(
        "and slips by {:.3} mm and {:.3}°",
        1e3 * slip.translation.vector.norm(),
        slip.rotation.angle().to_degrees()
    );
    drawing::draw("target/gripper_lift.svg", &gripper, (lifted, HALF), &run)?;
    println!("drawn in target/gripper_lift.svg");

    anyhow::ensure!((rise - LIFT).abs() < 3e-3, "the box rises by {rise} m");
    anyhow::ensure!(
        slip.translation.vector.norm() < 1e-3 && slip.rotation.angle() < 0.05,
        "it slips"
    );
    let speed = end[lifted].linear.norm();
    anyhow::ensure!(speed < 1e-2, "it still moves with {speed} m/s");
    Ok(())
}

/// Rubber pads: a side of the box sinks in by 0.1 mm under 20 N, and what sticks stays.
fn law() -> anyhow::Result<Law<KelvinVoigt, BristleFriction<Coulomb>>> {
    let contact_area = 4.0 * HALF[0] * HALF[2];
    let target = ContactCalibration { mass: 2.0, gravity: 9.81, penetration: 1e-4, contact_area };
    let friction =
        BristleFriction { friction: Coulomb { friction: 0.8, slip_scale: 1e-2 }, deflection: 1e-4 };
    Ok(Law::new(KelvinVoigt::from_target(&target, 0.3)?, friction)?)
}
