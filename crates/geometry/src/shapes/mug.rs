//! A mug with a handle.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;

/// Dimensions and resolution of a mug: a cup around the z axis that stands on z = 0, with a handle towards +x.
///
/// ```
/// use prehend_geometry::mass::mass_properties;
/// use prehend_geometry::shapes::Mug;
///
/// // Of stoneware: 2400 kg/m³.
/// let mug = mass_properties(&Mug::default().mesh(), 2400.0)?;
/// assert!((mug.mass - 0.26).abs() < 0.01);
/// # Ok::<(), prehend_geometry::MassError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mug {
    /// Outer radius \[m\].
    pub radius: f64,
    /// Height \[m\].
    pub height: f64,
    /// Thickness of wall and bottom \[m\]; the rim is round.
    pub wall: f64,
    /// Radius of the handle's tube \[m\].
    pub handle: f64,
    /// How far the middle of that tube stands out from the wall \[m\], along half an ellipse.
    pub reach: f64,
    /// Length of a cell on wall and handle \[m\], about: half the radius of the handle at most.
    pub cell: f64,
}

impl Default for Mug {
    /// 8 cm wide and 9 cm high, with a handle as thick as a finger's width.
    fn default() -> Self {
        Self { radius: 0.04, height: 0.09, wall: 4e-3, handle: 4.5e-3, reach: 0.032, cell: 2.5e-3 }
    }
}

impl Mug {
    /// Its surface, of genus one.
    pub fn mesh(&self) -> TriMesh {
        let opening = Opening::of(self);
        let (profile, wall) = self.profile(&opening);
        let rows = profile.len();
        let columns = opening.columns;
        let mut mesh = TriMesh::default();
        for j in 0..columns {
            let (sin, cos) = (TAU * j as f64 / columns as f64).sin_cos();
            mesh.vertices.extend(profile.iter().map(|[r, z]| Point3::new(r * cos, r * sin, *z)));
        }
        let at = |column: usize, row: usize| (column % columns * rows + row) as u32;
        let [low, high] = opening.rows.map(|row| wall + row);
        let width = 2 * opening.half;
        for j in 0..columns {
            for i in 0..rows - 1 {
                // The handle begins and ends around column 0.
                let beside = (j + opening.half) % columns < width;
                let open = |from: usize| (from..from + width).contains(&i);
                if !(beside && (open(low) || open(high))) {
                    let [a, b, c, d] = [at(j, i), at(j + 1, i), at(j + 1, i + 1), at(j, i + 1)];
                    mesh.faces.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        for (row, [r, z]) in [(0, profile[0]), (rows - 1, profile[rows - 1])] {
            debug_assert!(r > 0.0);
            let center = mesh.vertices.len() as u32;
            mesh.vertices.push(Point3::new(0.0, 0.0, z));
            for j in 0..columns {
                let [a, b] = [at(j, row), at(j + 1, row)];
                mesh.faces.push(if row == 0 { [center, b, a] } else { [center, a, b] });
            }
        }
        let place = |(column, row): (usize, usize)| at(column, row);
        let [from, to] = [(high, false), (low, true)].map(|(first, mirrored)| {
            opening.border(first, mirrored).into_iter().map(place).collect::<Vec<u32>>()
        });
        self.add_handle(&mut mesh, &from, &to);
        mesh
    }

    /// Pairs (radius, z) \[m\] from the bottom over the rim to the inside, and the row at which the outer wall begins.
    fn profile(&self, opening: &Opening) -> (Vec<[f64; 2]>, usize) {
        let Self { radius, height, wall, .. } = *self;
        let (foot, rim) = (0.5 * wall, 0.5 * wall);
        let disk = |radius: f64, z: f64| {
            let rings = ((radius / (2.0 * self.cell)).round() as usize).max(2);
            (1..rings).map(move |i| [radius * i as f64 / rings as f64, z])
        };
        let arc = |center: [f64; 2], radius: f64, from: f64, to: f64, steps: usize| {
            (0..=steps).map(move |i| {
                let (sin, cos) = (from + (to - from) * i as f64 / steps as f64).sin_cos();
                [center[0] + radius * cos, center[1] + radius * sin]
            })
        };
        let mut profile: Vec<[f64; 2]> = disk(radius - foot, 0.0).collect();
        profile.extend(arc([radius - foot, foot], foot, -0.5 * PI, 0.0, 2));
        let first = profile.len() - 1;
        let cells = opening.wall;
        let straight = height - foot - rim;
        let row = |i: usize| [radius, foot + straight * i as f64 / cells as f64];
        profile.extend((1..cells).map(row));
        profile.extend(arc([radius - rim, height - rim], rim, 0.0, PI, 4));
        let inner = radius - wall;
        let fillet = wall;
        let depth = height - rim - wall - fillet;
        let cells = ((depth / (2.0 * self.cell)).round() as usize).max(1);
        let row = |i: usize| [inner, height - rim - depth * i as f64 / cells as f64];
        profile.extend((1..cells).map(row));
        let quarter = arc([inner - fillet, wall + fillet], fillet, 0.0, -0.5 * PI, 3);
        profile.extend(quarter);
        let bottom: Vec<_> = disk(inner - fillet, wall).collect();
        profile.extend(bottom.into_iter().rev());
        (profile, first)
    }

    /// The tube from one opening to the other, whose borders go around it alike.
    fn add_handle(&self, mesh: &mut TriMesh, from: &[u32], to: &[u32]) {
        let columns = from.len();
        let middle = |border: &[u32]| {
            let sum: f64 = border.iter().map(|v| mesh.vertices[*v as usize].z).sum();
            sum / columns as f64
        };
        let [top, bottom] = [middle(from), middle(to)];
        let (center, half) = (0.5 * (top + bottom), 0.5 * (top - bottom));
        let length = 0.5
            * PI
            * (3.0 * (half + self.reach)
                - ((3.0 * half + self.reach) * (half + 3.0 * self.reach)).sqrt());
        let rings = ((length / self.cell).round() as usize).max(4);
        let mut last = from.to_vec();
        for ring in 1..rings {
            let (sin, cos) = (PI * ring as f64 / rings as f64).sin_cos();
            let place = Point3::new(self.radius + self.reach * sin, 0.0, center + half * cos);
            let tangent = Vector3::new(self.reach * cos, 0.0, -half * sin).normalize();
            let across = Vector3::y();
            let other = tangent.cross(&across);
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend((0..columns).map(|j| {
                let (sin, cos) = (TAU * j as f64 / columns as f64).sin_cos();
                place + (across * cos + other * sin) * self.handle
            }));
            let next: Vec<u32> = (first..).take(columns).collect();
            join(mesh, &last, &next);
            last = next;
        }
        join(mesh, &last, to);
    }
}

/// Faces from one ring of vertices to the next.
fn join(mesh: &mut TriMesh, from: &[u32], to: &[u32]) {
    for j in 0..from.len() {
        let k = (j + 1) % from.len();
        mesh.faces.extend([[from[j], from[k], to[k]], [from[j], to[k], to[j]]]);
    }
}

/// Where the handle leaves the wall: squares of cells around column 0.
struct Opening {
    /// Columns of the wall, and rows of its straight part.
    columns: usize,
    wall: usize,
    /// Half the side of a square, in cells.
    half: usize,
    /// The first row of the lower and of the upper square, in rows of the straight part.
    rows: [usize; 2],
}

impl Opening {
    fn of(mug: &Mug) -> Self {
        let straight = mug.height - mug.wall;
        let wall = ((straight / mug.cell).round() as usize).max(16);
        let columns = ((TAU * mug.radius / mug.cell).round() as usize).max(16);
        // As wide as the tube along its diagonals.
        let cell = straight / wall as f64;
        let half = ((mug.handle / (cell * FRAC_PI_4.cos() * 1.2)).round() as usize).max(1);
        let low = (wall / 6).max(1);
        Self { columns, wall, half, rows: [low, wall - low - 2 * half] }
    }

    /// Column and row of the points around the square that begins in row `first`, counterclockwise seen from outside, from the middle
    /// of its right side; upside down if `mirrored`.
    fn border(&self, first: usize, mirrored: bool) -> Vec<(usize, usize)> {
        let (half, side) = (self.half as isize, 2 * self.half as isize);
        let right = (0..half).map(|i| (half, i));
        let top = (0..side).map(|i| (half - i, half));
        let left = (0..side).map(|i| (-half, half - i));
        let bottom = (0..side).map(|i| (i - half, -half));
        let rest = (0..half).map(|i| (half, i - half));
        let around = right.chain(top).chain(left).chain(bottom).chain(rest);
        let column = |c: isize| (c + self.columns as isize) as usize % self.columns;
        let row = |r: isize| (first as isize + half + if mirrored { -r } else { r }) as usize;
        around.map(|(c, r)| (column(c), row(r))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume_of_genus;

    #[test]
    fn a_mug_is_closed_and_has_the_volume_of_its_parts() {
        for cell in [4e-3, 2.5e-3, 1.25e-3] {
            let mug = Mug { cell, ..Mug::default() };
            let volume = closed_volume_of_genus(&mug.mesh(), 1);
            let Mug { radius, height, wall, handle, reach, .. } = mug;
            let inner = radius - wall;
            let cup = PI * (radius * radius * height - inner * inner * (height - wall));
            // Half an ellipse between the middles of the openings.
            let tube = PI * handle * handle * 0.5 * PI * 0.5 * (reach + 0.28 * height) * 2.0;
            assert!((volume / (cup + tube) - 1.0).abs() < 0.04, "{cell}: {volume}");
        }
    }
}
