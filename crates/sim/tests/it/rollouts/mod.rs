//! Rollouts of whole models: what every integrator must do, and gradients over random scenes.

mod batch;
mod driven;
mod finite;
mod functions;
mod gradients;
mod groups;
mod integrators;
