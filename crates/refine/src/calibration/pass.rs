//! Normal equations of a rig, summed over frames.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use nalgebra::{DMatrix, DVector, Isometry3};

use super::information::{Elimination, FrameInformation, FramePlay};
use super::views::Views;

/// Result of visiting a frame.
pub struct Visit {
    pub(super) obj_id: u32,
    pub(super) information: FrameInformation,
    pub(super) disagreement: f64,
    /// By how many times more than is usual the frame disagrees with the rig, if that is so much that it is left out: its pose is wrong, or the
    /// rig was another then.
    pub left_out: Option<f64>,
    /// Whether the frame has a mask; else it was taken for where the object should be.
    pub has_mask: bool,
    /// Object → camera \[m\].
    pub t_cam_object: Isometry3<f64>,
    /// Turn and motion within which another frame shows the same \[rad, m\].
    pub(super) same_view: [f64; 2],
}

/// Normal equations, play and disagreements of the frames of a pass. Sums are reproducible for a given order of frames.
#[derive(Clone, Default)]
pub struct Pass {
    pub(super) sums: CalibrationSums,
    /// By frame that is visited again, with its object's number.
    play: Vec<(u32, FramePlay)>,
    /// By frame, those left out among them.
    pub(super) disagreements: Vec<f64>,
    pub(super) squares: PlaySquares,
    pub(super) views: Views,
}

/// By object: normal equations of the rig's parameters, and then of the object's coefficients.
#[derive(Clone, Default)]
pub(super) struct CalibrationSums(pub(super) BTreeMap<u32, (DMatrix<f64>, DVector<f64>)>);

impl CalibrationSums {
    fn add(&mut self, obj_id: u32, hessian: DMatrix<f64>, gradient: DVector<f64>) {
        match self.0.entry(obj_id) {
            Entry::Vacant(none) => drop(none.insert((hessian, gradient))),
            Entry::Occupied(mut sum) => {
                let (of_hessian, of_gradient) = sum.get_mut();
                *of_hessian += hessian;
                *of_gradient += gradient;
            }
        }
    }

    /// Moves the point of expansion by `change` of the parameters and by `of_objects` of the coefficients of objects.
    pub(super) fn shift(
        &mut self,
        change: &DVector<f64>,
        of_objects: &BTreeMap<u32, DVector<f64>>,
    ) {
        for (id, (hessian, gradient)) in &mut self.0 {
            let mut all = DVector::zeros(gradient.len());
            all.rows_mut(0, change.len()).copy_from(change);
            if let Some(of_object) = of_objects.get(id) {
                all.rows_mut(change.len(), of_object.len()).copy_from(of_object);
            }
            *gradient += &*hessian * all;
        }
    }
}

/// Squares that play is expected to have: mean square of each kind, summed over frames.
#[derive(Clone, Copy, Default)]
pub(super) struct PlaySquares {
    /// Translations \[m²\], rotations \[rad²\] and joints \[rad² or m²\].
    pub(super) sums: [f64; 3],
    pub(super) frames: f64,
}

impl PlaySquares {
    pub(super) fn merge(&mut self, other: &Self) {
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, other)| *sum += other);
        self.frames += other.frames;
    }
}

impl Pass {
    /// Adds what a frame has said, unless it is left out.
    pub fn add(&mut self, visit: Visit) {
        let Visit { obj_id, information, disagreement, left_out, t_cam_object, same_view, .. } =
            visit;
        self.disagreements.push(disagreement);
        if left_out.is_some() {
            return;
        }
        let FrameInformation { hessian, gradient, play } = information;
        self.sums.add(obj_id, hessian, gradient);
        self.views.add(obj_id, &t_cam_object, same_view);
        self.play.push((obj_id, play));
    }

    /// Adds what the frames of `other` have said, but for their play by frame: those within `same_view` \[rad, m\] of each other show the same.
    pub(super) fn merge(&mut self, other: &Self, same_view: [f64; 2]) {
        for (id, (hessian, gradient)) in &other.sums.0 {
            self.sums.add(*id, hessian.clone(), gradient.clone());
        }
        self.views.merge(&other.views, same_view);
        self.squares.merge(&other.squares);
        self.disagreements.extend(&other.disagreements);
    }

    /// Finds the squares of the frames' play if the parameters change so, and have that covariance then.
    pub(super) fn expect_play(
        &mut self,
        change: &DVector<f64>,
        covariance: &DMatrix<f64>,
        objects: &BTreeMap<u32, (Elimination, DMatrix<f64>)>,
    ) {
        self.squares = PlaySquares::default();
        for (id, play) in &self.play {
            let squares = play.expected_squares(change, covariance, objects.get(id));
            if squares.is_empty() {
                continue;
            }
            let joints = squares.rows(6, squares.len() - 6);
            let of_joints = if joints.is_empty() { 0.0 } else { joints.mean() };
            let sums = [squares.rows(0, 3).mean(), squares.rows(3, 3).mean(), of_joints];
            self.squares.merge(&PlaySquares { sums, frames: 1.0 });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_say_the_same_of_parameters_that_have_changed() {
        // Of two parameters, and two coefficients of an object.
        let root = DMatrix::from_fn(4, 4, |r, c| ((3 * r + c * c) as f64).sin());
        let hessian = &root * root.transpose();
        let gradient = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0]);
        let mut sums = CalibrationSums::default();
        sums.add(7, hessian.clone(), gradient.clone());
        let (change, of_object) =
            (DVector::from_vec(vec![0.1, 0.2]), DVector::from_vec(vec![-0.3, 0.4]));
        sums.shift(&change, &BTreeMap::from([(7, of_object)]));
        let all = DVector::from_vec(vec![0.1, 0.2, -0.3, 0.4]);
        // The gradient of g x + x H x / 2 there.
        assert!((&sums.0[&7].1 - (gradient + hessian * all)).amax() < 1e-12);
    }
}
