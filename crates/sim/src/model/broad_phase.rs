//! Broad phase: bodies of a group that are near enough to touch.

use std::borrow::Cow;

use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use prehend_autodiff::Scalar;

use super::Model;
use super::body::{Body, Motion};
use super::contact_group::ContactGroup;
use super::contact_pair::{ContactBodies, ContactPair};
use crate::body_state::{BodyState, Rows};
use crate::handle::BodyId;
use crate::time::Step;

/// Deviation from free motion to which a body may be pushed within a step, in fractions of its size.
const SLACK: f64 = 0.05;
/// Interval at which trajectories are looked at \[s\], and largest number of looks in a step.
const LOOK: f64 = 1e-3;
const LOOKS: f64 = 1000.0;

/// A contact of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CandidateContact {
    pub(crate) group: usize,
    pub(crate) bodies: ContactBodies,
    weight: f64,
}

/// Looks for contacts of groups.
pub(crate) struct BroadPhase<'a, S: Scalar> {
    model: &'a Model<S>,
    /// For each body, the radius of a ball about its center of mass that holds its samples and the solid of its field \[m\]; none if
    /// that has no end.
    radii: Vec<Option<f64>>,
    /// True if a body is in a group.
    grouped: Vec<bool>,
}

impl<'a, S: Scalar> BroadPhase<'a, S> {
    pub(crate) fn new(model: &'a Model<S>) -> Self {
        let mut grouped = vec![false; model.bodies.len()];
        let lists = model.contact_groups.iter().flat_map(ContactGroup::bodies);
        lists.flatten().for_each(|id| grouped[id.index()] = true);
        let radius =
            |(body, grouped): (&Body<S>, &bool)| if *grouped { radius(body) } else { None };
        let radii = model.bodies.iter().zip(&grouped).map(radius).collect();
        Self { model, radii, grouped }
    }

    /// The model whose contacts it looks for.
    pub(crate) fn model(&self) -> &Model<S> {
        self.model
    }

    /// The bodies of groups that forces move, each with its size \[m\].
    pub(crate) fn free(&self) -> impl Iterator<Item = (BodyId, f64)> {
        let free = self.model.moved_bodies().filter(|id| self.grouped[id.index()]);
        free.map(|id| {
            let gyration = self.model.gyration_radius(id);
            (id, self.radii[id.index()].unwrap_or(0.0).max(gyration))
        })
    }

    /// Largest deviation of each body's center in `step` from constant velocity \[m\], if nothing pushes it by
    /// more than `slack` parts of its size.
    pub(crate) fn deviations(&self, step: Step, slack: f64) -> Vec<f64> {
        let mut deviations = vec![0.0; self.model.bodies.len()];
        let fall = 0.5 * self.model.gravity.map(S::value).norm() * step.dt * step.dt;
        for (id, size) in self.free() {
            deviations[id.index()] = fall + slack * size;
        }
        let bodies = deviations.iter_mut().zip(&self.model.bodies).zip(&self.grouped);
        for ((deviation, body), _) in bodies.filter(|(_, grouped)| **grouped) {
            if let Motion::Kinematic(trajectory) = &body.motion {
                let looks = (step.dt / LOOK).ceil().min(LOOKS);
                let place = |look: usize| {
                    let state = trajectory.state(step.start + step.dt * look as f64 / looks);
                    state.value().pose.translation.vector
                };
                *deviation = (0..looks as usize).map(|i| (place(i + 1) - place(i)).norm()).sum();
            }
        }
        deviations
    }

    /// The contacts of groups whose samples may touch within `dt` \[s\] from `states` on, if no body's center comes farther than its
    /// one of `deviations` \[m\] from where constant velocity would bring it, others from where they are, in an order that
    /// depends on nothing but the bodies.
    pub(crate) fn find(&self, states: &Rows, deviations: &[f64], dt: f64) -> Vec<CandidateContact> {
        let reach = |(id, deviation): (BodyId, &f64)| {
            let free = self.model.bodies[id].feels_forces();
            SweptBall {
                center: states[id].pose.translation.vector,
                path: if free { states[id].linear * dt } else { Vector3::zeros() },
                radius: self.radii[id.index()].map(|radius| radius + deviation),
            }
        };
        let reaches: Vec<SweptBall> =
            (0..self.model.bodies.len()).map(BodyId).zip(deviations).map(reach).collect();
        let mut near = Vec::new();
        for (index, group) in self.model.contact_groups.iter().enumerate() {
            for (a, b) in self.pairs(group, &reaches) {
                let contacts = self.model.sides(a, b).unwrap_or_default().into_iter();
                let contacts = contacts.map(|(bodies, weight)| CandidateContact {
                    group: index,
                    bodies,
                    weight,
                });
                let may_touch = |contact: &CandidateContact| {
                    let reach = &reaches[contact.bodies.samples.index()];
                    let deviation = deviations[contact.bodies.samples.index()];
                    self.may_touch(contact, states, reach, deviation)
                };
                near.extend(contacts.filter(may_touch));
            }
        }
        near
    }

    /// The bodies of a group whose reaches meet.
    fn pairs(&self, group: &ContactGroup<S>, reaches: &[SweptBall]) -> Vec<(BodyId, BodyId)> {
        let margin = reach_of(&group.contact);
        let [a, b] = group.bodies();
        let (bounded, endless): (Vec<BodyId>, Vec<BodyId>) =
            b.iter().partition(|id| reaches[id.index()].radius.is_some());
        let boxes: Vec<Aabb> = bounded.iter().map(|id| reaches[id.index()].aabb(0.0)).collect();
        let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        let mut pairs = Vec::new();
        for &id in a {
            let reach = &reaches[id.index()];
            let mut others = endless.clone();
            match reach.radius {
                Some(_) => {
                    let own = reach.aabb(margin);
                    others.extend(tree.intersect_aabb(&own).map(|leaf| bounded[leaf as usize]));
                }
                None => others.extend(&bounded),
            }
            others.retain(|other| {
                group.is_wanted(id, *other)
                    && self.model.moves_against(id, *other)
                    && reach.meets(&reaches[other.index()], margin)
            });
            others.sort_unstable();
            pairs.extend(others.into_iter().map(|other| (id, other)));
        }
        pairs
    }

    /// True if samples of a body with this reach may touch a field that has no end, or is far from filling its ball.
    fn may_touch(
        &self,
        contact: &CandidateContact,
        states: &Rows,
        reach: &SweptBall,
        deviation: f64,
    ) -> bool {
        let ContactBodies { samples, field } = contact.bodies;
        let (body, base) = (&self.model.bodies[samples], &self.model.bodies[field]);
        let (Some(surface), Some(distance)) = (&body.surface, &base.field) else { return false };
        // What turns may come anywhere within its ball.
        if !matches!(base.motion, Motion::Fixed) {
            return true;
        }
        let pattern = &self.model.contact_groups[contact.group].contact;
        let radius = surface.radius_about(&body.com().map(S::value));
        let within = radius + 0.5 * reach.path.norm() + deviation + reach_of(pattern);
        let place = states[field].pose.inverse() * (reach.center + reach.path * 0.5);
        distance.distance(&place.into(), distance.lipschitz_bound() * within).is_some()
    }
}

/// Distance from a surface at which a contact begins \[m\].
fn reach_of<S: Scalar>(contact: &ContactPair<S>) -> f64 {
    contact.law().cutoff() + contact.smoothing.band()
}

/// Radius of a ball about the center of mass that holds samples and solid \[m\].
fn radius<S: Scalar>(body: &Body<S>) -> Option<f64> {
    let com = body.com().map(S::value);
    let samples = body.surface.as_ref().map_or(0.0, |surface| surface.radius_about(&com));
    let Some(field) = &body.field else { return Some(samples) };
    let (center, radius) = field.bounding_ball()?;
    Some(samples.max((center - com).norm() + radius))
}

/// Swept ball of a body: a radius \[m\] about its center that moves along a path \[m\], or everything.
struct SweptBall {
    center: Vector3<f64>,
    path: Vector3<f64>,
    radius: Option<f64>,
}

impl SweptBall {
    /// The box around it that is larger by `margin` \[m\].
    fn aabb(&self, margin: f64) -> Aabb {
        let [x, y, z] = (self.center + self.path * 0.5).into();
        let half = Vector::new(self.path.x, self.path.y, self.path.z).abs() * 0.5;
        let radius = self.radius.unwrap_or(f64::INFINITY) + margin;
        Aabb::from_half_extents(Vector::new(x, y, z), half + Vector::splat(radius))
    }

    /// True if it and another one are no farther apart than `margin` \[m\] at a time.
    fn meets(&self, other: &Self, margin: f64) -> bool {
        let (Some(a), Some(b)) = (self.radius, other.radius) else { return true };
        let (from, path) = (self.center - other.center, self.path - other.path);
        let length = path.norm_squared();
        let nearest = if length > 0.0 { (-from.dot(&path) / length).clamp(0.0, 1.0) } else { 0.0 };
        (from + path * nearest).norm() <= a + b + margin
    }
}

impl<S: Scalar> Model<S> {
    /// The contacts, and those of groups that are among `candidates`.
    pub(crate) fn contacts_with(&self, candidates: &[CandidateContact]) -> Vec<ContactPair<S>> {
        let mut contacts = self.contacts.clone();
        contacts.extend(candidates.iter().map(|CandidateContact { group, bodies, weight }| {
            self.contact_groups[*group].pair(*bodies, *weight)
        }));
        contacts
    }

    /// Model with those contacts of its groups one by one that may touch in `step` from `states`.
    pub(crate) fn with_candidates<T: Scalar>(&self, states: &Rows<T>, step: Step) -> Cow<'_, Self> {
        self.with_contacts(states, step.dt, |search| search.deviations(step, SLACK))
    }

    /// Model with those contacts of its groups one by one that may touch within `dt` \[s\] from `states`, with such
    /// `deviations` \[m\].
    fn with_contacts<T: Scalar>(
        &self,
        states: &Rows<T>,
        dt: f64,
        deviations: impl FnOnce(&BroadPhase<'_, S>) -> Vec<f64>,
    ) -> Cow<'_, Self> {
        if self.contact_groups.is_empty() {
            return Cow::Borrowed(self);
        }
        let values: Vec<BodyState> = states.iter().map(BodyState::value).collect();
        let search = BroadPhase::new(self);
        let candidates = search.find(&values, &deviations(&search), dt);
        let contacts = self.contacts_with(&candidates);
        Cow::Owned(Self {
            bodies: self.bodies.clone(),
            contacts,
            contact_groups: Vec::new(),
            articulations: self.articulations.clone(),
            joint_forces: self.joint_forces.clone(),
            bushings: self.bushings.clone(),
            transmissions: self.transmissions.clone(),
            gravity: self.gravity,
        })
    }

    /// [`Model::with_candidates`] of those that touch, or are no farther than `reach` \[m\] from it.
    pub(crate) fn with_touching<T: Scalar>(&self, states: &Rows<T>, reach: f64) -> Cow<'_, Self> {
        self.with_contacts(states, 0.0, |_| vec![reach; states.len()])
    }
}
