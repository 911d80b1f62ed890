//! An ellipsoid that settles between a palm and five fingers: the scene that simulators are compared on.
//!
//! Everybody integrates the same equations on the same numbers: a grid of the hand's signed distance interpolated
//! linearly, samples of equal weight, a penalty with damping on approach, regularized Coulomb friction, and
//! semi-implicit Euler with the rotation advanced to first order.

mod equations;
mod grid;

use std::sync::Arc;

use nalgebra::{
    Isometry3, Matrix3, Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3,
};
use prehend_autodiff::Scalar;
use prehend_geometry::DistanceField;
use prehend_sim::{
    Body, BodyState, ContactBodies, DynContactLaw, GapSmoothing, Model, RigidBody, Surface,
    TimeSteps,
};

pub(crate) use equations::FirstOrder;
use equations::SmoothedPenalty;
use grid::LinearGrid;

/// \[kg\]
const MASS: f64 = 0.2;
/// \[s\]
const STEP: f64 = 1e-3;
/// Half axes along the model's axes \[m\].
const AXES: [f64; 3] = [0.03, 0.055, 0.03];
/// Where the ellipsoid should end \[m\].
const TARGET: Vector3<f64> = Vector3::new(0.0, 0.0, 0.035);

/// The hand and its field, made once.
pub(crate) struct Grasp {
    field: Arc<dyn DistanceField>,
}

impl Grasp {
    pub(crate) fn new() -> Self {
        Self { field: Arc::new(LinearGrid::of_hand()) }
    }

    /// Hand (body 0) and ellipsoid (body 1) with `count` samples.
    pub(crate) fn model(&self, count: usize, smoothing: GapSmoothing) -> anyhow::Result<Model> {
        let squares = AXES.map(|a| a * a);
        let moments = [squares[1] + squares[2], squares[0] + squares[2], squares[0] + squares[1]];
        let inertia = Matrix3::from_diagonal(&(Vector3::from(moments) * (MASS / 5.0)));
        let rigid = RigidBody::new(MASS, inertia, Point3::origin())?;
        // Weights are in the law: a sample stands for itself.
        let surface = Surface::new(&spiral(count), &vec![1.0; count])?;
        let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
        let field = model.add(Body::fixed("hand").with_field(Arc::clone(&self.field)));
        let samples = model.add(Body::dynamic("ellipsoid", rigid).with_surface(surface));
        let law: Arc<dyn DynContactLaw> = Arc::new(SmoothedPenalty::shared_by(count));
        model.add_contact(ContactBodies { samples, field }, law, smoothing)?;
        Ok(model)
    }
}

/// Where hand and ellipsoid begin.
pub(crate) fn start() -> [BodyState; 2] {
    let rotation: UnitQuaternion<f64> = Unit::new_normalize(Quaternion::new(1.0, 0.05, 0.02, 0.03));
    let pose = Isometry3::from_parts(Translation3::new(0.002, -0.001, 0.0295), rotation);
    let (linear, angular) = (Vector3::new(0.02, 0.01, -0.05), Vector3::new(0.3, 0.1, 0.2));
    [BodyState::at_rest(Isometry3::identity()), BodyState { pose, linear, angular }]
}

pub(crate) fn time_steps(steps: usize) -> TimeSteps {
    TimeSteps { dt: STEP, steps }
}

/// How far from the target, and how fast, the ellipsoid ends.
pub(crate) fn loss<S: Scalar>(state: &BodyState<S>) -> S {
    let off = state.pose.translation.vector - TARGET.map(S::constant);
    off.norm_squared().times(100.0) + state.linear.norm_squared() + state.angular.norm_squared()
}

/// Loss and its gradient by the initial translation \[1/m\] and turn \[1/rad\] of the ellipsoid.
pub(crate) type Derivatives = (f64, [f64; 6]);

/// Reference of JAX for 2000 samples and 20 steps with Grasp'D's leak of a tenth at any distance.
pub(crate) const LEAKY_REFERENCE: Derivatives = (
    2.0984574920526,
    [
        5924.0832307006,
        -204.63812234556,
        528.74477528365,
        32.112273186398,
        71.917648678977,
        49.351515840698,
    ],
);

/// Reference of JAX 0.10 in double precision for `count` samples and `steps` steps.
///
/// # Panics
/// For numbers that it was not asked about.
pub(crate) fn reference(count: usize, steps: usize) -> Derivatives {
    match (count, steps) {
        (500, 20) => (
            2.132029677529,
            [
                3706.38400343,
                313.598563806,
                315.919235896,
                1.08760160514,
                -7.20911545027,
                22.1275272467,
            ],
        ),
        (500, 100) => (
            3.295388729648,
            [
                254.079212985,
                -46.1562327139,
                1059.82356232,
                51.0455899799,
                1.1561906309,
                1.51494083103,
            ],
        ),
        (2000, 20) => (
            2.098457492053,
            [
                3468.63582617,
                51.6147234541,
                252.160446425,
                2.15700587171,
                -1.25728902171,
                10.7881121345,
            ],
        ),
        (2000, 100) => (
            3.300597788226,
            [
                101.868444889,
                -88.9716929472,
                1038.91735375,
                51.2171007102,
                2.93291824654,
                0.670679683138,
            ],
        ),
        (8000, 20) => (
            2.121946853812,
            [
                3472.13846292,
                124.677512767,
                249.389890432,
                2.28207321772,
                -1.92495078279,
                11.6727018101,
            ],
        ),
        (8000, 100) => (
            3.304870898419,
            [
                124.682232576,
                -81.5459847082,
                1042.32763912,
                51.1809439348,
                2.26463915572,
                0.622776744776,
            ],
        ),
        _ => panic!("no reference for {count} samples and {steps} steps"),
    }
}

/// `count` samples of the ellipsoid on a golden-angle spiral about the model's y axis, in single precision \[m\].
fn spiral(count: usize) -> Vec<Point3<f64>> {
    let golden = std::f64::consts::PI * (1.0 + 5f64.sqrt());
    let point = |i: usize| {
        let i = i as f64 + 0.5;
        let polar = (1.0 - 2.0 * i / count as f64).acos();
        let (sin, cos) = (golden * i).sin_cos();
        let unit = [cos * polar.sin(), polar.cos(), sin * polar.sin()];
        Point3::from(std::array::from_fn(|k| f64::from((unit[k] * AXES[k]) as f32)))
    };
    (0..count).map(point).collect()
}
