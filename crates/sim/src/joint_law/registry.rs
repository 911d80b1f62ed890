//! Laws along joints by name.

use std::sync::Arc;

use super::JointLaw;
use super::dynamic::DynJointLaw;
use super::friction::JointFriction;
use super::linear::{JointDamper, JointSpring, Motor, PositionServo, VelocityServo};
use super::range::{JointLimits, SlackSpring};
use crate::contact::error::LawError;
use crate::contact::parameters::{LawParameter, ParameterArray, Tabulated};
use crate::contact::registry::exactly;

/// Makes a law from its parameters, in order.
type Constructor = fn(&[f64]) -> Result<Arc<dyn DynJointLaw>, LawError>;

/// A law along joints, by name.
#[derive(Clone, Debug)]
pub struct JointLawEntry {
    /// Its name.
    pub name: &'static str,
    /// Summary in one line.
    pub summary: &'static str,
    /// Parameters, then constants, in order.
    pub parameters: Vec<LawParameter>,
    constructor: Constructor,
}

impl JointLawEntry {
    fn of<L: JointLaw + Tabulated>(name: &'static str) -> Self {
        fn create<L: JointLaw + Tabulated>(
            values: &[f64],
        ) -> Result<Arc<dyn DynJointLaw>, LawError> {
            let table = (L::PARAMETERS, L::CONSTANTS).to_vec();
            let (params, constants) = exactly(values, &table)?;
            let law = L::from_values(params, constants);
            law.check(&params)?;
            Ok(Arc::new(law))
        }
        let parameters = (L::PARAMETERS, L::CONSTANTS).to_vec();
        Self { name, summary: L::SUMMARY, parameters, constructor: create::<L> }
    }

    /// The law with these values of its parameters.
    ///
    /// # Errors
    /// If they are too few, too many or out of range.
    pub fn create(&self, values: &[f64]) -> Result<Arc<dyn DynJointLaw>, LawError> {
        (self.constructor)(values)
    }
}

/// The laws of this crate by name: damper, friction, limits, motor, position_servo, slack_spring, spring and velocity_servo.
///
/// ```
/// let laws = prehend_sim::joint_law::joint_laws();
/// let spring = laws.iter().find(|law| law.name == "spring").ok_or("it is there")?;
/// assert_eq!(spring.parameters[0].name, "stiffness");
/// let spring = spring.create(&[2.0, 0.1])?;
/// assert_eq!(spring.effort(&[2.0, 0.1], 0.6, 0.0), -1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn joint_laws() -> Vec<JointLawEntry> {
    vec![
        JointLawEntry::of::<JointDamper>("damper"),
        JointLawEntry::of::<JointFriction>("friction"),
        JointLawEntry::of::<JointLimits>("limits"),
        JointLawEntry::of::<Motor>("motor"),
        JointLawEntry::of::<PositionServo>("position_servo"),
        JointLawEntry::of::<SlackSpring>("slack_spring"),
        JointLawEntry::of::<JointSpring>("spring"),
        JointLawEntry::of::<VelocityServo>("velocity_servo"),
    ]
}
