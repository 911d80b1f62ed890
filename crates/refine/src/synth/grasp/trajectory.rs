//! Motions of a hand that holds an object.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;

use super::drive::Effort;
use super::fault::GraspFault;
use super::grasper::{Grasp, Grasper, random_direction};
use super::simulation::{Medium, Simulation};

/// One moment of an object held in a hand, as it truly is.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSnapshot {
    /// Object coordinates → hand base coordinates \[m\].
    pub t_hand_object: Isometry3<f64>,
    /// Joint positions in the order of the robot's joint names \[rad; m\].
    pub joints: Vec<f64>,
    /// Gravity in hand base coordinates \[m/s²\].
    pub gravity: Vector3<f64>,
    /// Force of the object on each taxel, in the frame of the taxel's link \[N\].
    pub taxel_forces: Vec<Vector3<f64>>,
}

/// Waves that make up the turning of the hand, and the grip's rise and fall, an axis.
const WAVES: usize = 3;
/// Their frequencies \[1/s\], least and most.
const FREQUENCIES: (f64, f64) = (0.1, 0.6);
/// Time given to a grasp to settle under gravity before the first moment \[s\].
const SETTLING: f64 = 0.25;

impl Grasper<'_> {
    /// `steps` moments of the hand turning smoothly and at random while it holds the object, which is simulated.
    ///
    /// The hand turns slowly: what its acceleration does to the object is left out. The grip grows and falls back by up to
    /// [`squeeze`](super::GraspSettings::squeeze), and fingers follow an object that gives way. The same for the same
    /// grasp and seed.
    ///
    /// # Errors
    /// [`GraspFault::Slipped`] if the object does not stay in the hand; faults of the simulation.
    pub fn trajectory(
        &self,
        grasp: &Grasp,
        seed: u64,
        steps: usize,
    ) -> Result<Vec<GraspSnapshot>, GraspFault> {
        let mut random = SplitMix64::new(seed);
        let settings = &self.settings;
        let down = random_direction(&mut random) * settings.gravity;
        let turning: [Waves; 3] = std::array::from_fn(|_| Waves::new(&mut random));
        let squeezing = Waves::new(&mut random);
        let mut simulation = Simulation::new(&self.setup, &grasp.joints, &grasp.t_hand_object)?;
        let pace = vec![1.0; grasp.joints.len()];
        let dt = settings.time_step;
        let inner = (settings.frame_time / dt).round().max(1.0) as usize;
        let settling = (SETTLING / dt).ceil() as usize;
        let mut turn = UnitQuaternion::identity();
        let mut moments = Vec::with_capacity(steps);
        let mut start: Option<Isometry3<f64>> = None;
        let per_axis = settings.turn_rate / 3f64.sqrt();
        for step in 0..settling + inner * steps.max(1).saturating_sub(1) + 1 {
            let time = step.saturating_sub(settling) as f64 * dt;
            let gravity = turn.inverse() * down;
            let wave = squeezing.at(time) / Waves::LARGEST;
            let grip = grasp.grip * (1.0 + settings.squeeze * wave.max(0.0));
            let change = self.drive.change(&simulation, &Effort { pace: pace.clone(), grip });
            simulation.advance(&change, Medium::Gravity(gravity))?;
            if step < settling {
                continue;
            }
            let t_hand_object = simulation.t_hand_object();
            self.moved(start.get_or_insert(t_hand_object), &t_hand_object)?;
            if (step - settling).is_multiple_of(inner) && moments.len() < steps {
                moments.push(GraspSnapshot {
                    t_hand_object,
                    joints: simulation.joints().to_vec(),
                    gravity,
                    taxel_forces: self.skin.forces(&simulation.touches(), simulation.poses()),
                });
            }
            let rate = Vector3::from_fn(|i, _| per_axis * turning[i].at(time));
            turn *= UnitQuaternion::from_scaled_axis(rate * dt);
        }
        Ok(moments)
    }
}

/// A smooth random function of time of mean square 1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Waves([(f64, f64); WAVES]);

impl Waves {
    /// No value is larger.
    const LARGEST: f64 = 2.4495;

    fn new(random: &mut SplitMix64) -> Self {
        let (low, high) = FREQUENCIES;
        Self(std::array::from_fn(|_| {
            let rate = std::f64::consts::TAU * (low + (high - low) * random.uniform());
            (rate, std::f64::consts::TAU * random.uniform())
        }))
    }

    fn at(&self, time: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|(rate, phase)| (rate * time + phase).sin()).sum();
        sum * (2.0 / WAVES as f64).sqrt()
    }
}
