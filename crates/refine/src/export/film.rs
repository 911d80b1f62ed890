//! Hand and objects as they move through the images of a scene.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use prehend_geometry::{FilmBody, FilmCamera, FilmKey, GlbFilm, MeshError};

use super::upright::upright;
use crate::data::Target;
use crate::error::RefineError;
use crate::scene::{Frame, Hand, Object};

/// Colors of what has no own, sRGB-encoded.
const HAND: [f32; 3] = [0.55, 0.57, 0.6];
const OBJECT: [f32; 3] = [0.85, 0.6, 0.3];

/// A film of one scene, image by image.
///
/// Its nodes are `scene`, which stands the scene upright; below that the links of the hand by their names, as far as they have a shape, and those of
/// all other bodies; `object ID` for each object, from its second instance on `object ID instance N`; and `camera`. Images have places in time by their ids.
pub struct SceneFilm {
    /// Images a second.
    rate: f64,
    /// Id of the first image, and the film's frame → that of glTF.
    first: Option<(u32, UnitQuaternion<f64>)>,
    hand: Option<(Arc<Hand>, Vec<FilmBody>)>,
    objects: BTreeMap<(u32, usize), FilmBody>,
    camera: Option<FilmCamera>,
}

impl SceneFilm {
    /// Without any image, of `rate` images a second.
    ///
    /// # Errors
    /// [`RefineError::Setting`] if the rate is not above zero.
    pub fn new(rate: f64) -> Result<Self, RefineError> {
        if !(rate.is_finite() && rate > 0.0) {
            let problem = format!("{rate} is no number of images a second");
            return Err(RefineError::Setting { name: "rate", problem });
        }
        Ok(Self { rate, first: None, hand: None, objects: BTreeMap::new(), camera: None })
    }

    /// Adds the image `im_id` with its hand, later than all before. `t_base_cam` takes the camera's frame to that of the film, which is the same in all
    /// images: that of the world, or of a camera at rest \[m\]. The first image says what is up: against gravity, or where that is not known, in the picture.
    ///
    /// # Errors
    /// [`RefineError::Setting`] if the hand is another than in images before, and if it has joints of another number.
    pub fn add_image(
        &mut self,
        im_id: u32,
        observation: &Frame,
        t_base_cam: &Isometry3<f64>,
    ) -> Result<(), RefineError> {
        let mut links = Vec::new();
        if let Some(measured) = &observation.hand {
            let hand = &measured.hand;
            let posed = hand.posed(&measured.t_cam_hand, &measured.joints)?;
            let (known, bodies) =
                self.hand.get_or_insert_with(|| (Arc::clone(hand), bodies_of(hand)));
            if !names(known).eq(names(hand)) {
                let problem = "are others than in the images before".to_owned();
                return Err(RefineError::Setting { name: "bodies", problem });
            }
            let shown = shown(hand).map(|link| posed.t_world_links()[link]);
            links.extend(bodies.iter_mut().zip(shown));
        }
        let camera = &observation.camera;
        let film = self.camera.get_or_insert_with(|| FilmCamera {
            vertical_angle: 2.0 * (camera.height as f64 / (2.0 * camera.fy)).atan(),
            aspect: camera.width as f64 * camera.fy / (camera.height as f64 * camera.fx),
            keys: Vec::new(),
        });
        let (first, _) = *self.first.get_or_insert_with(|| {
            let up = observation.gravity.map_or_else(|| -Vector3::y(), |gravity| -gravity);
            (im_id, upright(&(t_base_cam * up), &(t_base_cam * Vector3::z())))
        });
        let time = f64::from(im_id - first.min(im_id)) / self.rate;
        for (body, t_cam_link) in links {
            body.keys.push(FilmKey { time, t_base_body: t_base_cam * t_cam_link });
        }
        film.keys.push(FilmKey { time, t_base_body: *t_base_cam });
        Ok(())
    }

    /// Adds the place of an object, object → camera \[m\], in the image that was added last.
    pub fn add_object(&mut self, target: &Target, object: &Object, t_cam_object: &Isometry3<f64>) {
        let last = self.camera.as_ref().and_then(|camera| camera.keys.last());
        let Some(FilmKey { time, t_base_body }) = last.copied() else { return };
        let Target { obj_id, instance, .. } = *target;
        let body = self.objects.entry((obj_id, instance)).or_insert_with(|| FilmBody {
            name: match instance {
                0 => format!("object {obj_id}"),
                more => format!("object {obj_id} instance {more}"),
            },
            meshes: vec![Arc::new(object.mesh.clone())],
            color: OBJECT,
            keys: Vec::new(),
        });
        body.keys.push(FilmKey { time, t_base_body: t_base_body * t_cam_object });
    }

    /// Writes what there is as GLB.
    ///
    /// # Errors
    /// Those of [`GlbFilm::save`], as where images did not come in their order.
    pub fn save(self, path: &Path) -> Result<(), MeshError> {
        let mut bodies = self.hand.map(|(_, bodies)| bodies).unwrap_or_default();
        bodies.extend(self.objects.into_values());
        let r_gltf_base = self.first.map_or_else(UnitQuaternion::identity, |(_, r)| r);
        GlbFilm { r_gltf_base, bodies, camera: self.camera }.save(path)
    }
}

fn names(hand: &Hand) -> impl Iterator<Item = &str> {
    hand.tree.links().iter().map(|link| link.name.as_str())
}

/// Indices of the links that have a shape.
fn shown(hand: &Hand) -> impl Iterator<Item = usize> {
    let links = hand.tree.links().iter().enumerate();
    links.filter(|(_, link)| !link.parts.is_empty()).map(|(index, _)| index)
}

/// The links that have a shape, without places yet.
fn bodies_of(hand: &Hand) -> Vec<FilmBody> {
    let links = shown(hand).map(|index| &hand.tree.links()[index]);
    let body = |link: &prehend_geometry::robot::Link| FilmBody {
        name: link.name.clone(),
        meshes: link.parts.iter().cloned().map(Arc::new).collect(),
        color: HAND,
        keys: Vec::new(),
    };
    links.map(body).collect()
}
