//! The scenes, with the settings that come to mind first.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::Scalar;
use prehend_geometry::DistanceField;
use prehend_geometry::shapes::sphere;
use prehend_sim::contact::{Bounce, Hertz, Stribeck, regularized_coulomb};
use prehend_sim::fields::{HalfSpace, Sphere, SphereCavity};
use prehend_sim::{
    Body, BodyId, BodyState, BristleFriction, ContactBodies, ContactCalibration, ContactForce,
    ContactKinematics, ContactLaw, Coulomb, DynContactLaw, GapSmoothing, HuntCrossley, KelvinVoigt,
    Law, Material, Model, RigidBody, Shape, State, Surface,
};

use super::parcel;
use super::scene::Input::{self, Law as ByLaw, Start};
use super::scene::Output::{self, Position, Velocity, Yaw};
use super::scene::Scene;

/// Force grows with the square of the penetration. Stiffness per area \[N/m⁴\] and friction coefficient.
struct Quadratic([f64; 2]);

impl ContactLaw for Quadratic {
    fn params(&self) -> &[f64] {
        &self.0
    }
    fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
        let normal = p[0] * contact.gap * contact.gap * contact.area;
        let tangential = regularized_coulomb(p[1], normal, &contact.slip, 1e-3);
        ContactForce { normal, tangential }
    }
    fn cutoff(&self) -> f64 {
        0.0
    }
}

pub(crate) const SMOOTH: GapSmoothing = GapSmoothing::Softplus { width: 5e-5 };
pub(crate) const HARD: GapSmoothing = GapSmoothing::Hard;

/// Hunt and Crossley's law for a body of `mass` \[kg\] on samples of 4 cm² together, 0.5 mm deep, with Coulomb friction.
pub(crate) fn hunt_crossley(mass: f64, friction: f64, slip_scale: f64) -> Arc<dyn DynContactLaw> {
    let target = ContactCalibration { mass, gravity: 9.81, penetration: 5e-4, contact_area: 4e-4 };
    let bounce = Bounce { restitution: 0.4, impact_speed: 1.0 };
    let normal = HuntCrossley::from_target(&target, 1.0, bounce).unwrap();
    Arc::new(Law::new(normal, Coulomb { friction, slip_scale }).unwrap())
}

pub(crate) fn kelvin_voigt(friction: f64, slip_scale: f64) -> Arc<dyn DynContactLaw> {
    let normal = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
    Arc::new(Law::new(normal, Coulomb { friction, slip_scale }).unwrap())
}

pub(crate) fn down() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -9.81)
}

/// A free body of `mass` \[kg\], isotropic `inertia` \[kg m²\] and equal samples of `area` \[m²\] together.
pub(crate) fn body(name: &str, mass: f64, inertia: f64, points: &[Point3<f64>], area: f64) -> Body {
    let rigid = RigidBody::new(mass, Matrix3::identity() * inertia, Point3::origin()).unwrap();
    Body::dynamic(name, rigid).with_surface(Surface::uniform(points, area).unwrap())
}

/// The corners of a box.
pub(crate) fn corners(half: [f64; 3]) -> Vec<Point3<f64>> {
    let sign = |i: usize, axis: usize| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] };
    (0..8).map(|i| Point3::new(sign(i, 0), sign(i, 1), sign(i, 2))).collect()
}

/// `count` points spread over an ellipsoid.
fn ellipsoid(count: usize, axes: [f64; 3]) -> Vec<Point3<f64>> {
    let point = |i: usize| {
        let (t, z) = (2.4 * i as f64, 1.0 - (2 * i + 1) as f64 / count as f64);
        let r = (1.0 - z * z).sqrt();
        Point3::new(axes[0] * r * t.cos(), axes[1] * r * t.sin(), axes[2] * z)
    };
    (0..count).map(point).collect()
}

/// Four feet below the center of mass.
fn feet(height: f64) -> Vec<Point3<f64>> {
    let feet = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    feet.map(|(x, y)| Point3::new(0.03 * x, 0.03 * y, -height)).to_vec()
}

/// A cube of 10 cm and 0.37 kg.
pub(crate) fn cube() -> Body {
    body("cube", 0.37, 0.37 * 0.01 / 6.0, &corners([0.05; 3]), 8e-4)
}

/// Where a body is, and how it moves.
pub(crate) fn state(pose: Isometry3<f64>, linear: [f64; 3], angular: [f64; 3]) -> BodyState {
    BodyState { linear: linear.into(), angular: angular.into(), ..BodyState::at_rest(pose) }
}

/// `body` on a fixed `field` under `gravity`; the body is number 1.
pub(crate) fn on(
    field: impl DistanceField + 'static,
    gravity: Vector3<f64>,
    body: Body,
    (law, smoothing): (Arc<dyn DynContactLaw>, GapSmoothing),
    start: BodyState,
) -> (Model, State) {
    let mut model = Model::new(gravity);
    let ground = model.add(Body::fixed("ground").with_field(Arc::new(field)));
    let samples = model.add(body);
    let bodies = ContactBodies { samples, field: ground };
    model.add_contact(bodies, law, smoothing).unwrap();
    (model, State::new([BodyState::at_rest(Isometry3::identity()), start]))
}

pub(crate) fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

/// A scene that goes on for `time` \[s\], differentiated by `input`; nudges of 1e-5 suit most.
fn scene(
    name: &'static str,
    (model, start): (Model, State),
    time: f64,
    (output, input): (Output, Input),
    bad_step: f64,
) -> Scene {
    let nudge = match input {
        Start(..) => 1e-5,
        ByLaw(contact, parameter) => 1e-3 * model.contacts[contact].params()[parameter],
    };
    Scene { name, model, start, time, input, output, nudge, bad_step }
}

/// All of them.
pub(crate) fn all() -> Vec<Scene> {
    let mut all = sliding();
    all.extend(falling());
    all.extend(several());
    all.extend(holding());
    all
}

/// All of them, turned, fields too, and pulled at; many bodies, meshes among them.
pub(crate) fn turned() -> Vec<Scene> {
    let turn = UnitQuaternion::from_euler_angles(0.4, -0.3, 1.1);
    let mut all = all();
    for Scene { model, start, .. } in &mut all {
        model.gravity = turn * model.gravity;
        for state in start.bodies_mut() {
            state.pose = turn * state.pose;
            (state.linear, state.angular) = (turn * state.linear, turn * state.angular);
        }
        let wrench = Vector6::new(0.1, -0.2, 0.05, 1e-3, -2e-3, 5e-4);
        model.bodies.iter_mut().for_each(|body| body.external_wrench = wrench);
    }
    for bristles in [true, false] {
        let name = if bristles { "ten bodies with bristles" } else { "ten bodies" };
        all.push(scene(name, many(bristles), 0.03, (Position(1, 0), Start(1, 6)), 1e-3));
    }
    all
}

/// Balls, boxes and meshes that fall on each other.
fn many(bristles: bool) -> (Model, State) {
    let mut model = Model::new(down());
    let floor = Shape::half_space(Vector3::z_axis()).unwrap();
    model.add(Body::fixed_from_shape("floor", &floor));
    let shapes = [
        Shape::ball(0.02).unwrap(),
        Shape::cuboid([0.02, 0.015, 0.01]).unwrap(),
        Shape::from_mesh(&sphere(0.02, 16)).unwrap(),
    ];
    let mut states = vec![BodyState::at_rest(Isometry3::identity())];
    for i in 0..10 {
        let body = Body::from_shape(&format!("body {i}"), &shapes[i % 3], 1000.0).unwrap();
        let place = Vector3::new((i % 3) as f64, (i / 3 % 2) as f64, 1.0 + i as f64);
        let place = place.component_mul(&Vector3::new(0.03, 0.02, 0.018));
        let pose = Isometry3::new(place, Vector3::new(0.3 * i as f64, 0.7, -0.2));
        states.push(body.rigid().unwrap().at_rest(&pose));
        model.add(body);
    }
    if bristles {
        model.add_contacts(Material::default()).unwrap();
    } else {
        let all: Vec<BodyId> = model.body_ids().collect();
        model.add_contacts_between(&all, &all, kelvin_voigt(0.5, 1e-2), SMOOTH).unwrap();
    }
    (model, State::new(states))
}

/// Contacts that hold.
fn holding() -> Vec<Scene> {
    let law = |mass: f64, friction: f64| {
        let target =
            ContactCalibration { mass, gravity: 9.81, penetration: 2e-4, contact_area: 4e-4 };
        let bounce = Bounce { restitution: 0.4, impact_speed: 1.0 };
        let normal = HuntCrossley::from_target(&target, 1.0, bounce).unwrap();
        let friction = Coulomb { friction, slip_scale: 1e-2 };
        Arc::new(Law::new(normal, BristleFriction { friction, deflection: 1e-4 }).unwrap())
    };
    let floor = HalfSpace::floor;
    let stool = body("stool", 0.2, 1e-4, &feet(0.015), 4e-4);
    let sliding = state(at(0.0, 0.0, 0.0148), [0.3, 0.0, 0.0], [0.0; 3]);
    let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.2), Vector3::new(0.3, 0.2, 0.1));
    let thrown = state(pose, [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]);
    let rigid = RigidBody::new(0.2, Matrix3::identity() * 5e-5, Point3::origin()).unwrap();
    let round = Surface::uniform(&[Point3::origin()], 4e-4).unwrap().rounded(0.02).unwrap();
    let ball = Body::dynamic("ball", rigid).with_surface(round);
    let spinning = state(at(0.0, 0.0, 0.04), [0.2, 0.0, 0.0], [0.0, -20.0, 5.0]);
    let stool = on(floor(), down(), stool, (law(0.2, 0.5), HARD), sliding);
    let cube = on(floor(), down(), cube(), (law(0.37, 0.3), HARD), thrown);
    let ball = on(floor(), down(), ball, (law(0.2, 0.5), HARD), spinning);
    let by_speed = (Position(1, 0), Start(1, 6));
    vec![
        scene("a stool slides and holds", stool.clone(), 0.2, by_speed, 5e-3),
        scene("the same by its friction", stool, 0.2, (Position(1, 0), ByLaw(0, 3)), 5e-3),
        scene("a cube is thrown and holds", cube, 0.5, by_speed, 4e-3),
        scene("a ball with backspin lands and rolls", ball, 0.3, by_speed, 5e-3),
    ]
}

/// Things that slide and stick.
fn sliding() -> Vec<Scene> {
    let stool = |law: Arc<dyn DynContactLaw>, smoothing| {
        let stool = body("stool", 0.2, 1e-4, &feet(0.015), 4e-4);
        on(
            HalfSpace::floor(),
            down(),
            stool,
            (law, smoothing),
            state(at(0.0, 0.0, 0.015), [0.3, 0.0, 0.0], [0.0; 3]),
        )
    };
    let quadratic = || Arc::new(Quadratic([1e11, 0.4]));
    let stribeck =
        Stribeck { friction: 0.6, kinetic_friction: 0.3, stribeck_speed: 0.05, slip_scale: 1e-3 };
    let normal = KelvinVoigt { stiffness: 1e7, damping: 1e5 };
    let stribeck = Arc::new(Law::new(normal, stribeck).unwrap());
    let incline = || {
        let block = body("block", 0.3, 2e-4, &feet(0.015), 4e-4);
        let (sin, cos) = 0.35_f64.sin_cos();
        let tilted = Vector3::new(9.81 * sin, 0.0, -9.81 * cos);
        on(
            HalfSpace::floor(),
            tilted,
            block,
            (kelvin_voigt(0.5, 1e-3), SMOOTH),
            state(at(0.0, 0.0, 0.0147), [-0.2, 0.1, 0.0], [0.0; 3]),
        )
    };
    let conveyor = || {
        let (model, mut start) = stool(kelvin_voigt(0.5, 1e-3), SMOOTH);
        start[0].linear.y = 0.5;
        (model, start)
    };
    let spinning = || {
        let coin = body("coin", 0.1, 2e-5, &ellipsoid(80, [0.02, 0.02, 0.004]), 4e-4);
        on(
            HalfSpace::floor(),
            down(),
            coin,
            (hunt_crossley(0.1, 0.3, 1e-3), HARD),
            state(at(0.0, 0.0, 0.004), [0.1, 0.0, 0.0], [0.0, 0.0, 20.0]),
        )
    };
    let slide = (Position(1, 0), Start(1, 6));
    vec![
        scene(
            "a law of one's own slides a stool to a halt",
            stool(quadratic(), SMOOTH),
            0.2,
            slide,
            1e-3,
        ),
        scene("the same with a hard onset", stool(quadratic(), HARD), 0.2, slide, 1e-3),
        scene("the guide's stool", stool(kelvin_voigt(0.5, 1e-2), SMOOTH), 0.2, slide, 5e-3),
        scene(
            "a stool by its friction",
            stool(hunt_crossley(0.2, 0.5, 1e-3), HARD),
            0.1,
            (Position(1, 0), ByLaw(0, 3)),
            5e-3,
        ),
        scene("Stribeck friction lets go", stool(stribeck, SMOOTH), 0.2, slide, 2e-3),
        scene("up an incline and stuck", incline(), 0.2, (Position(1, 1), Start(1, 7)), 2e-3),
        scene("a stool lands on a conveyor", conveyor(), 0.08, (Position(1, 1), Start(0, 7)), 1e-2),
        scene("a coin spins and drifts", spinning(), 0.3, (Position(1, 0), Start(1, 11)), 4e-3),
    ]
}

/// Things that fall, bounce and tumble.
fn falling() -> Vec<Scene> {
    let point = || body("pebble", 0.1, 1e-5, &[Point3::origin()], 4e-4);
    let oblique = || {
        on(
            HalfSpace::floor(),
            down(),
            point(),
            (hunt_crossley(0.1, 0.5, 1e-4), HARD),
            state(at(0.0, 0.0, 0.1), [0.8, 0.0, -1.0], [0.0; 3]),
        )
    };
    let elastic = || {
        let law = Law::new(Hertz { stiffness: 1e10 }, Coulomb { friction: 0.0, slip_scale: 1e-2 });
        on(
            HalfSpace::floor(),
            down(),
            point(),
            (Arc::new(law.unwrap()), HARD),
            state(at(0.0, 0.0, 0.2), [0.0; 3], [0.0; 3]),
        )
    };
    let ball = |count: usize| {
        let ball = body("ball", 0.2, 0.4 * 0.2 * 0.05 * 0.05, &ellipsoid(count, [0.05; 3]), 0.0314);
        on(
            HalfSpace::floor(),
            down(),
            ball,
            (Arc::new(Quadratic([1e10, 0.5])), SMOOTH),
            state(at(0.0, 0.0, 0.06), [0.5, 0.0, 0.0], [0.0; 3]),
        )
    };
    let toss = || {
        let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.2), Vector3::new(0.3, 0.2, 0.1));
        on(
            HalfSpace::floor(),
            down(),
            cube(),
            (hunt_crossley(0.37, 0.3, 1e-2), HARD),
            state(pose, [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]),
        )
    };
    let flat = || {
        on(
            HalfSpace::floor(),
            down(),
            cube(),
            (kelvin_voigt(0.3, 1e-2), SMOOTH),
            state(at(0.0, 0.0, 0.052), [0.0; 3], [0.0; 3]),
        )
    };
    let deep = || {
        on(
            HalfSpace::floor(),
            down(),
            cube(),
            (hunt_crossley(0.37, 0.3, 1e-2), HARD),
            state(at(0.0, 0.0, 0.048), [0.0; 3], [0.0; 3]),
        )
    };
    let egg = |field: SphereCavity| {
        let inertia = Matrix3::from_diagonal(&Vector3::new(6e-5, 9e-5, 5e-5));
        let rigid = RigidBody::new(0.2, inertia, Point3::new(1e-3, -2e-3, 3e-3)).unwrap();
        let surface = Surface::uniform(&ellipsoid(200, [0.03, 0.025, 0.02]), 6e-3).unwrap();
        let start = state(
            Isometry3::new(Vector3::new(0.005, 0.0, 0.021), Vector3::new(0.1, 0.2, 0.3)),
            [0.0, 0.05, 0.0],
            [1.0, -0.5, 0.7],
        );
        on(
            field,
            down(),
            Body::dynamic("egg", rigid).with_surface(surface),
            (kelvin_voigt(0.4, 1e-2), SMOOTH),
            start,
        )
    };
    let bowl = SphereCavity { center: Point3::new(0.0, 0.0, 0.1), radius: 0.1 };
    // A pebble that would pass over the peg in one step.
    let peg = Sphere { center: Point3::new(0.5, 0.0, 0.0), radius: 0.01 };
    let passing = on(
        peg,
        Vector3::zeros(),
        point(),
        (hunt_crossley(0.1, 0.2, 1e-2), HARD),
        state(at(0.0, 0.004, 0.0), [2.0, 0.0, 0.0], [0.0; 3]),
    );
    let stiff = || {
        let law = Law::new(
            KelvinVoigt { stiffness: 1e9, damping: 1e6 },
            Coulomb { friction: 0.3, slip_scale: 1e-2 },
        );
        let pose = Isometry3::new(Vector3::new(0.0, 0.0, 0.1), Vector3::new(0.2, 0.1, 0.0));
        on(
            HalfSpace::floor(),
            down(),
            cube(),
            (Arc::new(law.unwrap()), SMOOTH),
            state(pose, [0.3, 0.0, 0.0], [0.0; 3]),
        )
    };
    vec![
        scene(
            "a pebble bounces with friction, hard onset",
            oblique(),
            0.3,
            (Position(1, 0), Start(1, 2)),
            5e-3,
        ),
        scene("a pebble bounces without loss", elastic(), 0.5, (Position(1, 2), Start(1, 2)), 2e-3),
        scene("a ball of 500 samples", ball(500), 0.2, (Position(1, 0), Start(1, 2)), 2e-3),
        scene("a ball of 60 samples", ball(60), 0.2, (Velocity(1, 0), Start(1, 6)), 2e-3),
        scene("a cube is thrown", toss(), 0.5, (Position(1, 0), Start(1, 6)), 4e-3),
        scene("the same by its spin", toss(), 0.5, (Position(1, 1), Start(1, 10)), 4e-3),
        scene("a box lands flat", flat(), 0.1, (Position(1, 2), ByLaw(0, 0)), 1e-2),
        scene("a box starts in the floor", deep(), 0.2, (Position(1, 2), Start(1, 2)), 1e-2),
        scene("a stiff box tumbles", stiff(), 0.2, (Position(1, 0), Start(1, 6)), 1e-3),
        scene("an egg rocks in a bowl", egg(bowl), 0.3, (Position(1, 0), Start(1, 0)), 4e-3),
        scene("a pebble meets a thin peg", passing, 0.4, (Position(1, 1), Start(1, 1)), 4e-3),
    ]
}

/// Several bodies.
fn several() -> Vec<Scene> {
    let ball = |name: &str| {
        body(name, 0.2, 5e-5, &ellipsoid(300, [0.02; 3]), 5e-3)
            .with_field(Arc::new(Sphere { center: Point3::origin(), radius: 0.02 }))
    };
    let collision = || {
        let mut model = Model::new(Vector3::zeros());
        let (a, b) = (model.add(ball("red")), model.add(ball("white")));
        model.add_symmetric_contact(a, b, kelvin_voigt(0.3, 1e-2), SMOOTH).unwrap();
        let start = State::new([
            state(at(-0.1, 0.005, 0.0), [1.0, 0.0, 0.0], [0.0; 3]),
            BodyState::at_rest(Isometry3::identity()),
        ]);
        (model, start)
    };
    let pushed = || {
        let mut model = Model::new(down());
        let floor = model.add(Body::fixed("floor").with_field(Arc::new(HalfSpace::floor())));
        let block = model.add(cube());
        let pusher = Sphere { center: Point3::new(-0.08, 0.01, 0.05), radius: 0.02 };
        let arm = |time: f64| {
            let mut state = BodyState::at_rest(Isometry3::translation(0.1 * time, 0.0, 0.0));
            state.linear.x = 0.1;
            state
        };
        let arm = model.add(Body::kinematic("pusher", arm).with_field(Arc::new(pusher)));
        let lattice: Vec<Point3<f64>> = (0..441)
            .map(|i| {
                Point3::new(-0.05, (i % 21) as f64 * 5e-3 - 0.05, (i / 21) as f64 * 5e-3 - 0.05)
            })
            .chain(corners([0.05; 3]))
            .collect();
        model.bodies[block] = body("block", 0.37, 6e-4, &lattice, 0.01);
        for field in [floor, arm] {
            let bodies = ContactBodies { samples: block, field };
            model.add_contact(bodies, kelvin_voigt(0.4, 1e-2), SMOOTH).unwrap();
        }
        let still = BodyState::at_rest(Isometry3::identity());
        (model, State::new([still, state(at(0.0, 0.0, 0.05), [0.0; 3], [0.0; 3]), still]))
    };
    vec![
        scene("two balls collide", collision(), 0.3, (Position(1, 1), Start(0, 1)), 4e-3),
        scene("a parcel is tipped", parcel::tipped(), 0.7, (Yaw(1), ByLaw(0, 2)), 5e-3),
        scene(
            "a block is pushed off its center",
            pushed(),
            0.5,
            (Position(1, 1), Start(1, 1)),
            5e-3,
        ),
    ]
}
