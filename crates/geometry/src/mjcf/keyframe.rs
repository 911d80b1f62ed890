//! States that a model comes with.

use super::Model;
use super::element::Element;
use super::error::MjcfError;
use super::joint::JointKind;

/// A state of the whole model.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// Its name, empty where it has none.
    pub name: String,
    /// Its time \[s\].
    pub time: f64,
    /// Positions of all joints, body after body \[rad, m\]: [`JointKind::positions`] numbers each.
    pub positions: Vec<f64>,
    /// Velocities of all joints \[rad/s, m/s\]: [`JointKind::velocities`] numbers each.
    pub velocities: Vec<f64>,
    /// Controls of the actuators that have been read, in their order and units.
    pub controls: Vec<f64>,
}

/// The keyframes of `root`; of the `written` actuators some are not in the model, and `None`.
pub(super) fn read(
    root: &Element,
    model: &Model,
    written: &[Option<usize>],
) -> Result<Vec<Keyframe>, MjcfError> {
    let joints = || model.bodies.iter().flat_map(|b| &b.joints);
    let degrees = joints().map(|j| j.kind.velocities()).sum();
    let reference = model.reference_positions();
    let mut all = Vec::new();
    for e in root.in_sections("keyframe").filter(|e| e.tag == "key") {
        e.take();
        let mut positions = filled(e, "qpos", reference.clone())?;
        let mut at = 0;
        for kind in joints().map(|j| j.kind) {
            let end = at + kind.positions();
            if matches!(kind, JointKind::Ball | JointKind::Free) {
                let quaternion = &mut positions[end - 4..end];
                let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
                if norm < 1e-14 {
                    return Err(e.invalid("qpos", "has a quaternion of zeros"));
                }
                quaternion.iter_mut().for_each(|x| *x /= norm);
            }
            at = end;
        }
        let controls = filled(e, "ctrl", vec![0.0; written.len()])?;
        all.push(Keyframe {
            name: e.name(),
            time: e.number("time")?.unwrap_or(0.0),
            positions,
            velocities: filled(e, "qvel", vec![0.0; degrees])?,
            controls: controls
                .iter()
                .zip(written)
                .filter(|(_, w)| w.is_some())
                .map(|(c, _)| *c)
                .collect(),
        });
    }
    Ok(all)
}

/// As many numbers as there are in `default`, which stands where there are none.
fn filled(e: &Element, field: &'static str, default: Vec<f64>) -> Result<Vec<f64>, MjcfError> {
    let Some(list) = e.list(field, usize::MAX)? else { return Ok(default) };
    let (given, expected) = (list.len(), default.len());
    if given != expected {
        return Err(e.invalid(field, format!("has {given} numbers, and the model {expected}")));
    }
    Ok(list)
}
