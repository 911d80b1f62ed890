//! Trains networks that propose poses of an object in a robot hand ([`prehend_refine::network`]), on frames that it makes itself by simulated grasps and
//! sensors.

pub mod adam;
pub mod loss;
pub mod model;
pub mod sample;
pub mod train;
pub mod validate;
pub mod views;
