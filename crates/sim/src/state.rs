//! State of a model.

use std::ops::{Index, IndexMut};

use nalgebra::Isometry3;
use prehend_autodiff::Scalar;

use crate::body_state::BodyState;

/// State of a model at a time: all that a simulation goes on from.
///
/// Poses and velocities of bodies are read and written by their handles. Those of links follow from their joints, which
/// [`Model::set_joint`](crate::Model::set_joint) and [`Model::joint`](crate::Model::joint) write and read. Deflections of contacts with
/// [`Bristles`](crate::contact::Bristles) go along.
///
/// ```
/// use nalgebra::{Isometry3, Vector3};
/// use prehend_sim::{Body, RigidBody, Model};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mut model = Model::new(Vector3::new(0.0, 0.0, -9.81));
/// let ball = model.add(Body::dynamic("ball", RigidBody::ball(0.1, 0.03)?));
/// let mut start = model.neutral_state();
/// model.set_pose(&mut start, ball, &Isometry3::translation(0.0, 0.0, 1.0))?;
/// start[ball].linear.x = 0.5;
/// let end = model.simulate(&start, 0.2)?;
/// assert_eq!(end.time, 0.2);
/// assert!((end[ball].pose.translation.x - 0.1).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct State<S: Scalar = f64> {
    /// Time \[s\].
    pub time: f64,
    /// States of bodies, then of joints, then deflections of contacts.
    rows: Vec<BodyState<S>>,
    /// Number of bodies.
    bodies: usize,
}

impl<S: Scalar> State<S> {
    /// State at time 0 of a model without joints, whose bodies are in these states, in the order in which they were added; contacts are not
    /// deflected. Others start from [`Model::neutral_state`](crate::Model::neutral_state).
    pub fn new(bodies: impl Into<Vec<BodyState<S>>>) -> Self {
        let rows = bodies.into();
        Self { time: 0.0, bodies: rows.len(), rows }
    }

    /// State of a model with that number of bodies.
    pub(crate) fn from_rows(rows: Vec<BodyState<S>>, bodies: usize, time: f64) -> Self {
        Self { time, bodies: bodies.min(rows.len()), rows }
    }

    /// States of all bodies, in the order in which they were added.
    pub fn bodies(&self) -> &[BodyState<S>] {
        &self.rows[..self.bodies]
    }

    /// States of all bodies, to be changed.
    pub fn bodies_mut(&mut self) -> &mut [BodyState<S>] {
        &mut self.rows[..self.bodies]
    }

    /// Rows of a [`RolloutFunction`](crate::RolloutFunction), which starts at time 0: bodies, joints, contacts with bristles.
    pub fn rows(&self) -> &[BodyState<S>] {
        &self.rows
    }

    pub(crate) fn rows_mut(&mut self) -> &mut [BodyState<S>] {
        &mut self.rows
    }

    /// Adds rows at rest, or leaves the last ones out.
    pub(crate) fn resize_rows(&mut self, count: usize) {
        self.rows.resize(count, BodyState::at_rest(Isometry3::identity()));
    }

    /// State of the same model with other rows at another time \[s\].
    pub(crate) fn with(&self, rows: Vec<BodyState<S>>, time: f64) -> Self {
        Self { time, rows, bodies: self.bodies }
    }

    /// Numbers without derivatives.
    pub fn value(&self) -> State {
        self.map(BodyState::value)
    }

    fn map<T: Scalar>(&self, f: impl Fn(&BodyState<S>) -> BodyState<T>) -> State<T> {
        let rows = self.rows.iter().map(f).collect();
        State { time: self.time, rows, bodies: self.bodies }
    }
}

impl State {
    /// Constants of another scalar.
    pub fn cast<S: Scalar>(&self) -> State<S> {
        self.map(BodyState::cast)
    }
}

impl<S: Scalar, I> Index<I> for State<S>
where
    [BodyState<S>]: Index<I>,
{
    type Output = <[BodyState<S>] as Index<I>>::Output;

    /// State of a body by its handle, or its place among the bodies.
    #[inline]
    fn index(&self, body: I) -> &Self::Output {
        &self.bodies()[body]
    }
}

impl<S: Scalar, I> IndexMut<I> for State<S>
where
    [BodyState<S>]: IndexMut<I>,
{
    #[inline]
    fn index_mut(&mut self, body: I) -> &mut Self::Output {
        &mut self.bodies_mut()[body]
    }
}
