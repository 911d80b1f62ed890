//! The shapes of the built-in objects and how painted millimeters map onto them.

use nalgebra::Vector3;

use crate::mesh::TriMesh;
use crate::shapes::{
    BoxFace, RoundedBox, Section, loft, meridian_lengths, rounded_box, smoothed, subdivided,
};

use super::paint::Area;

/// A row of an outline \[mm\]: height, half width along x, half width along y, exponent.
pub(super) type Row = [f64; 4];

/// The shape of an object.
pub(super) enum Form {
    /// A carton: size and bulge along x, y, z, and radius of the edges \[mm\].
    Carton { size: [f64; 3], bulge: [f64; 3], radius: f64 },
    /// A round or oval container: its outline, and rounds of corner smoothing.
    Outline { rows: Vec<Row>, smoothing: usize },
}

/// Longest cell on flat parts \[m\].
const CELL: f64 = 0.012;
/// Columns around an outline.
const COLUMNS: usize = 64;

impl Form {
    /// The mesh \[m\] with texture coordinates, its bounding box centered on the origin.
    pub(super) fn mesh(&self) -> TriMesh {
        let mut mesh = match self {
            Self::Carton { size, bulge, radius } => rounded_box(&RoundedBox {
                size: meters(*size),
                radius: radius * 1e-3,
                bulge: meters(*bulge),
                arc_steps: 2,
                cell: CELL,
            }),
            Self::Outline { .. } => loft(&self.sections(), COLUMNS),
        };
        if let Some((low, high)) = mesh.bounds() {
            let middle = 0.5 * (low.coords + high.coords);
            mesh.vertices.iter_mut().for_each(|v| *v -= middle);
        }
        mesh
    }

    /// Width and height of the sheet to paint \[mm\].
    pub(super) fn sheet(&self) -> [f64; 2] {
        match self {
            Self::Carton { size: [x, y, z], .. } => [2.0 * (x + y), z + x],
            Self::Outline { rows, .. } => {
                let widest = rows
                    .iter()
                    .fold([0.0; 4], |a, b| if b[1] + b[2] > a[1] + a[2] { *b } else { a });
                [
                    girth(widest),
                    1e3 * meridian_lengths(&self.sections()).last().copied().unwrap_or(0.0),
                ]
            }
        }
    }

    /// Where a carton's face lies on the sheet \[mm\]; everything for other forms.
    pub(super) fn face(&self, face: BoxFace) -> Area {
        match self {
            Self::Carton { size, .. } => {
                let p = face.panel(Vector3::from(*size));
                [p.x, p.y, p.x + p.width, p.y + p.height]
            }
            Self::Outline { .. } => [0.0, 0.0, self.sheet()[0], self.sheet()[1]],
        }
    }

    /// Height on the sheet of the last place where an outline rises through `z` \[mm\].
    pub(super) fn level(&self, z: f64) -> f64 {
        let sections = self.sections();
        let lengths = meridian_lengths(&sections);
        let mut level = 0.0;
        for (pair, length) in sections.windows(2).zip(lengths.windows(2)) {
            let (low, high) = (1e3 * pair[0].z, 1e3 * pair[1].z);
            if low <= z && high > z {
                level = 1e3 * (length[0] + (z - low) / (high - low) * (length[1] - length[0]));
            }
        }
        level
    }

    /// An outline's sections \[m\], from the point at the bottom to the one at the top.
    fn sections(&self) -> Vec<Section> {
        let Self::Outline { rows, smoothing } = self else { return Vec::new() };
        let rows: Vec<_> = rows
            .iter()
            .map(|[z, a, b, n]| Section { z: z * 1e-3, half: [a * 1e-3, b * 1e-3], exponent: *n })
            .collect();
        subdivided(&smoothed(&rows, *smoothing), CELL)
    }
}

fn meters(mm: [f64; 3]) -> Vector3<f64> {
    Vector3::from(mm) * 1e-3
}

/// Length around a section \[mm\].
fn girth([_, a, b, n]: Row) -> f64 {
    let at = |i: usize| {
        let (s, c) = (std::f64::consts::FRAC_PI_2 * i as f64 / 1000.0).sin_cos();
        [a * c.max(0.0).powf(2.0 / n), b * s.powf(2.0 / n)]
    };
    let steps = (0..1000).map(|i| (at(i), at(i + 1)));
    4.0 * steps.map(|([x0, y0], [x1, y1])| (x1 - x0).hypot(y1 - y0)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheet_of_a_cylinder() {
        let rows = vec![
            [0.0, 0.0, 0.0, 2.0],
            [0.0, 30.0, 30.0, 2.0],
            [80.0, 30.0, 30.0, 2.0],
            [80.0, 0.0, 0.0, 2.0],
        ];
        let can = Form::Outline { rows, smoothing: 0 };
        let [width, height] = can.sheet();
        assert!(
            (width - 60.0 * std::f64::consts::PI).abs() < 1e-3 && (height - 140.0).abs() < 1e-9
        );
        assert!((can.level(20.0) - 50.0).abs() < 1e-9);
    }
}
