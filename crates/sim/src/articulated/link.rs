//! A tree of links.

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, Translation3, Unit, Vector3};
use prehend_autodiff::Scalar;

use super::joint::{CustomJoint, Joint};
use super::joint_model::MAX_NV;
use super::kinematics::{Kinematics, Scope};
use crate::body::RigidBody;

/// A link and the joint that it hangs on.
#[derive(Clone, Debug, PartialEq)]
pub struct Link<S: Scalar = f64> {
    /// Its name.
    pub name: String,
    /// The link that it hangs on; none is the world.
    pub parent: Option<usize>,
    /// Joint frame → parent link's frame.
    pub t_parent_joint: Isometry3<S>,
    /// Joint: the motion of the link in the joint's frame.
    pub joint: Joint,
    /// Mass \[kg\].
    pub mass: S,
    /// Center of mass, in the link's frame \[m\].
    pub com: Point3<S>,
    /// Inertia about the center of mass, along the link's axes \[kg m²\].
    pub inertia: Matrix3<S>,
    /// Inertia of what turns with the joint behind gears, for each degree of freedom \[kg m² or kg\].
    pub armature: S,
}

/// Number of a link's parameters.
pub(crate) const NUMBERS: usize = 3 + 4 + 1 + 3 + 6 + 1;

/// Their names.
pub(crate) const NUMBER_NAMES: [&str; NUMBERS] = [
    "joint_x",
    "joint_y",
    "joint_z",
    "joint_qx",
    "joint_qy",
    "joint_qz",
    "joint_qw",
    "mass",
    "com_x",
    "com_y",
    "com_z",
    "inertia_xx",
    "inertia_yy",
    "inertia_zz",
    "inertia_xy",
    "inertia_xz",
    "inertia_yz",
    "armature",
];

impl<S: Scalar> Link<S> {
    /// Link of `body` in the link's frame, hanging on the world by `joint` at its origin.
    pub fn new(name: impl Into<String>, joint: Joint, body: &RigidBody<S>) -> Self {
        let (mass, com, inertia) = (body.mass(), *body.com(), *body.inertia());
        Self { mass, com, inertia, ..Self::massless(name, joint) }
    }

    /// Without mass: what hangs on it has to have some.
    pub fn massless(name: impl Into<String>, joint: Joint) -> Self {
        Self {
            name: name.into(),
            parent: None,
            t_parent_joint: Isometry3::identity(),
            joint,
            mass: S::zero(),
            com: Point3::origin(),
            inertia: Matrix3::zeros(),
            armature: S::zero(),
        }
    }

    /// Hanging on the link number `parent` of those before it, where that has its joint \[m\].
    #[must_use]
    pub fn on(self, parent: usize, t_parent_joint: Isometry3<S>) -> Self {
        Self { parent: Some(parent), t_parent_joint, ..self }
    }

    /// Hanging on the world, where that has its joint \[m\].
    #[must_use]
    pub fn at(self, t_world_joint: Isometry3<S>) -> Self {
        Self { parent: None, t_parent_joint: t_world_joint, ..self }
    }

    /// With `armature` \[kg m² or kg\].
    #[must_use]
    pub fn with_armature(self, armature: S) -> Self {
        Self { armature, ..self }
    }

    /// Checks that its numbers are those of a link.
    fn check_numbers(&self) -> Result<(), ArticulationError> {
        let wrong = |problem| ArticulationError::Mass { link: self.name.clone(), problem };
        if !(self.mass.value() >= 0.0 && self.armature.value() >= 0.0) {
            return Err(wrong("mass and armature may not be negative"));
        }
        if !self.numbers().all(|x| x.value().is_finite()) {
            return Err(wrong("place, mass, center of mass, inertia or armature is not finite"));
        }
        Ok(())
    }

    /// True if a principal moment is negative by more than what few decimals round below zero.
    fn is_impossible(&self) -> bool {
        let moments = self.inertia.map(S::value).symmetric_eigenvalues();
        moments.min() < -1e-3 * moments.amax() - 1e-12 * self.mass.value()
    }

    /// The least inertia \[kg or kg m²\] that its joint moves if nothing hangs on the link, without armature; of a joint type of one's own nothing is known.
    fn least_inertia(&self) -> f64 {
        let (mass, inertia) = (self.mass.value(), self.inertia.map(S::value));
        let com = self.com.coords.map(S::value);
        let about_joint =
            inertia + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        // What is left of a moment that is none.
        let least = |matrix: Matrix3<f64>| {
            let moments = matrix.symmetric_eigenvalues();
            if moments.min() > 1e-14 * moments.amax() { moments.min() } else { 0.0 }
        };
        match &self.joint {
            Joint::Fixed | Joint::Placed | Joint::Custom(_) => f64::INFINITY,
            Joint::Revolute(axis) => axis.dot(&(about_joint * axis.into_inner())),
            Joint::Prismatic(axis) => mass * axis.norm_squared(),
            Joint::Spherical => least(about_joint),
            Joint::Floating => mass.min(least(inertia)),
        }
    }

    /// Frame of its joint in its parent's, from which coordinates count.
    pub(super) fn joint_frame(&self) -> Isometry3<S> {
        match self.joint {
            Joint::Placed => Isometry3::identity(),
            _ => self.t_parent_joint,
        }
    }

    /// Place and rotation (i, j, k, w) of its joint, mass, center of mass, inertia xx, yy, zz, xy, xz, yz, and armature.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = S> {
        let pose = &self.t_parent_joint;
        let i = &self.inertia;
        let place = pose.translation.vector.iter().chain(pose.rotation.coords.iter()).copied();
        let body = std::iter::once(self.mass).chain(self.com.iter().copied());
        let inertia = [i.m11, i.m22, i.m33, i.m12, i.m13, i.m23, self.armature];
        place.chain(body).chain(inertia)
    }

    /// Sets what [`numbers`](Self::numbers) gives.
    pub(crate) fn set_numbers(&mut self, numbers: &[S; NUMBERS]) {
        let [x, y, z, qx, qy, qz, qw, mass, cx, cy, cz, xx, yy, zz, xy, xz, yz, armature] =
            *numbers;
        let rotation = Unit::new_normalize(Quaternion::new(qw, qx, qy, qz));
        self.t_parent_joint = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
        (self.mass, self.com, self.armature) = (mass, Point3::new(cx, cy, cz), armature);
        self.inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    }

    /// Link, each number through `f`.
    fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Link<T> {
        let Isometry3 { translation, rotation } = self.t_parent_joint;
        let rotation = Unit::new_unchecked(Quaternion::from(rotation.coords.map(&f)));
        Link {
            name: self.name.clone(),
            parent: self.parent,
            t_parent_joint: Isometry3::from_parts(translation.vector.map(&f).into(), rotation),
            joint: self.joint.clone(),
            mass: f(self.mass),
            com: self.com.map(&f),
            inertia: self.inertia.map(&f),
            armature: f(self.armature),
        }
    }
}

/// Links and joints that form trees, rooted in the world.
#[derive(Clone, Debug)]
pub struct Articulation<S: Scalar = f64> {
    links: Vec<Link<S>>,
    /// For each link: the first coordinate and the first degree of freedom of its joint, and last how many there are.
    first: Vec<[usize; 2]>,
    /// For each degree of freedom: the link that it moves.
    link_of: Vec<usize>,
    /// For each degree of freedom: the one that carries it, the last of those before it on the way to the world.
    carriers: Vec<Option<usize>>,
    /// For each link: the last degree of freedom that moves it.
    last: Vec<Option<usize>>,
    /// Acceleration of free fall \[m/s²\].
    gravity: Vector3<S>,
}

/// Why links make no tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArticulationError {
    /// A parent that comes later.
    #[error("link {link}: its parent is no link before it")]
    Parent {
        /// The link.
        link: String,
    },
    /// A joint type of one's own with too few or too many coordinates.
    #[error("link {link}: a joint has 1 to 3 coordinates, not {count}")]
    DegreesOfFreedom {
        /// The link.
        link: String,
        /// Number that its joint has.
        count: usize,
    },
    /// A link that could be accelerated without effort.
    #[error("link {link}: {problem}")]
    Mass {
        /// The link.
        link: String,
        /// Cause.
        problem: &'static str,
    },
}

/// Checks that every joint moves some mass, or has armature.
fn check_moved<S: Scalar>(links: &[Link<S>]) -> Result<(), ArticulationError> {
    let mut weighs: Vec<bool> = links
        .iter()
        .map(|link| link.mass.value() > 0.0 || link.inertia.iter().any(|x| x.value() != 0.0))
        .collect();
    let carries = |index: usize| links.iter().any(|link| link.parent == Some(index));
    for (index, link) in links.iter().enumerate().rev() {
        let moved = link.least_inertia() + link.armature.value();
        // What moves with a link that carries others depends on where they are.
        if weighs[index] && (moved.is_nan() || moved <= 0.0) && !carries(index) {
            let problem = "its joint turns or slides without moving any mass, or has no axis";
            return Err(ArticulationError::Mass { link: link.name.clone(), problem });
        }
        if !weighs[index] && link.joint.nv() > 0 && link.armature.value() == 0.0 {
            let problem = "its joint moves no mass: neither the link nor what hangs on it has any";
            return Err(ArticulationError::Mass { link: link.name.clone(), problem });
        }
        if let Some(parent) = link.parent {
            weighs[parent] |= weighs[index];
        }
    }
    Ok(())
}

impl<S: Scalar> Articulation<S> {
    /// Articulation of `links`, each after its parent, that fall with `gravity` \[m/s²\].
    ///
    /// # Errors
    /// If a parent does not come before its link, a number is not finite, a mass negative, or a joint moves no mass or less inertia than none.
    pub fn new(links: Vec<Link<S>>, gravity: Vector3<S>) -> Result<Self, ArticulationError> {
        let (mut first, mut link_of) = (Vec::with_capacity(links.len() + 1), Vec::new());
        let mut carriers = Vec::new();
        let mut last: Vec<Option<usize>> = Vec::with_capacity(links.len());
        let mut next = [0, 0];
        for (index, link) in links.iter().enumerate() {
            if link.parent.is_some_and(|parent| parent >= index) {
                return Err(ArticulationError::Parent { link: link.name.clone() });
            }
            link.check_numbers()?;
            if let Joint::Custom(CustomJoint(model)) = &link.joint
                && !(1..=MAX_NV).contains(&model.nv())
            {
                let (link, count) = (link.name.clone(), model.nv());
                return Err(ArticulationError::DegreesOfFreedom { link, count });
            }
            first.push(next);
            next = [next[0] + link.joint.nq(), next[1] + link.joint.nv()];
            link_of.resize(next[1], index);
            let mut carrier = link.parent.and_then(|parent| last[parent]);
            for dof in carriers.len()..next[1] {
                carriers.push(carrier);
                carrier = Some(dof);
            }
            last.push(carrier);
        }
        first.push(next);
        check_moved(&links)?;
        let new = Self { links, first, link_of, carriers, last, gravity };
        new.check_inertias()?;
        Ok(new)
    }

    /// Checks that all that the joints move has an inertia: where a link has one that no body can have, others that are fixed to it, hang on it or
    /// carry it may make good for it.
    fn check_inertias(&self) -> Result<(), ArticulationError> {
        let Some(link) = self.links.iter().find(|link| link.is_impossible()) else {
            return Ok(());
        };
        let q: Vec<S> = self.neutral().into_iter().map(S::constant).collect();
        let mass = self.kinematics(&q, &vec![S::zero(); self.nv()]).mass_matrix();
        let problem = "a principal moment of its inertia is negative";
        let error = || ArticulationError::Mass { link: link.name.clone(), problem };
        mass.map(|x| x.value()).cholesky().map(|_| ()).ok_or_else(error)
    }

    /// The links, each after its parent.
    pub fn links(&self) -> &[Link<S>] {
        &self.links
    }

    /// Checks that the numbers of all links are such.
    pub(crate) fn check_numbers(&self) -> Result<(), ArticulationError> {
        self.links.iter().try_for_each(Link::check_numbers)?;
        self.check_inertias()
    }

    /// The links, to be changed: to differentiate by a mass, a length or an armature, put a variable in its place. Their joints and parents are
    /// to stay as they are.
    pub fn links_mut(&mut self) -> &mut [Link<S>] {
        &mut self.links
    }

    /// Acceleration of free fall \[m/s²\].
    pub fn gravity(&self) -> &Vector3<S> {
        &self.gravity
    }

    /// Number of coordinates q.
    pub fn nq(&self) -> usize {
        self.first[self.links.len()][0]
    }

    /// Number of degrees of freedom, and so of velocities v and efforts τ.
    pub fn nv(&self) -> usize {
        self.link_of.len()
    }

    /// Ranges of the coordinates and of the degrees of freedom of the joint of `link`.
    pub fn range(&self, link: usize) -> [std::ops::Range<usize>; 2] {
        [0, 1].map(|k| self.first[link][k]..self.first[link + 1][k])
    }

    /// The link that a degree of freedom moves.
    pub(crate) fn link_of(&self, dof: usize) -> usize {
        self.link_of[dof]
    }

    /// The degrees of freedom that move a link, the nearest first.
    pub(crate) fn dofs_of(&self, link: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.last[link], |k| self.carriers[*k])
    }

    /// For each degree of freedom the one that carries it.
    pub(crate) fn carriers(&self) -> &[Option<usize>] {
        &self.carriers
    }

    /// The coordinates at which all links are in their joints' frames.
    pub fn neutral(&self) -> Vec<f64> {
        self.links.iter().flat_map(|link| link.joint.neutral()).copied().collect()
    }

    /// `q` after moving on by `step`: velocities times a time.
    ///
    /// # Panics
    /// If there are not as many coordinates and velocities as there should be.
    pub fn moved(&self, q: &[S], step: &[S]) -> Vec<S> {
        self.check(q, step);
        let mut after = Vec::with_capacity(q.len());
        for (link, ranges) in self.links.iter().zip(self.first.windows(2)) {
            let [from, to] = [ranges[0], ranges[1]];
            link.joint.moved(&q[from[0]..to[0]], &step[from[1]..to[1]], &mut after);
        }
        after
    }

    /// Kinematics of the links at coordinates `q` and velocities `v`.
    ///
    /// # Panics
    /// If there are not as many as there should be.
    pub fn kinematics(&self, q: &[S], v: &[S]) -> Kinematics<'_, S> {
        Kinematics::new(self, q, v, Scope::WithInertia)
    }

    /// [`kinematics`](Self::kinematics) without inertias: where links are and how they move.
    pub(crate) fn motion(&self, q: &[S], v: &[S]) -> Kinematics<'_, S> {
        Kinematics::new(self, q, v, Scope::KinematicsOnly)
    }

    pub(crate) fn check(&self, q: &[S], v: &[S]) {
        assert_eq!(q.len(), self.nq(), "one number a coordinate");
        assert_eq!(v.len(), self.nv(), "one number a degree of freedom");
    }
}

impl Articulation {
    /// In constants of another scalar.
    pub fn cast<S: Scalar>(&self) -> Articulation<S> {
        self.map(S::constant)
    }
}

impl<S: Scalar> Articulation<S> {
    /// Trees, each number through `f`.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Articulation<T> {
        let (first, link_of) = (self.first.clone(), self.link_of.clone());
        let (carriers, last) = (self.carriers.clone(), self.last.clone());
        let links = self.links.iter().map(|link| link.map(&f)).collect();
        let gravity = self.gravity.map(f);
        Articulation { links, first, link_of, carriers, last, gravity }
    }
}
