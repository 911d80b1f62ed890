//! Rollouts as functions of arrays.

use std::collections::BTreeMap;

use numpy::PyUntypedArrayMethods;
use prehend_sim::{RolloutFunction, RolloutGradient, RolloutInputs, SimulationError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::arrays::{Array, Numbers, array, in_order};
use crate::batch::{Input, batch_of, joined, with_batch};
use crate::error::wrong;
use crate::integrator::AnyIntegrator;
use crate::layout::{
    FIELDS, RUN, StateLayout, gradient_of, run_arrays, run_of, state_arrays, state_of,
};
use crate::python_law::LawFailure;
use crate::threads;

/// A rollout of a model as a function of its initial state, of some parameters, and of controls. Made by `Model.rollout`.
///
/// `rollout(state, parameters=None, controls=None, *, end=False)` gives a `Run`: its states at 0, dt, …, steps·dt, whose arrays have steps + 1 in front,
/// and poses and velocities of all `bodies`, (steps + 1, bodies, 13); with `end` those at the end alone. `parameters` are as many as their names, or
/// a dict of some of them by name, those of the model if left out; `controls` are (steps, names).
///
/// With one more dimension in front, inputs are a batch: those without are the same for all, and worlds are simulated side by side on all cores.
#[pyclass(frozen, module = "prehend")]
pub(crate) struct Rollout {
    function: RolloutFunction<AnyIntegrator>,
    layout: StateLayout,
    /// Values of the parameters, where none are given.
    values: Vec<f64>,
    /// Names of the parameters.
    #[pyo3(get)]
    parameters: Vec<String>,
    /// Names of the controls.
    #[pyo3(get)]
    controls: Vec<String>,
}

/// All parameters, or some by name.
#[derive(FromPyObject)]
enum Parameters<'py> {
    Named(BTreeMap<String, Numbers<'py>>),
    All(Numbers<'py>),
}

/// Inputs from Python: a state's arrays, parameters and controls.
type Given<'py> = ([Option<Numbers<'py>>; 4], Option<Parameters<'py>>, Option<Numbers<'py>>);

/// An array with its name and its shape without a batch.
type Expected<'a, 'py> = (&'a str, Vec<usize>, Option<&'a Numbers<'py>>);

/// All inputs: those of the state, parameters together or each by itself, controls.
struct Inputs<'a> {
    all: Vec<Input<'a>>,
    batch: Option<usize>,
}

/// Inputs of a world.
struct Point<'a> {
    states: Vec<f64>,
    parameters: Vec<f64>,
    controls: &'a [f64],
}

impl Point<'_> {
    fn inputs(&self) -> RolloutInputs<'_> {
        RolloutInputs {
            states: &self.states,
            parameters: &self.parameters,
            controls: self.controls,
        }
    }
}

impl Rollout {
    pub(crate) fn new(
        function: RolloutFunction<AnyIntegrator>,
        parameters: Vec<String>,
        controls: Vec<String>,
        values: Vec<f64>,
    ) -> Self {
        let layout = StateLayout::new(function.model());
        Self { function, layout, values, parameters, controls }
    }

    fn steps(&self) -> usize {
        self.function.time_steps().steps
    }

    /// Arrays of parameters and controls.
    fn others<'a, 'py>(
        &'a self,
        parameters: Option<&'a Parameters<'py>>,
        controls: Option<&'a Numbers<'py>>,
    ) -> PyResult<Vec<Expected<'a, 'py>>> {
        let all = |own| vec![("parameters", vec![self.values.len()], own)];
        let mut others = match parameters {
            Some(Parameters::Named(named)) => {
                if let Some(name) = named.keys().find(|name| !self.parameters.contains(name)) {
                    return Err(wrong(format!("the rollout has no parameter '{name}'")));
                }
                let own = self.parameters.iter();
                own.map(|name| (name.as_str(), Vec::new(), named.get(name))).collect()
            }
            Some(Parameters::All(own)) => all(Some(own)),
            None => all(None),
        };
        others.push(("controls", vec![self.steps(), self.controls.len()], controls));
        Ok(others)
    }

    /// The inputs, checked.
    fn inputs<'a>(&'a self, (state, parameters, controls): &'a Given<'_>) -> PyResult<Inputs<'a>> {
        if controls.is_none() && !self.controls.is_empty() {
            return Err(wrong(format!("controls are missing: {}", self.controls.join(", "))));
        }
        let mut all = self.layout.inputs(state)?;
        let others = self.others(parameters.as_ref(), controls.as_ref())?;
        let mut values = &*self.values;
        for (name, shape, array) in &others {
            let own;
            // The values end before the controls, which are given or none.
            (own, values) = values.split_at(shape.iter().product::<usize>().min(values.len()));
            all.push(Input::or(*array, own, shape, name)?);
        }
        let names = FIELDS.into_iter().chain(others.iter().map(|(name, ..)| *name));
        let batch = batch_of(names.zip(&all))?;
        Ok(Inputs { all, batch })
    }

    /// The inputs of a world in `parts`, its other states as `states` have them.
    fn point<'a>(&self, mut states: Vec<f64>, parts: &[&'a [f64]]) -> Point<'a> {
        let (fields, others) = parts.split_at(FIELDS.len());
        for (field, numbers) in fields.iter().enumerate() {
            self.layout.write(field, &mut states, numbers, |to, x| *to = x);
        }
        let (parameters, controls) = others.split_at(others.len() - 1);
        Point { states, parameters: parameters.concat(), controls: controls[0] }
    }

    /// Results of `compute` for all worlds, in parallel, while Python's other threads run on.
    fn each<T: Send>(
        &self,
        py: Python<'_>,
        inputs: &Inputs<'_>,
        compute: impl Fn(usize, &Point<'_>) -> Result<T, SimulationError> + Sync + Send,
    ) -> PyResult<Vec<T>> {
        let named = |(world, result): (usize, Result<T, SimulationError>)| {
            result.map_err(|error| match inputs.batch {
                Some(_) => wrong(format!("world {world}: {error}")),
                None => wrong(error.to_string()),
            })
        };
        let failure = LawFailure::watch();
        let one = |world: usize| {
            let parts: Vec<&[f64]> = inputs.all.iter().map(|input| input.of(world)).collect();
            compute(world, &self.point(self.layout.rows.clone(), &parts))
        };
        let all = || (0..inputs.batch.unwrap_or(1)).into_par_iter().map(one).collect();
        let results: Vec<Result<T, SimulationError>> = threads::detached(py, all)?;
        let results: PyResult<Vec<T>> = results.into_iter().enumerate().map(named).collect();
        match (results, failure.taken()) {
            (_, Some(of_law)) => Err(of_law),
            (results, None) => results,
        }
    }

    /// Those at all times of an array of a run, or those at one.
    fn shape(&self, field: usize, end: bool) -> Vec<usize> {
        let steps = (!end).then_some(self.steps() + 1);
        with_batch(steps, &self.layout.shape(field))
    }

    /// The arrays of a run of a world, whose rows are these.
    fn read(&self, rows: &[f64]) -> [Vec<f64>; 5] {
        std::array::from_fn(|field| self.layout.read(field, rows))
    }

    /// A `Run` of the arrays of all worlds.
    fn run<'py>(
        &self,
        py: Python<'py>,
        worlds: Vec<[Vec<f64>; 5]>,
        batch: Option<usize>,
        end: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut fields: [Vec<Vec<f64>>; 5] = Default::default();
        for world in worlds {
            fields.iter_mut().zip(world).for_each(|(all, own)| all.push(own));
        }
        let mut field = 0;
        let [q, v, act, fixed, bodies] = fields.map(|own| {
            let shape = with_batch(batch, &self.shape(field, end));
            field += 1;
            array(py, joined(own), &shape)
        });
        run_of(py, [q?, v?, act?, fixed?, bodies?])
    }
}

#[pymethods]
impl Rollout {
    /// The `Run`: states at 0, dt, …, steps·dt, or at the end alone; of a batch with its length in front.
    #[pyo3(signature = (state, parameters=None, controls=None, *, end=false))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        state: &Bound<'py, PyAny>,
        parameters: Option<Parameters<'py>>,
        controls: Option<Numbers<'py>>,
        end: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = (state_arrays(state)?, parameters, controls);
        let inputs = self.inputs(&given)?;
        let runs = self.each(py, &inputs, |_, at| match end {
            true => Ok(self.read(&self.function.end(at.inputs())?)),
            false => Ok(self.read(&self.function.evaluate(at.inputs())?)),
        })?;
        self.run(py, runs, inputs.batch, end)
    }

    /// The `Gradient` of a number by all inputs. `run` is what calling gave for the same inputs; `adjoints`, derivatives by it in a `Run` of the same
    /// arrays, or of those at the end, are zero where they are None.
    #[pyo3(signature = (run, adjoints, state, parameters=None, controls=None))]
    fn pullback<'py>(
        &self,
        py: Python<'py>,
        run: &Bound<'py, PyAny>,
        adjoints: &Bound<'py, PyAny>,
        state: &Bound<'py, PyAny>,
        parameters: Option<Parameters<'py>>,
        controls: Option<Numbers<'py>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = (state_arrays(state)?, parameters, controls);
        let inputs = self.inputs(&given)?;
        let (run, adjoints) = (run_arrays(run)?, run_arrays(adjoints)?);
        let mut numbers = Vec::with_capacity(2 * RUN.len());
        for (what, arrays) in [("run", &run), ("adjoints", &adjoints)] {
            for (field, (name, own)) in RUN.iter().zip(arrays).enumerate() {
                let [whole, end] =
                    [false, true].map(|end| with_batch(inputs.batch, &self.shape(field, end)));
                let is_adjoint = what == "adjoints";
                numbers.push(match own.as_ref().map(|own| (own, own.shape())) {
                    Some((own, shape)) if shape == whole || is_adjoint && shape == end => {
                        in_order(own)
                    }
                    None if is_adjoint => Vec::new().into(),
                    own => {
                        let shape = own.map_or(&[][..], |(_, shape)| shape);
                        let or = if is_adjoint { format!(" or {end:?}") } else { String::new() };
                        let text = format!(
                            "{what}, {name}: an array of {whole:?}{or} is expected, not {shape:?}"
                        );
                        return Err(wrong(text));
                    }
                });
            }
        }
        let (run, adjoints) = numbers.split_at(RUN.len());
        let (width, times) = (self.function.width(), self.steps() + 1);
        let worlds = inputs.batch.unwrap_or(1);
        let gradients: Vec<RolloutGradient> = self.each(py, &inputs, |world, at| {
            let mut rows = at.states.repeat(times);
            let mut by_rows = vec![0.0; width * times];
            for field in 0..RUN.len() {
                let of_world = |all: &'_ [f64]| {
                    let own = all.len() / worlds.max(1);
                    world * own..(world + 1) * own
                };
                let (own, by_own) = (&run[field], &adjoints[field]);
                self.layout.write(field, &mut rows, &own[of_world(own)], |to, x| *to = x);
                let by_own = &by_own[of_world(by_own)];
                let is_end = by_own.len() < own.len() / worlds.max(1);
                let first = if is_end { width * (times - 1) } else { 0 };
                self.layout.write(field, &mut by_rows[first..], by_own, |to, x| *to += x);
            }
            self.function.vjp(at.inputs(), &rows, &by_rows)
        })?;
        let [q, v, act, fixed] = [0, 1, 2, 3].map(|field| {
            let each: Vec<Vec<f64>> =
                gradients.iter().map(|own| self.layout.read(field, &own.states)).collect();
            inputs.all[field].gathered(py, each.iter().map(Vec::as_slice))
        });
        let of_parameters = &inputs.all[FIELDS.len()..inputs.all.len() - 1];
        let mut first = 0;
        let mut by_parameters = of_parameters.iter().map(|input| {
            let own = first..first + input.width;
            first = own.end;
            input.gathered(py, gradients.iter().map(|by| &by.parameters[own.clone()]))
        });
        let by_parameters = match &given.1 {
            Some(Parameters::Named(named)) => {
                let by_name = PyDict::new(py);
                for (name, by) in self.parameters.iter().zip(by_parameters) {
                    if named.contains_key(name) {
                        by_name.set_item(name, by?)?;
                    }
                }
                by_name.into_any()
            }
            _ => by_parameters.next().ok_or_else(|| wrong("no parameters"))??.into_any(),
        };
        let by_controls = inputs.all[inputs.all.len() - 1]
            .gathered(py, gradients.iter().map(|own| own.controls.as_slice()))?;
        gradient_of(py, [q?, v?, act?, fixed?], [by_parameters, by_controls.into_any()])
    }

    /// The `Run` and its derivative along tangents, by forward mode. Inputs and tangents are state, parameters and controls; tangents, and arrays
    /// of their state, may be None for zero.
    #[pyo3(signature = (inputs, tangents))]
    fn jvp<'py>(
        &self,
        py: Python<'py>,
        inputs: (Bound<'py, PyAny>, Option<Parameters<'py>>, Option<Numbers<'py>>),
        tangents: (Option<Bound<'py, PyAny>>, Option<Parameters<'py>>, Option<Numbers<'py>>),
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let given = (state_arrays(&inputs.0)?, inputs.1, inputs.2);
        let inputs = self.inputs(&given)?;
        let state = tangents.0.as_ref().map(state_arrays).transpose()?;
        let state = state.unwrap_or([None, None, None, None]);
        let none = Parameters::Named(BTreeMap::new());
        let parameters = match (&given.1, &tangents.1) {
            (Some(Parameters::Named(_)), None) => Some(&none),
            (_, own) => own.as_ref(),
        };
        let others = self.others(parameters, tangents.2.as_ref())?;
        let others = others.into_iter().map(|(name, _, own)| (name, own));
        let tangents: Vec<_> =
            FIELDS.into_iter().zip(state.each_ref().map(Option::as_ref)).chain(others).collect();
        if tangents.len() != inputs.all.len() {
            return Err(wrong("tangents of parameters: a dict where parameters are one"));
        }
        let mut along = Vec::with_capacity(tangents.len());
        for (input, (name, given)) in inputs.all.iter().zip(&tangents) {
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
        let both = self.each(py, &inputs, |world, at| {
            let parts = inputs.all.iter().zip(&along);
            let parts: Vec<&[f64]> =
                parts.map(|(input, own)| &own[input.start(world)..][..input.width]).collect();
            let zeros = vec![0.0; self.layout.rows.len()];
            let along = self.point(zeros, &parts);
            let [values, slopes] = self.function.jvp(at.inputs(), along.inputs())?;
            Ok((self.read(&values), self.read(&slopes)))
        })?;
        let (values, slopes): (Vec<_>, Vec<_>) = both.into_iter().unzip();
        let batch = inputs.batch;
        Ok((self.run(py, values, batch, false)?, self.run(py, slopes, batch, false)?))
    }

    /// The state whose arrays are used where those of a given one are None: `Model.neutral_state`.
    #[getter]
    fn neutral_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        neutral_state(py, &self.layout)
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

    /// The names of the bodies, in their order in a run.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.function.model().bodies.iter().map(|body| body.name.clone()).collect()
    }

    fn __repr__(&self) -> String {
        let (steps, dt) = (self.steps(), self.dt());
        format!(
            "Rollout({steps} steps of {dt} s, parameters={:?}, controls={:?})",
            self.parameters, self.controls
        )
    }
}

/// A `State` at rest.
pub(crate) fn neutral_state<'py>(
    py: Python<'py>,
    layout: &StateLayout,
) -> PyResult<Bound<'py, PyAny>> {
    let mut field = 0;
    let [q, v, act, fixed] = layout.neutral().map(|own| {
        let shape = layout.shape(field);
        field += 1;
        array(py, own, &shape)
    });
    state_of(py, [q?, v?, act?, fixed?])
}
