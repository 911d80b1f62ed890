//! The inertia that actuators feel, for damping ratios.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Isometry3, Point3, Vector3};

use super::actuator::Transmission;
use super::joint::{Joint, JointKind};
use super::{JointIndex, Model, TendonPart};

/// The factorized mass matrix of a model with all joints at their references.
pub(super) struct Reflected {
    cholesky: Cholesky<f64, Dyn>,
    places: Places,
}

/// Degrees of freedom and bodies with all joints at their references.
struct Places {
    poses: Vec<Isometry3<f64>>,
    freedoms: Vec<Freedom>,
    /// Of each joint of each body, its first degree of freedom.
    first: Vec<Vec<usize>>,
    /// Of each body, the degrees of freedom that move it.
    moving: Vec<Vec<usize>>,
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
            let velocity = |f: &Freedom| f.velocity(&part.com);
            for &i in moving {
                let (force, torque) =
                    (velocity(&freedoms[i]) * part.mass, part.inertia * freedoms[i].turn);
                for &j in moving {
                    matrix[(i, j)] +=
                        force.dot(&velocity(&freedoms[j])) + torque.dot(&freedoms[j].turn);
                }
            }
        }
        let places = Places { poses, freedoms, first, moving };
        for (index, tendon) in model.tendons.iter().enumerate().filter(|(_, t)| t.armature > 0.0) {
            // That of cables around obstacles is not known here.
            if let Some(slope) = places.slope(model, Transmission::Tendon(index)) {
                matrix += &slope * slope.transpose() * tendon.armature;
            }
        }
        Some(Self { cholesky: matrix.cholesky()?, places })
    }

    /// The inertia along a joint with this many degrees of freedom: of the mean of their mobilities.
    pub(super) fn of_joint(&self, joint: JointIndex, freedoms: usize) -> f64 {
        let first = self.places.first[joint.body][joint.joint];
        let mobility = (first..first + freedoms).map(|k| {
            let unit = DVector::from_fn(self.cholesky.l_dirty().nrows(), |i, _| f64::from(i == k));
            self.cholesky.solve(&unit)[k]
        });
        freedoms as f64 / mobility.sum::<f64>()
    }

    /// The inertia at the length of an actuator: 1/(J M⁻¹ Jᵀ), with everything else free to move.
    pub(super) fn of(
        &self,
        model: &Model,
        transmission: Transmission,
        gear: &[f64; 6],
    ) -> Option<f64> {
        let slope = self.places.slope(model, transmission)? * gear[0];
        let mobility = slope.dot(&self.cholesky.solve(&slope));
        Some(if mobility > 0.0 { 1.0 / mobility } else { 0.0 })
    }
}

impl Places {
    /// Derivative of the length of what an actuator pulls at by each degree of freedom; `None` of what is neither a sum of joints nor a
    /// cable from site to site.
    fn slope(&self, model: &Model, transmission: Transmission) -> Option<DVector<f64>> {
        let mut slope = DVector::zeros(self.freedoms.len());
        let mut add = |joint: JointIndex, by: f64| slope[self.first[joint.body][joint.joint]] += by;
        match transmission {
            Transmission::Joint { joint, .. } if model.joint(joint).kind.velocities() == 1 => {
                add(joint, 1.0);
            }
            Transmission::Tendon(tendon) => {
                let tendon = &model.tendons[tendon];
                tendon.joints.iter().for_each(|t| add(t.joint, t.coefficient));
                self.add_cable(&tendon.parts, &mut slope)?;
            }
            _ => return None,
        }
        Some(slope)
    }

    fn add_cable(&self, parts: &[TendonPart], slope: &mut DVector<f64>) -> Option<()> {
        let mut last: Option<(Option<usize>, Point3<f64>)> = None;
        let mut share = 1.0;
        for part in parts {
            match *part {
                TendonPart::Around { .. } => return None,
                TendonPart::Pulley { divisor } => (last, share) = (None, 1.0 / divisor),
                TendonPart::Site { body, point } => {
                    let here = (body, body.map_or(point, |body| self.poses[body] * point));
                    if let Some(before) = last.replace(here) {
                        let along = (here.1 - before.1).try_normalize(1e-15).unwrap_or_default();
                        for ((body, place), sign) in [(here, share), (before, -share)] {
                            for &freedom in body.iter().flat_map(|body| &self.moving[*body]) {
                                let moved = self.freedoms[freedom].velocity(&place);
                                slope[freedom] += sign * along.dot(&moved);
                            }
                        }
                    }
                }
            }
        }
        Some(())
    }
}

impl Freedom {
    /// The velocity of a point that it moves, by its own.
    fn velocity(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.slide + self.turn.cross(&(point - self.anchor))
    }
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
