//! Normal equations of one frame for the parameters of its rig.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::problem::{Block, RIDGE, ScaledCholesky, State};
use crate::rig::Rig;
use crate::scene::SurfaceDeviation;
use crate::strategy::Evidence;

/// Normal equations of the rig's parameters and then of the object's coefficients (three of each node), with all that is the frame's own
/// eliminated: the object's pose, play, and what patches of the surface are off by themselves.
pub(super) struct FrameInformation {
    pub(super) hessian: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
    pub(super) play: FramePlay,
}

/// The play of a frame's hand pose and joints.
#[derive(Clone)]
pub(super) struct FramePlay {
    /// If the parameters do not change, and its derivatives by them.
    at_rest: DVector<f64>,
    by_parameters: DMatrix<f64>,
    variances: DVector<f64>,
}

impl FrameInformation {
    /// Normal equations of `evidence`, about the calibrations `said` that the frame states after correction by `rig`. `field` is the deviation of the
    /// object's surface, `sigmas` are the standard deviations of its pose. `None` if the evidence lacks pose, camera or image warp, or is singular.
    pub(super) fn new(
        evidence: &Evidence,
        said: &State,
        rig: &Rig,
        field: Option<&SurfaceDeviation>,
        sigmas: &[f64],
    ) -> Option<Self> {
        let Evidence { state, equations, patches } = evidence;
        let joints = Block::Joints(state.joints.len());
        // Places of calibrations in the equations, and in the state; of a hand that is not known there are none.
        let (mut calibrations, mut in_state) = (Vec::new(), Vec::new());
        let mut first = 0;
        for block in [Block::HandPose, joints, Block::Camera] {
            if let Some(at) = equations.offset(block) {
                calibrations.extend(at..at + block.dimension());
                in_state.extend(first..first + block.dimension());
            }
            first += block.dimension();
        }
        equations.offset(Block::Camera)?;
        let pose = equations.offset(Block::ObjectPose)?;
        let (_, first_warp) = equations.image_warp()?;
        let (gradient, hessian) = equations.dense();
        let (n, first_patch) = (gradient.len(), equations.dimension());
        // Derivatives of the evidence's parameters by the rig's parameters and the object's coefficients.
        let coefficients = field.map_or(0, |field| 3 * field.count());
        let mut by_shared = DMatrix::zeros(n, rig.len() + coefficients);
        let jacobian = rig.jacobian(said).select_rows(&in_state);
        for (row, at) in jacobian.row_iter().zip(&calibrations) {
            by_shared.view_mut((*at, 0), row.shape()).copy_from(&row);
        }
        for k in 0..n - first_warp {
            by_shared[(first_warp + k, rig.first_warp() + k)] = 1.0;
        }
        if let (Some(patches), Some(field)) = (patches, field) {
            let turn = state.t_cam_object.rotation.to_rotation_matrix();
            for (p, place) in patches.places().iter().enumerate() {
                let features = field.features(&state.t_cam_object.inverse_transform_point(place));
                for (m, feature) in features.iter().enumerate() {
                    let at = (first_patch + 3 * p, rig.len() + 3 * m);
                    let axes = turn.matrix() * *feature;
                    by_shared.fixed_view_mut::<3, 3>(at.0, at.1).copy_from(&axes);
                }
            }
        }
        let in_play = calibrations.len() - Block::Camera.dimension();
        let own: Vec<usize> = (pose..pose + 6)
            .chain(calibrations[..in_play].iter().copied())
            .chain(first_patch..first_warp)
            .collect();
        let mut variances: Vec<f64> = sigmas.iter().map(|sigma| sigma * sigma).collect();
        variances.extend(rig.play.variances(state.joints.len()).take(in_play));
        // Patches there are where there is a field.
        variances.resize(own.len(), field.map_or(1.0, SurfaceDeviation::own_variance));
        // The evidence is linear about its state, not about what the frame says.
        let mut offset = DVector::zeros(n);
        let deviation = state.calibration_deviation(said);
        calibrations.iter().zip(&in_state).for_each(|(at, from)| offset[*at] = deviation[*from]);
        let gradient = gradient - &hessian * offset;
        let by_all = &hessian * &by_shared;
        let mut of_own = hessian.select_rows(&own).select_columns(&own);
        variances.iter().enumerate().for_each(|(k, variance)| of_own[(k, k)] += variance.recip());
        let inverse = ScaledCholesky::new(&of_own, RIDGE)?.inverse();
        let coupling = by_all.select_rows(&own);
        let through = &inverse * &coupling;
        let at_rest = -(&inverse * gradient.select_rows(&own));
        let of_play = sigmas.len();
        Some(Self {
            hessian: by_shared.tr_mul(&by_all) - coupling.tr_mul(&through),
            gradient: by_shared.tr_mul(&gradient) + coupling.tr_mul(&at_rest),
            play: FramePlay {
                at_rest: at_rest.rows(of_play, in_play).into_owned(),
                by_parameters: -through.rows(of_play, in_play),
                variances: inverse.diagonal().rows(of_play, in_play).into_owned(),
            },
        })
    }

    /// How much lower the frame's cost would be with parameters of its own, `prior` being their inverse variances about those that the rig has:
    /// over what that would be by noise alone. The rig's are true, or have the errors of `covariance` if the frame has no part in them.
    pub(super) fn disagreement(
        &self,
        prior: &DVector<f64>,
        covariance: Option<&DMatrix<f64>>,
    ) -> Option<f64> {
        // Of the rig alone, the object's coefficients being what they may be beforehand.
        let n = prior.len();
        let coefficients = vec![0.0; self.gradient.len() - n];
        let object = Elimination::new(&self.hessian, &self.gradient, &coefficients)?;
        let hessian = self.hessian.view((0, 0), (n, n)) + object.hessian;
        let gradient = self.gradient.rows(0, n) + object.gradient;
        let factor = (&hessian + DMatrix::from_diagonal(prior)).cholesky()?;
        let mut noise = hessian.clone();
        if let Some(covariance) = covariance {
            noise += &hessian * covariance * &hessian;
        }
        let degrees = factor.solve(&noise).trace();
        let squared = gradient.dot(&factor.solve(&gradient));
        // Of a frame that says nothing, both are zero.
        Some(squared / degrees.max(1e-9)).filter(|ratio| ratio.is_finite())
    }
}

impl FramePlay {
    /// The squares that are expected of hand pose and joints if the parameters change so, and have that covariance then; of those of the object,
    /// if it has any, `object` says how they depend on the others, with their covariance if these are known.
    pub(super) fn expected_squares(
        &self,
        change: &DVector<f64>,
        covariance: &DMatrix<f64>,
        object: Option<&(Elimination, DMatrix<f64>)>,
    ) -> DVector<f64> {
        let n = change.len();
        let mut by_parameters = self.by_parameters.columns(0, n).into_owned();
        let mut play = self.at_rest.clone();
        let mut variances = self.variances.clone();
        if let Some((object, of_object)) = object {
            let by_object = self.by_parameters.columns(n, object.at_rest.len());
            by_parameters += by_object * &object.by_parameters;
            play += by_object * &object.at_rest;
            variances += (by_object * of_object).component_mul(&by_object).column_sum();
        }
        play += &by_parameters * change;
        variances += (&by_parameters * covariance).component_mul(&by_parameters).column_sum();
        play.component_mul(&play) + variances
    }
}

/// An object's coefficients, eliminated from normal equations.
pub(super) struct Elimination {
    /// Change of the rig parameters' normal equations by the elimination (Schur complement).
    pub(super) hessian: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// Change of the coefficients if the parameters do not change, and its derivatives by them.
    pub(super) at_rest: DVector<f64>,
    pub(super) by_parameters: DMatrix<f64>,
}

impl Elimination {
    /// Elimination of the object's coefficients, which follow the rig's parameters in the equations. Their values are `coefficients`, their prior is
    /// N(0, I). `None` if the equations are singular.
    pub(super) fn new(
        hessian: &DMatrix<f64>,
        gradient: &DVector<f64>,
        coefficients: &[f64],
    ) -> Option<Self> {
        let m = coefficients.len();
        let n = gradient.len() - m;
        let own = hessian.view((n, n), (m, m)) + DMatrix::identity(m, m);
        let coupling = hessian.view((n, 0), (m, n));
        let factor = own.cholesky()?;
        let pull = gradient.rows(n, m) + DVector::from_column_slice(coefficients);
        let (at_rest, by_parameters) = (-factor.solve(&pull), -factor.solve(&coupling));
        Some(Self {
            hessian: coupling.tr_mul(&by_parameters),
            gradient: coupling.tr_mul(&at_rest),
            factor,
            at_rest,
            by_parameters,
        })
    }

    /// Covariance of the coefficients if the parameters are known.
    pub(super) fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::*;
    use crate::calibration::{Calibrator, CalibratorSettings};
    use crate::factor::{
        FreeSpaceFactor, FreeSpaceSettings, HandDepthFactor, HandDepthSettings, PointToPlaneFactor,
        PointToPlaneSettings,
    };
    use crate::problem::{DepthField, Factor, ImageWarp, NormalEquations, RADIAL};
    use crate::scene::{Frame, PreparedFrame, default_scene};

    /// Depth that is off by a smooth field is what a rig corrects, so its derivatives are those of a factor's cost by that correction.
    #[test]
    fn derivatives_by_depths_field_match_differences() {
        let scene = default_scene(1).unwrap();
        let settings = CalibratorSettings::default();
        let calibrator = Calibrator::new(16, (640, 480), BTreeMap::new(), settings).unwrap();
        let warp = Arc::new(ImageWarp { depth: DepthField::new(640, 480, 4) });
        let factors_of = |observation: &Frame| {
            let frame = PreparedFrame::new(observation, &scene.object).unwrap();
            let mut state = State::new(&frame, &scene.truth).unwrap();
            // Off, so that costs have slopes.
            state.t_cam_object.translation.z += 1e-3;
            state.t_cam_hand.translation.z += 1e-3;
            let depth = PointToPlaneFactor::new(&frame, &PointToPlaneSettings::default()).unwrap();
            let hand = HandDepthFactor::new(&frame, 500, &HandDepthSettings::default()).unwrap();
            let free = FreeSpaceFactor::new(&frame, &FreeSpaceSettings::default());
            (state, [Box::new(depth) as Box<dyn Factor>, Box::new(hand), Box::new(free)])
        };
        let (state, factors) = factors_of(&scene.frame);
        for (f, factor) in factors.iter().enumerate() {
            let blocks = [Block::ObjectPose, Block::Camera];
            let mut equations = NormalEquations::new(&blocks).with_image_warp(Arc::clone(&warp));
            factor.linearize(&state, &mut equations);
            let first = equations.image_warp().unwrap().1 + RADIAL;
            let (gradient, _) = equations.dense();
            let step = 2e-6;
            for k in [16, 17, 23, 24, 25] {
                let cost = |sign: f64| {
                    let mut rig = calibrator.rig().clone();
                    rig.depth_offsets[k] = sign * step;
                    let observation = rig.corrected(&scene.frame).unwrap();
                    let (state, factors) = factors_of(&observation);
                    factors[f].cost(&state)
                };
                let difference = (cost(1.0) - cost(-1.0)) / (2.0 * step);
                let found = gradient[first + k];
                let error = (found - difference).abs() / difference.abs().max(500.0);
                assert!(error < 0.03, "{} {k}: {found} {difference}", factor.name());
            }
            // A field that is the same everywhere is the bias of the camera.
            let sum: f64 = gradient.rows(first, warp.depth.len()).sum();
            let bias = gradient[equations.offset(Block::Camera).unwrap() + 1];
            assert!((sum - bias).abs() < 1e-9 * bias.abs(), "{sum} {bias}");
        }
    }

    /// Derivatives by radial distortion equal those by a shift of the principal point, in a small window.
    #[test]
    fn derivatives_by_distortion_are_those_of_a_shift_there() {
        let scene = default_scene(1).unwrap();
        let warp = Arc::new(ImageWarp { depth: DepthField::new(640, 480, 4) });
        let mut observation = scene.frame.clone();
        // Off the image's center, where distortion is something.
        observation.camera.cx -= 0.3 * observation.camera.fx;
        let aside = 0.3 * scene.truth.translation.z;
        observation.hand.as_mut().unwrap().t_cam_hand.translation.x += aside;
        let mut state = {
            let frame = PreparedFrame::new(&observation, &scene.object).unwrap();
            State::new(&frame, &scene.truth).unwrap()
        };
        state.t_cam_object.translation.x += aside;
        let links = scene.hand.posed(&state.t_cam_hand, &state.joints).unwrap();
        for factor in ["point-to-plane", "hand-depth"] {
            let on_object = factor == "point-to-plane";
            let is_there = |at: &usize| {
                let ray = observation.camera.ray((at % 640) as f64, (at / 640) as f64);
                let depth = f64::from(observation.depth.pixels()[*at]);
                let near = || links.signed_distance(&(ray.xy() * depth).push(depth).into(), 1.0);
                let masked = observation.mask.pixels()[*at];
                if on_object { masked } else { !masked && near().is_some_and(|d| d < 3e-3) }
            };
            let all: Vec<usize> = (0..640 * 480).filter(is_there).collect();
            let center = all[all.len() / 2];
            let mut window = observation.clone();
            for (at, z) in window.depth.pixels_mut().iter_mut().enumerate() {
                let apart = [at % 640, at / 640].map(|v| v as f64);
                let [x, y] = [apart[0] - (center % 640) as f64, apart[1] - (center / 640) as f64];
                if x.abs().max(y.abs()) > 8.0 {
                    *z = 0.0;
                }
            }
            let frame = PreparedFrame::new(&window, &scene.object).unwrap();
            let factor: Box<dyn Factor> = if on_object {
                Box::new(PointToPlaneFactor::new(&frame, &PointToPlaneSettings::default()).unwrap())
            } else {
                Box::new(HandDepthFactor::new(&frame, 500, &HandDepthSettings::default()).unwrap())
            };
            let blocks = [Block::ObjectPose, Block::Camera];
            let mut equations = NormalEquations::new(&blocks).with_image_warp(Arc::clone(&warp));
            factor.linearize(&state, &mut equations);
            let (camera, first) =
                (equations.offset(Block::Camera).unwrap(), equations.image_warp().unwrap().1);
            let ray = window.camera.ray((center % 640) as f64, (center / 640) as f64).xy();
            let (_, hessian) = equations.dense();
            let by_shift = |row: usize| {
                ray.x * hessian[(row, camera + 2)] + ray.y * hessian[(row, camera + 3)]
            };
            let along = ray.x * by_shift(camera + 2) + ray.y * by_shift(camera + 3);
            for k in 0..RADIAL {
                let size = ray.norm_squared().powi(k as i32 + 1);
                let pairs = [(first + k, size * along), (camera + 2, by_shift(camera + 2))];
                for (row, by_row) in pairs {
                    let (found, expected) = (hessian[(row, first + k)], size * by_row);
                    let off = (found / expected - 1.0).abs();
                    assert!(off < 0.25, "{} {k}: {found}, not {expected}", factor.name());
                }
            }
        }
    }
}
