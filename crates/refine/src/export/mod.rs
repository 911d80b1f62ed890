//! Poses in files for other programs: a film of hand and object for viewers ([`SceneFilm`], GLB). `docs/EXPORT.md` describes it.

mod film;
mod upright;

pub use film::SceneFilm;
