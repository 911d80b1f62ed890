//! States that a model comes with.

use super::Model;
use super::element::Element;
use super::error::Result;
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
) -> Result<Vec<Keyframe>> {
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
                match norm > 1e-14 {
                    true => quaternion.iter_mut().for_each(|x| *x /= norm),
                    false => quaternion.copy_from_slice(&[1.0, 0.0, 0.0, 0.0]),
                }
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

/// As many numbers as there are in `default`, which stands where there are none; those that are missing at the end are zero.
fn filled(e: &Element, field: &'static str, default: Vec<f64>) -> Result<Vec<f64>> {
    let Some(mut list) = e.list(field, usize::MAX)? else { return Ok(default) };
    let (given, expected) = (list.len(), default.len());
    if given > expected {
        return Err(e.invalid(field, format!("has {given} numbers, and the model {expected}")));
    }
    list.resize(expected, 0.0);
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::super::Model;
    use crate::read_options::ReadOptions;

    fn read(key: &str) -> Result<Model, String> {
        let partial = ReadOptions { partial: true, ..ReadOptions::default() };
        let xml = format!(
            "<mujoco><worldbody><body pos=\"0 0 1\"><freejoint/><geom size=\"1\"/></body><body><joint name=\"q\" ref=\"180\"/>\
            <geom size=\"1\"/></body></worldbody><actuator><muscle joint=\"q\"/><motor joint=\"q\"/></actuator>\
            <keyframe><key {key}/></keyframe></mujoco>"
        );
        Model::from_str_with(&xml, None, &partial).map_err(|e| e.to_string())
    }

    #[test]
    fn what_is_not_told_is_at_its_reference() {
        let frame = read("name=\"k\" ctrl=\"3 4\"").unwrap().keyframes.remove(0);
        let pi = std::f64::consts::PI;
        assert_eq!(frame.positions, [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, pi]);
        assert_eq!(frame.velocities, [0.0; 7]);
        // The first actuator has not been read.
        assert_eq!(frame.controls, [4.0]);
        let frame = read("qpos=\"1 2 3 0 0 2 0 4\" time=\"5\"").unwrap().keyframes.remove(0);
        assert_eq!(frame.positions, [1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 0.0, 4.0]);
        assert_eq!((frame.time, frame.controls.as_slice()), (5.0, &[0.0][..]));
    }

    #[test]
    fn lists_must_fit_the_model() {
        let error = read("name=\"k\" qvel=\"1 2 3 4 5 6 7 8\"").unwrap_err();
        assert!(error.contains("key 'k': qvel has 8 numbers, and the model 7"), "{error}");
        // As MuJoCo has it: zeros at the end, and no turn where a quaternion is zero.
        let frame = read("qvel=\"1\" qpos=\"1 2\"").unwrap().keyframes.remove(0);
        assert_eq!(frame.velocities, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(frame.positions, [1.0, 2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
