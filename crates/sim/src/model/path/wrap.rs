//! The shortest way between two points around a circle, a sphere or a cylinder.
//!
//! All is decided by values; what is decided is computed with derivatives.

use std::f64::consts::{PI, TAU};

use nalgebra::{Vector2, Vector3};
use prehend_autodiff::Scalar;

/// Iterations for a point of reflection.
const ITERATIONS: usize = 30;

/// A way that touches an obstacle.
pub(super) struct Wrapped<S: Scalar> {
    /// Points where it begins and ends to touch \[m\].
    pub(super) touch: [Vector3<S>; 2],
    /// Its length between them \[m\].
    pub(super) length: S,
}

/// The way around a sphere, or a cylinder about the z axis, in its own frame; `None` where it is straight. With `side` it winds
/// around as a way by that point does, or runs through the inside where the point is.
pub(super) fn around<S: Scalar>(
    ends: [Vector3<S>; 2],
    radius: f64,
    is_cylinder: bool,
    side: Option<Vector3<S>>,
) -> Option<Wrapped<S>> {
    let (x, y) = if is_cylinder {
        (Vector3::x(), Vector3::y())
    } else {
        let x = ends[0] / ends[0].norm();
        let normal = ends[0].cross(&ends[1]);
        // Any plane will do where all is on one line.
        let normal = match normal.norm_squared().value() > 1e-30 {
            true => normal / normal.norm(),
            false => across(&x),
        };
        (x, normal.cross(&x))
    };
    let flat = |place: &Vector3<S>| Vector2::new(place.dot(&x), place.dot(&y));
    let [a, b] = [flat(&ends[0]), flat(&ends[1])];
    if [a, b].iter().any(|p| p.norm_squared().value() < radius * radius) {
        return None;
    }
    let [p, q] = [a, b].map(|p| p.map(S::value));
    let is_inside = side.is_some_and(|side| side.map(S::value).norm() < radius);
    let (touch, length) = match side.map(|side| flat(&side).map(S::value)) {
        Some(_) if is_inside => {
            let point = reflection([a, b], [p, q], radius)?;
            ([point; 2], S::zero())
        }
        side => {
            let clockwise = chosen([p, q], radius, side)?;
            tangents([a, b], radius, clockwise)
        }
    };
    let mut touch = touch.map(|p| x * p.x + y * p.y);
    let mut length = length;
    if is_cylinder {
        // A helix, whose height is in proportion to the way from above.
        let [before, after] =
            [(a, touch[0]), (b, touch[1])].map(|(p, t)| (p - Vector2::new(t.x, t.y)).norm());
        let slope = (ends[1].z - ends[0].z) / (before + length + after);
        touch[0].z = ends[0].z + slope * before;
        touch[1].z = ends[0].z + slope * (before + length);
        let height = touch[1].z - touch[0].z;
        length = if length.value() > 0.0 {
            (length * length + height * height).sqrt()
        } else {
            S::zero()
        };
    }
    Some(Wrapped { touch, length })
}

/// A direction across `x`.
fn across<S: Scalar>(x: &Vector3<S>) -> Vector3<S> {
    let least = x.map(S::value).iamin();
    let normal = x.cross(&Vector3::ith(least, S::one()));
    normal / normal.norm()
}

/// Sense in which the shortest one around a circle turns, clockwise or not; `None` where it is straight.
fn chosen(ends: [Vector2<f64>; 2], radius: f64, side: Option<Vector2<f64>>) -> Option<bool> {
    let [a, b] = ends;
    let leans: f64 = ends.iter().map(|p| (radius / p.norm()).min(1.0).acos()).sum();
    if let Some(side) = side {
        // It winds around the center as the way by the side does, whether or not the straight line meets the circle.
        let turn = angle(&a, &side) + angle(&side, &b);
        return (turn.abs() > leans).then_some(turn < 0.0);
    }
    let along = b - a;
    let square = along.norm_squared();
    if square < 1e-30 {
        return None;
    }
    let nearest = a + along * (-a.dot(&along) / square).clamp(0.0, 1.0);
    (nearest.norm() <= radius).then_some(angle(&a, &b) < 0.0)
}

/// The angle from one direction to another, from −π to π.
fn angle(from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
    from.perp(to).atan2(from.dot(to))
}

/// Points where the tangents from two points touch a circle, and the length of the arc between.
fn tangents<S: Scalar>(
    [a, b]: [Vector2<S>; 2],
    radius: f64,
    clockwise: bool,
) -> ([Vector2<S>; 2], S) {
    let sign = if clockwise { -1.0 } else { 1.0 };
    let touch = |p: Vector2<S>, sign: f64| {
        let square = p.norm_squared();
        let tangent = (square.plus(-radius * radius)).max(S::zero()).sqrt().times(sign * radius);
        let to = |own: S, other: S| (own.times(radius * radius) + other * tangent) / square;
        Vector2::new(to(p.x, -p.y), to(p.y, p.x))
    };
    let (first, last) = (touch(a, sign), touch(b, -sign));
    let cross = (first.x * last.y - first.y * last.x).times(sign);
    let angle = cross.atan2(first.dot(&last));
    let angle = if angle.value() < 0.0 { angle.plus(TAU) } else { angle };
    ([first, last], angle.times(radius))
}

/// The point of a circle that a way from within touches: where both parts make the same angle with it. `None` where the straight line
/// passes through.
fn reflection<S: Scalar>(
    ends: [Vector2<S>; 2],
    [p, q]: [Vector2<f64>; 2],
    radius: f64,
) -> Option<Vector2<S>> {
    let along = q - p;
    let square = along.norm_squared();
    if square < 1e-30 {
        return None;
    }
    let share = -p.dot(&along) / square;
    if (0.0..=1.0).contains(&share) && (p + along * share).norm() < radius {
        return None;
    }
    // By the angle from the first end's direction towards the second's.
    let between = p.perp(&q).atan2(p.dot(&q));
    let (mut low, mut high) = (0.0, between.abs().min(PI));
    let start = p.y.atan2(p.x);
    let at = |angle: f64| start + angle.copysign(between);
    for _ in 0..ITERATIONS {
        let middle = 0.5 * (low + high);
        let slope = unbalance([p, q], radius, at(middle)) * 1.0_f64.copysign(between);
        if slope < 0.0 { low = middle } else { high = middle }
    }
    // Newton's steps carry the derivatives.
    let mut angle = S::constant(at(0.5 * (low + high)));
    for _ in 0..3 {
        let plain = angle.value();
        let step = 1e-6;
        let [p, q] = [p, q];
        let curvature = (unbalance([p, q], radius, plain + step)
            - unbalance([p, q], radius, plain - step))
            / (2.0 * step);
        if curvature == 0.0 {
            break;
        }
        angle -= unbalance(ends, radius, angle).times(1.0 / curvature);
    }
    let (sin, cos) = angle.sin_cos();
    Some(Vector2::new(cos.times(radius), sin.times(radius)))
}

/// Derivative by the angle of a circle's point of its distances from two others.
fn unbalance<S: Scalar>(ends: [Vector2<S>; 2], radius: f64, angle: S) -> S {
    let (sin, cos) = angle.sin_cos();
    let (point, tangent) = (Vector2::new(cos, sin) * S::constant(radius), Vector2::new(-sin, cos));
    let mut sum = S::zero();
    for end in ends {
        let apart = point - end;
        sum += apart.dot(&tangent) / apart.norm();
    }
    sum.times(radius)
}
