//! Shapes of all sizes: numbers, or an error, at their singular points too.

use nalgebra::{Point3, UnitQuaternion};
use parry3d_f64::shape::{Ball, Capsule, Cone, Cuboid, Cylinder, HalfSpace, Shape as ParryShape};
use prehend_geometry::DistanceField;
use prehend_sim::fields::{Sphere, SphereCavity};
use prehend_sim::{Body, RigidBody, Shape, ShapeOptions, Surface};

#[test]
fn shapes_of_all_sizes() {
    for x in [0.0, 1e-300, 1e-100, 1e-60, 1e-9, 1e6, 1e60, 1e150] {
        let shapes: [Box<dyn ParryShape>; 5] = [
            Box::new(Ball::new(x)),
            Box::new(Cuboid::new([0.01, 0.01, x].into())),
            Box::new(Capsule::new_y(x, x)),
            Box::new(Cylinder::new(x, x)),
            Box::new(Cone::new(x, x)),
        ];
        for shape in shapes.iter().filter_map(|shape| Shape::from_parry(&**shape).ok()) {
            for point in [Point3::origin(), Point3::new(0.0, x, 0.0), Point3::new(x, 1.0, 1.0)] {
                assert_finite(&**shape.field(), &point);
            }
            if let Ok(body) = Body::from_shape("body", &shape, 1e3) {
                let rigid = body.rigid().unwrap();
                let inverse = rigid.inverse_world_inertia(&UnitQuaternion::identity());
                assert!(rigid.inertia().iter().chain(inverse.iter()).all(|x| x.is_finite()));
            }
        }
    }
}

#[test]
fn what_has_no_shape_or_too_many_samples_is_refused() {
    let (center, radius) = (Point3::origin(), 0.1);
    assert_finite(&Sphere { center, radius }, &center);
    assert_finite(&SphereCavity { center, radius }, &center);
    assert!(Shape::from_parry(&HalfSpace { normal: [0.0; 3].into() }).is_err());
    let close = ShapeOptions { spacing: Some(1e-12), ..ShapeOptions::default() };
    assert!(Shape::from_parry_with(&Cylinder::new(0.1, 0.1), &close).is_err());
    assert!(Surface::cuboid([0.1; 3], 1e-12).is_err());
    assert!(RigidBody::ball(1e-300, 1e-9).is_err());
}

fn assert_finite(field: &dyn DistanceField, point: &Point3<f64>) {
    if let Some(sample) = field.sample(point, f64::INFINITY) {
        let mut all = sample.gradient.iter().chain(sample.hessian.iter());
        assert!(sample.distance.is_finite() && all.all(|x| x.is_finite()), "{point}: {sample:?}");
    }
}
