//! Wavefront OBJ with MTL materials, through `tobj` (coordinates in single precision).

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::Cursor;
use std::path::Path;

use nalgebra::{Point3, Vector3};
use tobj::{LoadError, LoadOptions, Material, Mesh, Model};

use super::images::Images;
use super::parts::{Part, join};
use super::{MeshError, mtl, texture};
use crate::mesh::TriMesh;

const OPTIONS: LoadOptions =
    LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<TriMesh, MeshError> {
    let text = plain_text(bytes);
    check_indices(&text, path)?;
    let library = libraries(&text, path);
    let unknown = unknown_materials(&text, &library);
    if !unknown.is_empty() {
        let names = Vec::from_iter(unknown).join(", ");
        log::warn!("{}: no library has the materials {names}: no colors of them", path.display());
    }
    let mut arranged = Cursor::new(arranged(&text));
    let (models, _) = tobj::load_obj_buf(&mut arranged, &OPTIONS, |_| Ok(library.clone()))
        .map_err(|e| MeshError::malformed(path, line_at_fault(&text), e))?;
    let mut images = Images::new(path);
    let mut parts = Vec::new();
    for model in &models {
        let material = model.mesh.material_id.and_then(|id| library.0.get(id));
        let image = match material.and_then(image_name) {
            Some(name) if !model.mesh.texcoords.is_empty() => {
                images.get(name, || texture::near(path, name))
            }
            _ => None,
        };
        let color = material.and_then(|m| m.diffuse).unwrap_or([1.0; 3]);
        parts.push(Part { mesh: geometry(&model.mesh), texture: image, color });
    }
    // A group of nothing but points or lines leaves a part without faces.
    parts.retain(|p| !p.mesh.faces.is_empty());
    // Colors of eight bits, as some programs write them.
    if parts.iter().flat_map(|p| p.mesh.colors.iter().flatten().flatten()).any(|c| *c > 1.0) {
        let colors = parts.iter_mut().flat_map(|p| p.mesh.colors.iter_mut().flatten().flatten());
        colors.for_each(|c| *c /= 255.0);
    }
    join(parts, path)
}

/// Values of the lines that begin with `key`.
fn values<'a>(text: &'a str, key: &'a str) -> impl Iterator<Item = &'a str> {
    text.lines().filter_map(move |line| {
        let (word, value) = line.trim().split_once(char::is_whitespace)?;
        (word == key).then_some(value.trim())
    })
}

/// Materials of all libraries that the text names, wherever it does: a line names one, or several with spaces between.
fn libraries(text: &str, path: &Path) -> mtl::Library {
    let mut all = mtl::Library::default();
    let mut add = |name: &str| -> Result<(), String> {
        let (materials, places) = mtl::parse(&texture::near(path, name)?)?;
        let first = all.0.len();
        all.0.extend(materials);
        all.1.extend(places.into_iter().map(|(name, place)| (name, first + place)));
        Ok(())
    };
    let mut seen = BTreeSet::new();
    for names in values(text, "mtllib").filter(|names| seen.insert(*names)) {
        let Err(whole) = add(names) else { continue };
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

/// Materials that the text uses and no library has.
fn unknown_materials<'a>(text: &'a str, library: &mtl::Library) -> BTreeSet<&'a str> {
    values(text, "usemtl").filter(|name| !library.1.contains_key(*name)).collect()
}

/// The text as `tobj` needs it: with one library, before any material is used, and a new group wherever faces begin or cease to have
/// texture coordinates, since a group has them at all corners or at none.
fn arranged(text: &str) -> String {
    let mut out = String::from("mtllib all\n");
    let mut painted = None;
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("mtllib") => continue,
            Some("f") => {
                let own = words.all(|w| w.split('/').nth(1).is_some_and(|uv| !uv.is_empty()));
                if painted.replace(own).is_some_and(|before| before != own) {
                    out.push_str("g\n");
                }
            }
            _ => {}
        }
        out.extend([line, "\n"]);
    }
    out
}

/// The text in UTF-8 without a byte order mark, each line whole where a backslash broke it, and without comments behind numbers.
fn plain_text(bytes: &[u8]) -> String {
    let wide = |decode: fn([u8; 2]) -> u16| {
        let units = bytes[2..].as_chunks().0.iter().map(|pair| decode(*pair));
        let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        Cow::Owned(text.collect::<String>())
    };
    let text = match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    };
    let mut out = String::with_capacity(text.len() + 1);
    for line in text.lines() {
        // Names may hold the mark of comments.
        let is_plain = line.trim_start().starts_with(|c: char| "#vflp-.0123456789".contains(c));
        let line = line.split_once('#').filter(|_| is_plain).map_or(line, |(own, _)| own);
        match line.strip_suffix('\\') {
            Some(begun) => out.extend([begun, " "]),
            None => out.extend([line, "\n"]),
        }
    }
    out
}

/// Positions and faces alone.
pub(super) fn parse_shape(bytes: &[u8], path: &Path) -> Result<TriMesh, MeshError> {
    let text = plain_text(bytes);
    check_indices(&text, path)?;
    // Corners share their position whatever their normals are.
    let options = LoadOptions { single_index: false, ..OPTIONS };
    let no_materials = |_: &Path| Err(LoadError::GenericFailure);
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(&text), &options, no_materials)
        .map_err(|e| MeshError::malformed(path, line_at_fault(&text), e))?;
    let mut whole = TriMesh::default();
    for Model { mesh, .. } in models {
        let vertices = mesh.positions.chunks_exact(3);
        let vertices = vertices.map(|p| Point3::new(p[0], p[1], p[2]).cast()).collect();
        let faces = mesh.indices.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
        whole.append(&TriMesh::new(vertices, faces));
    }
    Ok(whole)
}

/// The positions alone, with no faces.
pub(super) fn points(bytes: &[u8]) -> TriMesh {
    let text = plain_text(bytes);
    let points = text.lines().filter_map(|line| {
        let mut words = line.strip_prefix("v ")?.split_whitespace().map(str::parse::<f64>);
        let mut next = || words.next()?.ok().filter(|x| x.is_finite());
        Some(Point3::new(next()?, next()?, next()?))
    });
    TriMesh::new(points.collect(), Vec::new())
}

/// Refuses indices before the first element and beyond [`u32`], with which `tobj` computes offsets that overflow.
fn check_indices(text: &str, path: &Path) -> Result<(), MeshError> {
    // Of positions, texture coordinates and normals: a face counts back from the last one above it.
    let mut counts = [0_i64; 3];
    for (number, line) in text.lines().enumerate() {
        // The white space of `tobj`.
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            Some("f" | "l") => {
                let mut indices = words.flat_map(|word| word.split('/').zip(counts));
                if let Some(index) = indices.find_map(|(text, count)| out_of_range(text, count)) {
                    let (line, reason) = (number + 1, format!("index {index} is out of range"));
                    return Err(MeshError::malformed(path, format!("line {line}"), reason));
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// The index that `text` is, after `count` elements, if it is of none. What is no number, `tobj` tells.
fn out_of_range(text: &str, count: i64) -> Option<i64> {
    let index: i64 = text.parse().ok()?;
    (index < -count || index > i64::from(u32::MAX)).then_some(index)
}

/// The line, from 1, without which the lines before it can be read: `tobj` does not say where it stopped. Where faces
/// precede their vertices, it may be such a face's.
fn line_at_fault(text: &str) -> String {
    let bytes = text.as_bytes();
    let ends: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i] == b'\n').map(|i| i + 1).collect();
    let reads = |lines: usize| {
        let end = if lines > ends.len() { bytes.len() } else { ends[lines - 1] };
        let text = &mut Cursor::new(&bytes[..end]);
        tobj::load_obj_buf(text, &OPTIONS, |_| Err(LoadError::GenericFailure)).is_ok()
    };
    // The first `good` lines can be read, the first `bad` cannot.
    let (mut good, mut bad) = (0, ends.len() + 1);
    while bad - good > 1 {
        let middle = good + (bad - good) / 2;
        if reads(middle) { good = middle } else { bad = middle }
    }
    format!("line {bad}")
}

/// The file of `map_Kd`, which may follow options such as `-s 1 1 1`.
fn image_name(material: &Material) -> Option<&str> {
    let name = material.diffuse_texture.as_deref()?.trim();
    if name.starts_with('-') { name.split_whitespace().last() } else { Some(name) }
}

fn geometry(mesh: &Mesh) -> TriMesh {
    let n = mesh.positions.len() / 3;
    let triple = |values: &[f32]| -> Vec<[f32; 3]> {
        values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
    };
    // An attribute that only some vertices have is no attribute of the mesh.
    let whole = |values: &[f32], width: usize| n > 0 && values.len() == width * n;
    let mut out = TriMesh::new(
        triple(&mesh.positions).into_iter().map(|p| Point3::from(p.map(f64::from))).collect(),
        mesh.indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    );
    if whole(&mesh.normals, 3) {
        out.normals = Some(
            triple(&mesh.normals).into_iter().map(|v| Vector3::from(v.map(f64::from))).collect(),
        );
    }
    if whole(&mesh.vertex_color, 3) {
        out.colors = Some(triple(&mesh.vertex_color));
    }
    if whole(&mesh.texcoords, 2) {
        out.uvs = Some(mesh.texcoords.chunks_exact(2).map(|c| [c[0], c[1]]).collect());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE_CORNER: &str = "mtllib m.mtl\no a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        vt 0.5 0.5\nusemtl painted\nf 1/1 2/2 3/3\nf -4/5 -2/3 -1/4\n";

    fn load(text: &str, path: &Path) -> Result<TriMesh, MeshError> {
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
        let unknown = unknown_materials(text, &libraries(text, &path));
        assert_eq!(unknown, BTreeSet::from(["gone"]));
    }

    #[test]
    fn colors_of_eight_bits() {
        let text = "v 0 0 0 128 51 255\nv 1 0 0 0 0 1\nv 0 1 0 0 0 0\nf 1 2 3\n";
        let colors = load(text, Path::new("m.obj")).unwrap().colors.unwrap();
        assert_eq!(colors[..2], [[128.0 / 255.0, 0.2, 1.0], [0.0, 0.0, 1.0 / 255.0]]);
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
