//! Settings of grasps, and what is asked of them.

use crate::defaults::settings;
use crate::synth::error::SynthError;
use crate::synth::settings::numbers;

settings! {
    /// Settings of a [`Grasper`](super::Grasper). The defaults suit a hand of human size and household objects.
    pub struct GraspSettings {
        /// Stiffness of contacts per area \[N/m³\]: total normal force over the volume that hand and object share.
        pub stiffness: f64 = 6e8,
        /// Coefficient of friction; skins of rubber have 0.7 to 1.
        pub friction: f64 = 0.8,
        /// Slip speed that regularizes friction \[m/s\]: what is held creeps by a fraction of it.
        pub slip_speed: f64 = 2e-4,
        /// Distance between neighboring samples of the object's surface \[m\].
        pub sample_spacing: f64 = 2.5e-3,
        /// Time step of the simulation \[s\].
        pub time_step: f64 = 5e-3,
        /// Force against it at which a joint stops \[N\], that on all it moves taken together.
        pub grip: f64 = 2.0,
        /// Addition to `grip` for each newton of the object's weight.
        pub grip_per_weight: f64 = 0.6,
        /// Joints give way where the load exceeds this many times the one at which they stop.
        pub yield_ratio: f64 = 6.0,
        /// Random factor on the speed of each joint, 1 ± this: in which order fingers arrive.
        pub speed_spread: f64 = 0.3,
        /// While the hand closes the object floats, and loses its speed within this time \[s\].
        pub damping_time: f64 = 0.05,
        /// All must be nearly at rest within this time after the hand begins to close \[s\].
        pub closing_time: f64 = 3.0,
        /// The part of placements that follow the object's principal axes; the rest are turned at random.
        pub aligned: f64 = 0.8,
        /// Standard deviation of the angles by which aligned placements differ from those axes \[rad\].
        pub tilt: f64 = 0.15,
        /// Standard deviation of the object's place across the palm \[m\].
        pub offset: f64 = 0.012,
        /// The object starts at most so far from the hand \[m\].
        pub clearance: f64 = 0.02,
        /// Gravity \[m/s²\].
        pub gravity: f64 = 9.81,
        /// Directions of gravity in which an object must hold, one after the other.
        pub hold_directions: usize = 6,
        /// Duration of each of them \[s\].
        pub hold_time: f64 = 0.3,
        /// An object that moves farther in the hand has slipped \[m\].
        pub slip_distance: f64 = 5e-3,
        /// An object that turns farther in the hand has slipped \[rad\].
        pub slip_angle: f64 = 5f64.to_radians(),
        /// Least and largest contact area: what of the object is within 5 mm of the hand \[cm²\].
        pub contact_area: (f64, f64) = (20.0, 60.0),
        /// Largest volume that hand and object may share \[cm³\].
        pub intersection_volume: f64 = 0.4,
        /// Links that must touch at least.
        pub links: usize = 3,
        /// Time between the moments of a trajectory \[s\].
        pub frame_time: f64 = 0.05,
        /// Angular speed of the hand along a trajectory \[rad/s\], root mean square.
        pub turn_rate: f64 = 1.5,
        /// By how much of itself the grip grows along a trajectory, at most.
        pub squeeze: f64 = 0.3,
        /// Number of times that the hand loosens its grip along a trajectory for a moment, so that the object slips by 4 to 15 mm, or less if it holds.
        pub slips: u32 = 0,
        /// A contact is felt by taxels within this distance \[m\].
        pub taxel_reach: f64 = 8e-3,
    }
}

/// Settings that may be zero; all others are positive.
const MAY_BE_ZERO: [&str; 13] = [
    "aligned",
    "clearance",
    "friction",
    "grip_per_weight",
    "hold_directions",
    "intersection_volume",
    "links",
    "offset",
    "slips",
    "speed_spread",
    "squeeze",
    "tilt",
    "turn_rate",
];

impl GraspSettings {
    /// Refuses numbers out of their range.
    pub(super) fn check(&self) -> Result<(), SynthError> {
        let refuse = |name: &str, value: f64, range: &str| {
            Err(SynthError::Refused(format!("the setting {name} must be {range}, is {value}")))
        };
        let (least, most) = self.contact_area;
        if !(least >= 0.0 && most > least) {
            return refuse("contact_area", most, "more than the least area, which is at least 0");
        }
        for (name, value) in numbers(self) {
            let may_be_zero = MAY_BE_ZERO.contains(&name.as_str());
            let range = match name.as_str() {
                "speed_spread" if value >= 1.0 => "below 1",
                "yield_ratio" if value < 1.0 => "at least 1",
                _ if value.is_finite() && (value > 0.0 || value == 0.0 && may_be_zero) => continue,
                _ if may_be_zero => "at least 0",
                _ => "positive",
            };
            return refuse(&name, value, range);
        }
        Ok(())
    }
}
