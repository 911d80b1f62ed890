//! Bodies that move, as an animation of glTF (sections 3.5.2 and 3.11).

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use serde_json::{Value, json};

use super::chunk::Chunk;
use super::primitive::{ColorSpace, Parts};
use super::tracks::{Tracks, quaternion};
use crate::io::MeshError;
use crate::mesh::TriMesh;

/// Where something is at a moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmKey {
    /// Time since the film began \[s\].
    pub time: f64,
    /// Coordinates of the body → those of the film's base frame \[m\].
    pub t_base_body: Isometry3<f64>,
}

/// A rigid body of a film.
#[derive(Clone, Debug)]
pub struct FilmBody {
    /// Name of its node.
    pub name: String,
    /// Its surfaces in its own frame \[m\].
    pub meshes: Vec<Arc<TriMesh>>,
    /// Color of what has no own, sRGB-encoded, 0..=1.
    pub color: [f32; 3],
    /// Where it is, in ascending order of times; at least one. A body is where the first key says before that, and straight between keys.
    pub keys: Vec<FilmKey>,
}

/// A camera of a film, in the convention of computer vision: x right, y down, z forward.
#[derive(Clone, Debug)]
pub struct FilmCamera {
    /// Angle between the upper and the lower edge of its image \[rad\].
    pub vertical_angle: f64,
    /// Width over height of its image.
    pub aspect: f64,
    /// As [`FilmBody::keys`].
    pub keys: Vec<FilmKey>,
}

/// Rigid bodies that move in one frame, the base, for viewers.
///
/// The file has one scene with one root node, `scene`, which turns the base frame; its children are a node for each body, of the body's name, and one for
/// the camera, `camera`. One animation moves those that are not at rest, linearly in place and along great arcs in rotation. Quaternions do not
/// change their sign from key to key.
#[derive(Clone, Debug)]
pub struct GlbFilm {
    /// Base frame → glTF's, whose y-axis points up.
    pub r_gltf_base: UnitQuaternion<f64>,
    /// Rigid bodies shown.
    pub bodies: Vec<FilmBody>,
    /// From where images were taken, if from somewhere.
    pub camera: Option<FilmCamera>,
}

impl GlbFilm {
    /// Writes the film as GLB, in single precision; textures go inside as PNG. Vertex colors are written as glTF has them, in linear intensities.
    ///
    /// # Errors
    /// [`MeshError::Write`], and then no file has appeared or changed: also if a body has no key, times do not ascend or a number is not finite in
    /// single precision; and those of [`TriMesh::save_glb`].
    pub fn save(&self, path: &Path) -> Result<(), MeshError> {
        let (mut chunk, mut parts) = (Chunk::default(), Parts::default());
        let mut meshes = Vec::new();
        let mut tracks = Tracks::default();
        let mut nodes = vec![json!({ "name": "scene", "rotation": quaternion(&self.r_gltf_base) })];
        for body in &self.bodies {
            let mut node = json!({ "name": body.name });
            if !body.meshes.is_empty() {
                let mut primitive = |mesh: &Arc<TriMesh>| {
                    parts.add(mesh, body.color, ColorSpace::Linear, &mut chunk, path)
                };
                let primitives: Vec<Value> =
                    body.meshes.iter().map(&mut primitive).collect::<Result<_, _>>()?;
                node["mesh"] = meshes.len().into();
                meshes.push(json!({ "name": body.name, "primitives": primitives }));
            }
            tracks.place(&mut node, nodes.len(), &body.name, &body.keys, &mut chunk, path)?;
            nodes.push(node);
        }
        let mut document = json!({ "scene": 0, "scenes": [{ "nodes": [0] }] });
        if let Some(FilmCamera { vertical_angle, aspect, keys }) = &self.camera {
            // Half a turn about x: cameras of glTF look against z, with y up.
            let turned = |key: &FilmKey| {
                let t_base_body = key.t_base_body
                    * UnitQuaternion::from_quaternion(Quaternion::new(0.0, 1.0, 0.0, 0.0));
                FilmKey { t_base_body, ..*key }
            };
            let keys: Vec<FilmKey> = keys.iter().map(turned).collect();
            let mut node = json!({ "name": "camera", "camera": 0 });
            tracks.place(&mut node, nodes.len(), "camera", &keys, &mut chunk, path)?;
            nodes.push(node);
            let lens = json!({ "yfov": vertical_angle, "aspectRatio": aspect, "znear": 0.01 });
            document["cameras"] = json!([{ "type": "perspective", "perspective": lens }]);
        }
        if nodes.len() > 1 {
            nodes[0]["children"] = (1..nodes.len()).collect();
        }
        document["nodes"] = nodes.into();
        if !meshes.is_empty() {
            document["meshes"] = meshes.into();
        }
        if !tracks.samplers.is_empty() {
            let Tracks { samplers, channels } = tracks;
            let animation = json!({ "name": "film", "samplers": samplers, "channels": channels });
            document["animations"] = json!([animation]);
        }
        parts.describe(&mut document);
        chunk.save(document, path)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Vector3;

    use super::*;
    use crate::shapes::cuboid;

    fn key(time: f64, angle: f64) -> FilmKey {
        let (place, turn) = (Vector3::new(time, 0.5, -1.0), Vector3::z() * angle);
        FilmKey { time, t_base_body: Isometry3::new(place, turn) }
    }

    fn film(keys: Vec<FilmKey>) -> GlbFilm {
        let mut painted = cuboid(Vector3::repeat(0.1));
        painted.colors = Some(vec![[0.5; 3]; painted.vertices.len()]);
        let body = |name: &str, mesh, keys| FilmBody {
            name: name.into(),
            meshes: vec![Arc::new(mesh)],
            color: [0.8; 3],
            keys,
        };
        let bodies = vec![
            body("turns \"about\"", painted, keys),
            body("rests", cuboid(Vector3::repeat(0.2)), vec![key(0.0, 0.0), key(0.0, 0.0)]),
        ];
        let camera = FilmCamera { vertical_angle: 0.8, aspect: 1.5, keys: vec![key(0.0, 0.0)] };
        GlbFilm { r_gltf_base: UnitQuaternion::identity(), bodies, camera: Some(camera) }
    }

    #[test]
    fn keys_are_read_as_they_were_written_and_quaternions_keep_their_sign() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.glb");
        // Beyond half a turn, where the real part changes its sign.
        let keys: Vec<FilmKey> =
            (0..7).map(|k| key(f64::from(k), f64::from(k) * PI / 3.0)).collect();
        let mut film = film(keys.clone());
        film.bodies[1].keys.truncate(1);
        film.save(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let gltf = gltf::Gltf::from_slice(&bytes).unwrap();
        let names: Vec<_> = gltf.nodes().map(|n| n.name().unwrap().to_owned()).collect();
        assert_eq!(names, ["scene", "turns \"about\"", "rests", "camera"]);
        assert_eq!(gltf.nodes().next().unwrap().children().count(), 3);
        let animation = gltf.animations().next().unwrap();
        assert_eq!(animation.channels().count(), 2);
        for channel in animation.channels() {
            assert_eq!(channel.target().node().index(), 1);
            let reader = channel.reader(|_| gltf.blob.as_deref());
            let times: Vec<f32> = reader.read_inputs().unwrap().collect();
            assert_eq!(times, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
            match reader.read_outputs().unwrap() {
                gltf::animation::util::ReadOutputs::Translations(places) => {
                    assert!(places.zip(&times).all(|(p, t)| p == [*t, 0.5, -1.0]));
                }
                gltf::animation::util::ReadOutputs::Rotations(turns) => {
                    let turns: Vec<_> = turns.into_f32().collect();
                    for pair in turns.windows(2) {
                        assert!((0..4).map(|k| pair[0][k] * pair[1][k]).sum::<f32>() > 0.0);
                    }
                    for (q, key) in turns.iter().zip(&keys) {
                        let [i, j, k, w] = q.map(f64::from);
                        let q = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
                        assert!(q.angle_to(&key.t_base_body.rotation) < 1e-6);
                    }
                }
                _ => panic!("nothing else moves"),
            }
        }
        // Colors are intensities: half of sRGB's scale is a fifth of the light.
        let primitive = gltf.meshes().next().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| gltf.blob.as_deref());
        let first = reader.read_colors(0).unwrap().into_rgb_f32().next().unwrap();
        assert!((first[0] - 0.214).abs() < 1e-3, "{first:?}");
        // The camera looks along z of its base frame.
        let (_, q, _) = gltf.nodes().last().unwrap().transform().decomposed();
        assert_eq!(q, [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_film_that_no_viewer_would_play_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.glb");
        for (keys, what) in [
            (vec![], "there is no key"),
            (vec![key(1.0, 0.0), key(1.0, 0.0)], "times do not ascend"),
            (vec![key(0.0, f64::NAN)], "not finite"),
        ] {
            let mut film = film(keys);
            film.bodies.truncate(1);
            let refused = film.save(&path).unwrap_err().to_string();
            assert!(refused.contains(what) && refused.contains("turns"), "{refused}");
        }
        assert!(!path.exists());
    }
}
