//! Leaving out samples that cannot touch for a while.

use std::sync::Arc;

use prehend_autodiff::Scalar;

use crate::contact::wrench::Patch;
use crate::state::State;
use crate::world::World;

/// How far samples may move relative to a field before those near it are looked for anew \[m\].
const MARGIN: f64 = 1e-3;

/// A world that only knows the samples near to a field: the others exert no force as long as [`Near::holds`], so
/// results are the same to the last bit.
pub(crate) struct Near<S: Scalar> {
    pub(crate) world: World<S>,
    /// For each contact, the body with the samples as the field saw it, and how far its samples are from its centre of mass \[m\].
    made_at: Vec<(State, f64)>,
}

impl<S: Scalar> Near<S> {
    pub(crate) fn new(world: &World<S>, states: &[State<S>]) -> Self {
        let mut near = world.clone();
        let mut made_at = Vec::new();
        for pair in &mut near.contacts {
            let (state, com) = (world.seen_value(pair, states), world.bodies[pair.samples].com());
            made_at.push((state, pair.surface.radius_about(&com)));
            if let Some(field) = &world.bodies[pair.field].field {
                let (surface, onset) = (&*pair.surface, pair.onset);
                let patch = Patch { surface, com, state, field: field.as_ref(), onset };
                pair.surface = Arc::new(patch.near(pair.law.cutoff(), MARGIN));
            }
        }
        Self { world: near, made_at }
    }

    /// Whether no sample that was left out can touch during the next `dt` \[s\].
    pub(crate) fn holds(&self, states: &[State<S>], dt: f64) -> bool {
        self.world.contacts.iter().zip(&self.made_at).all(|(pair, (made_at, radius))| {
            let now = self.world.seen_value(pair, states);
            let shift = now.pose.translation.vector - made_at.pose.translation.vector;
            let turn = now.pose.rotation.angle_to(&made_at.pose.rotation);
            let ahead = now.linear.norm() + now.angular.norm() * radius;
            shift.norm() + turn * radius + ahead * dt <= MARGIN
        })
    }
}
