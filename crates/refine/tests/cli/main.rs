//! The `prehend` program, run as its users run it, on a made-up dataset.

mod bad_input;
mod command;
mod fixture;
mod truth;
