//! Ways through the links of an articulation whose lengths forces act along: cables over pulleys and around obstacles, thrusters, cranks.

mod wrap;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use prehend_autodiff::Scalar;
use prehend_autodiff::lie::so3_log;

use crate::articulated::Kinematics;
use crate::spatial::{angular, linear, spatial};

/// A point of a link, or of the model where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Anchor {
    /// Index of the link in its articulation.
    pub(crate) link: Option<usize>,
    /// In the link's frame \[m\].
    pub(crate) point: Point3<f64>,
}

/// A frame of a link, or of the model where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LinkFrame {
    pub(crate) link: Option<usize>,
    pub(crate) t_link_frame: Isometry3<f64>,
}

/// A cylinder about the z axis of a frame, or a sphere, that a cable runs around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Obstacle {
    pub(crate) frame: LinkFrame,
    pub(crate) radius: f64,
    pub(crate) is_cylinder: bool,
    /// The cable runs on the side of this point, or inside where the point is.
    pub(crate) side: Option<Anchor>,
}

/// A part of a way.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PathPart {
    /// A straight line, whose length counts by `factor`.
    Straight { ends: [Anchor; 2], factor: f64 },
    /// The shortest way around an obstacle, or a straight line that does not meet it.
    Around { ends: [Anchor; 2], obstacle: Obstacle, factor: f64 },
    /// Direction of a force and torque along the axes of a frame: it has a rate, but no length.
    Twist { frame: LinkFrame, gear: [f64; 6] },
    /// Place and turn of a frame in another, along the other's axes: links that carry both move neither.
    Relative { frame: LinkFrame, reference: LinkFrame, gear: [f64; 6] },
    /// The turn of a ball joint's or a free joint's link times the first or last three numbers along the link's axes, or, `in_parent`, the
    /// joint's; without a reference, a pose in the joint's frame, it has no length.
    Turn {
        link: usize,
        gear: [f64; 6],
        is_free: bool,
        in_parent: bool,
        reference: Option<Isometry3<f64>>,
    },
    /// The angle of a ball joint's link from where the joint is at its neutral coordinates.
    Angle { link: usize },
    /// A rod from a crank to a slider along the z axis of a frame: how far the slider is.
    Crank { pin: Anchor, slider: LinkFrame, rod: f64, factor: f64 },
    /// The coordinate of a joint of one axis, whose degree of freedom this is.
    Axis { coordinate: usize, dof: usize, factor: f64 },
    /// A polynomial, its lowest power first, of the length of another way less `reference`.
    Polynomial { path: Box<Path>, reference: f64, coefficients: [f64; 5] },
}

/// A way: its parts one after the other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Path(pub(crate) Vec<PathPart>);

/// The length of a way and its derivatives.
pub(crate) struct Length<S> {
    pub(crate) value: S,
    /// By each degree of freedom of the articulation.
    pub(crate) slopes: Vec<S>,
    /// Its acceleration while those of all joints are zero; no number of ways around obstacles and of polynomials.
    pub(crate) drift: S,
}

impl Path {
    /// The length with the links where they are by coordinates `q`; the drift only where it is wanted.
    pub(crate) fn length<S: Scalar>(
        &self,
        at: &Kinematics<'_, S>,
        q: &[S],
        with_drift: bool,
    ) -> Length<S> {
        let mut sum = Sum { at, value: S::zero(), slopes: vec![S::zero(); at.axes.len()] };
        let mut drift = S::zero();
        for part in &self.0 {
            match part {
                PathPart::Straight { ends, factor } => {
                    let [a, b] = ends.map(|end| sum.point(&end));
                    sum.add_line([(ends[0].link, a), (ends[1].link, b)], *factor);
                    if with_drift {
                        drift +=
                            at.drift_of_line([(ends[0].link, a), (ends[1].link, b)]).times(*factor);
                    }
                }
                PathPart::Around { ends, obstacle, factor } => {
                    sum.add_around(ends, obstacle, *factor);
                    if with_drift {
                        drift = S::constant(f64::NAN);
                    }
                }
                PathPart::Twist { frame, gear } => {
                    let (rotation, place) = sum.frame(frame);
                    let [force, torque] = along(&rotation, gear);
                    sum.add_wrench(frame.link, &place, &force, &torque, &|_| true);
                }
                PathPart::Relative { frame, reference, gear } => {
                    sum.add_relative(frame, reference, gear);
                }
                PathPart::Turn { link, gear, is_free, in_parent, reference } => {
                    sum.add_turn(*link, gear, [*is_free, *in_parent], reference.as_ref());
                }
                PathPart::Angle { link } => sum.add_angle(*link),
                PathPart::Crank { pin, slider, rod, factor } => {
                    sum.add_crank(pin, slider, *rod, *factor);
                }
                PathPart::Axis { coordinate, dof, factor } => {
                    sum.value += q[*coordinate].times(*factor);
                    sum.slopes[*dof] += S::constant(*factor);
                }
                PathPart::Polynomial { path, reference, coefficients } => {
                    let inner = path.length(at, q, false);
                    let x = inner.value - S::constant(*reference);
                    let (mut value, mut slope) = (S::zero(), S::zero());
                    for coefficient in coefficients.iter().rev() {
                        slope = slope * x + value;
                        value = value * x + S::constant(*coefficient);
                    }
                    sum.value += value;
                    for (own, inner) in sum.slopes.iter_mut().zip(inner.slopes) {
                        *own += inner * slope;
                    }
                    if with_drift {
                        drift = S::constant(f64::NAN);
                    }
                }
            }
        }
        Length { value: sum.value, slopes: sum.slopes, drift }
    }
}

/// The force and the torque of a gear along the axes of a frame.
fn along<S: Scalar>(rotation: &Matrix3<S>, gear: &[f64; 6]) -> [Vector3<S>; 2] {
    let [x, y, z, u, v, w] = gear.map(S::constant);
    [rotation * Vector3::new(x, y, z), rotation * Vector3::new(u, v, w)]
}

/// A length that is being added up. Places are about the origin of the kinematics.
struct Sum<'a, 'b, S: Scalar> {
    at: &'a Kinematics<'b, S>,
    value: S,
    slopes: Vec<S>,
}

impl<S: Scalar> Sum<'_, '_, S> {
    fn frame(&self, frame: &LinkFrame) -> (Matrix3<S>, Vector3<S>) {
        let own = frame.t_link_frame.rotation.to_rotation_matrix().into_inner().map(S::constant);
        let place = frame.t_link_frame.translation.vector.map(S::constant);
        match frame.link {
            Some(link) => {
                let rotation = self.at.rotations[link];
                (rotation * own, self.at.places[link] + rotation * place)
            }
            None => (own, place - self.at.origin.map(S::constant)),
        }
    }

    fn point(&self, anchor: &Anchor) -> Vector3<S> {
        let (link, t_link_frame) = (anchor.link, Isometry3::from(anchor.point.coords));
        self.frame(&LinkFrame { link, t_link_frame }).1
    }

    /// Adds what moves with a force at `place` and a torque on a link, by the degrees of freedom that count.
    fn add_wrench(
        &mut self,
        link: Option<usize>,
        place: &Vector3<S>,
        force: &Vector3<S>,
        torque: &Vector3<S>,
        counts: &dyn Fn(usize) -> bool,
    ) {
        let Some(link) = link else { return };
        let wrench = spatial(force, &(torque + place.cross(force)));
        for dof in self.at.tree.dofs_of(link).filter(|dof| counts(*dof)) {
            self.slopes[dof] += self.at.axes[dof].dot(&wrench);
        }
    }

    fn add_line(&mut self, [(a, from), (b, to)]: [(Option<usize>, Vector3<S>); 2], factor: f64) {
        let apart = to - from;
        let length = apart.norm_squared().value().sqrt();
        if length < 1e-15 {
            return;
        }
        let length = apart.norm();
        let pull = apart * (S::constant(factor) / length);
        self.value += length.times(factor);
        let none = Vector3::zeros();
        self.add_wrench(a, &from, &-pull, &none, &|_| true);
        self.add_wrench(b, &to, &pull, &none, &|_| true);
    }

    fn add_around(&mut self, ends: &[Anchor; 2], obstacle: &Obstacle, factor: f64) {
        let [from, to] = ends.map(|end| self.point(&end));
        let (rotation, center) = self.frame(&obstacle.frame);
        let local = |place: Vector3<S>| rotation.transpose() * (place - center);
        let side = obstacle.side.map(|side| local(self.point(&side)));
        let points = [local(from), local(to)];
        let found = wrap::around(points, obstacle.radius, obstacle.is_cylinder, side);
        let Some(wrap::Wrapped { touch, length }) = found else {
            return self.add_line([(ends[0].link, from), (ends[1].link, to)], factor);
        };
        let [first, last] = touch.map(|place| center + rotation * place);
        let own = obstacle.frame.link;
        self.add_line([(ends[0].link, from), (own, first)], factor);
        self.value += length.times(factor);
        self.add_line([(own, last), (ends[1].link, to)], factor);
    }

    fn add_relative(&mut self, frame: &LinkFrame, reference: &LinkFrame, gear: &[f64; 6]) {
        let (rotation, place) = self.frame(frame);
        let (base, origin) = self.frame(reference);
        let [force, torque] = along(&base, gear);
        self.value += force.dot(&(place - origin));
        let turn = nalgebra::Rotation3::from_matrix_unchecked(base.transpose() * rotation);
        let turn = so3_log(&nalgebra::UnitQuaternion::from_rotation_matrix(&turn));
        for k in 0..3 {
            self.value += turn[k].times(gear[3 + k]);
        }
        let of = |link: Option<usize>| -> Vec<usize> {
            link.map(|link| self.at.tree.dofs_of(link).collect()).unwrap_or_default()
        };
        let [own, other] = [of(frame.link), of(reference.link)];
        self.add_wrench(frame.link, &place, &force, &torque, &|k| !other.contains(&k));
        self.add_wrench(reference.link, &origin, &-force, &-torque, &|k| !own.contains(&k));
    }

    fn add_turn(
        &mut self,
        link: usize,
        gear: &[f64; 6],
        [is_free, in_parent]: [bool; 2],
        reference: Option<&Isometry3<f64>>,
    ) {
        let own = &self.at.tree.links()[link];
        let (joint, place) = (own.t_parent_joint.rotation, own.t_parent_joint.translation.vector);
        let joint = joint.to_rotation_matrix().into_inner();
        let (base, origin) = match own.parent {
            Some(parent) => {
                let rotation = self.at.rotations[parent];
                (rotation * joint, self.at.places[parent] + rotation * place)
            }
            None => (joint, place - self.at.origin.map(S::constant)),
        };
        let rotation = self.at.rotations[link];
        let [a, b, c, d, e, f] = *gear;
        let (force, torque) = if is_free { ([a, b, c], [d, e, f]) } else { ([0.0; 3], [a, b, c]) };
        let [force, torque] = [force, torque].map(|v| Vector3::from(v.map(S::constant)));
        if let Some(reference) = reference {
            let own = reference.rotation.to_rotation_matrix().into_inner().map(S::constant);
            let turn = (base * own).transpose() * rotation;
            let turn = nalgebra::Rotation3::from_matrix_unchecked(turn);
            let turn = so3_log(&nalgebra::UnitQuaternion::from_rotation_matrix(&turn));
            let moved = base.transpose() * (self.at.places[link] - origin);
            let moved = moved - reference.translation.vector.map(S::constant);
            self.value += turn.dot(&torque) + moved.dot(&force);
        }
        let torque = if in_parent { base * torque } else { rotation * torque };
        let place = self.at.places[link];
        let [_, dofs] = self.at.tree.range(link);
        self.add_wrench(Some(link), &place, &(base * force), &torque, &|k| dofs.contains(&k));
    }

    fn add_angle(&mut self, link: usize) {
        let own = &self.at.tree.links()[link];
        let base = own.parent.map_or_else(Matrix3::identity, |parent| self.at.rotations[parent]);
        let base = base * own.t_parent_joint.rotation.to_rotation_matrix().into_inner();
        let rotation = self.at.rotations[link];
        let turn = nalgebra::Rotation3::from_matrix_unchecked(base.transpose() * rotation);
        let turn = so3_log(&nalgebra::UnitQuaternion::from_rotation_matrix(&turn));
        // There is no direction where there is no angle.
        if turn.norm_squared().value() < 1e-24 {
            return;
        }
        let angle = turn.norm();
        self.value += angle;
        let torque = rotation * (turn / angle);
        let place = self.at.places[link];
        let [_, dofs] = self.at.tree.range(link);
        self.add_wrench(Some(link), &place, &Vector3::zeros(), &torque, &|k| dofs.contains(&k));
    }

    fn add_crank(&mut self, pin: &Anchor, slider: &LinkFrame, rod: f64, factor: f64) {
        let pin_place = self.point(pin);
        let (rotation, place) = self.frame(slider);
        let axis = rotation.column(2).into_owned();
        let apart = pin_place - place;
        let ahead = apart.dot(&axis);
        let square = ahead * ahead - apart.norm_squared() + S::constant(rod * rod);
        let (mut by_apart, mut by_axis) = (axis, apart);
        if square.value() > 0.0 {
            let root = square.sqrt();
            let share = S::one() - ahead / root;
            by_apart = axis * share + apart / root;
            by_axis = apart * share;
            self.value += (ahead - root).times(factor);
        } else {
            self.value += ahead.times(factor);
        }
        let (force, torque) =
            (by_apart * S::constant(factor), axis.cross(&by_axis).map(|x| x.times(factor)));
        self.add_wrench(pin.link, &pin_place, &force, &Vector3::zeros(), &|_| true);
        self.add_wrench(slider.link, &place, &-force, &torque, &|_| true);
    }
}

impl<S: Scalar> Kinematics<'_, S> {
    /// The acceleration of the distance of two points, in links or the model, while those of all joints are zero.
    fn drift_of_line(&self, ends: [(Option<usize>, Vector3<S>); 2]) -> S {
        let [a, b] = ends.map(|(link, place)| {
            let Some(link) = link else { return [Vector3::zeros(); 2] };
            // Sums of what each joint adds.
            let mut all = nalgebra::Vector6::zeros();
            let mut next = Some(link);
            while let Some(index) = next {
                all += self.drifts[index];
                next = self.tree.links()[index].parent;
            }
            let spin = angular(&self.velocities[link]);
            let velocity = linear(&self.velocities[link]) + spin.cross(&place);
            let turning = angular(&all).cross(&place) + spin.cross(&velocity);
            [velocity, linear(&all) + turning]
        });
        let apart = ends[1].1 - ends[0].1;
        let length = apart.norm();
        if length.value() < 1e-15 {
            return S::zero();
        }
        let direction = apart / length;
        let rate = b[0] - a[0];
        let along = rate.dot(&direction);
        direction.dot(&(b[1] - a[1])) + (rate.norm_squared() - along * along) / length
    }
}
