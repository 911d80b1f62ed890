//! parry in single and in double precision: two crates of one source.
//!
//! Signed distances need `TriMeshFlags::ORIENTED`, intersections the topology too.

mod double;
mod single;

use crate::workloads::{Comparisons, Scenes};

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    single::queries::add(to, scenes);
    double::queries::add(to, scenes);
    double::overlap::add(to, scenes);
}
