//! Motions of a hand that holds an object.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;

use super::grasper::{Grasp, Grasper};
use super::simulation::GraspSimulation;
use super::skin::taxel_forces;
use crate::synth::error::SynthError;
use crate::synth::pose_noise::random_direction;

/// One moment of an object held in a hand, as it truly is.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSnapshot {
    /// Object coordinates → hand base coordinates \[m\].
    pub t_hand_object: Isometry3<f64>,
    /// Joint positions in the order of the robot's joint names \[rad; m\].
    pub joints: Vec<f64>,
    /// Gravity in hand base coordinates \[m/s²\].
    pub gravity: Vector3<f64>,
    /// Rotation of the hand: hand base axes → axes that stand still.
    pub turn: UnitQuaternion<f64>,
    /// Force of the object on each taxel, in the frame of the taxel's link \[N\].
    pub taxel_forces: Vec<Vector3<f64>>,
}

/// Waves that make up the turning of the hand, and the grip's rise and fall, an axis.
const WAVES: usize = 3;
/// Their frequencies \[1/s\], least and most.
const FREQUENCIES: (f64, f64) = (0.1, 0.6);
/// Time given to a grasp to settle under gravity before the first moment \[s\].
const SETTLING: f64 = 0.25;
/// Share of the grip that is left while the object slips.
const LOOSE: f64 = 0.02;
/// Distance that it slips, least and most \[m\], unless the hand is loose for so long \[s\] before.
const SLIP: (f64, f64) = (4e-3, 15e-3);
const LOOSE_TIME: f64 = 0.3;

impl Grasper<'_> {
    /// `steps` moments of the hand turning smoothly and at random while it holds the object, which is simulated.
    ///
    /// The hand turns slowly: what its acceleration does to the object is left out. The grip grows and falls back by up to
    /// [`squeeze`](super::GraspSettings::squeeze), and fingers follow an object that gives way. The same for the same
    /// grasp and seed.
    ///
    /// # Errors
    /// [`SynthError::Refused`] if the object does not stay in the hand; faults of the simulation.
    pub fn trajectory(
        &self,
        grasp: &Grasp,
        seed: u64,
        steps: usize,
    ) -> Result<Vec<GraspSnapshot>, SynthError> {
        let mut random = SplitMix64::new(seed);
        let down = random_direction(&mut random) * self.settings.gravity;
        self.moments(grasp, &mut random, steps, &UnitQuaternion::identity(), &down)
    }

    /// A [`trajectory`](Self::trajectory) that begins with the hand turned by `turn` under the gravity `down`, both in axes that stand still.
    pub(super) fn moments(
        &self,
        grasp: &Grasp,
        random: &mut SplitMix64,
        steps: usize,
        turn: &UnitQuaternion<f64>,
        down: &Vector3<f64>,
    ) -> Result<Vec<GraspSnapshot>, SynthError> {
        let settings = &self.settings;
        let turning: [Waves; 3] = std::array::from_fn(|_| Waves::new(random));
        let squeezing = Waves::new(random);
        let Grasp { joints, t_hand_object, grip, .. } = grasp;
        let mut simulation = GraspSimulation::new(self, joints, t_hand_object, *grip)?;
        let dt = settings.time_step;
        let inner = (settings.frame_time / dt).round().max(1.0) as usize;
        let settling = (SETTLING / dt).ceil() as usize;
        let mut slips = Slips::new(settings.slips, steps, random);
        let mut turn = *turn;
        let mut moments = Vec::with_capacity(steps);
        let mut start: Option<Isometry3<f64>> = None;
        let per_axis = settings.turn_rate / 3f64.sqrt();
        for step in 0..settling + inner * steps.max(1).saturating_sub(1) + 1 {
            let time = step.saturating_sub(settling) as f64 * dt;
            let gravity = turn.inverse() * down;
            let wave = squeezing.at(time) / Waves::LARGEST;
            let slipping =
                step >= settling && slips.at(moments.len(), &simulation, settings.time_step);
            let squeezed = grip * (1.0 + settings.squeeze * wave.max(0.0));
            simulation.grip = if slipping { LOOSE * squeezed } else { squeezed };
            simulation.close(Some(gravity))?;
            if step < settling {
                continue;
            }
            let t_hand_object = simulation.t_hand_object();
            if slipping {
                // It is to stay where it is then.
                start = None;
            } else {
                self.moved(start.get_or_insert(t_hand_object), &t_hand_object)?;
            }
            if (step - settling).is_multiple_of(inner) && moments.len() < steps {
                moments.push(GraspSnapshot {
                    t_hand_object,
                    joints: simulation.joints.clone(),
                    gravity,
                    turn,
                    taxel_forces: self.taxel_forces(&simulation),
                });
            }
            let rate = Vector3::from_fn(|i, _| per_axis * turning[i].at(time));
            turn *= UnitQuaternion::from_scaled_axis(rate * dt);
        }
        Ok(moments)
    }

    /// Force of the object on each taxel, in the frame of its link \[N\].
    fn taxel_forces(&self, simulation: &GraspSimulation<'_>) -> Vec<Vector3<f64>> {
        let (taxels, reach) = (&self.robot.taxels, self.settings.taxel_reach);
        taxel_forces(taxels, &self.taxel_links, reach, &simulation.touches(), &simulation.poses)
    }
}

/// Times at which the hand loosens its grip, and distances that the object slips then.
struct Slips {
    /// The next moments, the last first, each with a distance \[m\].
    left: Vec<(usize, f64)>,
    /// The one that goes on: the object's pose before, its distance, and the time left \[s\].
    now: Option<(Isometry3<f64>, f64, f64)>,
}

impl Slips {
    /// `count` slips in `steps` moments.
    fn new(count: u32, steps: usize, random: &mut SplitMix64) -> Self {
        let mut slip = |k: u32| {
            let share = (f64::from(k) + 0.3 + 0.4 * random.uniform()) / f64::from(count);
            let (least, most) = SLIP;
            ((share * steps as f64) as usize, least + (most - least) * random.uniform())
        };
        let mut left: Vec<_> = (0..count).map(&mut slip).collect();
        left.reverse();
        Self { left, now: None }
    }

    /// True while the grip is loose.
    fn at(&mut self, moment: usize, simulation: &GraspSimulation<'_>, dt: f64) -> bool {
        let pose = simulation.t_hand_object();
        if let Some((_, distance)) = self.left.pop_if(|(next, _)| moment >= *next) {
            self.now = Some((pose, distance, LOOSE_TIME));
        }
        let Some((from, distance, time)) = &mut self.now else { return false };
        *time -= dt;
        let slipped = (pose.translation.vector - from.translation.vector).norm() >= *distance;
        if slipped || *time <= 0.0 {
            self.now = None;
        }
        self.now.is_some()
    }
}

/// A smooth random function of time of mean square 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::synth) struct Waves([(f64, f64); WAVES]);

impl Waves {
    /// No value is larger.
    const LARGEST: f64 = 2.4495;

    pub(in crate::synth) fn new(random: &mut SplitMix64) -> Self {
        let (low, high) = FREQUENCIES;
        Self(std::array::from_fn(|_| {
            let rate = std::f64::consts::TAU * (low + (high - low) * random.uniform());
            (rate, std::f64::consts::TAU * random.uniform())
        }))
    }

    pub(in crate::synth) fn at(&self, time: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|(rate, phase)| (rate * time + phase).sin()).sum();
        sum * (2.0 / WAVES as f64).sqrt()
    }
}
