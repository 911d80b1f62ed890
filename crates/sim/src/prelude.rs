//! The names that most programs need: `use prehend_sim::prelude::*;`.

pub use crate::articulated::{Joint, Link};
pub use crate::contact::{
    BristleFriction, ContactCalibration, ContactForce, ContactKinematics, ContactLaw, Coulomb,
    DynContactLaw, GapSmoothing, HuntCrossley, KelvinVoigt, Law,
};
pub use crate::fields::{Cuboid, HalfSpace};
pub use crate::joint_law::{
    JointDamper, JointFriction, JointLaw, JointLimits, JointSpring, Motor, PositionServo,
    VelocityServo,
};
pub use crate::robot::{MjcfOptions, MjcfRobot, UrdfOptions};
pub use crate::{
    Adaptive, Batch, Body, BodyId, BodyState, BuildError, Bushing, BushingId, ContactBodies,
    ContactId, Integrator, JointForceId, Material, Model, Motion, RigidBody, RolloutFunction,
    RolloutInputs, RungeKutta4, SemiImplicitEuler, Shape, ShapeOptions, SimulationError, State,
    Step, Surface, TimeSteps,
    integrator::{BackwardEuler, StepCheckpointed, SubStepped},
    model::{BushingStiffness, JointAxis},
};
