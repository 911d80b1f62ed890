//! Double precision.

use parry3d_f64 as parry;

const NAME: &str = "parry3d-f64";
const UNORIENTED: &str = "parry3d-f64, flags not set";

type Real = f64;

#[path = "overlap.rs"]
pub(super) mod overlap;
#[path = "queries.rs"]
pub(super) mod queries;
