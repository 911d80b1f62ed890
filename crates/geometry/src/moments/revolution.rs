//! Solids of revolution about the y axis.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Vector3};
use prehend_autodiff::Scalar;

use super::Moments;

/// Nodes and weights of Gauss's quadrature with twelve points on −1..1, the positive half.
const GAUSS: [(f64, f64); 6] = [
    (0.125_233_408_511_468_9, 0.249_147_045_813_402_8),
    (0.367_831_498_998_180_2, 0.233_492_536_538_354_8),
    (0.587_317_954_286_617_5, 0.203_167_426_723_065_9),
    (0.769_902_674_194_304_7, 0.160_078_328_543_346_2),
    (0.904_117_256_370_474_9, 0.106_939_325_995_318_4),
    (0.981_560_634_246_719_2, 0.047_175_336_386_511_8),
];

/// A piece of the outline, in distance from the axis and height \[m\].
enum ProfilePiece<S> {
    Line {
        from: [S; 2],
        to: [S; 2],
    },
    /// Angles \[rad\] from the direction away from the axis, up.
    Arc {
        center: [S; 2],
        radius: S,
        angles: [S; 2],
    },
}

impl<S: Scalar> Moments<S> {
    /// A cylinder around the y axis from −`half_height` to `half_height`.
    pub fn cylinder(half_height: S, radius: S) -> Self {
        let side = ProfilePiece::Line { from: [radius, -half_height], to: [radius, half_height] };
        side.moments()
    }

    /// A cylinder around the y axis with half balls on its ends, whose centers are at ±`half_height`.
    pub fn capsule(half_height: S, radius: S) -> Self {
        Self::round_cylinder(half_height, S::zero(), radius)
    }

    /// A cone around the y axis with its base at −`half_height` and its tip at `half_height`.
    pub fn cone(half_height: S, radius: S) -> Self {
        let side =
            ProfilePiece::Line { from: [radius, -half_height], to: [S::zero(), half_height] };
        side.moments()
    }

    /// All within `border` of a cylinder.
    pub fn round_cylinder(half_height: S, radius: S, border: S) -> Self {
        let right = S::constant(FRAC_PI_2);
        let edge = |height: S, angles: [S; 2]| ProfilePiece::Arc {
            center: [radius, height],
            radius: border,
            angles,
        };
        let wide = radius + border;
        let pieces = [
            edge(-half_height, [-right, S::zero()]),
            ProfilePiece::Line { from: [wide, -half_height], to: [wide, half_height] },
            edge(half_height, [S::zero(), right]),
        ];
        pieces.iter().map(ProfilePiece::moments).sum()
    }

    /// All within `border` of a cone.
    pub fn round_cone(half_height: S, radius: S, border: S) -> Self {
        let right = S::constant(FRAC_PI_2);
        // Where the normal of the side points.
        let flat = radius.value() == 0.0 && half_height.value() == 0.0;
        let tilt = S::zero().select(flat, radius.atan2(half_height.times(2.0)));
        let shift = [border * tilt.cos(), border * tilt.sin()];
        let arc =
            |center: [S; 2], angles: [S; 2]| ProfilePiece::Arc { center, radius: border, angles };
        let [base, tip] = [[radius, -half_height], [S::zero(), half_height]];
        let pieces = [
            arc(base, [-right, tilt]),
            ProfilePiece::Line {
                from: [base[0] + shift[0], base[1] + shift[1]],
                to: [tip[0] + shift[0], tip[1] + shift[1]],
            },
            arc(tip, [tilt, right]),
        ];
        pieces.iter().map(ProfilePiece::moments).sum()
    }
}

impl<S: Scalar> ProfilePiece<S> {
    /// The moments of what is between the axis and this piece: ∫π r² dy and so on, exact to rounding.
    fn moments(&self) -> Moments<S> {
        let nodes = GAUSS.iter().flat_map(|&(x, w)| [(-x, w), (x, w)]);
        let halves = nodes.flat_map(|(x, w)| [-0.5, 0.5].map(|half| (half + 0.5 * x, 0.5 * w)));
        halves.map(|(node, weight)| self.slice(node).scaled(weight)).sum()
    }

    /// The moments of a disk per change of the place on the piece, which goes from −1 to 1.
    fn slice(&self, place: f64) -> Moments<S> {
        let between = |[a, b]: [S; 2]| (a + b).times(0.5) + (b - a).times(0.5 * place);
        let ([r, y], rise) = match self {
            Self::Line { from, to } => {
                ([0, 1].map(|i| between([from[i], to[i]])), (to[1] - from[1]).times(0.5))
            }
            Self::Arc { center, radius, angles } => {
                let angle = between(*angles);
                let (sin, cos) = angle.sin_cos();
                let rise = *radius * cos * (angles[1] - angles[0]).times(0.5);
                ([center[0] + *radius * cos, center[1] + *radius * sin], rise)
            }
        };
        let area = (r * r).times(PI);
        let volume = area * rise;
        let across = (volume * r * r).times(0.25);
        Moments {
            volume,
            first: Vector3::new(S::zero(), volume * y, S::zero()),
            second: Matrix3::from_diagonal(&Vector3::new(across, volume * y * y, across)),
        }
    }
}

impl<S: Scalar> Moments<S> {
    fn scaled(self, factor: f64) -> Self {
        Self {
            volume: self.volume.times(factor),
            first: self.first.map(|x| x.times(factor)),
            second: self.second.map(|x| x.times(factor)),
        }
    }
}
