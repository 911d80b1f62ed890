//! The inertia that actuators feel, for damping ratios.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Isometry3, Point3, Vector3};

use super::actuator::Transmission;
use super::joint::{Joint, JointKind};
use super::{JointIndex, Model};

/// The factorized mass matrix of a model with all joints at their references.
pub(super) struct Reflected {
    cholesky: Cholesky<f64, Dyn>,
    /// Of each joint of each body, its first degree of freedom.
    first: Vec<Vec<usize>>,
}

/// A degree of freedom in the world: what turns about the anchor, what slides.
struct Freedom {
    turn: Vector3<f64>,
    slide: Vector3<f64>,
    anchor: Point3<f64>,
    armature: f64,
}

impl Reflected {
    /// `None` where something weighs nothing and yet moves.
    pub(super) fn new(model: &Model) -> Option<Self> {
        let poses = model.reference_poses();
        let mut freedoms = Vec::new();
        let mut first = Vec::new();
        // Of each body, the degrees of freedom that move it.
        let mut moving: Vec<Vec<usize>> = Vec::new();
        for (body, pose) in model.bodies.iter().zip(&poses) {
            let mut all = body.parent.map(|p| moving[p].clone()).unwrap_or_default();
            let begin = freedoms.len();
            let mut of_joints = Vec::new();
            for joint in &body.joints {
                of_joints.push(freedoms.len());
                freedoms.extend(of(joint, pose));
            }
            all.extend(begin..freedoms.len());
            moving.push(all);
            first.push(of_joints);
        }
        let armatures = DVector::from_iterator(freedoms.len(), freedoms.iter().map(|f| f.armature));
        let mut matrix = DMatrix::from_diagonal(&armatures);
        for ((body, pose), moving) in model.bodies.iter().zip(&poses).zip(&moving) {
            let Some(part) = body.inertial.map(|inertial| inertial.moved(pose)) else { continue };
            let velocity = |f: &Freedom| f.slide + f.turn.cross(&(part.com - f.anchor));
            for &i in moving {
                let (force, torque) =
                    (velocity(&freedoms[i]) * part.mass, part.inertia * freedoms[i].turn);
                for &j in moving {
                    matrix[(i, j)] +=
                        force.dot(&velocity(&freedoms[j])) + torque.dot(&freedoms[j].turn);
                }
            }
        }
        for (index, tendon) in model.tendons.iter().enumerate().filter(|(_, t)| t.armature > 0.0) {
            let slope = slope(model, &first, freedoms.len(), Transmission::Tendon(index));
            matrix += &slope * slope.transpose() * tendon.armature;
        }
        Some(Self { cholesky: matrix.cholesky()?, first })
    }

    /// The inertia at the length of an actuator: 1/(J M⁻¹ Jᵀ), with everything else free to move.
    pub(super) fn of(&self, model: &Model, transmission: Transmission, gear: f64) -> f64 {
        let count = self.cholesky.l_dirty().nrows();
        let slope = slope(model, &self.first, count, transmission) * gear;
        let mobility = slope.dot(&self.cholesky.solve(&slope));
        if mobility > 0.0 { 1.0 / mobility } else { 0.0 }
    }
}

/// Derivative of the length of what an actuator pulls at by each of `count` degrees of freedom.
fn slope(
    model: &Model,
    first: &[Vec<usize>],
    count: usize,
    transmission: Transmission,
) -> DVector<f64> {
    let mut slope = DVector::zeros(count);
    let mut add = |joint: JointIndex, by: f64| slope[first[joint.body][joint.joint]] += by;
    match transmission {
        Transmission::Joint(joint) => add(joint, 1.0),
        Transmission::Tendon(tendon) => {
            model.tendons[tendon].joints.iter().for_each(|t| add(t.joint, t.coefficient));
        }
    }
    slope
}

/// The degrees of freedom of a joint of a body that is at `pose`.
fn of(joint: &Joint, pose: &Isometry3<f64>) -> Vec<Freedom> {
    let anchor = pose * joint.anchor;
    let turning = |turn: Vector3<f64>, anchor: Point3<f64>| Freedom {
        turn,
        slide: Vector3::zeros(),
        anchor,
        armature: joint.armature,
    };
    let sliding = |slide: Vector3<f64>| Freedom { slide, ..turning(Vector3::zeros(), anchor) };
    let axes = [0, 1, 2].map(|k| Vector3::ith(k, 1.0));
    let about = |anchor: Point3<f64>| axes.map(|axis| turning(pose * axis, anchor));
    match joint.kind {
        JointKind::Hinge => vec![turning(pose * *joint.axis, anchor)],
        JointKind::Slide => vec![sliding(pose * *joint.axis)],
        JointKind::Ball => about(anchor).into(),
        JointKind::Free => {
            axes.map(sliding).into_iter().chain(about(pose.translation.vector.into())).collect()
        }
    }
}
