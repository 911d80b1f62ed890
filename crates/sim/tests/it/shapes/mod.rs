//! Shapes of parry as bodies: distances and masses beside parry's own, derivatives, and bodies at rest.

mod catalog;
mod derivatives;
mod dimensions;
mod distances;
mod finite;
mod heights;
mod joined;
mod mass;
mod rest;
