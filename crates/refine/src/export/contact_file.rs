//! Contacts as a PLY file: points with what is known of them as properties.

use std::fmt::Write as _;
use std::path::Path;

use super::contact::ContactPoint;
use crate::data::Target;
use crate::data::bop::{DatasetError, write_atomically};

/// A contact, and of which object in which image it is.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactRow {
    /// Object and image.
    pub target: Target,
    /// The contact, in the frame of that image's camera.
    pub contact: ContactPoint,
}

/// Properties of a vertex in order.
const PROPERTIES: [(&str, &[&str]); 4] = [
    ("double", &["x", "y", "z"]),
    ("float", &["nx", "ny", "nz", "fx", "fy", "fz", "distance"]),
    ("uchar", &["kind"]),
    ("int", &["link", "scene_id", "im_id", "obj_id", "instance"]),
];

/// What the properties are, in comments that travel with the file.
const COMMENTS: &str = "comment Contacts of hand and object, one a vertex; lengths in meters, forces in newtons
comment Frame: the camera of image im_id, x right, y down, z forward
comment nx ny nz: unit normal out of the hand; fx fy fz: force of the object on the hand, nan where not known
comment distance: to the object's surface at its pose, negative inside it; of kind 3 to the hand's; nan where beyond 5 cm
comment kind: 0 force of a taxel, 1 touched, 2 patch of a soft skin, 3 surfaces within 5 mm at the pose
";

/// Writes `rows` to `path` as a binary PLY file of points. The file appears whole or not at all.
///
/// # Errors
/// [`DatasetError::Write`].
pub fn write_contacts(path: &Path, rows: &[ContactRow]) -> Result<(), DatasetError> {
    let mut links: Vec<&str> = Vec::new();
    let mut vertices = Vec::new();
    for ContactRow { target, contact } in rows {
        let known = links.iter().position(|link| *link == contact.link);
        let link = known.unwrap_or_else(|| {
            links.push(&contact.link);
            links.len() - 1
        });
        let ContactPoint { position, normal, force, distance, kind, .. } = contact;
        position.iter().for_each(|v| vertices.extend(v.to_le_bytes()));
        let floats = normal.iter().chain(force).chain([distance]);
        floats.for_each(|v| vertices.extend((*v as f32).to_le_bytes()));
        vertices.push(*kind as u8);
        let Target { scene_id, im_id, obj_id, instance } = *target;
        let ids = [link as u32, scene_id, im_id, obj_id, instance as u32];
        ids.iter().for_each(|id| vertices.extend(id.to_le_bytes()));
    }
    let mut header = format!("ply\nformat binary_little_endian 1.0\n{COMMENTS}");
    for (index, link) in links.iter().enumerate() {
        // A line break would end the comment.
        let link: String = link.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let _ = writeln!(header, "comment link {index}: {link}");
    }
    let _ = writeln!(header, "element vertex {}", rows.len());
    for (kind, names) in PROPERTIES {
        names.iter().for_each(|name| header += &format!("property {kind} {name}\n"));
    }
    let mut content = (header + "end_header\n").into_bytes();
    content.extend(vertices);
    write_atomically(path, &content)
}
