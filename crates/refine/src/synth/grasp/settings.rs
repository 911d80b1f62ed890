//! How grasps are made and what is asked of them.

use super::fault::GraspError;
use super::preshape::Preshape;

/// Settings of a [`Grasper`](super::Grasper). The defaults suit a hand of human size and household objects.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSettings {
    /// How the hand opens, and how it closes; [`Preshape::of`] the robot if absent.
    pub preshape: Option<Preshape>,
    /// Stiffness of contacts per area \[N/m³\]: total normal force over the volume that hand and object share.
    pub stiffness: f64,
    /// Coefficient of friction; skins of rubber have 0.7 to 1.
    pub friction: f64,
    /// Slip speed that regularizes friction \[m/s\]: what is held creeps by a fraction of it.
    pub slip_speed: f64,
    /// Distance between neighboring samples of the object's surface \[m\].
    pub sample_spacing: f64,
    /// Time step of the simulation \[s\].
    pub time_step: f64,
    /// Force against it at which a joint stops \[N\], that on all it moves taken together.
    pub grip: f64,
    /// What is added to `grip` for each newton of the object's weight.
    pub grip_per_weight: f64,
    /// Joints give way where the load exceeds this many times the one at which they stop.
    pub yield_ratio: f64,
    /// Random factor on the speed of each joint, 1 ± this: in which order fingers arrive.
    pub speed_spread: f64,
    /// While the hand closes the object floats, and loses its speed within this time \[s\].
    pub damping_time: f64,
    /// All must be nearly at rest within this time after the hand begins to close \[s\].
    pub closing_time: f64,
    /// The part of placements that follow the object's principal axes; the rest are turned at random.
    pub aligned: f64,
    /// Standard deviation of the angles by which aligned placements differ from those axes \[rad\].
    pub tilt: f64,
    /// Standard deviation of the object's place across the palm \[m\].
    pub offset: f64,
    /// The object starts at most so far from the hand \[m\].
    pub clearance: f64,
    /// Gravity \[m/s²\].
    pub gravity: f64,
    /// Directions of gravity in which an object must hold, one after the other.
    pub hold_directions: usize,
    /// How long each of them lasts \[s\].
    pub hold_time: f64,
    /// An object that moves farther in the hand has slipped \[m\].
    pub slip_distance: f64,
    /// An object that turns farther in the hand has slipped \[rad\].
    pub slip_angle: f64,
    /// Least and largest contact area: what of the object is within 5 mm of the hand \[cm²\].
    pub contact_area: (f64, f64),
    /// Largest volume that hand and object may share \[cm³\].
    pub intersection_volume: f64,
    /// Links that must touch at least.
    pub links: usize,
    /// Time between the moments of a trajectory \[s\].
    pub frame_time: f64,
    /// How fast the hand turns along a trajectory \[rad/s\], root mean square.
    pub turn_rate: f64,
    /// By how much of itself the grip grows along a trajectory, at most.
    pub squeeze: f64,
    /// A contact is felt by taxels within this distance \[m\].
    pub taxel_reach: f64,
}

impl Default for GraspSettings {
    fn default() -> Self {
        Self {
            preshape: None,
            stiffness: 6e8,
            friction: 0.8,
            slip_speed: 2e-4,
            sample_spacing: 2.5e-3,
            time_step: 5e-3,
            grip: 2.0,
            grip_per_weight: 0.6,
            yield_ratio: 6.0,
            speed_spread: 0.3,
            damping_time: 0.05,
            closing_time: 3.0,
            aligned: 0.8,
            tilt: 0.15,
            offset: 0.012,
            clearance: 0.02,
            gravity: 9.81,
            hold_directions: 6,
            hold_time: 0.3,
            slip_distance: 5e-3,
            slip_angle: 5f64.to_radians(),
            contact_area: (20.0, 60.0),
            intersection_volume: 0.4,
            links: 3,
            frame_time: 0.05,
            turn_rate: 1.5,
            squeeze: 0.3,
            taxel_reach: 8e-3,
        }
    }
}

impl GraspSettings {
    /// Whether every number is in its range.
    pub(super) fn check(&self) -> Result<(), GraspError> {
        let positive = [
            ("stiffness", self.stiffness),
            ("slip_speed", self.slip_speed),
            ("sample_spacing", self.sample_spacing),
            ("time_step", self.time_step),
            ("grip", self.grip),
            ("damping_time", self.damping_time),
            ("closing_time", self.closing_time),
            ("gravity", self.gravity),
            ("hold_time", self.hold_time),
            ("slip_distance", self.slip_distance),
            ("slip_angle", self.slip_angle),
            ("frame_time", self.frame_time),
            ("taxel_reach", self.taxel_reach),
        ];
        let not_negative = [
            ("friction", self.friction),
            ("grip_per_weight", self.grip_per_weight),
            ("speed_spread", self.speed_spread),
            ("aligned", self.aligned),
            ("tilt", self.tilt),
            ("offset", self.offset),
            ("clearance", self.clearance),
            ("turn_rate", self.turn_rate),
            ("squeeze", self.squeeze),
        ];
        let refuse = |name, value, range| Err(GraspError::Setting { name, value, range });
        let (least, most) = self.contact_area;
        if !(least >= 0.0 && most > least) {
            return refuse("contact_area", most, "more than the least area, which is at least 0");
        }
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return refuse(name, value, "positive");
            }
        }
        for (name, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(name, value, "at least 0");
            }
        }
        if self.yield_ratio.is_nan() || self.yield_ratio < 1.0 {
            return refuse("yield_ratio", self.yield_ratio, "at least 1");
        }
        if self.speed_spread >= 1.0 {
            return refuse("speed_spread", self.speed_spread, "below 1");
        }
        Ok(())
    }
}
