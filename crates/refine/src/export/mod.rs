//! Poses in files for other programs: a film of hand and object for viewers ([`SceneFilm`], GLB), and where they touch ([`contacts`], PLY).
//! `docs/EXPORT.md` describes both.

mod contact;
mod contact_file;
mod film;
mod upright;

pub use contact::{ContactKind, ContactPoint, contacts};
pub use contact_file::{ContactRow, write_contacts};
pub use film::SceneFilm;
