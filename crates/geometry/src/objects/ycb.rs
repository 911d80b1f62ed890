//! The catalogue: names, numbers, masses and shapes.

use std::sync::Arc;

use crate::{Texture, TriMesh};

use super::forms::{Form, Row};
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

struct Entry {
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

    /// The textured surface \[m\]: one closed body, z up, its bounding box centred on the origin, the front at +x (of
    /// lying cartons the top).
    pub fn mesh(self) -> TriMesh {
        let entry = self.entry();
        TriMesh { texture: Some(Arc::new(entry.texture())), ..entry.form.mesh() }
    }

    /// The unrolled picture alone.
    pub fn texture(self) -> Texture {
        self.entry().texture()
    }

    fn entry(self) -> Entry {
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
        Entry { name, bop_id, mass, form, base, print }
    }
}

impl Entry {
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

// Outlines from the bottom's centre to the top's [mm], fitted to the scans' sizes and volumes.

const SOUP: &[[f64; 2]] = &[
    [2.5, 0.0],
    [2.5, 31.0],
    [0.0, 32.0],
    [0.0, 33.4],
    [2.2, 33.7],
    [3.5, 32.6],
    [98.3, 32.6],
    [99.6, 33.7],
    [101.8, 33.4],
    [101.8, 32.0],
    [98.3, 31.0],
    [98.3, 0.0],
];

const TUNA: &[[f64; 2]] = &[
    [2.0, 0.0],
    [2.0, 36.5],
    [0.0, 38.0],
    [0.0, 39.6],
    [4.0, 39.9],
    [7.0, 41.2],
    [30.0, 41.2],
    [31.4, 42.6],
    [33.5, 42.5],
    [33.5, 41.0],
    [30.0, 40.2],
    [30.0, 0.0],
];

const POTTED: &[Row] = &[
    [1.5, 0.0, 0.0, 4.0],
    [1.5, 23.8, 46.8, 4.0],
    [0.0, 24.6, 47.6, 4.0],
    [0.0, 25.6, 48.6, 4.0],
    [2.5, 26.0, 49.0, 4.0],
    [4.0, 25.2, 48.2, 4.0],
    [78.0, 25.2, 48.2, 4.0],
    [79.5, 26.0, 49.0, 4.0],
    [82.0, 25.6, 48.6, 4.0],
    [82.0, 24.6, 47.6, 4.0],
    [79.5, 23.8, 46.8, 4.0],
    [79.5, 0.0, 0.0, 4.0],
];

const MUSTARD: &[Row] = &[
    [2.5, 0.0, 0.0, 2.4],
    [2.5, 18.0, 34.0, 2.4],
    [0.0, 22.0, 40.0, 2.4],
    [0.0, 24.0, 42.5, 2.4],
    [5.0, 28.0, 47.2, 2.4],
    [16.0, 28.85, 48.05, 2.4],
    [30.0, 28.85, 48.05, 2.4],
    [64.0, 27.9, 46.8, 2.4],
    [98.0, 28.6, 47.6, 2.4],
    [116.0, 28.4, 46.6, 2.4],
    [132.0, 24.5, 38.5, 2.3],
    [145.0, 18.5, 25.0, 2.1],
    [152.0, 15.5, 17.5, 2.0],
    [156.0, 15.0, 15.4, 2.0],
    [156.0, 18.4, 18.4, 2.0],
    [156.5, 18.6, 18.6, 2.0],
    [168.0, 18.2, 18.2, 2.0],
    [170.0, 17.0, 17.0, 2.0],
    [172.5, 10.5, 10.5, 2.0],
    [184.0, 6.4, 6.4, 2.0],
    [190.0, 5.0, 5.0, 2.0],
    [191.5, 4.2, 4.2, 2.0],
    [191.5, 3.0, 3.0, 2.0],
    [191.5, 0.0, 0.0, 2.0],
];

const BLEACH: &[Row] = &[
    [3.0, 0.0, 0.0, 2.6],
    [3.0, 25.0, 39.0, 2.6],
    [0.0, 28.5, 43.0, 2.6],
    [0.0, 30.0, 44.8, 2.6],
    [6.0, 33.2, 48.2, 2.6],
    [14.0, 34.0, 49.1, 2.6],
    [30.0, 34.0, 49.1, 2.6],
    [80.0, 33.0, 47.8, 2.6],
    [118.0, 33.0, 47.4, 2.6],
    [142.0, 31.2, 44.2, 2.6],
    [168.0, 26.5, 36.5, 2.4],
    [190.0, 21.0, 26.5, 2.2],
    [206.0, 17.2, 18.4, 2.0],
    [213.0, 16.6, 16.6, 2.0],
    [216.0, 16.6, 16.6, 2.0],
    [216.0, 20.4, 20.4, 2.0],
    [217.0, 20.8, 20.8, 2.0],
    [246.0, 19.8, 19.8, 2.0],
    [252.0, 19.0, 19.0, 2.0],
    [254.1, 17.0, 17.0, 2.0],
    [254.1, 15.0, 15.0, 2.0],
    [254.1, 0.0, 0.0, 2.0],
];

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
    fn closed_centred_and_of_the_real_size_and_volume() {
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
            let Texture { width, height, pixels } = object.texture();
            assert_eq!((width.max(height), pixels.len()), (TEXTURE_PIXELS, width * height));
            // Half a turn must change the colour of a good part of the sheet.
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
