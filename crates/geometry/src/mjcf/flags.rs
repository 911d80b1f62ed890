//! Parts of the physics that a model turns off.

use super::Model;
use super::element::Element;
use super::error::Result;

/// Flags of the `flag` elements that turn off parts of the smooth dynamics.
#[derive(Default)]
pub(super) struct Flags {
    pub(super) no_gravity: bool,
    no_actuation: bool,
    no_springs: bool,
    no_dampers: bool,
}

impl Flags {
    pub(super) fn read(root: &Element) -> Result<Self> {
        let mut flags = Self::default();
        for e in root.sections("option").flat_map(|option| option.sections("flag")) {
            let words = [("enable", false), ("disable", true)];
            for (field, off) in [
                ("gravity", &mut flags.no_gravity),
                ("actuation", &mut flags.no_actuation),
                ("spring", &mut flags.no_springs),
                ("damper", &mut flags.no_dampers),
            ] {
                *off = e.keyword(field, &words)?.unwrap_or(*off);
            }
        }
        Ok(flags)
    }

    /// Turns off what the model would do otherwise.
    pub(super) fn apply(&self, model: &mut Model) {
        for joint in model.bodies.iter_mut().flat_map(|body| &mut body.joints) {
            turn_off(self.no_springs, &mut joint.stiffness, &mut joint.higher_stiffness);
            turn_off(self.no_dampers, &mut joint.damping, &mut joint.higher_damping);
        }
        for tendon in &mut model.tendons {
            turn_off(self.no_springs, &mut tendon.stiffness, &mut tendon.higher_stiffness);
            turn_off(self.no_dampers, &mut tendon.damping, &mut tendon.higher_damping);
        }
        for actuator in model.actuators.iter_mut().filter(|_| self.no_actuation) {
            (actuator.gain, actuator.bias) = ([0.0; 3], [0.0; 3]);
        }
    }
}

fn turn_off(off: bool, first: &mut f64, higher: &mut [f64; 2]) {
    if off {
        (*first, *higher) = (0.0, [0.0; 2]);
    }
}
