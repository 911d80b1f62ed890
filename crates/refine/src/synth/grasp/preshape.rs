//! Pre-shapes: the open hand before it grasps, and speeds of its joints.

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use prehend_geometry::hand::JOINT_NAMES;
use prehend_geometry::robot::KinematicTree as Tree;

use super::self_collision::ball;
use crate::scene::Hand;
use crate::synth::error::SynthError;

/// The open hand and the way it closes. Joints are in the order of the robot's joint names.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Preshape {
    /// Positions before closing \[rad or m\].
    pub(super) open: Vec<f64>,
    /// By how much these are varied, uniformly and both ways \[rad or m\].
    pub(super) spread: Vec<f64>,
    /// Speeds of closing with their sign \[rad/s or m/s\]; zero for joints that keep still.
    pub(super) speed: Vec<f64>,
    /// The palm's frame: origin on the palm where objects should be, z out of it, y the axis about which fingers wrap.
    pub(super) t_hand_palm: Isometry3<f64>,
}

/// Speeds of the fastest joints of a hand without a pre-shape of its own.
const ANGULAR_SPEED: f64 = 1.0;
const LINEAR_SPEED: f64 = 0.05;
/// A joint closes if it brings what it moves nearer by this part of what the best joint does.
const CLOSES: f64 = 0.35;

impl Preshape {
    /// The built-in hand's own if `robot` has its joints, else a guess: [`Preshape::guess`].
    ///
    /// # Errors
    /// As [`Preshape::guess`].
    pub(super) fn of(robot: &Hand) -> Result<Self, SynthError> {
        Self::built_in(&robot.tree).map_or_else(|| Self::guess(robot), Ok)
    }

    /// Fingers nearly straight, the thumb opposite to them; finger roots and the thumb's two first joints keep still.
    fn built_in(tree: &Tree) -> Option<Self> {
        const FINGER: [[f64; 3]; 4] =
            [[0.0, 0.12, 0.0], [0.15, 0.15, 1.0], [0.15, 0.15, 1.0], [0.15, 0.15, 0.8]];
        const THUMB: [[f64; 3]; 4] =
            [[1.3, 0.09, 0.0], [0.2, 0.2, 0.0], [0.1, 0.1, 1.0], [0.1, 0.1, 1.0]];
        let number = |name: &String| JOINT_NAMES.iter().position(|n| n == name);
        let numbers: Vec<usize> = tree.joint_names().iter().map(number).collect::<Option<_>>()?;
        if numbers.len() != JOINT_NAMES.len() {
            return None;
        }
        let column = |k: usize| {
            let of = |&i: &usize| if i < 12 { FINGER[i % 4][k] } else { THUMB[i % 4][k] };
            numbers.iter().map(of).collect()
        };
        // The hand's +x leaves the palm; fingers wrap about its y. The thumb stands opposite to y = 0.01.
        let t_hand_palm = frame(&Point3::new(0.019, 0.005, 0.012), &Vector3::x(), &Vector3::y());
        Some(Self { open: column(0), spread: column(1), speed: column(2), t_hand_palm })
    }

    /// The pre-shape that joint limits and geometry suggest: joints that bring their links nearer to the point between the fingers
    /// close, from the limit where those are farthest; the others stay in the middle. The palm is the part of the root, or
    /// of what is next to it, that is nearest to that point.
    ///
    /// # Errors
    /// [`SynthError::Refused`] if no joint does so.
    pub(super) fn guess(robot: &Hand) -> Result<Self, SynthError> {
        let tree = &robot.tree;
        let limits = tree.joint_limits();
        let bounded = |&(lower, upper): &(f64, f64)| lower.is_finite() && upper.is_finite();
        let middle = |l: &(f64, f64)| if bounded(l) { 0.5 * (l.0 + l.1) } else { 0.0 };
        let middle: Vec<f64> = limits.iter().map(middle).collect();
        let paths = tree.paths();
        let shapes = robot.shape.links().iter();
        let centers: Vec<_> = shapes.map(|shape| ball(shape).map(|(c, _)| c)).collect();
        let solid = || centers.iter().enumerate().filter_map(|(l, c)| Some((l, (*c)?)));
        let poses = tree.forward_kinematics(&middle);
        // Fingertips: links with a shape that move no other such link.
        let moves = |link: usize, other: usize| {
            let (own, path) = (&paths[link], &paths[other]);
            link != other && own.iter().all(|j| path.contains(j)) && path.len() > own.len()
        };
        let tips: Vec<usize> = solid()
            .map(|(link, _)| link)
            .filter(|&l| !paths[l].is_empty() && !solid().any(|(o, _)| moves(l, o)))
            .collect();
        let tip = |&l: &usize| poses[l] * centers[l].unwrap_or_default();
        let sum: Vector3<f64> = tips.iter().map(|l| tip(l).coords).sum();
        let focus = Point3::from(sum / tips.len().max(1) as f64);

        let screws = tree.screws(&poses);
        let driven = |link: usize, variable: usize| {
            paths[link].iter().any(|&s| screws[s].variable == variable)
        };
        let away = |variable: usize, value: f64| {
            let mut joints = middle.clone();
            joints[variable] = value;
            let poses = tree.forward_kinematics(&joints);
            let distance = |(l, c): (usize, Point3<f64>)| (poses[l] * c - focus).norm();
            let moved: Vec<f64> =
                solid().filter(|(l, _)| driven(*l, variable)).map(distance).collect();
            moved.iter().sum::<f64>() / moved.len().max(1) as f64
        };
        let nearer = |variable: usize, l: &(f64, f64)| {
            if bounded(l) { away(variable, l.0) - away(variable, l.1) } else { 0.0 }
        };
        let nearer: Vec<f64> = limits.iter().enumerate().map(|(v, l)| nearer(v, l)).collect();
        let best = nearer.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        if best <= 0.0 {
            return Err(SynthError::refused("the robot has no joint that would close its fingers"));
        }
        let (mut open, mut speed) = (middle, vec![0.0; limits.len()]);
        for (v, (lower, upper)) in limits.iter().enumerate() {
            if nearer[v].abs() > CLOSES * best {
                let turns = screws.iter().any(|s| s.variable == v && s.angular.norm() > 0.0);
                let fastest = if turns { ANGULAR_SPEED } else { LINEAR_SPEED };
                open[v] = if nearer[v] > 0.0 { *lower } else { *upper };
                speed[v] = fastest * nearer[v].signum();
            }
        }
        let spread = |(lower, upper): &(f64, f64)| {
            let range = upper - lower;
            if range.is_finite() { 0.05 * range } else { 0.0 }
        };

        // The palm: the nearest point of what no joint moves, or of the least moved.
        let least = solid().map(|(l, _)| paths[l].len()).min().unwrap_or(0);
        let surface = |link: usize| {
            let t = poses[link];
            let local = t.inverse() * focus;
            let closest = robot.shape.links()[link].closest().iter();
            closest.filter_map(move |c| c.closest(&local, f64::INFINITY)).map(move |c| t * c.point)
        };
        let base = solid().map(|(l, _)| l).filter(|&l| paths[l].len() == least);
        let origin = base.flat_map(surface).min_by(|a, b| {
            let distance = |p: &Point3<f64>| (p - focus).norm_squared();
            distance(a).total_cmp(&distance(b))
        });
        let origin = origin.unwrap_or_default();
        let out = (focus - origin).try_normalize(1e-9).unwrap_or_else(Vector3::z);
        // Fingers wrap about the direction in which closing moves their tips the least.
        let mut motion = Matrix3::from_diagonal_element(0.0) + out * out.transpose();
        for &link in &tips {
            let own = paths[link].iter().map(|&s| &screws[s]);
            let velocity: Vector3<f64> =
                own.map(|s| s.velocity(&tip(&link)) * speed[s.variable]).sum();
            if let Some(direction) = velocity.try_normalize(1e-12) {
                motion += direction * direction.transpose();
            }
        }
        let eigen = motion.symmetric_eigen();
        let axis = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        Ok(Self {
            open,
            spread: limits.iter().map(spread).collect(),
            speed,
            t_hand_palm: frame(&origin, &out, &axis),
        })
    }
}

/// The frame at `origin` with its z along `out` and its y along `axis` as far as that is across.
fn frame(origin: &Point3<f64>, out: &Vector3<f64>, axis: &Vector3<f64>) -> Isometry3<f64> {
    let across = axis.cross(out);
    let x = across.try_normalize(1e-9).unwrap_or_else(|| {
        let other = if out.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        other.cross(out).normalize()
    });
    let turn = UnitQuaternion::from_basis_unchecked(&[x, out.cross(&x), *out]);
    Isometry3::from_parts(origin.coords.into(), turn)
}
