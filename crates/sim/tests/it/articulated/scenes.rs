//! Random scenes.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use prehend_autodiff::Scalar;
use prehend_geometry::SplitMix64;
use prehend_sim::articulated::{Joint, JointModel, Link};
use prehend_sim::fields::{HalfSpace, Sphere};
use prehend_sim::joint_law::{
    JointDamper, JointFriction, JointLimits, JointSpring, PositionServo, VelocityServo,
};
use prehend_sim::{
    Body, BristleFriction, Bushing, ContactBodies, Coulomb, DynContactLaw, GapSmoothing,
    KelvinVoigt, Law, Model, RigidBody, State, Surface, model::BushingStiffness,
};

/// A nut on a thread.
#[derive(Debug)]
struct Thread;

impl JointModel for Thread {
    fn nv(&self) -> usize {
        1
    }
    fn placement<S: Scalar>(&self, q: &[S]) -> Isometry3<S> {
        let turn = Vector3::new(S::zero(), S::zero(), q[0]);
        let rise = Translation3::new(S::zero(), q[0].sin().times(0.02), q[0].times(0.05));
        Isometry3::from_parts(rise, prehend_autodiff::lie::so3_exp(&turn))
    }
}

pub(super) fn random_link(random: &mut SplitMix64, index: usize, floats: bool) -> Link {
    let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * random.normal());
    let place = Translation3::from(vector(0.1));
    let turn = UnitQuaternion::from_scaled_axis(vector(1.0));
    let axis = Unit::new_normalize(vector(1.0));
    let root = Matrix3::from_columns(&[vector(0.03), vector(0.03), vector(0.03)]);
    let choice = vector(1.0);
    let joint = match (choice.x.abs() * 1e6) as usize % 8 {
        _ if index == 0 && floats => Joint::Floating,
        0 => Joint::Spherical,
        1 => Joint::Fixed,
        2 => Joint::Prismatic(axis),
        3 => Joint::custom(Thread),
        _ => Joint::Revolute(axis),
    };
    let back = 1 + (choice.y.abs() * 1e6) as usize % 2;
    Link {
        name: format!("link {index}"),
        parent: index.checked_sub(back.min(index)).filter(|_| index > 0),
        t_parent_joint: Isometry3::from_parts(place, turn),
        joint,
        mass: 0.2 + 0.1 * choice.z.abs(),
        com: vector(0.02).into(),
        inertia: root * root.transpose() + Matrix3::identity() * 1e-3,
        armature: 1e-3 * (index % 3) as f64,
    }
}

const FRICTION: Coulomb = Coulomb { friction: 0.5, slip_scale: 5e-2 };
const SPRING: KelvinVoigt = KelvinVoigt { stiffness: 3e5, damping: 1e3 };

pub(super) fn coulomb_law() -> (Arc<dyn DynContactLaw>, GapSmoothing) {
    let law = Law::new(SPRING, FRICTION).unwrap();
    (Arc::new(law), GapSmoothing::Softplus { width: 2e-3 })
}

/// A tree whose links are balls, low over a floor, beside a free ball; everything is pressed together and moves.
pub(super) fn random_scene(seed: u64) -> (Model, State) {
    let mut random = SplitMix64::new(seed);
    let count = 1 + seed as usize % 6;
    let links = (0..count).map(|index| random_link(&mut random, index, seed.is_multiple_of(3)));
    let links: Vec<Link> = links.collect();
    let mut model = Model::new(Vector3::new(0.1, -0.2, -9.81));
    let floor = Body::fixed("floor")
        .with_field(Arc::new(HalfSpace { height: -0.02, ..HalfSpace::floor() }));
    let floor = model.add(floor);
    let ball = |model: &mut Model, body, radius: f64| {
        let body: &mut Body = &mut model.bodies[body];
        body.surface = Some(Arc::new(Surface::ball(radius).unwrap()));
        body.field = Some(Arc::new(Sphere { center: Point3::origin(), radius }));
    };
    let free = model.add(Body::dynamic("ball", RigidBody::ball(0.3, 0.06).unwrap()));
    ball(&mut model, free, 0.06);
    let bodies = model.add_articulation(links).unwrap();
    bodies.iter().for_each(|body| ball(&mut model, *body, 0.08));
    let (slides, smoothing) = coulomb_law();
    let holds = BristleFriction { friction: FRICTION, deflection: 1e-3 };
    let holds: Arc<dyn DynContactLaw> = Arc::new(Law::new(SPRING, holds).unwrap());
    for (index, &samples) in bodies.iter().enumerate() {
        let field = if index % 2 == 0 { floor } else { free };
        let law = if index % 3 == 2 { holds.clone() } else { slides.clone() };
        model.add_contact(ContactBodies { samples, field }, law, smoothing).unwrap();
        let moves = model.articulations[0].tree.links()[index].joint.nv();
        if moves == 0 || matches!(model.articulations[0].tree.links()[index].joint, Joint::Floating)
        {
            continue;
        }
        model.add_joint_force(samples, JointDamper { damping: 0.05 }).unwrap();
        match index % 3 {
            0 => {
                model.add_joint_force(samples, JointSpring { stiffness: 2.0, rest: 0.1 }).unwrap();
                let friction = JointFriction { friction: 0.1, velocity_scale: 0.1 };
                model.add_joint_force(samples, friction).unwrap();
            }
            1 => {
                let servo =
                    PositionServo { target: 0.3, stiffness: 5.0, damping: 0.1, max_effort: 50.0 };
                model.add_joint_force(samples, servo).unwrap();
            }
            _ => {
                let servo = VelocityServo { target: 1.0, damping: 0.3, max_effort: 50.0 };
                model.add_joint_force(samples, servo).unwrap();
                let limits =
                    JointLimits { lower: -0.01, upper: 0.01, stiffness: 50.0, damping: 0.2 };
                model.add_joint_force(samples, limits).unwrap();
            }
        }
    }
    if let [a, .., b] = bodies.as_slice() {
        model.add_symmetric_contact(*a, *b, slides, smoothing).unwrap();
    }
    if seed % 5 < 2 {
        let frames = [
            Isometry3::translation(0.01, 0.02, -0.03),
            Isometry3::new(Vector3::new(0.0, 0.1, 0.05), Vector3::new(0.3, -0.2, 0.5)),
        ];
        let (others, last) = ([free, floor], bodies[count - 1]);
        let inertia = if seed.is_multiple_of(2) { 1e-3 } else { 0.0 };
        let stiffness = BushingStiffness::critical(0.03, inertia, 0.05);
        let bodies = [last, others[seed as usize % 5]];
        model.add_bushing(Bushing { bodies, frames, stiffness }).unwrap();
    }
    let mut states = model.neutral_state();
    states[free].pose.translation.vector = Vector3::new(0.05, 0.02, 0.03);
    states[free].linear = Vector3::new(0.1, -0.3, -0.2);
    for (index, &link) in bodies.iter().enumerate() {
        let joint = model.articulations[0].tree.links()[index].joint.clone();
        let mut numbers = |n: usize| (0..n).map(|_| 0.3 * random.normal()).collect::<Vec<f64>>();
        let mut q: Vec<f64> = joint.neutral().to_vec();
        let change = numbers(q.len());
        q.iter_mut().zip(change).for_each(|(q, x)| *q += 0.3 * x);
        let v = numbers(joint.nv());
        model.set_joint(&mut states, link, &q, &v).unwrap();
    }
    (model, states)
}
