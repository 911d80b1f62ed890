//! Measurements of a hand: its pose, joints and touch.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use numpy::PyUntypedArrayMethods;
use prehend_refine::RefineError;
use prehend_refine::scene::HandMeasurement;
use pyo3::prelude::*;

use super::poses::pose;
use crate::arrays::{Numbers, in_order};
use crate::error::{Raise, wrong};

/// Positions of joints by name, or in order.
#[derive(FromPyObject)]
pub(super) enum Joints<'py> {
    Named(BTreeMap<String, f64>),
    Ordered(Numbers<'py>),
}

/// The state of `hand`, checked.
pub(super) fn measured(
    hand: &Arc<prehend_refine::Hand>,
    hand_pose: &Numbers<'_>,
    joints: Joints<'_>,
    touch: Option<&Numbers<'_>>,
) -> PyResult<HandMeasurement> {
    let named = match joints {
        Joints::Named(named) => named,
        Joints::Ordered(positions) => {
            let (names, positions) = (hand.tree.joint_names(), in_order(&positions));
            hand.check_joints(&positions).raise()?;
            names.iter().cloned().zip(positions.iter().copied()).collect()
        }
    };
    let forces: Vec<Vector3<f64>> = match touch {
        None => Vec::new(),
        Some(touch) => match touch.shape() {
            [_, 3] => in_order(touch).as_chunks().0.iter().copied().map(Vector3::from).collect(),
            shape => {
                return Err(wrong(format!("touch: an array of n × 3 is expected, not {shape:?}")));
            }
        },
    };
    let (given, taxels) = (forces.len(), hand.taxels.len());
    if touch.is_some() && given != taxels {
        return Err(RefineError::TaxelCount { forces: given, taxels }).raise();
    }
    let joints = hand.tree.joint_vector(&named).raise()?;
    Ok(hand.measured(pose(hand_pose, "hand_pose")?, joints).with_forces(forces))
}
