//! An ellipsoid of surface samples in a hand of a palm and five fingers.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, UnitQuaternion, Vector3};
use prehend_geometry::{DistanceField, FieldSample};
use prehend_sim::{
    Body, BodyState, ContactBodies, DynContactLaw, GapSmoothing, Model, RigidBody, Surface,
};

/// Mass of the object \[kg\].
const MASS: f64 = 0.2;
/// Half axes of the object \[m\].
const AXES: [f64; 3] = [0.03, 0.055, 0.03];

/// A palm whose top is the plane z = 0 and five fingers that stand on it.
pub(crate) struct Hand;

/// Ends and radius of the fingers \[m\].
fn fingers() -> impl Iterator<Item = (Point3<f64>, Point3<f64>, f64)> {
    let finger = |k: i32| {
        let y = -0.036 + 0.024 * f64::from(k);
        (Point3::new(0.042, y, 0.0), Point3::new(0.036, y, 0.06), 0.010)
    };
    let thumb = (Point3::new(-0.044, 0.0, 0.0), Point3::new(-0.038, 0.0, 0.05), 0.012);
    (0..4).map(finger).chain([thumb])
}

/// Distance to something of which `offset` leads away, less `radius`; curved across `offset` in the directions of
/// `free`.
fn rounded(offset: Vector3<f64>, radius: f64, free: &Matrix3<f64>) -> FieldSample {
    let length = offset.norm().max(1e-12);
    let gradient = offset / length;
    let hessian = (free - gradient * gradient.transpose()) / length;
    FieldSample { distance: length - radius, gradient, hessian }
}

/// From the palm's middle to `point`, and how far beyond each of its sides that is.
fn from_palm(point: &Point3<f64>) -> [Vector3<f64>; 2] {
    let from = point - Point3::new(0.0, 0.0, -0.01);
    [from, from.abs() - Vector3::new(0.05, 0.05, 0.01)]
}

fn palm_distance(point: &Point3<f64>) -> f64 {
    let [_, beyond] = from_palm(point);
    beyond.map(|b| b.max(0.0)).norm() + beyond.max().min(0.0)
}

fn palm(point: &Point3<f64>) -> FieldSample {
    let [from, beyond] = from_palm(point);
    if beyond.max() <= 0.0 {
        let axis = beyond.imax();
        let mut gradient = Vector3::zeros();
        gradient[axis] = from[axis].signum();
        return FieldSample { distance: beyond[axis], gradient, hessian: Matrix3::zeros() };
    }
    let offset = Vector3::from_fn(|i, _| beyond[i].max(0.0) * from[i].signum());
    let free = Matrix3::from_diagonal(&beyond.map(|b| if b > 0.0 { 1.0 } else { 0.0 }));
    rounded(offset, 0.0, &free)
}

/// Where between its ends a finger is nearest to `point`, as a fraction beyond 0..=1 past them, and the offset from
/// there.
fn from_finger(point: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> (f64, Vector3<f64>) {
    let (along, from) = (b - a, point - a);
    let t = from.dot(&along) / along.norm_squared();
    (t, from - along * t.clamp(0.0, 1.0))
}

fn finger(point: &Point3<f64>, (a, b, radius): &(Point3<f64>, Point3<f64>, f64)) -> FieldSample {
    let (t, offset) = from_finger(point, a, b);
    let axis = (b - a).normalize();
    let held = if (0.0..=1.0).contains(&t) { axis * axis.transpose() } else { Matrix3::zeros() };
    rounded(offset, *radius, &(Matrix3::identity() - held))
}

impl DistanceField for Hand {
    fn sample(&self, point: &Point3<f64>, reach: f64) -> Option<FieldSample> {
        let mut nearest = (palm_distance(point), None);
        for shape in fingers() {
            let distance = from_finger(point, &shape.0, &shape.1).1.norm() - shape.2;
            if distance < nearest.0 {
                nearest = (distance, Some(shape));
            }
        }
        let sample = || nearest.1.map_or_else(|| palm(point), |shape| finger(point, &shape));
        (nearest.0 <= reach).then(sample)
    }
}

/// Number of the object's body.
pub(crate) const OBJECT: usize = 1;

/// The hand, fixed, and the object with `count` samples of one unit of area together.
pub(crate) fn model(
    count: usize,
    law: Arc<dyn DynContactLaw>,
    smoothing: GapSmoothing,
) -> anyhow::Result<Model> {
    let golden = std::f64::consts::PI * (1.0 + 5f64.sqrt());
    let point = |i: usize| {
        let place = i as f64 + 0.5;
        let (sine, cosine) = (golden * place).sin_cos();
        let height = 1.0 - 2.0 * place / count as f64;
        let across = (1.0 - height * height).sqrt();
        Point3::new(AXES[0] * cosine * across, AXES[1] * height, AXES[2] * sine * across)
    };
    let points: Vec<Point3<f64>> = (0..count).map(point).collect();
    let [a, b, c] = AXES.map(|axis| axis * axis * MASS / 5.0);
    let inertia = Matrix3::from_diagonal(&Vector3::new(b + c, a + c, a + b));
    let rigid = RigidBody::new(MASS, inertia, Point3::origin())?;
    let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
    let field = model.add(Body::fixed("hand").with_field(Arc::new(Hand)));
    let object = Body::dynamic("object", rigid).with_surface(Surface::uniform(&points, 1.0)?);
    let samples = model.add(object);
    model.add_contact(ContactBodies { samples, field }, law, smoothing)?;
    Ok(model)
}

/// Where the object begins: just in touch with palm and fingers, falling and turning slowly.
pub(crate) fn start() -> BodyState {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(1.0, 0.05, 0.02, 0.03));
    let translation = Vector3::new(0.002, -0.001, 0.0295);
    BodyState {
        pose: Isometry3::from_parts(translation.into(), rotation),
        linear: Vector3::new(0.02, 0.01, -0.05),
        angular: Vector3::new(0.3, 0.1, 0.2),
    }
}
