//! Muscles, as MuJoCo has them.

use prehend_autodiff::Scalar;

use super::JointLaw;
use super::affine_actuator::within;
use crate::contact::parameters::law_part;

law_part! {
    /// A muscle: it pulls with its activation times curves of its fiber's length and speed, and passively where the fiber is long.
    pub struct Muscle: "muscle" {
        activation ["1"] Finite "activation";
    }
    constants {
        force ["N"] NotNegative "active force at its own length, at rest";
        origin ["m"] Finite "length at which the fiber's is zero";
        unit ["m"] Positive "length of a fiber of its own length";
        shortest ["1"] Finite "fiber's length below which it has no active force";
        longest ["1"] Finite "fiber's length above which it has no active force";
        fastest ["1/s"] Positive "speed of shortening at which it has no active force";
        passive ["1"] NotNegative "passive force halfway to the longest, twice of";
        stretching ["1"] Finite "active force where it is stretched fast";
    }
}

impl Muscle {
    fn by_length<S: Scalar>(&self, fiber: S) -> S {
        let (low, high) = (0.5 * (self.shortest + 1.0), 0.5 * (1.0 + self.longest));
        let square = |from: f64, width: f64| {
            let x = fiber.plus(-from).times(1.0 / width);
            (x * x).times(0.5)
        };
        match fiber.value() {
            x if x < self.shortest || x > self.longest => S::zero(),
            x if x <= low => square(self.shortest, low - self.shortest),
            x if x <= 1.0 => S::one() - square(1.0, 1.0 - low),
            x if x <= high => S::one() - square(1.0, high - 1.0),
            _ => square(self.longest, self.longest - high),
        }
    }

    fn by_speed<S: Scalar>(&self, speed: S) -> S {
        let most = self.stretching - 1.0;
        match speed.value() {
            x if x <= -1.0 => S::zero(),
            x if x <= 0.0 => speed.plus(1.0) * speed.plus(1.0),
            x if x <= most => {
                let short = speed.plus(-most);
                S::constant(self.stretching) - (short * short).times(1.0 / most)
            }
            _ => S::constant(self.stretching),
        }
    }

    fn passively<S: Scalar>(&self, fiber: S) -> S {
        let half = 0.5 * (self.longest - 1.0);
        let x = fiber.plus(-1.0).times(1.0 / half);
        match x.value() {
            value if value <= 0.0 => S::zero(),
            value if value <= 1.0 => (x * x).times(0.5 * self.passive),
            _ => x.plus(-0.5).times(self.passive),
        }
    }
}

impl JointLaw for Muscle {
    fn effort<S: Scalar>(&self, [activation]: [S; 1], position: S, velocity: S) -> S {
        let fiber = position.plus(-self.origin).times(1.0 / self.unit);
        let speed = velocity.times(1.0 / (self.unit * self.fastest));
        let active = self.by_length(fiber) * self.by_speed(speed) * activation;
        -(active + self.passively(fiber)).times(self.force)
    }
}

law_part! {
    /// Rate of the activation of a muscle, which is the velocity of a joint that moves 1 kg m² and nothing else: it follows the control, faster
    /// the more it is active and slower the more it is not.
    pub struct MuscleActivation: "activation of a muscle" {
        control ["1"] Finite "control";
    }
    constants {
        activating ["s"] Positive "time constant upwards";
        deactivating ["s"] Positive "time constant downwards";
        smoothing ["1"] NotNegative "width over which one becomes the other";
    }
}

impl JointLaw for MuscleActivation {
    fn effort<S: Scalar>(&self, [control]: [S; 1], _: S, activation: S) -> S {
        let change = within(control, [0.0, 1.0]) - activation;
        let scale = within(activation, [0.0, 1.0]).times(1.5).plus(0.5);
        let up = scale.times(self.activating);
        let down = S::constant(self.deactivating) / scale;
        let time = match (self.smoothing, change.value() > 0.0) {
            (0.0, true) => up,
            (0.0, false) => down,
            (width, _) => {
                let x = within(change.times(1.0 / width).plus(0.5), [0.0, 1.0]);
                let step = x * x * x * ((x.times(6.0).plus(-15.0)) * x).plus(10.0);
                down + (up - down) * step
            }
        };
        change / time
    }
}
