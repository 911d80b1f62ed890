//! The object as a free body among the kinematically driven links of a hand.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use prehend_autodiff::lie::so3_log;
use prehend_geometry::robot::LinkShape;
use prehend_geometry::{DistanceField, FieldSample};
use prehend_sim::{
    Body, BodyId, BodyState, BuildError, ContactBodies, ContactKinematics, DynContactLaw,
    GapSmoothing, Integrator, Model, SemiImplicitEuler, SimulationError, State, Step, Surface,
    integrator::{BackwardEuler, SubStepped},
};

use super::grasper::Grasper;

/// Samples farther from the hand than this are left out until something has moved \[m\]. Links' grids reach farther.
const NEAR: f64 = 10e-3;
/// By how much something may move until they are looked for anew \[m\]: interpolated distances rise a little faster than
/// points move.
const MOVED: f64 = 7e-3;
/// Parts into which a step is divided at most.
const PARTS: usize = 8;
/// Parts at most where steps are explicit.
const EXPLICIT_PARTS: usize = 1 << 12;

/// A sample of the object's surface in contact with a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub(super) link: usize,
    /// Hand frame \[m\].
    pub(super) point: Point3<f64>,
    /// Out of the link, hand frame.
    pub(super) normal: Vector3<f64>,
    /// Force on the object, hand frame \[N\].
    pub(super) force: Vector3<f64>,
    /// Stiffness along the normal \[N/m\].
    pub(super) stiffness: f64,
}

/// One hand and one object, at one moment.
pub(super) struct GraspSimulation<'a> {
    pub(super) grasper: &'a Grasper<'a>,
    model: Model,
    /// States of the model's bodies.
    states: State,
    object: BodyId,
    /// Links with a shape, in the order of their bodies.
    links: Vec<Solid>,
    pub(super) joints: Vec<f64>,
    /// Pose of every link, hand frame.
    pub(super) poses: Vec<Isometry3<f64>>,
    /// Factors on the speeds of the joints that close.
    pub(super) pace: Vec<f64>,
    /// Force at which fingers stop at the mean lever \[N\].
    pub(super) grip: f64,
    steps: usize,
}

struct Solid {
    link: usize,
    shape: Arc<LinkShape>,
    /// Corners of the box around the link, link frame.
    corners: [Point3<f64>; 8],
    /// `t_object_link` when the samples near it were looked for.
    looked_at: Option<Isometry3<f64>>,
}

impl<'a> GraspSimulation<'a> {
    /// Hand and object at rest.
    pub(super) fn new(
        grasper: &'a Grasper<'a>,
        joints: &[f64],
        t_hand_object: &Isometry3<f64>,
        grip: f64,
    ) -> Result<Self, SimulationError> {
        let Grasper { robot, body: rigid, .. } = grasper;
        let poses = robot.tree.forward_kinematics(joints);
        let mut model = Model::new(Vector3::zeros());
        let (mut links, mut fields, mut states) = (Vec::new(), Vec::new(), Vec::new());
        for (link, shape) in robot.shape.links().iter().enumerate() {
            let Some(grid) = shape.grid() else { continue };
            let (low, high) = grid.bounds();
            let corner = |i: usize| {
                Point3::from(Vector3::from_fn(
                    |k, _| if i >> k & 1 == 0 { low[k] } else { high[k] },
                ))
            };
            let body = Body::fixed(&robot.tree.links()[link].name).with_field(shape.clone());
            fields.push(model.add(body));
            states.push(BodyState::at_rest(poses[link]));
            let (shape, corners) = (shape.clone(), std::array::from_fn(corner));
            links.push(Solid { link, shape, corners, looked_at: None });
        }
        let object = model.add(Body::dynamic("object", *rigid));
        states.push(rigid.at_rest(t_hand_object));
        let mut new = Self {
            grasper,
            model,
            states: State::new(states),
            object,
            links,
            joints: joints.to_vec(),
            poses,
            pace: vec![1.0; joints.len()],
            grip,
            steps: 0,
        };
        new.update_broad_phase()?;
        for field in fields {
            let bodies = ContactBodies { samples: object, field };
            new.model.add_contact(bodies, Arc::clone(&grasper.law), GapSmoothing::Hard)?;
        }
        Ok(new)
    }

    pub(super) fn t_hand_object(&self) -> Isometry3<f64> {
        self.grasper.body.body_pose(&self.states[self.object].pose)
    }

    /// Speed of the object's center of mass \[m/s\] and its angular speed \[rad/s\].
    pub(super) fn speed(&self) -> (f64, f64) {
        let BodyState { linear, angular, .. } = &self.states[self.object];
        (linear.norm(), angular.norm())
    }

    /// One time step, during which the joints move by `change`, under `gravity` (hand frame \[m/s²\]); without, the object floats and loses its speed.
    pub(super) fn advance(
        &mut self,
        change: &[f64],
        gravity: Option<Vector3<f64>>,
    ) -> Result<(), SimulationError> {
        let Grasper { robot, body: rigid, settings, .. } = self.grasper;
        let dt = settings.time_step;
        self.joints.iter_mut().zip(change).for_each(|(q, d)| *q += d);
        let poses = robot.tree.forward_kinematics(&self.joints);
        for (body, solid) in self.links.iter().enumerate() {
            let (from, to) = (&self.poses[solid.link], &poses[solid.link]);
            let turn = so3_log(&(to.rotation * from.rotation.inverse()));
            self.states[body] = BodyState {
                pose: *to,
                linear: (to.translation.vector - from.translation.vector) / dt,
                angular: turn / dt,
            };
        }
        self.poses = poses;
        let state = self.states[self.object];
        let mut load = Vector6::zeros();
        self.model.gravity = gravity.unwrap_or_default();
        if gravity.is_none() {
            let rate = 1.0 / (settings.damping_time + dt);
            let inertia = rigid.world_inertia(&state.pose.rotation);
            let drag = state.linear * (-rate * rigid.mass());
            load.fixed_rows_mut::<3>(0).copy_from(&drag);
            load.fixed_rows_mut::<3>(3).copy_from(&(inertia * state.angular * -rate));
        }
        self.model.bodies[self.object].external_wrench = load;
        self.update_broad_phase()?;
        self.states = self.stepped()?;
        self.steps += 1;
        Ok(())
    }

    /// The states one time step later: by the implicit equations as they are, or else with softer friction, or else by
    /// explicit steps as short as those need. Newton's method may fail where many samples make or lose contact at once.
    fn stepped(&mut self) -> Result<State, SimulationError> {
        let grasper = self.grasper;
        let step = Step::new(self.steps, grasper.settings.time_step);
        let implicit = SubStepped { integrator: BackwardEuler, max_substeps: PARTS };
        let explicit = SubStepped { integrator: SemiImplicitEuler, max_substeps: EXPLICIT_PARTS };
        let unsolved = |done: &Result<_, _>| matches!(done, Err(SimulationError::Unsolved { .. }));
        let mut done = implicit.step(&self.model, &self.states, step);
        if unsolved(&done) {
            self.set_friction_law(&grasper.soft_law);
            done = implicit.step(&self.model, &self.states, step);
            if unsolved(&done) {
                done = explicit.step(&self.model, &self.states, step);
            }
            self.set_friction_law(&grasper.law);
        }
        done
    }

    fn set_friction_law(&mut self, law: &Arc<dyn DynContactLaw>) {
        self.model.contacts.iter_mut().for_each(|pair| pair.set_law(Arc::clone(law)));
    }

    /// Keeps the samples that may touch before the next look.
    fn update_broad_phase(&mut self) -> Result<(), SimulationError> {
        let t_object_hand = self.t_hand_object().inverse();
        let moved = |solid: &Solid| {
            let now = t_object_hand * self.poses[solid.link];
            solid.looked_at.is_none_or(|then| {
                // Displacements are affine in the point: none within the box exceeds those of its corners.
                solid.corners.iter().any(|c| (now * c - then * c).norm_squared() > MOVED * MOVED)
            })
        };
        if !self.links.iter().any(moved) {
            return Ok(());
        }
        for solid in &mut self.links {
            solid.looked_at = Some(t_object_hand * self.poses[solid.link]);
        }
        let near = |point: &&Point3<f64>| {
            self.links.iter().any(|solid| {
                let local = solid.looked_at.map(|t| t.inverse_transform_point(point));
                local.is_some_and(|local| solid.shape.distance(&local, NEAR).is_some())
            })
        };
        let mut kept: Vec<_> = self.grasper.samples.iter().filter(near).copied().collect();
        // A surface must not be empty.
        if kept.is_empty() {
            kept.extend(self.grasper.samples.first());
        }
        let surface = Surface::new(&kept, &vec![self.grasper.area; kept.len()])
            .map_err(|error| BuildError::Body { body: "object".to_owned(), error })?;
        self.model.bodies[self.object].surface = Some(Arc::new(surface));
        Ok(())
    }

    /// All contacts, as the simulator has them.
    pub(super) fn touches(&self) -> Vec<Touch> {
        let state = &self.states[self.object];
        let t_hand_object = self.t_hand_object();
        let mut touches = Vec::new();
        let Some(surface) = &self.model.bodies[self.object].surface else { return touches };
        let law = &self.grasper.law;
        let stiffness = law.params()[0];
        for sample in surface.points() {
            let point = t_hand_object * sample.position;
            let arm = point.coords - state.pose.translation.vector;
            let velocity = state.linear + state.angular.cross(&arm);
            for (body, solid) in self.links.iter().enumerate() {
                let link = &self.states[body];
                let local = link.pose.inverse_transform_point(&point);
                let Some(sample_of_link) = solid.shape.sample(&local, 0.0) else { continue };
                let FieldSample { distance, gradient, .. } = sample_of_link;
                let Some(normal) = gradient.try_normalize(1e-9) else { continue };
                let normal = link.pose.rotation * normal;
                let lever = point.coords - link.pose.translation.vector;
                let relative = velocity - link.linear - link.angular.cross(&lever);
                let normal_speed = relative.dot(&normal);
                let slip = relative - normal * normal_speed;
                let contact = ContactKinematics {
                    gap: distance,
                    normal_speed,
                    slip,
                    normal,
                    area: sample.area,
                };
                let response = law.force(law.params(), &contact);
                touches.push(Touch {
                    link: solid.link,
                    point,
                    normal,
                    force: normal * response.normal + response.tangential,
                    stiffness: stiffness * sample.area,
                });
            }
        }
        touches
    }
}
