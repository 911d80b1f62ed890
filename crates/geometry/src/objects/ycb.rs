//! The catalog: names, numbers, masses and shapes.

use std::sync::Arc;

use crate::mesh::{Texture, TriMesh};

use super::forms::{Form, Row};
use super::outlines::{BLEACH, MUSTARD, POTTED, SOUP, TUNA};
use super::paint::{Canvas, Color};
use super::{cartons, containers};

/// A household object of the YCB set (Calli et al., IEEE Robotics & Automation Magazine 22(3), 2015), rebuilt from
/// its published dimensions.
///
/// Sizes and volumes follow the real object's; the print is this project's own, different on every side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum YcbObject {
    /// 004, 38 × 89 × 175 mm.
    SugarBox,
    /// 005, ⌀ 67 × 102 mm.
    TomatoSoupCan,
    /// 006, 58 × 96 × 192 mm.
    MustardBottle,
    /// 007, ⌀ 85 × 34 mm.
    TunaCan,
    /// 008, 89 × 110 × 35 mm, lying.
    PuddingBox,
    /// 009, 73 × 85 × 28 mm, lying.
    GelatinBox,
    /// 010, 52 × 98 × 82 mm.
    PottedMeatCan,
    /// 021, 68 × 98 × 254 mm.
    BleachCleanser,
    /// 061, 50 × 75 × 50 mm.
    FoamBrick,
}

/// How an object is painted on its sheet.
type Print = fn(&mut Canvas, &Form);

struct YcbEntry {
    name: &'static str,
    bop_id: u32,
    mass: f64,
    form: Form,
    base: Color,
    print: Print,
}

/// Pixels along the longer side of a texture.
const TEXTURE_PIXELS: usize = 768;

impl YcbObject {
    /// Every built-in object.
    pub const ALL: [Self; 9] = [
        Self::SugarBox,
        Self::TomatoSoupCan,
        Self::MustardBottle,
        Self::TunaCan,
        Self::PuddingBox,
        Self::GelatinBox,
        Self::PottedMeatCan,
        Self::BleachCleanser,
        Self::FoamBrick,
    ];

    /// Name in the YCB set, such as `006_mustard_bottle`.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// The object of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|o| o.name() == name)
    }

    /// Number in the BOP dataset YCB-V.
    pub fn bop_id(self) -> u32 {
        self.entry().bop_id
    }

    /// Mass \[kg\] from the YCB set's list, with contents.
    pub fn mass(self) -> f64 {
        self.entry().mass
    }

    /// The textured surface \[m\]: one closed body, z up, its bounding box centered on the origin, the front at +x (of
    /// lying cartons the top).
    pub fn mesh(self) -> TriMesh {
        let entry = self.entry();
        TriMesh { texture: Some(Arc::new(entry.texture())), ..entry.form.mesh() }
    }

    fn entry(self) -> YcbEntry {
        let carton = |size, bulge, radius| Form::Carton { size, bulge, radius };
        let (name, bop_id, mass, form, base, print): (_, _, _, _, _, Print) = match self {
            Self::SugarBox => {
                let form = carton([38.0, 89.0, 175.0], [2.5, 0.6, 0.4], 1.0);
                ("004_sugar_box", 3, 0.514, form, 0xf7c52d, cartons::sugar)
            }
            Self::TomatoSoupCan => {
                ("005_tomato_soup_can", 4, 0.349, round(SOUP), 0xc9ced3, containers::soup)
            }
            Self::MustardBottle => {
                ("006_mustard_bottle", 5, 0.603, oval(MUSTARD), 0xf6c21a, containers::mustard)
            }
            Self::TunaCan => {
                ("007_tuna_fish_can", 6, 0.171, round(TUNA), 0xd3d6d9, containers::tuna)
            }
            Self::PuddingBox => {
                let form = carton([89.0, 110.0, 35.0], [0.2, 0.2, 0.5], 0.8);
                ("008_pudding_box", 7, 0.187, form, 0x5b2c17, cartons::pudding)
            }
            Self::GelatinBox => {
                let form = carton([73.0, 85.0, 28.0], [0.2, 0.2, 0.4], 0.8);
                ("009_gelatin_box", 8, 0.097, form, 0xd3133a, cartons::gelatin)
            }
            Self::PottedMeatCan => (
                "010_potted_meat_can",
                9,
                0.370,
                Form::Outline { rows: POTTED.to_vec(), smoothing: 0 },
                0xccd1d6,
                containers::potted_meat,
            ),
            Self::BleachCleanser => {
                ("021_bleach_cleanser", 12, 1.131, oval(BLEACH), 0xf4f6f7, containers::bleach)
            }
            Self::FoamBrick => {
                let form = carton([50.0, 75.0, 50.0], [0.3, 0.3, 0.3], 2.0);
                ("061_foam_brick", 21, 0.028, form, 0xa9452f, cartons::foam)
            }
        };
        YcbEntry { name, bop_id, mass, form, base, print }
    }
}

impl YcbEntry {
    fn texture(&self) -> Texture {
        let mut canvas = Canvas::new(self.form.sheet(), TEXTURE_PIXELS, self.base);
        (self.print)(&mut canvas, &self.form);
        canvas.into_texture()
    }
}

/// A tin: heights and radii \[mm\].
fn round(rows: &[[f64; 2]]) -> Form {
    Form::Outline { rows: rows.iter().map(|[z, r]| [*z, *r, *r, 2.0]).collect(), smoothing: 0 }
}

/// A blown bottle, its corners smoothed.
fn oval(rows: &[Row]) -> Form {
    Form::Outline { rows: rows.to_vec(), smoothing: 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume;

    /// Name, smallest and largest plausible size \[mm\] (list and measured box, sorted), measured volume \[cm³\].
    const MEASURED: [(&str, [f64; 3], [f64; 3], f64); 9] = [
        ("004_sugar_box", [38.0, 89.0, 175.0], [45.2, 92.0, 176.1], 637.93),
        ("005_tomato_soup_can", [66.0, 66.0, 101.0], [67.4, 67.5, 101.8], 319.36),
        ("006_mustard_bottle", [58.0, 95.0, 190.0], [57.7, 96.1, 191.5], 612.04),
        ("007_tuna_fish_can", [33.0, 85.0, 85.0], [33.5, 85.3, 85.3], 152.62),
        ("008_pudding_box", [35.0, 89.0, 110.0], [38.3, 89.6, 113.3], 341.77),
        ("009_gelatin_box", [28.0, 73.0, 85.0], [29.8, 72.7, 89.4], 173.06),
        ("010_potted_meat_can", [50.0, 82.0, 97.0], [57.2, 83.4, 101.5], 354.13),
        ("021_bleach_cleanser", [65.0, 98.0, 250.0], [68.0, 98.2, 254.1], 972.34),
        ("061_foam_brick", [50.0, 50.0, 75.0], [51.1, 52.0, 77.3], 184.93),
    ];

    #[test]
    fn closed_centered_and_of_the_real_size_and_volume() {
        for (object, (name, low, high, volume)) in YcbObject::ALL.into_iter().zip(MEASURED) {
            assert_eq!(object.name(), name);
            assert_eq!(YcbObject::from_name(name), Some(object));
            let mesh = object.mesh();
            let (a, b) = mesh.bounds().unwrap();
            assert!((a.coords + b.coords).norm() < 1e-12, "{name}");
            let mut size = ((b - a) * 1e3).as_slice().to_vec();
            size.sort_by(f64::total_cmp);
            for k in 0..3 {
                assert!(
                    size[k] > low[k].min(high[k]) - 0.6 && size[k] < low[k].max(high[k]) + 0.6,
                    "{name} {size:?}"
                );
            }
            let cm3 = closed_volume(&mesh) * 1e6;
            assert!((cm3 / volume - 1.0).abs() < 0.04, "{name}: {cm3} cm³, measured {volume}");
            assert!((400..8_000).contains(&mesh.faces.len()), "{name}: {} faces", mesh.faces.len());
        }
    }

    #[test]
    fn prints_tell_the_sides_apart() {
        for object in YcbObject::ALL {
            let Texture { width, height, pixels } = object.entry().texture();
            assert_eq!((width.max(height), pixels.len()), (TEXTURE_PIXELS, width * height));
            // Half a turn must change the color of a good part of the sheet.
            let differs = |i: &usize| {
                let (row, column) = (i / width, i % width);
                let other = pixels[row * width + (column + width / 2) % width];
                pixels[*i].iter().zip(other).any(|(a, b)| a.abs_diff(b) > 40)
            };
            let share = (0..pixels.len()).filter(differs).count() as f64 / pixels.len() as f64;
            assert!(share > 0.1, "{}: {share}", object.name());
        }
    }
}
