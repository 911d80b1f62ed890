//! Wavefront OBJ with MTL materials.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use nalgebra::{Point3, Vector3};

use super::images::Images;
use super::mtl::{self, Library};
use super::parts::{Part, join};
use super::polygon::{Polygons, triangles};
use super::{MeshError, Result, text, texture};
use crate::mesh::TriMesh;

/// Indices of position, texture coordinates and normal of a corner.
type Corner = [u32; 3];

/// Index of a texture coordinate or normal that a corner has not.
const NONE: u32 = u32::MAX;

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh> {
    let content = ObjContent::parse(bytes, path)?;
    let library = content.library(path);
    let unknown = content.unknown_materials(&library);
    if !unknown.is_empty() {
        let names = Vec::from_iter(unknown).join(", ");
        log::warn!("{}: no library has the materials {names}: no colors of them", path.display());
    }
    let mut images = Images::new(path);
    let find = |name: &String| mtl::without_comment(name).find_map(|name| library.get(name));
    let materials: Vec<_> = content.materials.iter().map(find).collect();
    // A mesh has texture coordinates at all corners or at none.
    let run = |face: &ObjFace, corners: &[Corner]| {
        let is_painted = corners.iter().all(|[_, uv, _]| *uv != NONE);
        (face.group, face.material.filter(|&m| materials[m].is_some()), is_painted)
    };
    let mut parts = Vec::new();
    for ((_, material, is_painted), mesh) in content.meshes(run, |corner| corner) {
        let material = material.and_then(|m| materials[m]);
        let texture = material.filter(|_| is_painted).and_then(|m| m.texture(&mut images, path));
        let color = material.and_then(|m| m.diffuse).unwrap_or([1.0; 3]);
        parts.push(Part { mesh, texture, color });
    }
    // Colors of eight bits, as some programs write them.
    if parts.iter().flat_map(|p| p.mesh.colors.iter().flatten().flatten()).any(|c| *c > 1.0) {
        let colors = parts.iter_mut().flat_map(|p| p.mesh.colors.iter_mut().flatten().flatten());
        colors.for_each(|c| *c /= 255.0);
    }
    join(parts, path)
}

/// Positions and faces alone; corners share their position whatever their normals are. Without faces all positions that are finite.
pub(super) fn parse_shape(bytes: &[u8], path: &Path) -> Result<TriMesh> {
    let mut content = ObjContent::parse(bytes, path)?;
    let mut whole = TriMesh::default();
    for (_, mesh) in content.meshes(|face, _| face.group, |[at, _, _]| [at, NONE, NONE]) {
        whole.append(&TriMesh::new(mesh.vertices, mesh.faces));
    }
    if whole.faces.is_empty() {
        content.positions.retain(|p| p.iter().all(|c| c.is_finite()));
        whole.vertices = content.positions;
    }
    Ok(whole)
}

/// Statements of a file.
#[derive(Default)]
struct ObjContent {
    positions: Vec<Point3<f64>>,
    /// Colors of the positions.
    colors: Vec<Option<[f32; 3]>>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<Vector3<f64>>,
    polygons: Polygons<Corner>,
    /// Places of the polygons.
    faces: Vec<ObjFace>,
    /// Names that stand behind `usemtl`.
    materials: Vec<String>,
    /// Names that stand behind `mtllib`, in their order.
    libraries: Vec<String>,
}

/// Place of a polygon.
struct ObjFace {
    /// Line of the file, from 1.
    line: usize,
    /// Number of objects and groups above it.
    group: usize,
    /// Place of its material's name.
    material: Option<usize>,
}

impl ObjContent {
    fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let fault =
            |line: usize, reason| MeshError::malformed(path, format!("line {line}"), reason);
        let mut all = Self::default();
        let (mut group, mut material, mut places) = (0, None, HashMap::new());
        for (number, line) in text::lines(&text::decoded(bytes)) {
            let line = line.trim();
            let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            match key {
                "o" | "g" => group += 1,
                "usemtl" => {
                    material = Some(*places.entry(value.trim().to_owned()).or_insert_with(|| {
                        all.materials.push(value.trim().to_owned());
                        all.materials.len() - 1
                    }));
                }
                "mtllib" if !all.libraries.iter().any(|name| name == value.trim()) => {
                    all.libraries.push(value.trim().to_owned());
                }
                "f" => {
                    let words = uncommented(value).split_whitespace();
                    let corners: Result<Vec<_>, _> = words.map(|word| all.corner(word)).collect();
                    let corners = corners.map_err(|reason| fault(number, reason))?;
                    // Of two corners it is a line.
                    if corners.len() > 2 {
                        all.polygons.push(corners);
                        all.faces.push(ObjFace { line: number, group, material });
                    }
                }
                "v" | "vt" | "vn" => {
                    all.add(key, value).map_err(|reason| fault(number, reason))?;
                }
                _ => {}
            }
        }
        // Some programs leave out texture coordinates and normals, but not their indices.
        let counts = [all.positions.len(), all.uvs.len(), all.normals.len()];
        for (k, _) in counts.iter().enumerate().skip(1).filter(|(_, count)| **count == 0) {
            all.polygons.corners_mut().for_each(|corner| corner[k] = NONE);
        }
        for (face, corners) in all.faces.iter().zip(all.polygons.iter()) {
            let mut indices = corners.iter().flat_map(|corner| corner.iter().zip(counts));
            let outside = indices.find(|&(&index, count)| index != NONE && index as usize >= count);
            if let Some((index, _)) = outside {
                return Err(fault(face.line, out_of_range(i64::from(*index) + 1)));
            }
        }
        Ok(all)
    }

    /// Adds a position (`x y z [w]` or `x y z r g b`), texture coordinates or a normal.
    fn add(&mut self, key: &str, value: &str) -> Result<(), String> {
        // Whatever is no number ends them: comments.
        let words = uncommented(value).split_whitespace();
        let mut numbers = [0.0; 6];
        let parsed = words.map_while(|word| word.parse::<f64>().ok());
        let count = numbers.iter_mut().zip(parsed).map(|(to, number)| *to = number).count();
        let [x, y, z, rgb @ ..] = numbers;
        let least = if key == "vt" { 1 } else { 3 };
        if count < least {
            return Err(format!("{key} has {count} numbers, not {least}"));
        }
        match key {
            "vt" => self.uvs.push([x as f32, y as f32]),
            "vn" => self.normals.push(Vector3::new(x, y, z)),
            _ => {
                self.positions.push(Point3::new(x, y, z));
                self.colors.push((count == 6).then_some(rgb.map(|c| c as f32)));
            }
        }
        Ok(())
    }

    /// Corner of a face: `v`, `v/vt`, `v//vn` or `v/vt/vn`, from 1, or back from the last one above.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let mut corner = [NONE; 3];
        for ((to, count), text) in corner.iter_mut().zip(counts).zip(word.split('/')) {
            if !text.is_empty() {
                let index: i64 = text.parse().map_err(|_| format!("'{text}' is no index"))?;
                let place = if index < 0 { index + count as i64 } else { index - 1 };
                let place = u32::try_from(place).ok().filter(|place| *place != NONE);
                *to = place.ok_or_else(|| out_of_range(index))?;
            }
        }
        if corner[0] == NONE { Err(format!("'{word}' has no position")) } else { Ok(corner) }
    }

    /// Materials of all libraries: a line names one, or several with spaces between.
    fn library(&self, path: &Path) -> Library {
        let mut all = Library::new();
        let mut add = |name: &str| -> Result<(), String> {
            all.extend(mtl::parse(&texture::near(path, name)?)?);
            Ok(())
        };
        for names in &self.libraries {
            let Err(whole) = add(names) else { continue };
            let names = mtl::without_comment(names).last().unwrap_or_default();
            let words: Vec<&str> = names.split_whitespace().collect();
            let read = |name: &&str| Some(format!("{name}: {}", add(name).err()?));
            let unread: Vec<String> = words.iter().filter_map(read).collect();
            if unread.len() == words.len() {
                log::warn!("{}: mtllib {names}: {whole}: no colors", path.display());
            } else if !unread.is_empty() {
                log::warn!("{}: mtllib {}: no colors of it", path.display(), unread.join("; "));
            }
        }
        all
    }

    /// Materials that are used and that no library has.
    fn unknown_materials(&self, library: &Library) -> BTreeSet<&str> {
        let is_known =
            |name: &&str| mtl::without_comment(name).any(|name| library.contains_key(name));
        self.materials.iter().map(String::as_str).filter(|name| !is_known(name)).collect()
    }

    /// Meshes of successive faces of one `run`, with that run. Corners of one `identity` are one vertex.
    fn meshes<R: PartialEq>(
        &self,
        run: impl Fn(&ObjFace, &[Corner]) -> R,
        identity: impl Fn(Corner) -> Corner,
    ) -> Vec<(R, TriMesh)> {
        let mut meshes = Vec::new();
        let mut begun: Option<(R, Vertices)> = None;
        for (face, corners) in self.faces.iter().zip(self.polygons.iter()) {
            let own = run(face, corners);
            if begun.as_ref().is_some_and(|(run, _)| *run != own) {
                meshes.extend(begun.take());
            }
            let (_, vertices) = begun.get_or_insert_with(|| (own, Vertices::default()));
            let places: Vec<u32> = corners.iter().map(|&c| vertices.place(identity(c))).collect();
            let positions: Vec<_> = corners.iter().map(|c| self.positions[c[0] as usize]).collect();
            let faces =
                triangles(&positions).into_iter().map(|triangle| triangle.map(|k| places[k]));
            vertices.faces.extend(faces);
        }
        meshes.extend(begun);
        meshes.into_iter().map(|(run, vertices)| (run, self.mesh(vertices))).collect()
    }

    fn mesh(&self, Vertices { corners, faces, .. }: Vertices) -> TriMesh {
        // An attribute that only some vertices have is none of the mesh.
        fn attribute<T: Copy>(corners: &[Corner], k: usize, all: &[T]) -> Option<Vec<T>> {
            corners.iter().map(|corner| all.get(corner[k] as usize).copied()).collect()
        }
        let positions = attribute(&corners, 0, &self.positions).unwrap_or_default();
        let colors = attribute(&corners, 0, &self.colors);
        TriMesh {
            colors: colors.and_then(|colors| colors.into_iter().collect()),
            uvs: attribute(&corners, 1, &self.uvs),
            normals: attribute(&corners, 2, &self.normals),
            ..TriMesh::new(positions, faces)
        }
    }
}

/// Numbers without a comment behind them; `1.#QNAN` is none.
fn uncommented(numbers: &str) -> &str {
    let own = numbers.split_once('#').map(|(own, _)| own);
    own.filter(|own| !own.ends_with('.')).unwrap_or(numbers)
}

fn out_of_range(index: i64) -> String {
    format!("index {index} is out of range")
}

/// Vertices and faces of a part.
#[derive(Default)]
struct Vertices {
    corners: Vec<Corner>,
    places: HashMap<Corner, u32>,
    faces: Vec<[u32; 3]>,
}

impl Vertices {
    /// Place of a corner, as a new vertex unless it is known.
    fn place(&mut self, corner: Corner) -> u32 {
        *self.places.entry(corner).or_insert_with(|| {
            self.corners.push(corner);
            self.corners.len() as u32 - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE_CORNER: &str = "mtllib m.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        vt 0.5 0.5\nusemtl painted\nf 1/1 2/2 3/3\nf -4/5 -2/3 -1/4\n";

    fn load(text: &str, path: &Path) -> Result<TriMesh> {
        TriMesh::from_bytes(text.as_bytes(), path)
    }

    #[test]
    fn texture_and_seams() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        // A library that is missing, outside of the folder or broken costs the colors.
        std::fs::write(folder.path().join("broken.mtl"), "newmtl painted\nKd 1\nKd x\n").unwrap();
        for name in ["m.mtl", "../m.mtl", "broken.mtl"] {
            let mesh = load(&CUBE_CORNER.replace("m.mtl", name), &path).unwrap();
            assert!(mesh.faces.len() == 2 && mesh.texture.is_none(), "{name}");
        }
        std::fs::write(
            folder.path().join("m.mtl"),
            "newmtl painted\nKd 1 1 1\nmap_Kd -s 1 1 1 t.png\n",
        )
        .unwrap();
        assert!(load(CUBE_CORNER, &path).unwrap().texture.is_none());
        image::RgbImage::from_raw(1, 2, vec![9, 9, 9, 7, 7, 7])
            .unwrap()
            .save(folder.path().join("t.png"))
            .unwrap();
        let mesh = load(CUBE_CORNER, &path).unwrap();
        // Corner 1 has two texture coordinates and is stored twice; corner 3 is shared.
        assert_eq!((mesh.vertices.len(), mesh.faces.len()), (5, 2));
        let uvs = mesh.uvs.as_ref().unwrap();
        let at = |f: usize, k: usize| {
            (mesh.vertices[mesh.faces[f][k] as usize], uvs[mesh.faces[f][k] as usize])
        };
        assert_eq!(at(0, 0), (Point3::origin(), [0.0, 0.0]));
        assert_eq!(at(1, 0), (Point3::origin(), [0.5, 0.5]));
        assert_eq!(at(0, 2), at(1, 1));
        assert_eq!(mesh.texture.unwrap().pixels.len(), 2);
    }

    #[test]
    fn texts_of_all_kinds() {
        // Interleaved and negative indices, a line in two, names with spaces.
        let text = "mtllib a b.mtl c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red one\nf -3 \\\n-2 -1\nv 0 0 1\nusemtl blue\nf 1 2 -1\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        let material = |name: &str, color: &str| format!("newmtl {name}\nKd {color}\n");
        std::fs::write(folder.path().join("a b.mtl"), material("red one", "1 0 0")).unwrap();
        let wide = |bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            text.replace('\n', "\r\n").encode_utf16().flat_map(bytes).collect()
        };
        let big = [&[0xfe, 0xff][..], &wide(u16::to_be_bytes)].concat();
        let little = [&[0xff, 0xfe][..], &wide(u16::to_le_bytes)].concat();
        let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
        for bytes in [big, little, marked, text.as_bytes().to_vec()] {
            let mesh = TriMesh::from_bytes(&bytes, &path).unwrap();
            assert_eq!(mesh.faces, [[0, 1, 2], [0, 1, 3]]);
            assert_eq!(mesh.vertices[3], Point3::new(0.0, 0.0, 1.0));
        }
        let alone = text.replace("a b.mtl c.mtl", "a b.mtl");
        assert_eq!(load(&alone, &path).unwrap().colors.unwrap()[0], [1.0, 0.0, 0.0]);
        std::fs::write(folder.path().join("a"), material("red one", "1 0 0")).unwrap();
        std::fs::write(folder.path().join("b.mtl"), material("blue", "0 0 1")).unwrap();
        let several = load(&text.replace(" c.mtl", ""), &path).unwrap();
        assert_eq!(several.colors.unwrap()[0], [1.0, 0.0, 0.0]);
        std::fs::remove_file(folder.path().join("a b.mtl")).unwrap();
        let several = load(&text.replace(" c.mtl", ""), &path).unwrap();
        assert_eq!(several.colors.unwrap()[3], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn faces_without_texture_coordinates_have_the_plain_color() {
        let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 0 1\nusemtl a\n\
            f 1/1 2/1 3/2\nf 1 2 4\nf 1/1 3/2 4/2\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        let material = "newmtl a\nKd 1 0 0\nmap_Kd C:\\art\\TEX.PNG\n";
        std::fs::write(folder.path().join("m.mtl"), material).unwrap();
        let image = image::RgbImage::from_raw(1, 2, vec![9, 9, 9, 7, 7, 7]).unwrap();
        image.save(folder.path().join("tex.png")).unwrap();
        // Once with the image repeated.
        for text in [text, text.replace("vt 0 1", "vt 0 2").as_str()] {
            let mesh = load(text, &path).unwrap();
            let (texture, uvs) = (mesh.texture.unwrap(), mesh.uvs.unwrap());
            let pixel = |v: u32| {
                let [u, v] = uvs[v as usize];
                let row = ((1.0 - v) * texture.height as f32) as usize;
                texture.pixels[row * texture.width + (u * texture.width as f32) as usize][0]
            };
            let red: Vec<[u8; 3]> = mesh.faces.iter().map(|f| f.map(pixel)).collect();
            assert_eq!(red, [[7, 7, 9], [255; 3], [7, 9, 9]]);
        }
    }

    #[test]
    fn libraries_apply_wherever_they_are_named() {
        let text = "v 0 0 0 # origin\nv 1 0 0\nv 0 1 0\nusemtl a#b\nf 1 2 3 # one\nusemtl gone\n\
            f 1 3 2\nmtllib gone.mtl M.MTL # two\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        std::fs::write(folder.path().join("m.mtl"), "newmtl a#b\nKd 1 0 0\n").unwrap();
        let mesh = load(text, &path).unwrap();
        assert_eq!(mesh.faces, [[0, 1, 2], [3, 4, 5]]);
        let colors = mesh.colors.unwrap();
        assert_eq!((colors[0], colors[3]), ([1.0, 0.0, 0.0], [1.0; 3]));
        let content = ObjContent::parse(text.as_bytes(), &path).unwrap();
        let unknown = content.unknown_materials(&content.library(&path));
        assert_eq!(unknown, BTreeSet::from(["gone"]));
    }

    #[test]
    fn colors_of_eight_bits() {
        let text = "v 0 0 0 128 51 255\nv 1 0 0 0 0 1\nv 0 1 0 0 0 0\nf 1 2 3\n";
        let colors = load(text, Path::new("m.obj")).unwrap().colors.unwrap();
        assert_eq!(colors[..2], [[128.0 / 255.0, 0.2, 1.0], [0.0, 0.0, 1.0 / 255.0]]);
    }

    #[test]
    fn faces_and_faults_keep_their_place() {
        // An arrow, whose fan around its first corner leaves it; far away, where single precision has steps of 6 cm.
        let text = "v 1000000 3 0\nv 999999 0 0 \\\n 1\nv 1000000 1 0\nv 1000001 0 0\nf 2 3 4 1\n";
        let mesh = load(text, Path::new("m.obj")).unwrap();
        assert!((mesh.area() - 2.0).abs() < 1e-12);
        assert_eq!(mesh.vertices[0].x, 999_999.0);
        let near =
            load(&text.replace("v 1000000 1", "v 1000000.01 1"), Path::new("m.obj")).unwrap();
        assert_eq!(near.vertices[1].x, 1_000_000.01);
        let error = load(&format!("{text}f 1 2 9\n"), Path::new("m.obj")).unwrap_err().to_string();
        assert_eq!(error, "m.obj: line 7: index 9 is out of range");
        let words = [
            ("f 1 x 2", "'x' is no index"),
            ("v 1 2", "v has 2 numbers, not 3"),
            ("f 1 /2 3", "'/2' has no position"),
        ];
        for (line, reason) in words {
            let error =
                load(&format!("{text}{line}\n"), Path::new("m.obj")).unwrap_err().to_string();
            assert_eq!(error, format!("m.obj: line 7: {reason}"));
        }
    }

    #[test]
    fn what_is_written_twice_or_not_at_all() {
        // Indices without what they refer to; a material named before each face; numbers that end in no number.
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1/1/1 2/2/2 3/3/3\nusemtl a\nf 1/1/1 2/2/2 4/4/4\n";
        let mesh = load(text, Path::new("m.obj")).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.faces.len()), (4, 2));
        assert!(mesh.uvs.is_none() && mesh.normals.is_none());
        let error = load(&format!("{text}v 1 1 1.#QNAN\n"), Path::new("m.obj")).unwrap_err();
        assert_eq!(error.to_string(), "m.obj: line 9: v has 2 numbers, not 3");
    }

    #[test]
    fn names_and_comments_behind_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.obj");
        let image = image::RgbImage::from_raw(1, 1, vec![1, 2, 3]).unwrap();
        image.save(folder.path().join("t.png")).unwrap();
        let library = "newmtl red # main\nMAP_KD t.png # painted\n";
        std::fs::write(folder.path().join("m.mtl"), library).unwrap();
        let text = "mtllib m.mtl # one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl red # all\nf 1/1 2/1 3/1\n";
        let mesh = load(text, &path).unwrap();
        assert_eq!(mesh.texture.unwrap().pixels, [[1, 2, 3]]);
    }

    #[test]
    fn plain_geometry_needs_no_material() {
        let text = "mtllib gone.mtl\nv 0 0 0 1 0 0.5\nv 1 0 0 1 0 0\nv 1 1 0 1 0 0\nv 0 1 0 1 0 0\nusemtl x\nf 1 2 3 4\n";
        let mesh = load(text, Path::new("m.obj")).unwrap();
        assert_eq!((mesh.faces.len(), mesh.colors.unwrap()[0]), (2, [1.0, 0.0, 0.5]));
    }

    #[test]
    fn malformed_input() {
        let path = Path::new("m.obj");
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for bad in [
            "f 1 2 4\n",
            "f 1 2 0\n",
            "f 1 2 -9\n",
            "f 1 2 9223372036854775807\n",
            "f 1/1 2/1 3/-3\n",
            "f 1//1 2//1 3//-2\n",
            // Three times as much is 5, without the carry.
            "f 1//1 2//1 3//6148914691236517207\n",
            "f 1 2 99999999999999999999\n",
            "v 0 0\n",
            "f a b c\n",
        ] {
            let text = format!("vn 0 0 1\n{triangle}{bad}vn 0 0 1\nf 1 2 3\n");
            let error = load(&text, path).unwrap_err().to_string();
            assert!(error.starts_with("m.obj: line 5: "), "{bad}{error}");
        }
        assert!(matches!(load("", path), Err(MeshError::Empty { .. })));
        assert!(matches!(load(triangle, path), Err(MeshError::Empty { .. })));
        let error = load("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", path).unwrap_err().to_string();
        assert!(error.contains("m.obj: vertex 1: coordinate is not finite"), "{error}");
        assert!(TriMesh::from_bytes(&[0xff, 0xfe, b'\n', 0x80], path).is_err());
        assert!(TriMesh::from_bytes(&[0xff], path).is_err());
    }

    #[test]
    fn indices_out_of_range_are_refused_whatever_the_white_space() {
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";
        for space in [" ", "\t", "\u{b}", "\u{85}", "\u{a0}"] {
            for index in ["-2", "6148914691236517207", "4294967296"] {
                let text = format!("{corners}f{space}1//1 2//1 3//{index}\n");
                let error = load(&text, Path::new("m.obj")).unwrap_err().to_string();
                assert_eq!(error, format!("m.obj: line 5: index {index} is out of range"));
            }
            let text = format!("{corners}f{space}1//1 2//1 3//-1\n");
            assert!(load(&text, Path::new("m.obj")).is_ok());
        }
    }
}
