//! Reverse mode: kinematics and forward dynamics of all links as one node each, with adjoints in closed form.

mod dynamics;
mod inputs;
mod motion;
mod poses;
#[cfg(test)]
mod tests;

pub(crate) use self::dynamics::{Acting, accelerations};
pub(crate) use self::poses::link_states;
