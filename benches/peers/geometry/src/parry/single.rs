//! Single precision. Intersections are left to double precision.

use parry3d as parry;

const NAME: &str = "parry3d, f32";
const UNORIENTED: &str = "parry3d, f32, flags not set";

type Real = f32;

#[path = "queries.rs"]
pub(super) mod queries;
