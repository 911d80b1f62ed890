//! MTL: of each material its diffuse color (`Kd`) and image (`map_Kd`); `tobj`'s own reader panics on short lines.

use std::collections::HashMap;

use tobj::Material;

/// The materials of a library, and their places by name.
pub(super) type Library = (Vec<Material>, HashMap<String, usize>);

/// The materials of a library; an error says in which line.
pub(super) fn parse(bytes: &[u8]) -> Result<Library, String> {
    let text = String::from_utf8_lossy(bytes);
    let (mut materials, mut places) = (Vec::<Material>::new(), HashMap::new());
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        let fault = |reason: &str| Err(format!("line {}: {reason}", number + 1));
        if key == "newmtl" {
            places.insert(value.to_owned(), materials.len());
            materials.push(Material { name: value.to_owned(), ..Material::default() });
            continue;
        }
        if key != "Kd" && key != "map_Kd" {
            continue;
        }
        let Some(material) = materials.last_mut() else {
            return fault("a property before any newmtl");
        };
        if key == "map_Kd" {
            material.diffuse_texture = Some(value.to_owned());
            continue;
        }
        // Spectral and CIE XYZ colors are written by nobody.
        let numbers: Option<Vec<f32>> = value
            .split_whitespace()
            .map(|v| v.parse().ok().filter(|c: &f32| c.is_finite()))
            .collect();
        match numbers.as_deref() {
            // A single number stands for all three.
            Some(&[gray]) => material.diffuse = Some([gray; 3]),
            Some(&[r, g, b]) => material.diffuse = Some([r, g, b]),
            _ => return fault("Kd is not three numbers"),
        }
    }
    Ok((materials, places))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_and_images_by_name() {
        let text = "# two\r\nnewmtl a b\r\n Kd 0.5 1 0\r\nKa 1 1\r\nNs x\r\nnewmtl c\nKd 0.25\nmap_Kd  my tex.png \n";
        let (materials, places) = parse(text.as_bytes()).unwrap();
        assert_eq!((places["a b"], places["c"]), (0, 1));
        assert_eq!(materials[0].diffuse, Some([0.5, 1.0, 0.0]));
        assert_eq!(materials[1].diffuse, Some([0.25; 3]));
        assert_eq!(materials[1].diffuse_texture.as_deref(), Some("my tex.png"));
        assert!(parse(b"").unwrap().0.is_empty());
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
