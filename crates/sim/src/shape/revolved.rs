//! Cylinders and cones.

use std::f64::consts::{PI, TAU};

use nalgebra::Point3;
use prehend_autodiff::Scalar;
use prehend_geometry::Moments;

use super::border::Edges;
use super::profile::Profile;
use super::round::{Core, Round};
use super::rows::{parts, rows};
use super::solid::{Convex, RoundSample};

/// Kind of a solid of revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outline {
    /// A cylinder.
    Cylinder,
    /// A cone, its tip above.
    Cone,
}

/// A cylinder or cone around the y axis with its middle at the origin, by half its height and its radius.
///
/// Its samples lie on rings of the same solid with its faces moved inward. Next to the rim there is a strip of one width on base and
/// side; a sample on the rim stands for its part of the base, so that bases press with their own area, evenly. On its side it
/// is a prism: it rolls over as many edges as a ring has samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Revolved {
    pub(crate) outline: Outline,
    pub(crate) border: Edges,
    pub(crate) spacing: f64,
    /// Width of the strips next to the rim \[m\].
    strip: f64,
}

/// Edges of the prism at least.
const PRISM: usize = 24;

impl Revolved {
    /// The strips are as wide as the closest rows of the `dimensions`.
    pub(crate) fn new(outline: Outline, border: Edges, spacing: f64, dimensions: &[f64]) -> Self {
        let solid = Self { outline, border, spacing, strip: spacing };
        let corners = solid.corners(dimensions, border.rounding(dimensions).inset());
        let length = |pair: &[[f64; 2]]| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let lengths = corners.windows(2).map(length);
        let step = |length: f64| length / parts(length, spacing) as f64;
        Self { strip: lengths.map(step).fold(spacing, f64::min), ..solid }
    }

    /// Corners of the outline with its sides moved inward by `inset`, from the axis below to the axis above.
    fn corners<T: Scalar>(&self, dimensions: &[T], inset: T) -> Vec<[T; 2]> {
        let [half, radius] = [dimensions[0], dimensions[1]];
        let low = inset - half;
        match self.outline {
            Outline::Cylinder => {
                let (out, high) = (radius - inset, half - inset);
                vec![[T::zero(), low], [out, low], [out, high], [T::zero(), high]]
            }
            Outline::Cone => {
                let height = half.times(2.0);
                let side = (height * height + radius * radius).sqrt();
                let out = ((height - inset) * radius - inset * side) / height;
                vec![[T::zero(), low], [out, low], [T::zero(), half - inset * side / radius]]
            }
        }
    }
}

impl Convex for Revolved {
    fn names(&self) -> Vec<String> {
        self.border.names(&["half_height", "radius"])
    }

    fn moments<T: Scalar>(&self, dimensions: &[T]) -> Moments<T> {
        let [half, radius] = [dimensions[0], dimensions[1]];
        match (self.outline, self.border) {
            (Outline::Cylinder, Edges::Within(_)) => Moments::cylinder(half, radius),
            (Outline::Cone, Edges::Within(_)) => Moments::cone(half, radius),
            (Outline::Cylinder, Edges::Around) => {
                Moments::round_cylinder(half, radius, dimensions[2])
            }
            (Outline::Cone, Edges::Around) => Moments::round_cone(half, radius, dimensions[2]),
        }
    }

    fn round<T: Scalar>(&self, dimensions: &[T]) -> Round<T> {
        let rounding = self.border.rounding(dimensions);
        let corners = self.corners(dimensions, rounding.core());
        Round { core: Core::Profile(Profile::new(&corners)), border: rounding.border() }
    }

    fn lattice(&self, dimensions: &[f64]) -> Option<([f64; 3], f64)> {
        Some(([dimensions[1], dimensions[1], dimensions[0]], self.spacing))
    }

    fn border(&self) -> Option<Edges> {
        Some(self.border)
    }

    fn deepest(&self, dimensions: &[f64]) -> Option<f64> {
        let [half, radius] = [dimensions[0], dimensions[1]];
        Some(match self.outline {
            Outline::Cylinder => half.min(radius),
            // The incircle of the section.
            Outline::Cone => 2.0 * half * radius / (radius + (2.0 * half).hypot(radius)),
        })
    }

    fn samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        let rounding = self.border.rounding(dimensions);
        let radius = rounding.samples();
        let corners = self.corners(dimensions, rounding.inset());
        let mut rings = Rings { radius, spacing: self.spacing, samples: Vec::new() };
        let sides: Vec<[[T; 2]; 2]> = corners.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        for (number, &[from, to]) in sides.iter().enumerate() {
            let flat = (from[1] - to[1]).value() == 0.0;
            let (run, rise) = (to[0] - from[0], to[1] - from[1]);
            let length = (run * run + rise * rise).sqrt();
            // Marked are the ends at a rim.
            let marked = [number > 0, number + 1 < sides.len()];
            let row = rows([T::zero(), length], marked, self.strip, self.spacing, radius);
            let last = row.len() - 1;
            for (i, &(place, width)) in row.iter().enumerate() {
                let part = place / length;
                let center = [from[0] + run * part, from[1] + rise * part];
                // Rims belong to the base below or above.
                if !flat && (i == 0 || (i == last && marked[1])) {
                    continue;
                }
                let [low, high] = [0, 1].map(|end| {
                    let edge = match end {
                        0 if i == 0 => T::zero(),
                        1 if i == last => length,
                        0 => (row[i - 1].0 + place).times(0.5),
                        _ => (place + row[i + 1].0).times(0.5),
                    };
                    from[0] + run * edge / length
                });
                let rim = (i == 0 && marked[0]) || (i == last && marked[1]);
                let area = if flat {
                    // Of the disk between the middles to the next rings, or the edge of the solid.
                    let mut bounds = [low, high];
                    if rim {
                        let edge = dimensions[1] + rounding.outward();
                        bounds[usize::from(run.value() > 0.0)] = edge;
                    }
                    let [a, b] = bounds.map(|x| x * x);
                    (if run.value() > 0.0 { b - a } else { a - b }).times(PI)
                } else {
                    // The band, of the solid itself: as far out as the samples reach.
                    let outward = rise / length * radius;
                    ((low + high).times(0.5) + outward) * width.times(TAU)
                };
                // The rims and the side are a prism.
                let least = if rim || !flat { PRISM } else { 1 };
                rings.add(center, least, area);
            }
        }
        rings.samples
    }
}

/// Samples on rings.
struct Rings<T: Scalar> {
    radius: T,
    spacing: f64,
    samples: Vec<RoundSample<T>>,
}

impl<T: Scalar> Rings<T> {
    /// A ring at this distance from the axis and height, which stands for `area` in all, of at least so many samples; one on the axis.
    fn add(&mut self, [out, height]: [T; 2], least: usize, area: T) {
        let around = match out.value() {
            x if x < 1e-9 * self.spacing => 1,
            x => parts(TAU * x, self.spacing).max(least),
        };
        let share = area.times(1.0 / around as f64);
        for i in 0..around {
            let (sin, cos) = (TAU * i as f64 / around as f64).sin_cos();
            let center = Point3::new(out.times(cos), height, out.times(sin));
            self.samples.push(RoundSample { center, radius: self.radius, area: share });
        }
    }
}
