//! The built-in hand: an Allegro right hand (16 joints) covered with XELA uSkin pads (368 taxels).
//!
//! Authored from published dimensions. Frame of the base link: +z towards the fingers, +x out of the palm, +y
//! towards the index finger. Joints 0–3 move the index finger, 4–7 the middle, 8–11 the ring, 12–15 the thumb.

mod allegro;
mod grasp;
#[cfg(test)]
mod parts;
#[cfg(test)]
mod posed;
mod taxel_csv;
mod taxels;

pub use allegro::{ALLEGRO_XELA_URDF, JOINT_COUNT, JOINT_NAMES};
pub use grasp::{Grasp, default_grasp};
pub use taxel_csv::{TaxelError, load_taxels};
pub use taxels::{Taxel, taxels};
