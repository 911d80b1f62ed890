//! COLLADA: triangles and polygons under the transforms of nodes, positions and faces alone.
//!
//! Lengths are in meters by the file's `unit`. Its up axis is passed over, as robots' tools do.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix4, Point3, Rotation3, Unit, Vector3};
use roxmltree::{Document, Node};

use super::limits::MAX_ELEMENTS;
use super::polygon::triangles;
use super::{MeshError, Result};
use crate::mesh::TriMesh;

/// Deepest nesting of nodes, those of instances included.
const MOST_LEVELS: usize = 64;

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh> {
    let malformed = |e: &dyn ToString| MeshError::malformed(path, "document", e.to_string());
    let text = str::from_utf8(bytes).map_err(|e| malformed(&e))?;
    let document = Document::parse(text).map_err(|e| malformed(&e))?;
    let root = document.root_element();
    let ids = document.descendants().filter_map(|node| Some((node.attribute("id")?, node)));
    let mut reader = ColladaReader { path, ids: ids.collect(), mesh: TriMesh::default() };
    let unit = children(root, "asset").flat_map(|asset| children(asset, "unit")).next();
    let unit = unit.and_then(|unit| unit.attribute("meter")?.parse().ok()).unwrap_or(1.0);
    let scenes = children(root, "scene").flat_map(|s| children(s, "instance_visual_scene"));
    for scene in scenes {
        let scene = reader.target(scene)?;
        reader.node(scene, &Matrix4::new_scaling(unit), 0)?;
    }
    Ok(reader.mesh)
}

fn children<'a, 'i>(node: Node<'a, 'i>, tag: &'a str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.tag_name().name() == tag)
}

struct ColladaReader<'a, 'i> {
    path: &'a Path,
    ids: BTreeMap<&'a str, Node<'a, 'i>>,
    mesh: TriMesh,
}

impl<'a, 'i> ColladaReader<'a, 'i> {
    fn fault(&self, node: Node<'a, 'i>, reason: impl ToString) -> MeshError {
        let line = node.document().text_pos_at(node.range().start).row;
        let element = format!("line {line}: {}", node.tag_name().name());
        MeshError::malformed(self.path, element, reason)
    }

    /// Element that an instance or an input refers to.
    fn target(&self, node: Node<'a, 'i>) -> Result<Node<'a, 'i>> {
        let name = node.attribute("url").or(node.attribute("source")).unwrap_or_default();
        let found = name.strip_prefix('#').and_then(|id| self.ids.get(id)).copied();
        found.ok_or_else(|| self.fault(node, format!("nothing is called '{name}'")))
    }

    fn numbers<T: std::str::FromStr>(&self, node: Node<'a, 'i>) -> Result<Vec<T>> {
        let words = node.text().unwrap_or_default().split_ascii_whitespace();
        let all: Result<Vec<T>, _> = words.map(str::parse).collect();
        all.map_err(|_| self.fault(node, "holds something that is not a number"))
    }

    fn node(
        &mut self,
        node: Node<'a, 'i>,
        t_scene_parent: &Matrix4<f64>,
        level: usize,
    ) -> Result<()> {
        if level > MOST_LEVELS {
            return Err(self.fault(node, "is nested too deeply"));
        }
        let mut pose = *t_scene_parent;
        for child in node.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "matrix" | "translate" | "rotate" | "scale" => pose *= self.transform(child)?,
                "node" => self.node(child, &pose, level + 1)?,
                "instance_node" => self.node(self.target(child)?, &pose, level + 1)?,
                "instance_geometry" => {
                    for mesh in children(self.target(child)?, "mesh") {
                        for primitive in mesh.children().filter(Node::is_element) {
                            self.primitive(primitive, &pose)?;
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn transform(&self, node: Node<'a, 'i>) -> Result<Matrix4<f64>> {
        let numbers: Vec<f64> = self.numbers(node)?;
        Ok(match (node.tag_name().name(), numbers.as_slice()) {
            ("matrix", all) if all.len() == 16 => Matrix4::from_row_slice(all),
            ("translate", &[x, y, z]) => Matrix4::new_translation(&Vector3::new(x, y, z)),
            ("scale", &[x, y, z]) => Matrix4::new_nonuniform_scaling(&Vector3::new(x, y, z)),
            ("rotate", &[x, y, z, degrees]) => Unit::try_new(Vector3::new(x, y, z), 0.0)
                .map_or_else(Matrix4::identity, |axis| {
                    Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous()
                }),
            _ => return Err(self.fault(node, "has not as many numbers as it should")),
        })
    }

    fn primitive(&mut self, node: Node<'a, 'i>, pose: &Matrix4<f64>) -> Result<()> {
        let kind = node.tag_name().name();
        if !["triangles", "polylist", "polygons", "tristrips", "trifans"].contains(&kind) {
            return Ok(());
        }
        let offset = |input: Node<'a, 'i>| -> usize {
            input.attribute("offset").and_then(|text| text.parse().ok()).unwrap_or(0)
        };
        let stride = children(node, "input").map(offset).max().unwrap_or(0).saturating_add(1);
        let is = |semantic: &'static str| {
            move |input: &Node<'a, 'i>| input.attribute("semantic") == Some(semantic)
        };
        let Some(vertices) = children(node, "input").find(is("VERTEX")) else { return Ok(()) };
        let place = offset(vertices);
        let positions = children(self.target(vertices)?, "input").find(is("POSITION"));
        let positions = positions.ok_or_else(|| self.fault(vertices, "has no positions"))?;
        let list = children(self.target(positions)?, "float_array").next();
        let list: Vec<f64> =
            self.numbers(list.ok_or_else(|| self.fault(positions, "is empty"))?)?;
        let points = list.chunks_exact(3).map(|p| pose.transform_point(&Point3::from_slice(p)));
        let mut part = TriMesh::new(points.collect(), Vec::new());
        let counts = children(node, "vcount").next();
        let counts: Vec<usize> = counts.map_or(Ok(Vec::new()), |node| self.numbers(node))?;
        for list in children(node, "p") {
            let all: Vec<u32> = self.numbers(list)?;
            let corners: Vec<u32> =
                all.chunks(stride).filter_map(|c| c.get(place)).copied().collect();
            if corners.iter().any(|corner| *corner as usize >= part.vertices.len()) {
                return Err(self.fault(list, "refers to a vertex that is not there"));
            }
            let of_polygon = |c: &[u32]| -> Vec<[u32; 3]> {
                let positions: Vec<_> = c.iter().map(|&v| part.vertices[v as usize]).collect();
                triangles(&positions).into_iter().map(|triangle| triangle.map(|k| c[k])).collect()
            };
            let mut faces = Vec::new();
            match kind {
                "triangles" => faces.extend_from_slice(corners.as_chunks().0),
                "polylist" => {
                    let mut rest = corners.as_slice();
                    for &count in &counts {
                        let Some((own, after)) = rest.split_at_checked(count) else { break };
                        faces.extend(of_polygon(own));
                        rest = after;
                    }
                }
                "tristrips" => faces.extend(strip(&corners)),
                "trifans" => {
                    faces.extend(corners.windows(2).skip(1).map(|w| [corners[0], w[0], w[1]]));
                }
                _ => faces.extend(of_polygon(&corners)),
            }
            part.faces.extend(faces);
        }
        if pose.fixed_view::<3, 3>(0, 0).determinant() < 0.0 {
            part.faces.iter_mut().for_each(|face| face.swap(1, 2));
        }
        self.mesh.append(&part);
        // Instances share data, so that a small file can ask for any number of triangles.
        let size = self.mesh.faces.len() + self.mesh.vertices.len();
        MeshError::within(self.path, "faces and vertices", size, MAX_ELEMENTS)
    }
}

/// Triangles of a strip, of which every other one runs the other way round.
pub(super) fn strip(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    corners
        .windows(3)
        .enumerate()
        .map(|(k, w)| if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
        <asset><unit meter="0.01"/><up_axis>Y_UP</up_axis></asset>
        <library_geometries><geometry id="g"><mesh>
        <source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array></source>
        <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
        <polylist count="2"><input semantic="NORMAL" source="#p" offset="0"/><input semantic="VERTEX" source="#v" offset="1"/>
        <vcount>3 3</vcount><p>0 0 0 2 0 1 0 0 0 1 0 3</p></polylist>
        <tristrips><input semantic="VERTEX" source="#v" offset="0"/><p>0 3 2 1</p></tristrips></mesh></geometry></library_geometries>
        <library_nodes><node id="n"><scale>1 1 -1</scale><instance_geometry url="#g"/></node></library_nodes>
        <library_visual_scenes><visual_scene id="s"><node><translate>0 0 5</translate><rotate>0 0 1 90</rotate>
        <node><instance_node url="#n"/></node></node></visual_scene></library_visual_scenes>
        <scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;

    #[test]
    fn nodes_place_and_scale() {
        let path = Path::new("m.dae");
        let mesh = parse(FILE.as_bytes(), path).unwrap();
        // Mirrored, turned by 90° about z, lifted by 5 cm.
        assert!((mesh.vertices[1] - Point3::new(0.0, 0.01, 0.05)).norm() < 1e-15);
        assert!((mesh.vertices[3] - Point3::new(0.0, 0.0, 0.04)).norm() < 1e-15);
        assert_eq!((mesh.faces.len(), mesh.faces[0]), (4, [0, 1, 2]));
        let volume = crate::mass::mass_properties(&mesh.welded(), 1.0).unwrap().mass;
        assert!((volume - 1e-6 / 6.0).abs() < 1e-15, "{volume}");
        for (from, to, says) in [
            ("url=\"#g\"", "url=\"#x\"", "instance_geometry: nothing is called '#x'"),
            ("0 3 2 1", "0 3 2 4", "p: refers to a vertex"),
            ("<instance_geometry", "<instance_node url=\"#n\"/><instance_geometry", "too deeply"),
            ("0 0 5", "0 0", "translate: has not as many"),
            ("</COLLADA>", "", "document"),
        ] {
            let error = parse(FILE.replace(from, to).as_bytes(), path).unwrap_err().to_string();
            assert!(error.starts_with("m.dae: ") && error.contains(says), "{error}");
        }
    }

    #[test]
    fn polygons_may_be_concave() {
        let corners = "0 3 0 -1 0 0 0 1 0 1 0 0";
        let file = FILE
            .replace("0 0 0 1 0 0 0 1 0 0 0 1", corners)
            .replace(
                "<vcount>3 3</vcount><p>0 0 0 2 0 1 0 0 0 1 0 3</p>",
                "<vcount>4</vcount><p>0 1 0 2 0 3 0 0</p>",
            )
            .replace("<p>0 3 2 1</p>", "");
        let polygons = file.replace("polylist", "polygons").replace("<vcount>4</vcount>", "");
        for file in [file, polygons] {
            let mesh = parse(file.as_bytes(), Path::new("m.dae")).unwrap();
            assert_eq!(mesh.faces.len(), 2);
            assert!((mesh.area() - 2e-4).abs() < 1e-15, "{}", mesh.area());
        }
    }
}
