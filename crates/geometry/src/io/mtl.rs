//! MTL: of each material its diffuse color (`Kd`) and image (`map_Kd`).

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::images::Images;
use super::{text, texture};
use crate::mesh::Texture;

/// Materials by name.
pub(super) type Library = BTreeMap<String, Material>;

/// A material.
#[derive(Clone, Debug, Default)]
pub(super) struct Material {
    pub(super) diffuse: Option<[f32; 3]>,
    /// Value of `map_Kd`: a file's name, with options such as `-s 1 1 1` before it.
    image: Option<String>,
}

impl Material {
    /// The image, where there is one that can be read.
    pub(super) fn texture(&self, images: &mut Images<'_>, path: &Path) -> Option<Arc<Texture>> {
        let value = self.image.as_deref()?;
        let file = |value: &str| {
            let last = value.split_whitespace().last().filter(|_| value.starts_with('-'));
            texture::near(path, last.unwrap_or(value))
        };
        let missing = || Err("no file is named".to_owned());
        let bytes = || without_comment(value).map(file).reduce(Result::or).unwrap_or_else(missing);
        images.get(value, bytes)
    }
}

/// A value as it stands, which may hold the mark of comments, then without a comment behind it.
pub(super) fn without_comment(value: &str) -> impl Iterator<Item = &str> {
    let before = value.split_once(" #").or(value.split_once("\t#")).map(|(own, _)| own.trim());
    std::iter::once(value).chain(before)
}

/// The materials of a library; an error says in which line.
pub(super) fn parse(bytes: &[u8]) -> Result<Library, String> {
    let mut materials: Vec<(String, Material)> = Vec::new();
    for (number, line) in text::lines(&text::decoded(bytes)) {
        let line = line.trim();
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        let fault = |reason: &str| Err(format!("line {number}: {reason}"));
        let key = key.to_ascii_lowercase();
        if key == "newmtl" {
            materials.push((value.to_owned(), Material::default()));
            continue;
        }
        if key != "kd" && key != "map_kd" {
            continue;
        }
        let Some((_, material)) = materials.last_mut() else {
            return fault("a property before any newmtl");
        };
        if key == "map_kd" {
            material.image = Some(value.to_owned());
            continue;
        }
        // Spectral and CIE XYZ colors are written by nobody.
        let numbers: Option<Vec<f32>> = value
            .split_whitespace()
            .take_while(|word| !word.starts_with('#'))
            .map(|v| v.parse().ok().filter(|c: &f32| c.is_finite()))
            .collect();
        match numbers.as_deref() {
            // A single number stands for all three.
            Some(&[gray]) => material.diffuse = Some([gray; 3]),
            Some(&[r, g, b, ..]) => material.diffuse = Some([r, g, b]),
            _ => return fault("Kd is not three numbers"),
        }
    }
    // Colors of eight bits, as some programs write them.
    let colors = || materials.iter().flat_map(|(_, m)| m.diffuse.iter().flatten());
    if colors().any(|c| *c > 1.0) && colors().all(|c| c.fract() == 0.0) {
        let colors = materials.iter_mut().flat_map(|(_, m)| m.diffuse.iter_mut().flatten());
        colors.for_each(|c| *c /= 255.0);
    }
    let mut library = Library::new();
    for (name, material) in materials {
        without_comment(&name)
            .for_each(|name| drop(library.insert(name.to_owned(), material.clone())));
    }
    Ok(library)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_and_images_by_name() {
        let text = "# two\r\nnewmtl a b\r\n Kd 0.5 1 0 # as it was\r\nKa 1 1\r\nNs x\r\nNEWMTL c # plain\nkd 0.25\n\
            map_kd  my tex.png \n";
        let wide: Vec<u8> =
            format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        let lines = text.replace("\r\n", "\n").replace("0.5 1", "0.5 \\\n1").replace('\n', "\r");
        let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
        for bytes in [text.as_bytes().to_vec(), wide, lines.into_bytes(), marked] {
            let library = parse(&bytes).unwrap();
            assert_eq!(library["a b"].diffuse, Some([0.5, 1.0, 0.0]));
            assert_eq!(library["c"].diffuse, Some([0.25; 3]));
            assert_eq!(library["c"].image.as_deref(), Some("my tex.png"));
        }
        assert!(parse(b"").unwrap().is_empty());
    }

    #[test]
    fn colors_of_eight_bits() {
        let library = parse(b"newmtl a\nKd 255 51 0\nnewmtl b\nKd 1 0 0\n").unwrap();
        assert_eq!(library["a"].diffuse, Some([1.0, 0.2, 0.0]));
        assert_eq!(library["b"].diffuse, Some([1.0 / 255.0, 0.0, 0.0]));
        let library = parse(b"newmtl a\nKd 1.5 0.5 0\n").unwrap();
        assert_eq!(library["a"].diffuse, Some([1.5, 0.5, 0.0]));
    }

    #[test]
    fn faults_name_their_line() {
        for (bad, line) in [
            ("newmtl a\nKd 1 1\n", "line 2: "),
            ("newmtl a\nKd 1 x 1\n", "line 2: "),
            ("newmtl a\nKd nan 1 1\n", "line 2: "),
            ("newmtl a\n\nKd\n", "line 3: "),
            ("map_Kd a.png\n", "line 1: a property before"),
        ] {
            assert!(parse(bad.as_bytes()).unwrap_err().starts_with(line), "{bad}");
        }
    }
}
