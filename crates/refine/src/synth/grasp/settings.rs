//! How grasps are made and what is asked of them.

use super::fault::GraspError;
use super::preshape::Preshape;

/// What a number must be, in words and as a test.
type Range = (&'static str, fn(f64) -> bool);

const POSITIVE: Range = ("positive", |v| v.is_finite() && v > 0.0);
const NOT_NEGATIVE: Range = ("at least 0", |v| v.is_finite() && v >= 0.0);
const BELOW_ONE: Range = ("at least 0 and below 1", |v| (0.0..1.0).contains(&v));
const AT_LEAST_ONE: Range = ("at least 1", |v| v >= 1.0);

/// Makes [`GraspSettings`] of what each setting is, its default, and the range of those that are checked.
macro_rules! grasp_settings {
    ($($(#[$what:meta])* $name:ident: $type:ty = $default:expr $(, $range:expr)?;)*) => {
        /// Settings of a [`Grasper`](super::Grasper). The defaults suit a hand of human size and household objects.
        #[derive(Clone, Debug, PartialEq)]
        pub struct GraspSettings {
            $($(#[$what])* pub $name: $type,)*
        }

        impl Default for GraspSettings {
            fn default() -> Self {
                Self { $($name: $default),* }
            }
        }

        impl GraspSettings {
            /// Names, values and ranges of the numbers that have one.
            fn ranges(&self) -> Vec<(&'static str, f64, Range)> {
                vec![$($((stringify!($name), self.$name, $range),)?)*]
            }
        }
    };
}

grasp_settings! {
    /// How the hand opens, and how it closes; [`Preshape::of`] the robot if absent.
    preshape: Option<Preshape> = None;
    /// Stiffness of contacts per area \[N/m³\]: total normal force over the volume that hand and object share.
    stiffness: f64 = 6e8, POSITIVE;
    /// Coefficient of friction; skins of rubber have 0.7 to 1.
    friction: f64 = 0.8, NOT_NEGATIVE;
    /// Slip speed that regularizes friction \[m/s\]: what is held creeps by a fraction of it.
    slip_speed: f64 = 2e-4, POSITIVE;
    /// Distance between neighboring samples of the object's surface \[m\].
    sample_spacing: f64 = 2.5e-3, POSITIVE;
    /// Time step of the simulation \[s\].
    time_step: f64 = 5e-3, POSITIVE;
    /// Force against it at which a joint stops \[N\], that on all it moves taken together.
    grip: f64 = 2.0, POSITIVE;
    /// What is added to `grip` for each newton of the object's weight.
    grip_per_weight: f64 = 0.6, NOT_NEGATIVE;
    /// Joints give way where the load exceeds this many times the one at which they stop.
    yield_ratio: f64 = 6.0, AT_LEAST_ONE;
    /// Random factor on the speed of each joint, 1 ± this: in which order fingers arrive.
    speed_spread: f64 = 0.3, BELOW_ONE;
    /// While the hand closes the object floats, and loses its speed within this time \[s\].
    damping_time: f64 = 0.05, POSITIVE;
    /// All must be nearly at rest within this time after the hand begins to close \[s\].
    closing_time: f64 = 3.0, POSITIVE;
    /// The part of placements that follow the object's principal axes; the rest are turned at random.
    aligned: f64 = 0.8, NOT_NEGATIVE;
    /// Standard deviation of the angles by which aligned placements differ from those axes \[rad\].
    tilt: f64 = 0.15, NOT_NEGATIVE;
    /// Standard deviation of the object's place across the palm \[m\].
    offset: f64 = 0.012, NOT_NEGATIVE;
    /// The object starts at most so far from the hand \[m\].
    clearance: f64 = 0.02, NOT_NEGATIVE;
    /// Gravity \[m/s²\].
    gravity: f64 = 9.81, POSITIVE;
    /// Directions of gravity in which an object must hold, one after the other.
    hold_directions: usize = 6;
    /// How long each of them lasts \[s\].
    hold_time: f64 = 0.3, POSITIVE;
    /// An object that moves farther in the hand has slipped \[m\].
    slip_distance: f64 = 5e-3, POSITIVE;
    /// An object that turns farther in the hand has slipped \[rad\].
    slip_angle: f64 = 5f64.to_radians(), POSITIVE;
    /// Least and largest contact area: what of the object is within 5 mm of the hand \[cm²\].
    contact_area: (f64, f64) = (20.0, 60.0);
    /// Largest volume that hand and object may share \[cm³\].
    intersection_volume: f64 = 0.4;
    /// Links that must touch at least.
    links: usize = 3;
    /// Time between the moments of a trajectory \[s\].
    frame_time: f64 = 0.05, POSITIVE;
    /// How fast the hand turns along a trajectory \[rad/s\], root mean square.
    turn_rate: f64 = 1.5, NOT_NEGATIVE;
    /// By how much of itself the grip grows along a trajectory, at most.
    squeeze: f64 = 0.3, NOT_NEGATIVE;
    /// How often the hand loosens its grip along a trajectory for a moment, so that the object slips by 4 to 15 mm, or less if it holds.
    slips: u32 = 0;
    /// A contact is felt by taxels within this distance \[m\].
    taxel_reach: f64 = 8e-3, POSITIVE;
}

impl GraspSettings {
    /// Whether every number is in its range.
    pub(super) fn check(&self) -> Result<(), GraspError> {
        let refuse = |name: &str, value: f64, range: &str| {
            Err(GraspError::Setting(format!("the setting {name} must be {range}, is {value}")))
        };
        let (least, most) = self.contact_area;
        if !(least >= 0.0 && most > least) {
            return refuse("contact_area", most, "more than the least area, which is at least 0");
        }
        match self.ranges().into_iter().find(|(_, value, (_, holds))| !holds(*value)) {
            Some((name, value, (range, _))) => refuse(name, value, range),
            None => Ok(()),
        }
    }
}
