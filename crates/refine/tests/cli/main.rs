//! The `prehend` program, run as its users run it, on a made-up dataset.

#![allow(clippy::unwrap_used)] // a test may panic; helpers outside test functions count as code to the lint

mod bad_input;
mod calibrate;
mod command;
mod details;
mod eval_bop;
mod export;
mod fixture;
mod fused;
mod info;
mod initial;
mod log;
mod masks;
mod messages;
mod pages;
mod resume;
mod settings;
mod study;
mod track;
mod truth;
mod watch;
