//! Rollouts as functions of arrays.

use numpy::PyUntypedArrayMethods;
use prehend_sim::{RolloutFunction, RolloutGradient, RolloutInputs, SimulationError};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::{Array, Numbers, array, in_order};
use crate::error::wrong;
use crate::integrator::AnyIntegrator;
use crate::python_law::LawFailure;
use crate::threads;

/// Numbers of a state.
pub(crate) const STATE: usize = 13;

/// A rollout of a model as a function of its initial states, of some parameters, and of controls. Made by `Model.rollout`.
///
/// `rollout(states, parameters=None, controls=None, *, end=False)` gives the states at 0, dt, …, steps·dt, of shape (steps + 1, rows, 13), or those at the
/// end alone, (rows, 13). `parameters` are as many as their names, those of the model if left out; `controls` are (steps, names).
///
/// A row of states is position [m], unit quaternion (x, y, z, w), velocity [m/s] and angular velocity [rad/s] of the center of mass, world frame; of a link or
/// a fixed body, of the origin of its frame. Rows are bodies, then joints and contacts with bristles; those of links follow from their joints, whose columns
/// `Model.joint_row` tells. With one more dimension in front, inputs are a batch: those without are the same for all, and worlds are simulated side by
/// side on all cores.
#[pyclass(frozen, module = "prehend")]
pub(crate) struct Rollout {
    function: RolloutFunction<AnyIntegrator>,
    /// Values of the parameters, where none are given.
    values: Vec<f64>,
    /// Names of the parameters.
    #[pyo3(get)]
    parameters: Vec<String>,
    /// Names of the controls.
    #[pyo3(get)]
    controls: Vec<String>,
}

/// The numbers of all worlds of a batch, or of one for all.
struct Input<'a> {
    numbers: std::borrow::Cow<'a, [f64]>,
    /// Numbers of a world.
    width: usize,
    batch: Option<usize>,
    shape: Vec<usize>,
}

impl<'a> Input<'a> {
    /// Whose shape without a batch is `expected`; a length of None may be any.
    fn new(array: &'a Numbers<'_>, expected: &[Option<usize>], what: &str) -> PyResult<Self> {
        let shape = array.shape();
        let fits = |own: &[usize]| {
            own.len() == expected.len()
                && own.iter().zip(expected).all(|(own, wanted)| wanted.is_none_or(|w| w == *own))
        };
        let batch = match shape {
            own if fits(own) => None,
            [batch, own @ ..] if fits(own) => Some(*batch),
            _ => {
                let wanted: Vec<String> = expected
                    .iter()
                    .map(|n| n.map_or_else(|| "n".to_owned(), |n| n.to_string()))
                    .collect();
                let text = format!(
                    "{what}: an array of {} is expected, or a batch of them, not {shape:?}",
                    wanted.join(" × ")
                );
                return Err(wrong(text));
            }
        };
        let shape = shape.to_vec();
        let own = if batch.is_some() { &shape[1..] } else { &shape };
        let width = own.iter().product();
        Ok(Self { numbers: in_order(array), width, batch, shape })
    }

    fn of(&self, world: usize) -> &[f64] {
        let start = if self.batch.is_some() { world * self.width } else { 0 };
        &self.numbers[start..][..self.width]
    }

    /// Derivatives by this input: of each world, or their sum.
    fn gathered<'py>(&self, py: Python<'py>, each: Vec<&[f64]>) -> PyResult<Array<'py>> {
        let mut all = vec![0.0; self.numbers.len()];
        for (world, own) in each.into_iter().enumerate() {
            let start = if self.batch.is_some() { world * self.width } else { 0 };
            all[start..][..self.width].iter_mut().zip(own).for_each(|(sum, x)| *sum += x);
        }
        array(py, all, &self.shape)
    }
}

/// All inputs.
struct Inputs<'a> {
    states: Input<'a>,
    parameters: Input<'a>,
    controls: Input<'a>,
    batch: Option<usize>,
}

impl Inputs<'_> {
    fn of(&self, world: usize) -> RolloutInputs<'_> {
        RolloutInputs {
            states: self.states.of(world),
            parameters: self.parameters.of(world),
            controls: self.controls.of(world),
        }
    }

    fn worlds(&self) -> usize {
        self.batch.unwrap_or(1)
    }

    /// The shape of a batch of what has the shape `own`.
    fn shape(&self, own: &[usize]) -> Vec<usize> {
        self.batch.iter().chain(own).copied().collect()
    }
}

impl Rollout {
    pub(crate) fn new(
        function: RolloutFunction<AnyIntegrator>,
        parameters: Vec<String>,
        controls: Vec<String>,
        values: Vec<f64>,
    ) -> Self {
        Self { function, values, parameters, controls }
    }

    fn steps(&self) -> usize {
        self.function.time_steps().steps
    }

    fn rows(&self) -> usize {
        self.function.width() / STATE
    }

    /// The inputs, checked; `given` are those that Python gave.
    fn inputs<'a>(
        &'a self,
        states: &'a Numbers<'_>,
        parameters: Option<&'a Numbers<'_>>,
        controls: Option<&'a Numbers<'_>>,
    ) -> PyResult<Inputs<'a>> {
        let states = Input::new(states, &[None, Some(STATE)], "states")?;
        let own = |numbers: &'a [f64], shape: &[usize]| Input {
            numbers: numbers.into(),
            width: numbers.len(),
            batch: None,
            shape: shape.to_vec(),
        };
        let [_, count] = self.function.inputs();
        let parameters = match parameters {
            Some(array) => Input::new(array, &[Some(self.values.len())], "parameters")?,
            None => own(&self.values, &[self.values.len()]),
        };
        let controls = match controls {
            Some(array) => Input::new(array, &[Some(self.steps()), Some(count)], "controls")?,
            None if count == 0 => own(&[], &[self.steps(), 0]),
            None => {
                return Err(wrong(format!("controls are missing: {}", self.controls.join(", "))));
            }
        };
        let mut batch = None;
        for (what, own) in
            [("states", &states), ("parameters", &parameters), ("controls", &controls)]
        {
            match (batch, own.batch) {
                (Some(all), Some(own)) if all != own => {
                    return Err(wrong(format!(
                        "{what}: a batch of {own}, but others are of {all}"
                    )));
                }
                (_, Some(own)) => batch = Some(own),
                _ => {}
            }
        }
        Ok(Inputs { states, parameters, controls, batch })
    }

    /// Results of `compute` for all worlds, in parallel, while Python's other threads run on.
    fn each<T: Send>(
        &self,
        py: Python<'_>,
        inputs: &Inputs<'_>,
        compute: impl Fn(usize) -> Result<T, SimulationError> + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let named = |(world, result): (usize, Result<T, SimulationError>)| {
            result.map_err(|error| match inputs.batch {
                Some(_) => wrong(format!("world {world}: {error}")),
                None => wrong(error.to_string()),
            })
        };
        let failure = LawFailure::watch();
        let all = || (0..inputs.worlds()).into_par_iter().map(&compute).collect();
        let results: Vec<Result<T, SimulationError>> = threads::detached(py, all)?;
        let results: PyResult<Vec<T>> = results.into_iter().enumerate().map(named).collect();
        match (results, failure.taken()) {
            (_, Some(of_law)) => Err(of_law),
            (results, None) => results,
        }
    }
}

#[pymethods]
impl Rollout {
    /// The states at 0, dt, …, steps·dt, of shape (steps + 1, rows, 13), or those at the end alone, (rows, 13); of a batch with its length in front.
    #[pyo3(signature = (states, parameters=None, controls=None, *, end=false))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        states: Numbers<'py>,
        parameters: Option<Numbers<'py>>,
        controls: Option<Numbers<'py>>,
        end: bool,
    ) -> PyResult<Array<'py>> {
        let inputs = self.inputs(&states, parameters.as_ref(), controls.as_ref())?;
        let runs = self.each(py, &inputs, |world| match end {
            true => self.function.end(inputs.of(world)),
            false => self.function.evaluate(inputs.of(world)),
        })?;
        let own = [self.steps() + 1, self.rows(), STATE];
        array(py, joined(runs), &inputs.shape(if end { &own[1..] } else { &own }))
    }

    /// The products of `adjoints` and the Jacobian at these inputs, by states, parameters and controls. `run` is what calling gave for the same
    /// inputs; adjoints have its shape, or that of its end.
    #[pyo3(signature = (run, adjoints, states, parameters=None, controls=None))]
    fn pullback<'py>(
        &self,
        py: Python<'py>,
        run: Numbers<'py>,
        adjoints: Numbers<'py>,
        states: Numbers<'py>,
        parameters: Option<Numbers<'py>>,
        controls: Option<Numbers<'py>>,
    ) -> PyResult<(Array<'py>, Array<'py>, Array<'py>)> {
        let inputs = self.inputs(&states, parameters.as_ref(), controls.as_ref())?;
        let own = [self.steps() + 1, self.rows(), STATE];
        let (whole, end) = (inputs.shape(&own), inputs.shape(&own[1..]));
        if run.shape() != whole {
            return Err(wrong(format!(
                "run: an array of {whole:?} is expected, not {:?}",
                run.shape()
            )));
        }
        let at_end = adjoints.shape() == end;
        if !at_end && adjoints.shape() != whole {
            let text = format!(
                "adjoints: an array of {whole:?} or {end:?} is expected, not {:?}",
                adjoints.shape()
            );
            return Err(wrong(text));
        }
        let width = self.function.width();
        let whole = width * (self.steps() + 1);
        let (run, adjoints) = (in_order(&run), in_order(&adjoints));
        let gradients: Vec<RolloutGradient> = self.each(py, &inputs, |world| {
            let run = &run[world * whole..][..whole];
            match at_end {
                false => {
                    self.function.vjp(inputs.of(world), run, &adjoints[world * whole..][..whole])
                }
                true => {
                    let mut all = vec![0.0; whole - width];
                    all.extend_from_slice(&adjoints[world * width..][..width]);
                    self.function.vjp(inputs.of(world), run, &all)
                }
            }
        })?;
        Ok((
            inputs.states.gathered(py, gradients.iter().map(|g| &*g.states).collect())?,
            inputs.parameters.gathered(py, gradients.iter().map(|g| &*g.parameters).collect())?,
            inputs.controls.gathered(py, gradients.iter().map(|g| &*g.controls).collect())?,
        ))
    }

    /// The run and its derivative along tangents, each None for zero, by forward mode.
    #[pyo3(signature = (inputs, tangents))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        inputs: (Numbers<'py>, Option<Numbers<'py>>, Option<Numbers<'py>>),
        tangents: (Option<Numbers<'py>>, Option<Numbers<'py>>, Option<Numbers<'py>>),
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let at = self.inputs(&inputs.0, inputs.1.as_ref(), inputs.2.as_ref())?;
        let inputs = [&at.states, &at.parameters, &at.controls];
        let given = [&tangents.0, &tangents.1, &tangents.2];
        let names = ["states", "parameters", "controls"];
        let mut along = Vec::with_capacity(3);
        for ((input, given), name) in inputs.into_iter().zip(given).zip(names) {
            along.push(match given {
                None => vec![0.0; input.numbers.len()],
                Some(array) if array.shape() == input.shape => in_order(array).into_owned(),
                Some(array) => {
                    let (own, wanted) = (array.shape(), &input.shape);
                    let text = format!(
                        "tangents of {name}: an array of {wanted:?} is expected, not {own:?}"
                    );
                    return Err(wrong(text));
                }
            });
        }
        let part = |k: usize, world: usize| {
            let input = inputs[k];
            let start = if input.batch.is_some() { world * input.width } else { 0 };
            &along[k][start..][..input.width]
        };
        let both = self.each(py, &at, |world| {
            let [states, parameters, controls] = [0, 1, 2].map(|k| part(k, world));
            self.function.jvp(at.of(world), RolloutInputs { states, parameters, controls })
        })?;
        let (values, slopes): (Vec<_>, Vec<_>) = both.into_iter().map(|[a, b]| (a, b)).unzip();
        let shape = at.shape(&[self.steps() + 1, self.rows(), STATE]);
        Ok((array(py, joined(values), &shape)?, array(py, joined(slopes), &shape)?))
    }

    /// The values of the parameters where none are given.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        array(py, self.values.clone(), &[self.values.len()])
    }

    /// Number of steps.
    #[getter(steps)]
    fn number_of_steps(&self) -> usize {
        self.steps()
    }

    /// Time step [s].
    #[getter]
    fn dt(&self) -> f64 {
        self.function.time_steps().dt
    }

    /// Rows of states: bodies, joints and contacts with bristles.
    #[getter(rows)]
    fn number_of_rows(&self) -> usize {
        self.rows()
    }

    fn __repr__(&self) -> String {
        let (steps, dt) = (self.steps(), self.dt());
        format!(
            "Rollout({steps} steps of {dt} s, parameters={:?}, controls={:?})",
            self.parameters, self.controls
        )
    }
}

/// One after the other, without a copy of a single one.
fn joined(mut runs: Vec<Vec<f64>>) -> Vec<f64> {
    match runs.len() {
        1 => runs.pop().unwrap_or_default(),
        _ => runs.concat(),
    }
}
