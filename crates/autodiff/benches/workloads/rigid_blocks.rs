//! The rigid body of `rigid_body.rs` in block nodes: one for the sum of all contacts, and the steps of
//! `prehend_autodiff::rigid`.

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use prehend_autodiff::lie::{cross_matrix, so3_exp};
use prehend_autodiff::{Fwd, LocalFunction, Scalar, rigid};

use super::workloads::rigid_body::{
    GRAVITY, INERTIA, STEP, Scene, State, TARGET, Wrench, push, wrench,
};

/// `rigid_body::miss` in block nodes.
pub(crate) fn miss<S: Scalar>(inputs: &[S; 12], scene: &Scene) -> S {
    let [r0, r1, r2, x, y, z, vx, vy, vz, wx, wy, wz] = *inputs;
    let inertia = Matrix3::from_diagonal(&Vector3::from(INERTIA));
    let inverse = Matrix3::from_diagonal(&Vector3::from(INERTIA.map(f64::recip)));
    let mut rotation = so3_exp(&Vector3::new(r0, r1, r2));
    let mut position = Vector3::new(x, y, z);
    let mut velocity = Vector3::new(vx, vy, vz);
    let mut spin = Vector3::new(wx, wy, wz);
    for _ in 0..scene.steps {
        let [i, j, k, w] = rotation.coords.into();
        let [v, s] = [velocity, spin].map(<[S; 3]>::from);
        let contacts = [i, j, k, w, position.z, v[0], v[1], v[2], s[0], s[1], s[2]];
        // In flight there is nothing to record.
        let [fx, fy, fz, tx, ty, tz] = if touches(&contacts, scene) {
            S::local(&Contacts { scene }, contacts)
        } else {
            [S::zero(); 6]
        };
        velocity += Vector3::new(fx, fy, fz.plus(-GRAVITY)).map(|force| force.times(STEP));
        let torque = Vector3::new(tx, ty, tz);
        let momentum = rigid::conjugated(&rotation, &inertia, &spin);
        let change = torque - cross(&spin, &momentum);
        let acceleration = rigid::conjugated(&rotation, &inverse, &change);
        spin += acceleration.map(|rate| rate.times(STEP));
        position += velocity.map(|rate| rate.times(STEP));
        rotation = rigid::turned(&rotation, &spin.map(|rate| rate.times(STEP)));
    }
    let offset = position - Vector3::from(TARGET.map(S::constant));
    let tilt = S::one() - (rotation * Vector3::z()).z;
    offset.dot(&offset) + tilt * tilt
}

/// `a.cross(b)`.
fn cross<S: Scalar>(a: &Vector3<S>, b: &Vector3<S>) -> Vector3<S> {
    Vector3::from(S::local(&Cross, [a.x, a.y, a.z, b.x, b.y, b.z]))
}

struct Cross;

impl LocalFunction<6, 3> for Cross {
    #[inline]
    fn evaluate<S: Scalar>(&self, [a, b, c, x, y, z]: [S; 6]) -> [S; 3] {
        Vector3::new(a, b, c).cross(&Vector3::new(x, y, z)).into()
    }

    #[inline]
    fn linearize(&self, [a, b, c, x, y, z]: [f64; 6]) -> Option<([f64; 3], [[f64; 6]; 3])> {
        let jacobian =
            [[0.0, z, -y, 0.0, -c, b], [-z, 0.0, x, c, 0.0, -a], [y, -x, 0.0, -b, a, 0.0]];
        Some(([b * z - c * y, c * x - a * z, a * y - b * x], jacobian))
    }
}

/// Whether any point is below the floor.
fn touches<S: Scalar>(contacts: &[S; 11], scene: &Scene) -> bool {
    let State { pose, .. } = state(contacts.map(S::value));
    scene.points.iter().any(|point| (pose * point).z < 0.0)
}

/// Force and torque of all contacts, of the rotation's coordinates (i, j, k, w), the height and both
/// velocities.
struct Contacts<'a> {
    scene: &'a Scene,
}

impl LocalFunction<11, 6> for Contacts<'_> {
    #[inline]
    fn evaluate<S: Scalar>(&self, x: [S; 11]) -> [S; 6] {
        let Wrench { force, torque } = wrench(&state(x), self.scene);
        [force.x, force.y, force.z, torque.x, torque.y, torque.z]
    }

    /// A contact's force depends on four numbers, its height and velocity; how those depend on a small
    /// turn θ and the velocities of the body is linear algebra.
    fn linearize(&self, x: [f64; 11]) -> Option<([f64; 6], [[f64; 11]; 6])> {
        let State { pose, velocity, angular_velocity } = state(x);
        let by_spin = cross_matrix(&angular_velocity);
        let (mut force, mut torque) = (Vector3::zeros(), Vector3::zeros());
        // Derivatives of force and torque with respect to height, velocity, spin and turn.
        let mut by_height = [Vector3::zeros(); 2];
        let mut by = [[Matrix3::zeros(); 3]; 2];
        for point in &self.scene.points {
            let arm = pose.rotation * point.coords;
            let z = arm.z + pose.translation.z;
            if z >= 0.0 {
                continue;
            }
            let v = velocity + angular_velocity.cross(&arm);
            let [z, vx, vy, vz] = Fwd::<4>::variables([z, v.x, v.y, v.z]);
            let pushed = push(z, Vector3::new(vx, vy, vz), self.scene.stiffness);
            let f = pushed.map(|f| f.value);
            let height_slope = pushed.map(|f| f.derivative[0]);
            let slope = Matrix3::from_fn(|r, c| pushed[r].derivative[c + 1]);
            let cross = cross_matrix(&arm);
            // A turn moves the arm by θ × arm = −[arm]× θ, and with it height, velocity and lever.
            let mut arm_slope = slope * by_spin;
            arm_slope.set_column(2, &(arm_slope.column(2) + height_slope));
            let slopes = [slope, -slope * cross, -arm_slope * cross];
            force += f;
            torque += arm.cross(&f);
            by_height[0] += height_slope;
            by_height[1] += arm.cross(&height_slope);
            for (sum, slope) in by[0].iter_mut().zip(&slopes) {
                *sum += slope;
            }
            for (sum, slope) in by[1].iter_mut().zip(&slopes) {
                *sum += cross * slope;
            }
            by[1][2] += cross_matrix(&f) * cross;
        }
        let turn = rigid::rotation_vector_jacobian(&pose.rotation);
        let jacobian = std::array::from_fn(|row| {
            let (part, row) = (row / 3, row % 3);
            let [velocity, spin, by_turn] = &by[part];
            let coordinates = by_turn.row(row) * turn;
            std::array::from_fn(|column| match column {
                0..4 => coordinates[column],
                4 => by_height[part][row],
                5..8 => velocity[(row, column - 5)],
                _ => spin[(row, column - 8)],
            })
        });
        Some(([force.x, force.y, force.z, torque.x, torque.y, torque.z], jacobian))
    }
}

#[inline]
fn state<S: Scalar>(x: [S; 11]) -> State<S> {
    let [i, j, k, w, z, vx, vy, vz, wx, wy, wz] = x;
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    State {
        pose: Isometry3::from_parts(Translation3::new(S::zero(), S::zero(), z), rotation),
        velocity: Vector3::new(vx, vy, vz),
        angular_velocity: Vector3::new(wx, wy, wz),
    }
}
