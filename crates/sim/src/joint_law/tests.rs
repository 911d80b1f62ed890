//! Every law against differences, and what is refused.

use nalgebra::{Isometry3, Vector3};
use prehend_autodiff::{Fwd, Scalar};

use crate::articulated::{ArticulationError, Joint, JointModel, Link};
use crate::contact::LawError;
use crate::joint_law::*;
use crate::{Body, BuildError, Model, RigidBody, SimulationError};

fn laws() -> Vec<Box<dyn DynJointLaw>> {
    let servo = PositionServo { target: 0.7, stiffness: 3.0, damping: 0.2, max_effort: 1e3 };
    let limits = JointLimits { lower: -0.1, upper: 0.1, stiffness: 40.0, damping: 0.3 };
    let everything = [f64::NEG_INFINITY, f64::INFINITY];
    let actuator = AffineActuator {
        control: 0.4,
        gain: [2.0, 0.3, -0.1],
        bias: [0.1, -1.0, -0.2],
        control_range: [-1.0, 1.0],
        force_range: everything,
        rate_range: everything,
        period: 0.0,
    };
    let muscle = Muscle {
        activation: 0.4,
        force: 0.01,
        origin: -1.0,
        unit: 1.0,
        shortest: 0.5,
        longest: 1.6,
        fastest: 1.5,
        passive: 1.3,
        stretching: 1.2,
    };
    let (quadratic, cubic) = (1.0, 3.0);
    let spring = PolynomialSpring { linear: 2.0, quadratic, cubic, lower: -0.2, upper: 0.2 };
    vec![
        Box::new(muscle),
        Box::new(spring),
        Box::new(PolynomialDamper { linear: 2.0, quadratic: 0.05, cubic }),
        Box::new(JointSpring { stiffness: 2.0, rest: 0.3 }),
        Box::new(SlackSpring { stiffness: 2.0, lower: -0.2, upper: 0.2 }),
        Box::new(JointDamper { damping: 0.5 }),
        Box::new(JointFriction { friction: 0.4, velocity_scale: 0.1 }),
        Box::new(limits),
        Box::new(Motor { effort: 0.7 }),
        Box::new(servo),
        Box::new(VelocityServo { target: 0.5, damping: 2.0, max_effort: 1e3 }),
        Box::new(actuator),
    ]
}

#[test]
fn efforts_have_their_derivatives_and_passive_laws_take_energy() {
    for (index, law) in laws().iter().enumerate() {
        let p = law.param_values();
        assert_eq!(p.len(), law.param_names().len());
        law.check(&p).unwrap();
        for (q, v) in [(0.5, 0.3), (-0.4, -0.2), (0.05, 0.0), (0.3, -0.7)] {
            let step = 1e-6;
            let difference = |f: &dyn Fn(f64) -> f64| (f(step) - f(-step)) / (2.0 * step);
            let found = law.effort_by_motion(&p, q, v);
            assert_eq!(found.value, law.effort(&p, q, v));
            let by_position = difference(&|x| law.effort(&p, q + x, v));
            let by_velocity = difference(&|x| law.effort(&p, q, v + x));
            for (slope, expected) in found.derivative.into_iter().zip([by_position, by_velocity]) {
                assert!((slope - expected).abs() < 1e-7, "{index}: {slope} {expected}");
            }
            for k in 0..p.len() {
                let mut along: Vec<Fwd<1>> = p.iter().map(|p| Fwd::constant(*p)).collect();
                along[k] = Fwd::variable(p[k], 0);
                let [slope] = law.effort_along(&along, q, v).derivative;
                let expected = difference(&|x| {
                    let mut moved = p.clone();
                    moved[k] += x;
                    law.effort(&moved, q, v)
                });
                assert!((slope - expected).abs() < 1e-7, "{index} {k}: {slope} {expected}");
            }
            if law.is_passive() {
                let damped = law.effort(&p, q, v) - law.effort(&p, q, 0.0);
                assert!(damped * v <= 1e-12, "{index} brings energy");
            }
        }
        assert!(law.effort(&[], 0.0, 0.0).is_nan());
        assert!(matches!(law.check(&[]), Err(LawError::Count { .. })));
    }
}

#[test]
fn a_slack_spring_pulls_back_to_its_range() {
    let spring = SlackSpring { stiffness: 2.0, lower: -0.2, upper: 0.1 };
    for (position, effort) in [(-0.5, 0.6), (-0.1, 0.0), (0.1, 0.0), (0.4, -0.6)] {
        let found = DynJointLaw::effort(&spring, &spring.param_values(), position, 3.0);
        assert!((found - effort).abs() < 1e-15, "{position}: {found}");
    }
}

#[test]
fn what_brings_no_energy_says_so() {
    let passive: Vec<bool> = laws().iter().map(|law| law.is_passive()).collect();
    let expected = [false, true, false, true, true, true, true, true, false, false, false, false];
    assert_eq!(passive, expected);
}

#[test]
fn what_cannot_be_is_refused_where_it_is_added() {
    let mut model = Model::new(Vector3::zeros());
    let rod = RigidBody::cuboid(1.0, [0.1; 3]).unwrap();
    let hinge = Joint::Revolute(Vector3::x_axis());
    let stone = model.add(Body::dynamic("stone", rod));
    let links = vec![Link::new("rod", hinge.clone(), &rod), Link::new("plate", Joint::Fixed, &rod)];
    let links = model.add_articulation(links).unwrap();
    let other = model.add_articulation(vec![Link::new("other", hinge.clone(), &rod)]).unwrap()[0];
    let damper = |damping| JointDamper { damping };
    let refused = |error: BuildError| error.to_string();
    for (error, message) in [
        (
            refused(model.add_joint_force(links[0], damper(-1.0)).unwrap_err()),
            "the law along the joint of link 'rod': damping must be zero or positive, is -1",
        ),
        (
            refused(model.add_joint_force(links[1], damper(1.0)).unwrap_err()),
            "the joint of link 'plate' has no axis 0 to act along: a fixed or a floating one has none",
        ),
        (
            refused(model.add_joint_force(stone, damper(1.0)).unwrap_err()),
            "body 'stone' is no link of an articulation",
        ),
    ] {
        assert_eq!(error, message);
    }
    let both = [(links[0].into(), 1.0), (other.into(), -1.0)];
    let apart = model.add_coupled_force(&both, std::sync::Arc::new(damper(1.0))).unwrap_err();
    assert!(matches!(apart, BuildError::Apart { .. }));
    let id = model.add_joint_force(links[0], damper(1.0)).unwrap();
    assert!(model.joint_force_mut(id).set_param("friction", 1.0).is_err());
    model.joint_force_mut(id).set_param("damping", f64::NAN).unwrap();
    let states = model.neutral_state();
    assert!(matches!(
        model.simulate(&states, 0.1),
        Err(SimulationError::Build(BuildError::JointLaw { .. }))
    ));

    #[derive(Debug)]
    struct Many;
    impl JointModel for Many {
        fn nv(&self) -> usize {
            4
        }
        fn placement<S: Scalar>(&self, _: &[S]) -> Isometry3<S> {
            Isometry3::identity()
        }
    }
    let many = model.add_articulation(vec![Link::new("many", Joint::custom(Many), &rod)]);
    let expected = ArticulationError::DegreesOfFreedom { link: "many".to_owned(), count: 4 };
    assert_eq!(many, Err(BuildError::Articulation(expected)));
    let light = model.add_articulation(vec![Link::massless("feather", hinge.clone())]);
    assert!(matches!(light, Err(BuildError::Articulation(ArticulationError::Mass { .. }))));
    let carried = Link::new("stone", Joint::Fixed, &rod).on(0, Isometry3::identity());
    assert!(model.add_articulation(vec![Link::massless("feather", hinge), carried]).is_ok());
}
