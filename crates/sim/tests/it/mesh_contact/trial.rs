//! Values and derivatives of a scene, at defaults and converged.

use std::ops::Range;
use std::time::Instant;

use nalgebra::Vector3;
use prehend_autodiff::{Fwd, Scalar};
use prehend_sim::{Adaptive, Integrator, SimulationError, State, TimeSteps};

use super::scenes::Scene;

/// Tight enough to take differences of.
const CONVERGED: Adaptive =
    Adaptive { tolerance: 1e-11, sensitivity_tolerance: 1e-8, max_substeps: 10_000_000 };

/// Inputs by which a scene is differentiated, in this order: pose and velocity of the moving body along the directions of
/// [`BodyState::tangent`], the logarithms of [`LAW`], and a dimension \[m\].
const INPUTS: usize = 16;
const LAW: [&str; 3] = ["stiffness", "damping", "friction"];
/// Groups of inputs: their names and ranges, and a change along which the end is nearly linear.
const GROUPS: [(&str, Range<usize>, f64); 6] = [
    ("place", 0..3, 2e-6),
    ("orientation", 3..6, 1e-4),
    ("velocity", 6..9, 1e-4),
    ("angular velocity", 9..12, 1e-3),
    ("law", 12..15, 1e-3),
    ("shape", 15..16, 1e-6),
];
/// The direction in which the inputs of a group change.
const DIRECTION: [f64; 3] = [0.8, -0.5, 0.3];

impl Scene {
    /// Where the mark is in the end \[m\], with the inputs changed.
    fn end<S: Scalar>(
        &self,
        integrator: &impl Integrator,
        changes: &[S; INPUTS],
    ) -> Result<Vector3<S>, SimulationError> {
        let mut model = self.model.cast::<S>();
        let mut start: State<S> = self.start.cast();
        let tangent = std::array::from_fn(|i| changes[i]);
        start[self.moving] = self.start[self.moving].retract(&tangent);
        for (name, change) in LAW.into_iter().zip(&changes[12..15]) {
            for pair in &mut model.contacts {
                *pair.param_mut(name)? *= change.exp();
            }
        }
        if let Some(name) = self.dimension {
            let body = &mut model.bodies[self.moving];
            let dimensions = body.shape().map(|shape| shape.dimensions()).unwrap_or_default();
            let (_, value) = dimensions.into_iter().find(|(own, _)| own == name).unwrap();
            body.set_dimension(name, value + changes[15]).unwrap();
        }
        let once = TimeSteps { dt: self.time, steps: 1 };
        let end = model.simulate_with(integrator, &start, once)?.states;
        let pose = end[self.moving].pose;
        Ok(pose.translation.vector + pose.rotation * self.mark.map(S::constant))
    }

    /// Value and derivatives as they come.
    fn derivatives(&self) -> Result<Vector3<Fwd<INPUTS>>, SimulationError> {
        self.end(&Adaptive::default(), &Fwd::variables([0.0; INPUTS]))
    }

    /// The central difference of converged runs along a group of inputs.
    fn difference(&self, inputs: Range<usize>, h: f64) -> Result<Vector3<f64>, SimulationError> {
        let at = |h: f64| {
            let mut changes = [0.0; INPUTS];
            changes[inputs.clone()].iter_mut().zip(DIRECTION).for_each(|(x, part)| *x = h * part);
            self.end(&CONVERGED, &changes)
        };
        Ok((at(h)? - at(-h)?) / (2.0 * h))
    }
}

/// Values and derivatives at defaults beside those of converged runs.
pub(crate) fn check(scene: &Scene) {
    let began = Instant::now();
    let value = scene.end(&Adaptive::default(), &[0.0; INPUTS]).unwrap();
    let taken = began.elapsed().as_secs_f64();
    let converged = scene.end(&CONVERGED, &[0.0; INPUTS]).unwrap();
    let off = (value - converged).norm();
    println!("{}: in {taken:.2} s, off by {:.1e} m", scene.name, off);
    let began = Instant::now();
    let end = scene.derivatives().unwrap();
    println!("derivatives in {:.2} s", began.elapsed().as_secs_f64());
    for (name, inputs, step) in GROUPS {
        if name == "shape" && scene.dimension.is_none() {
            continue;
        }
        let difference = scene.difference(inputs.clone(), step).unwrap();
        let along = |x: Fwd<INPUTS>| -> f64 {
            x.derivative[inputs.clone()]
                .iter()
                .zip(DIRECTION)
                .map(|(slope, part)| slope * part)
                .sum()
        };
        let size = difference.norm();
        let off = 100.0 * (end.map(along) - difference).norm() / size;
        println!("by {name}: {size:.2e}, off by {off:.4} %");
        assert!(off < 1.0, "{} by {name}: {off} %", scene.name);
    }
    assert!(off < 1e-5, "{}: {off} m", scene.name);
}
