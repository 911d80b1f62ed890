//! The residuals of a factor, and their derivatives by blocks.

use nalgebra::{Point3, Vector2, Vector3, Vector6};
use prehend_autodiff::lie::twist_row;

use super::{Block, NormalEquations, State, Weighting};

/// Where a factor adds its residuals: sums of their costs and, if asked for, normal equations.
pub struct Rows<'a> {
    equations: Option<&'a mut NormalEquations>,
    cost: f64,
}

impl<'a> Rows<'a> {
    /// Sums costs alone; derivatives are not asked for.
    pub(super) fn cost_only() -> Self {
        Self { equations: None, cost: 0.0 }
    }

    /// Sums costs, and derivatives in `equations`.
    pub(super) fn linearized(equations: &'a mut NormalEquations) -> Self {
        Self { equations: Some(equations), cost: 0.0 }
    }

    /// The cost so far \[nat\].
    pub(super) fn cost(&self) -> f64 {
        self.cost
    }

    /// Adds a residual; `jacobian`, which writes its derivatives, is called only where they are needed.
    #[inline]
    pub fn add(
        &mut self,
        residual: f64,
        weighting: &Weighting,
        jacobian: impl FnOnce(&mut Row<'_>),
    ) {
        self.cost += weighting.cost(residual);
        if let Some(equations) = self.equations.as_deref_mut() {
            // A bound that holds is no measurement.
            if residual != 0.0 {
                equations.add_degrees(weighting.degrees);
            }
            equations.clear_row();
            let mut row = Row { equations };
            jacobian(&mut row);
            row.add(residual, weighting.weight(residual));
        }
    }

    /// Adds a constant to the cost, of residuals that no state changes \[nat\].
    pub fn add_constant(&mut self, cost: f64) {
        self.cost += cost;
    }
}

/// Derivatives of one residual.
pub struct Row<'a> {
    pub(super) equations: &'a mut NormalEquations,
}

impl Row<'_> {
    /// Writes the derivatives by the parameters of `block`; they are dropped if nobody solves for it.
    ///
    /// # Panics
    /// If there are not as many as the block has parameters, or the state has another number of joints.
    #[inline]
    pub fn block(&mut self, block: Block, derivatives: &[f64]) {
        assert_eq!(derivatives.len(), block.dimension(), "derivatives by {block:?}");
        if let Some(offset) = self.equations.offset(block) {
            self.equations.write_row(offset, derivatives);
        }
    }

    /// Writes the derivatives by the camera, of a residual about what is seen at `pixel` along `ray` (x/z, y/z).
    #[inline]
    pub fn camera(&mut self, pixel: &Vector2<f64>, ray: &Vector2<f64>, derivatives: &[f64]) {
        self.block(Block::Camera, derivatives);
        let Some(warp) = &self.equations.image_warp else { return };
        let first = self.equations.displacements();
        let derivatives = warp.derivatives(pixel, ray, derivatives);
        self.equations.auxiliary_entries.extend(derivatives.map(|(k, d)| (first + k, d)));
    }

    /// Derivatives by the object's pose of a residual that changes by `direction`·v while a point of the object, now at
    /// `point`, moves by v (camera frame).
    #[inline]
    pub fn object_point(&mut self, state: &State, point: &Point3<f64>, direction: &Vector3<f64>) {
        let twist = twist_row(&(point.coords - state.center()), direction);
        self.block(Block::ObjectPose, twist.as_slice());
    }

    /// Derivatives by both poses of a residual that changes by `direction`·v while a point at `point` moves by v away from the hand
    /// with the object: moving the hand by the same twist undoes it.
    #[inline]
    pub fn relative_point(&mut self, state: &State, point: &Point3<f64>, direction: &Vector3<f64>) {
        let object: Vector6<f64> = twist_row(&(point.coords - state.center()), direction);
        self.block(Block::ObjectPose, object.as_slice());
        self.block(Block::HandPose, (-object).as_slice());
    }

    /// Adds ½ `weight` r² of the residual r.
    #[inline]
    fn add(self, residual: f64, weight: f64) {
        let NormalEquations {
            gradient, hessian, by_auxiliary, row, parts, auxiliary_entries, ..
        } = self.equations;
        let (row, size) = (row.as_slice(), row.len());
        for part in parts.iter() {
            for i in part.clone() {
                // Joints elsewhere.
                if row[i] == 0.0 {
                    continue;
                }
                let scaled = weight * row[i];
                gradient[i] += weight * residual * row[i];
                let column = &mut hessian.as_mut_slice()[i * size..(i + 1) * size];
                // What is below the diagonal, whole parts side by side: the rest is its mirror image.
                for part in parts.iter().filter(|part| part.end > i) {
                    let below = part.start.max(i)..part.end;
                    let sums = column[below.clone()].iter_mut();
                    sums.zip(&row[below]).for_each(|(sum, d)| *sum += scaled * d);
                }
            }
        }
        if let Some(auxiliary) = by_auxiliary.as_mut().filter(|_| !auxiliary_entries.is_empty()) {
            let by_blocks = parts.iter().flat_map(|part| part.clone().map(|i| (i, row[i])));
            auxiliary.add_row(auxiliary_entries, by_blocks, residual, weight);
        }
    }
}
