//! What truly is, before any sensor has seen it.

use nalgebra::{Isometry3, Vector3};

/// One moment of an object held in a hand.
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
