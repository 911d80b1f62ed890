//! Surfaces through a stack of horizontal superellipses.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Point3;

use crate::mesh::TriMesh;

/// One horizontal cross-section, |x/a|ⁿ + |y/b|ⁿ = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Height \[m\].
    pub z: f64,
    /// Half widths a along x and b along y \[m\]; a section of zero width is a point.
    pub half: [f64; 2],
    /// Exponent n \[1\]: 2 is an ellipse, 1 a rhombus, large values approach a rectangle.
    pub exponent: f64,
}

impl Section {
    /// A circle of radius `radius` \[m\] at height `z` \[m\].
    pub fn circle(z: f64, radius: f64) -> Self {
        Self { z, half: [radius; 2], exponent: 2.0 }
    }

    fn is_point(&self) -> bool {
        self.half == [0.0; 2]
    }

    fn radius(&self) -> f64 {
        0.5 * (self.half[0] + self.half[1])
    }

    /// The point of the first quadrant with parameter (cos t, sin t).
    fn corner(&self, [c, s]: [f64; 2]) -> [f64; 2] {
        let power = 2.0 / self.exponent;
        [self.half[0] * c.powf(power), self.half[1] * s.powf(power)]
    }

    fn mix(&self, other: &Self, t: f64) -> Self {
        let mix = |a: f64, b: f64| a + t * (b - a);
        Self {
            z: mix(self.z, other.z),
            half: [mix(self.half[0], other.half[0]), mix(self.half[1], other.half[1])],
            exponent: mix(self.exponent, other.exponent),
        }
    }
}

/// Joins `sections`, listed from the bottom along the outline to the top, by `segments` columns (rounded up to
/// a multiple of four, so that the bounding box is exact).
///
/// An end that is not a point is closed by a flat cap. Columns are equally spaced along the girth of the
/// widest section. Texture coordinates unroll the surface: u runs counter-clockwise seen from above, from
/// −y (0) by +x (¼), +y (½) and −x (¾); v is the fraction of the outline's length. The mesh has two triangles
/// a column and pair of sections, one where a section is a point. Fewer than two sections give an empty mesh.
pub fn loft(sections: &[Section], segments: usize) -> TriMesh {
    let rows = capped(sections);
    if sections.len() < 2 || rows.len() < 3 {
        return TriMesh::default();
    }
    let quarter = segments.div_ceil(4).max(1);
    let columns = 4 * quarter;
    let parameters = equal_arcs(&rows, quarter);
    let lengths = meridian_lengths(&rows);
    let total = lengths.last().copied().unwrap_or(1.0);

    let (mut mesh, mut uvs, mut starts) = (TriMesh::default(), Vec::new(), Vec::new());
    for (row, length) in rows.iter().zip(&lengths) {
        starts.push(mesh.vertices.len() as u32);
        let v = (length / total) as f32;
        if row.is_point() {
            mesh.vertices.extend(std::iter::repeat_n(Point3::new(0.0, 0.0, row.z), columns));
            uvs.extend((0..columns).map(|j| [(j as f32 + 0.5) / columns as f32, v]));
            continue;
        }
        for j in 0..=columns {
            let (k, forward) = (j % quarter, (j / quarter) % 2 == 1);
            let [x, y] = row.corner(parameters[if forward { k } else { quarter - k }]);
            let (sx, sy) = [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)][(j / quarter) % 4];
            mesh.vertices.push(Point3::new(sx * x, sy * y, row.z));
            uvs.push([j as f32 / columns as f32, v]);
        }
    }
    for (r, pair) in rows.windows(2).enumerate() {
        for j in 0..columns as u32 {
            let (low, high) = (starts[r] + j, starts[r + 1] + j);
            if !pair[0].is_point() {
                mesh.faces.push([low, low + 1, if pair[1].is_point() { high } else { high + 1 }]);
            }
            if !pair[1].is_point() {
                mesh.faces.push([low, high + 1, high]);
            }
        }
    }
    mesh.uvs = Some(uvs);
    mesh
}

/// Length of the outline up to each section \[m\], at the mean of the two half widths.
pub fn meridian_lengths(sections: &[Section]) -> Vec<f64> {
    let mut length = 0.0;
    let mut lengths = vec![0.0; sections.len().min(1)];
    for pair in sections.windows(2) {
        length += (pair[1].z - pair[0].z).hypot(pair[1].radius() - pair[0].radius());
        lengths.push(length);
    }
    lengths
}

/// Rounds the corners of an outline by `rounds` of Chaikin's corner cutting (Computer Graphics and Image
/// Processing 3, 1974), which keeps the two ends; a section given twice in a row moves less, thrice not at all.
pub fn smoothed(sections: &[Section], rounds: usize) -> Vec<Section> {
    let mut rows = sections.to_vec();
    for _ in 0..rounds {
        let (Some(first), Some(last)) = (rows.first().copied(), rows.last().copied()) else {
            break;
        };
        let cut = rows.windows(2).flat_map(|p| [p[0].mix(&p[1], 0.25), p[0].mix(&p[1], 0.75)]);
        rows = std::iter::once(first).chain(cut).chain(std::iter::once(last)).collect();
    }
    rows.dedup();
    rows
}

/// Inserts sections until neighbors are at most `step` \[m\] apart along the outline.
pub fn subdivided(sections: &[Section], step: f64) -> Vec<Section> {
    let mut rows = Vec::from_iter(sections.first().copied());
    for pair in sections.windows(2) {
        let length = (pair[1].z - pair[0].z).hypot(pair[1].radius() - pair[0].radius());
        let parts = ((length / step).ceil() as usize).clamp(1, 10_000);
        rows.extend((1..=parts).map(|i| pair[0].mix(&pair[1], i as f64 / parts as f64)));
    }
    rows
}

/// `sections` without repetitions, both ends brought to a point.
fn capped(sections: &[Section]) -> Vec<Section> {
    let mut rows = sections.to_vec();
    if let (Some(first), Some(last)) = (sections.first(), sections.last()) {
        rows.insert(0, Section { half: [0.0; 2], ..*first });
        rows.push(Section { half: [0.0; 2], ..*last });
    }
    // Two points of different exponent are the same point.
    rows.dedup_by(|b, a| a.z == b.z && a.half == b.half);
    rows
}

/// Parameters (cos t, sin t) that cut a quadrant of the widest section into `parts` arcs of equal length.
fn equal_arcs(rows: &[Section], parts: usize) -> Vec<[f64; 2]> {
    let widest = rows.iter().fold(rows[0], |a, b| if b.radius() > a.radius() { *b } else { a });
    let fine = 256 * parts;
    let at = |i: usize| match i {
        0 => [1.0, 0.0],
        i if i == fine => [0.0, 1.0],
        i => {
            let (s, c) = (FRAC_PI_2 * i as f64 / fine as f64).sin_cos();
            [c, s]
        }
    };
    let mut lengths = vec![0.0];
    for i in 0..fine {
        let ([x0, y0], [x1, y1]) = (widest.corner(at(i)), widest.corner(at(i + 1)));
        lengths.push(lengths[i] + (x1 - x0).hypot(y1 - y0));
    }
    let step = lengths[fine] / parts as f64;
    (0..=parts)
        .map(|k| match k {
            0 => at(0),
            k if k == parts => at(fine),
            // Rounding may leave a length just short of its goal, where the next would be a whole step too far.
            k => at(lengths.partition_point(|l| *l < (k as f64 - 1e-9) * step)),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume;

    #[test]
    fn prism_over_a_quartic_oval_has_its_closed_form() {
        // Area of |x/a|⁴ + |y/b|⁴ = 1: 4ab Γ(5/4)² / Γ(3/2).
        let exact =
            0.1 * 4.0 * 0.03 * 0.05 * 0.906_402_477_055_477_f64.powi(2) / 0.886_226_925_452_758;
        let wall = [0.0, 0.1].map(|z| Section { z, half: [0.03, 0.05], exponent: 4.0 });
        let errors = [32, 64, 128].map(|n| (closed_volume(&loft(&wall, n)) / exact - 1.0).abs());
        assert!(errors[2] < 5e-4, "{errors:?}");
        assert!(errors.windows(2).all(|e| e[1] < 0.4 * e[0]), "{errors:?}");
    }

    #[test]
    fn bounds_are_exact_and_texture_runs_from_minus_y() {
        let mesh = loft(&[-0.1, 0.2].map(|z| Section { z, half: [0.03, 0.05], exponent: 3.0 }), 30);
        let (low, high) = mesh.bounds().unwrap();
        assert_eq!((low, high), (Point3::new(-0.03, -0.05, -0.1), Point3::new(0.03, 0.05, 0.2)));
        let uvs = mesh.uvs.as_ref().unwrap();
        for (u, expected) in
            [(0.0, [0.0, -0.05]), (0.25, [0.03, 0.0]), (0.5, [0.0, 0.05]), (1.0, [0.0, -0.05])]
        {
            let i = (0..uvs.len()).find(|&i| uvs[i][0] == u && mesh.vertices[i].z == 0.2).unwrap();
            assert_eq!([mesh.vertices[i].x, mesh.vertices[i].y], expected);
        }
    }

    #[test]
    fn smoothing_and_subdividing_keep_the_ends_and_the_cylinder() {
        let wall = [Section::circle(0.0, 0.02), Section::circle(0.1, 0.02)];
        let rows = subdivided(&smoothed(&wall, 2), 0.01);
        assert!(rows.len() >= 11);
        assert_eq!((rows[0], rows[rows.len() - 1]), (wall[0], wall[1]));
        let (a, b) = (closed_volume(&loft(&rows, 16)), closed_volume(&loft(&wall, 16)));
        assert!((a / b - 1.0).abs() < 1e-12);
        assert!(loft(&[], 8).faces.is_empty() && loft(&wall[..1], 8).faces.is_empty());
    }
}
