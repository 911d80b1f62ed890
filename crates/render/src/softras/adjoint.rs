//! Derivatives of a fragment by the corners of its face.

#[cfg(test)]
use super::face::Face;
use super::fragment::Fragment;
use super::number::Number;

/// Derivatives of something by what a fragment holds.
#[cfg(test)]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FragmentAdjoint {
    /// By the barycentric coordinates.
    pub(crate) b: [f32; 3],
    /// By the depth \[1/m\].
    pub(crate) z: f32,
    /// By the signed squared distance \[1/px²\].
    pub(crate) distance: f32,
}

impl<T: Number> Fragment<T> {
    /// From the derivatives by the barycentric coordinates, depth included (`along[i]` is b̄_i + z̄ Z_i), to those by the
    /// unclamped weights W_i.
    #[inline(always)]
    pub(crate) fn weight_adjoint(&self, along: [T; 3]) -> [T; 3] {
        let mean = self.b[0] * along[0] + self.b[1] * along[1] + self.b[2] * along[2];
        let mean = mean * self.sum_active;
        let factor = self.inverse_sum;
        [
            self.active[0] * factor * (along[0] - mean),
            self.active[1] * factor * (along[1] - mean),
            self.active[2] * factor * (along[2] - mean),
        ]
    }

    /// 2 (foot − p), signed as the distance is: the distance's derivative by a shift of the foot \[px\].
    #[inline(always)]
    pub(crate) fn distance_gradient(&self) -> [T; 2] {
        let two = self.z.like(2.0);
        let factor = T::pick(self.distance.below(self.z.like(0.0)), -two, two);
        [factor * self.to_foot[0], factor * self.to_foot[1]]
    }
}

#[cfg(test)]
impl Fragment<f32> {
    /// From derivatives by the fragment of `face` at pixel (column, row) to those by the columns, rows \[1/px\] and depths
    /// \[1/m\] of the face's corners.
    ///
    /// At kinks (a coordinate clamped just so, two edges equally near) it is the derivative of one side.
    pub(crate) fn pull_back(
        &self,
        face: &Face,
        column: f32,
        row: f32,
        perspective: bool,
        adjoint: &FragmentAdjoint,
    ) -> [[f32; 3]; 3] {
        let (x, y) = (column - face.base[0], row - face.base[1]);
        let v = [0, 1, 2].map(|i| [face.corner[i][0] - x, face.corner[i][1] - y]);
        // Where the sum is free, a depth that is the same everywhere moves with no coordinate; taking it off saves digits.
        let level = self.z * self.sum_active;
        let along = [0, 1, 2].map(|i| adjoint.b[i] + adjoint.z * (face.z[i] - level));
        let weight = self.weight_adjoint(along);
        let gradient = self.distance_gradient().map(|g| g * adjoint.distance);
        let mut out = [[0.0; 3]; 3];
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            // E_i = v_j × v_k.
            let edge = weight[i] * face.share[i];
            out[j][0] += edge * v[k][1];
            out[j][1] -= edge * v[k][0];
            out[k][0] -= edge * v[j][1];
            out[k][1] += edge * v[j][0];
            out[i][0] += gradient[0] * self.foot[i];
            out[i][1] += gradient[1] * self.foot[i];
            out[i][2] += adjoint.z * self.b[i];
            if perspective {
                // s = 1/Z falls by s/Z.
                let value = face.share[i] * (v[j][0] * v[k][1] - v[j][1] * v[k][0]);
                out[i][2] -= weight[i] * value / face.z[i];
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::super::naive::naive_fragment;
    use super::super::settings::Settings;
    use super::*;
    use crate::camera::Camera;
    use crate::mode::SoftRasOptions;

    /// In which a pixel is a unit of normalized device coordinates.
    const CAMERA: Camera = Camera { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, width: 2, height: 2 };

    fn flags(perspective_correct: bool, clip_barycentric: bool) -> SoftRasOptions {
        SoftRasOptions {
            blur_radius: 0.5,
            perspective_correct,
            clip_barycentric,
            ..SoftRasOptions::default()
        }
    }

    /// Compares with one-sided differences of the naive fragment at the origin: at a kink a derivative may lie anywhere
    /// between the two.
    fn check(corners: [[f64; 3]; 3], options: &SoftRasOptions, tolerance: f64) {
        let settings = Settings::new(options, &CAMERA);
        // The prepared face is rounded to f32, so the other starts there too.
        let corners = corners.map(|c| c.map(|v| v as f32 as f64));
        let face = Face::new(corners, &settings).unwrap();
        let (fragment, extent) = Fragment::new(&face, 0.0, 0.0, &settings);
        let naive = naive_fragment(corners, [0.0; 2], options);
        assert_eq!(extent.kept, naive.is_some());
        let Some(naive) = naive else { return };
        // Near the horizon, which has a test of its own.
        if naive.b.iter().any(|b| b.abs() > 10.0) {
            return;
        }
        let close = |a: f32, b: f64| (a as f64 - b).abs() <= tolerance * (1.0 + b.abs());
        assert!((0..3).all(|i| close(fragment.b[i], naive.b[i])), "{fragment:?} {naive:?}");
        assert!(close(fragment.z, naive.z) && close(fragment.distance, naive.distance));
        for (b, z, distance) in [
            ([0.7, -0.4, 0.2], 0.0, 0.0),
            ([0.0; 3], 1.3, 0.0),
            ([0.0; 3], 0.0, -0.8),
            ([-0.3, 0.5, 0.9], -0.6, 1.1),
        ] {
            let adjoint = FragmentAdjoint { b, z, distance };
            let perspective = options.perspective_correct;
            let exact = fragment.pull_back(&face, 0.0, 0.0, perspective, &adjoint);
            let value = |corners: [[f64; 3]; 3]| {
                let f = naive_fragment(corners, [0.0; 2], options).unwrap();
                let along: f64 = (0..3).map(|i| b[i] as f64 * f.b[i]).sum();
                along + z as f64 * f.z + distance as f64 * f.distance
            };
            let step = 1e-8;
            let mut scale = 1e-3f64;
            let mut pairs = Vec::new();
            for i in 0..3 {
                for k in 0..3 {
                    let side = |s: f64| {
                        let mut moved = corners;
                        moved[i][k] += s * step;
                        (value(moved) - value(corners)) / (s * step)
                    };
                    pairs.push((exact[i][k] as f64, side(-1.0), side(1.0)));
                    scale = scale.max(side(1.0).abs());
                }
            }
            for (exact, left, right) in pairs {
                let margin = tolerance * scale;
                assert!(
                    exact > left.min(right) - margin && exact < left.max(right) + margin,
                    "{exact} {left} {right}, {corners:?} {options:?} {adjoint:?}"
                );
            }
        }
    }

    fn check_all(corners: [[f64; 3]; 3], tolerance: f64) {
        for perspective in [false, true] {
            for clip in [false, true] {
                check(corners, &flags(perspective, clip), tolerance);
            }
        }
    }

    #[test]
    fn derivatives_by_the_corners_are_those_of_the_naive_fragment() {
        let mut state = 5u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for _ in 0..300 {
            let corners = [0, 1, 2].map(|_| [0.5 * next(), 0.5 * next(), 0.6 + 0.3 * next()]);
            let [a, b, c] = corners;
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if area.abs() > 0.02 {
                check_all(corners, 2e-3);
            }
        }
    }

    #[test]
    fn derivatives_hold_at_kinks() {
        let away = |x: f64, y: f64, z: f64| [x, y, z];
        // The origin on an edge, at a corner, beyond an edge, beyond a corner, and on the line of an edge.
        for [x, y] in [[0.0, -0.1], [0.0, 0.0], [0.1, -0.1], [0.1, 0.1], [0.0, 0.1], [-0.1, -0.1]] {
            let triangle = [away(x, y, 0.5), away(x, y + 0.25, 0.6), away(x + 0.25, y, 0.75)];
            check_all(triangle, 1e-3);
            let [a, b, c] = triangle;
            check_all([a, c, b], 1e-3);
        }
    }

    #[test]
    fn derivatives_of_slivers_and_short_edges_hold() {
        let sliver = [[-0.25, 0.01, 0.5], [0.25, 0.0102, 0.55], [0.3, 0.0105, 0.6]];
        check(sliver, &flags(true, true), 1e-2);
        check(sliver, &flags(false, true), 1e-2);
        // An edge of less than 1e-4: the distance to it is that to its second end.
        let short = [[0.1, 0.1, 0.5], [0.10005, 0.1, 0.5], [0.1, 0.4, 0.6]];
        let options = flags(true, true);
        let settings = Settings::new(&options, &CAMERA);
        let face = Face::new(short, &settings).unwrap();
        let (fragment, _) = Fragment::new(&face, 0.0, 0.0, &settings);
        let naive = naive_fragment(short, [0.0; 2], &options).unwrap();
        assert!((fragment.distance as f64 - naive.distance).abs() < 1e-7);
        check(short, &options, 1e-2);
    }

    #[test]
    fn beyond_the_horizon_everything_stays_finite() {
        // Seen nearly edge-on, the plane of the face passes through the pixel behind the camera.
        let steep = [[0.1, 0.0, 0.1], [0.2, 0.1, 2.0], [0.2, -0.1, 2.0]];
        let wide = SoftRasOptions { blur_radius: 100.0, ..flags(true, false) };
        for x in [0.0, 0.5, 3.0] {
            let corners = steep.map(|c| [c[0] + x, c[1], c[2]]);
            let settings = Settings::new(&wide, &CAMERA);
            let face = Face::new(corners, &settings).unwrap();
            let (fragment, _) = Fragment::new(&face, 0.0, 0.0, &settings);
            let naive = naive_fragment(corners, [0.0; 2], &wide).unwrap();
            assert!((fragment.z as f64 / naive.z - 1.0).abs() < 1e-3, "{fragment:?} {naive:?}");
            let adjoint = FragmentAdjoint { b: [1.0; 3], z: 1.0, distance: 1.0 };
            let out = fragment.pull_back(&face, 0.0, 0.0, true, &adjoint);
            assert!(out.iter().flatten().all(|v| v.is_finite()), "{out:?}");
        }
    }
}
