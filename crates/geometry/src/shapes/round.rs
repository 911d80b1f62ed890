//! Spheres, cylinders, capsules, superellipsoids and other bodies around the z axis.

use std::f64::consts::{FRAC_PI_2, PI};

use super::{Section, loft};
use crate::mesh::TriMesh;

/// The surface swept by turning `profile`, pairs (radius, z) \[m\] from the bottom along the outline to the
/// top, around z in `segments` columns; closed and unrolled as [`loft`] says.
pub fn revolve(profile: &[[f64; 2]], segments: usize) -> TriMesh {
    let sections: Vec<_> = profile.iter().map(|[r, z]| Section::circle(*z, *r)).collect();
    loft(&sections, segments)
}

/// A sphere of radius `radius` \[m\] about the origin, in `segments` columns and half as many rows; its
/// vertices lie on the sphere.
pub fn sphere(radius: f64, segments: usize) -> TriMesh {
    superellipsoid([radius; 3], [1.0; 2], segments)
}

/// A cylinder about z, from −`height`/2 to `height`/2 \[m\], in `segments` columns.
pub fn cylinder(radius: f64, height: f64, segments: usize) -> TriMesh {
    revolve(&[[radius, -0.5 * height], [radius, 0.5 * height]], segments)
}

/// A cone about z cut off flat, of radius `radii`\[0\] \[m\] at −`height`/2 and `radii`\[1\] at `height`/2 \[m\], in
/// `segments` columns; a radius of zero is an apex.
pub fn cone(radii: [f64; 2], height: f64, segments: usize) -> TriMesh {
    revolve(&[[radii[0], -0.5 * height], [radii[1], 0.5 * height]], segments)
}

/// The points within `radius` \[m\] of the segment from −`half_length` to `half_length` \[m\] on the z axis,
/// in `segments` columns, one of them at +x, and `rows` rows a hemisphere (at least one) of equal latitude; its
/// vertices lie on the true surface.
pub fn capsule(radius: f64, half_length: f64, segments: usize, rows: usize) -> TriMesh {
    let rows = rows.max(1);
    let arc = |i: usize, center: f64, sign: f64| {
        let (s, c) = (FRAC_PI_2 * i as f64 / rows as f64).sin_cos();
        [radius * if i == rows { 0.0 } else { c }, center + sign * radius * s]
    };
    let bottom = (0..=rows).rev().map(|i| arc(i, -half_length, -1.0));
    let top = (0..=rows).map(|i| arc(i, half_length, 1.0));
    revolve(&bottom.chain(top).collect::<Vec<_>>(), segments)
}

/// The superellipsoid (|x/a|^(2/ε₂) + |y/b|^(2/ε₂))^(ε₂/ε₁) + |z/c|^(2/ε₁) = 1 of half axes (a, b, c) \[m\] and
/// exponents (ε₁, ε₂) \[1\] (Barr, IEEE Computer Graphics and Applications 1(1), 1981), in `segments` columns
/// and half as many rows. ε = 1 is round, 2 a bevel, near 0 a box.
pub fn superellipsoid(half: [f64; 3], exponents: [f64; 2], segments: usize) -> TriMesh {
    let rows = 2 * segments.div_ceil(4).max(2);
    let signed = |v: f64| v.signum() * v.abs().powf(exponents[0]);
    let sections: Vec<_> = (0..=rows)
        .map(|i| {
            let (s, c) = (PI * (i as f64 / rows as f64 - 0.5)).sin_cos();
            let width = if i == 0 || i == rows { 0.0 } else { signed(c) };
            // The middle row lies exactly at zero, where rounding would be magnified by a small exponent.
            let z = if 2 * i == rows { 0.0 } else { half[2] * signed(s) };
            Section { z, half: [half[0] * width, half[1] * width], exponent: 2.0 / exponents[1] }
        })
        .collect();
    loft(&sections, segments)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::closed::closed_volume;

    /// Volume errors at doubling resolution must shrink about fourfold towards `exact`.
    fn converges(exact: f64, shape: impl Fn(usize) -> TriMesh) {
        let errors = [16, 32, 64, 128].map(|n| (closed_volume(&shape(n)) / exact - 1.0).abs());
        assert!(errors.windows(2).all(|e| e[1] < 0.3 * e[0]), "{errors:?}");
        assert!(errors[3] < 2e-3, "{errors:?}");
    }

    #[test]
    fn volumes_converge_to_the_closed_forms() {
        let (r, h) = (0.03, 0.05);
        converges(4.0 / 3.0 * PI * r * r * r, |n| sphere(r, n));
        converges(PI * r * r * h, |n| cylinder(r, h, n));
        converges(PI * r * r * (h + 4.0 / 3.0 * r), |n| capsule(r, 0.5 * h, n, n / 4));
        converges(PI * r * r * h / 3.0, |n| revolve(&[[r, 0.0], [0.0, h]], n));
        converges(PI * r * r * h / 3.0, |n| cone([0.0, r], h, n));
        let frustum = PI * h / 3.0 * (r * r + r * 0.01 + 1e-4);
        converges(frustum, |n| cone([r, 0.01], h, n));
        converges(4.0 / 3.0 * PI * r * h * 0.1, |n| superellipsoid([r, h, 0.1], [1.0, 1.0], n));
    }

    #[test]
    fn superellipsoid_exponents() {
        // ε = 2 in both is an octahedron, whatever the resolution.
        let octahedron = superellipsoid([0.03, 0.05, 0.1], [2.0, 2.0], 32);
        assert!((closed_volume(&octahedron) / (4.0 / 3.0 * 0.03 * 0.05 * 0.1) - 1.0).abs() < 1e-12);
        // ε₁ = ε₂ = ½: |x|⁴ + |y|⁴ + |z|⁴ = 1 encloses 8 Γ(5/4)³ / Γ(7/4).
        let exact = 8.0 * 0.906_402_477_055_477_f64.powi(3) / 0.919_062_526_848_883;
        converges(exact, |n| superellipsoid([1.0; 3], [0.5; 2], n));
    }

    #[test]
    fn points_lie_on_the_shape() {
        for p in &sphere(0.03, 24).vertices {
            assert!((p.coords.norm() - 0.03).abs() < 1e-15);
        }
        for p in &capsule(0.01, 0.02, 24, 12).vertices {
            let axis = nalgebra::Vector3::new(0.0, 0.0, p.z.clamp(-0.02, 0.02));
            let distance = (p.coords - axis).norm();
            assert!((distance - 0.01).abs() < 1e-15);
        }
    }

    #[test]
    fn columns_and_rows_divide_a_capsule_equally() {
        let mesh = capsule(0.01, 0.02, 24, 12).welded();
        // Two poles, and 12 rings of 24 at each end of the cylinder.
        assert_eq!(mesh.vertices.len(), 2 + 2 * 12 * 24);
        for p in &mesh.vertices {
            let latitude = ((p.z.abs() - 0.02) / 0.01).asin() / (FRAC_PI_2 / 12.0);
            assert!((latitude - latitude.round()).abs() < 1e-6, "{p}");
            let column = p.y.atan2(p.x) / (PI / 12.0);
            assert!((column - column.round()).abs() < 1e-9 || p.x.hypot(p.y) == 0.0, "{p}");
        }
    }
}
