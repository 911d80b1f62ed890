//! Arrays of states, and the rows of numbers that the simulator has instead.

use prehend_sim::{BodyState, Model, State};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

use crate::arrays::{Array, Numbers};
use crate::batch::{Input, batch_of};
use crate::error::{Raise, wrong};

/// Numbers of a row.
pub(crate) const ROW: usize = 13;

/// The arrays of a `State`.
pub(crate) const FIELDS: [&str; 4] = ["q", "v", "act", "fixed"];

/// The arrays of a `Run`: those of its states, and that of its bodies.
pub(crate) const RUN: [&str; 5] = ["q", "v", "act", "fixed", "bodies"];

/// Places of each array of a run among the numbers of all rows.
pub(crate) struct StateLayout {
    /// Numbers of all rows at rest.
    pub(crate) rows: Vec<f64>,
    places: [Vec<usize>; 5],
    neutral: [Vec<f64>; 5],
}

impl StateLayout {
    pub(crate) fn new(model: &Model) -> Self {
        let rows: Vec<f64> =
            model.neutral_state().rows().iter().flat_map(BodyState::coordinates).collect();
        let own = model.state_places();
        let bodies = (0..ROW * model.bodies.len()).collect();
        let places = [own.positions, own.velocities, own.deflections, own.fixed, bodies];
        let neutral = places.each_ref().map(|own| own.iter().map(|place| rows[*place]).collect());
        Self { rows, places, neutral }
    }

    /// The shape of an array, by its place among those of a run.
    pub(crate) fn shape(&self, field: usize) -> Vec<usize> {
        let count = self.places[field].len();
        if field < 3 { vec![count] } else { vec![count / ROW, ROW] }
    }

    /// The state at rest, of those that a `State` has.
    pub(crate) fn neutral(&self) -> [Vec<f64>; 4] {
        let [q, v, act, fixed, _] = self.neutral.clone();
        [q, v, act, fixed]
    }

    /// The numbers of an array among those of the rows at one time after the other.
    pub(crate) fn read(&self, field: usize, rows: &[f64]) -> Vec<f64> {
        let (width, places) = (self.rows.len().max(1), &self.places[field]);
        let mut numbers = Vec::with_capacity(places.len() * (rows.len() / width));
        for rows in rows.chunks_exact(width) {
            numbers.extend(places.iter().map(|place| rows[*place]));
        }
        numbers
    }

    /// Puts the `numbers` of an array among those of the rows at one time after the other.
    pub(crate) fn write(
        &self,
        field: usize,
        rows: &mut [f64],
        numbers: &[f64],
        put: impl Fn(&mut f64, f64),
    ) {
        let (width, places) = (self.rows.len().max(1), &self.places[field]);
        let numbers = numbers.chunks_exact(places.len().max(1));
        for (rows, numbers) in rows.chunks_exact_mut(width).zip(numbers) {
            places.iter().zip(numbers).for_each(|(place, x)| put(&mut rows[*place], *x));
        }
    }

    /// The arrays of a state, those at rest where they are None.
    pub(crate) fn inputs<'a>(
        &'a self,
        arrays: &'a [Option<Numbers<'_>>; 4],
    ) -> PyResult<Vec<Input<'a>>> {
        let input = |(field, name): (usize, &&str)| {
            let (array, shape) = (arrays[field].as_ref(), self.shape(field));
            Input::or(array, &self.neutral[field], &shape, format_args!("state.{name}"))
        };
        FIELDS.iter().enumerate().map(input).collect()
    }
}

/// The states of all worlds in the arrays of a `State`.
pub(crate) struct States<'a> {
    model: &'a Model,
    layout: &'a StateLayout,
    pub(crate) inputs: Vec<Input<'a>>,
    pub(crate) batch: Option<usize>,
}

impl<'a> States<'a> {
    pub(crate) fn new(
        model: &'a Model,
        layout: &'a StateLayout,
        arrays: &'a [Option<Numbers<'_>>; 4],
    ) -> PyResult<Self> {
        let inputs = layout.inputs(arrays)?;
        let batch = batch_of(FIELDS.into_iter().zip(&inputs))?;
        Ok(Self { model, layout, inputs, batch })
    }

    /// All of them, with links where their joints put them.
    pub(crate) fn each(&self) -> impl Iterator<Item = PyResult<State>> {
        (0..self.batch.unwrap_or(1)).map(|world| {
            let mut rows = self.layout.rows.clone();
            for (field, input) in self.inputs.iter().enumerate() {
                self.layout.write(field, &mut rows, input.of(world), |to, x| *to = x);
            }
            let rows = rows.as_chunks().0.iter().map(BodyState::from_coordinates).collect();
            let mut state = self.model.state_of_rows(rows, 0.0).raise()?;
            self.model.update_kinematics(&mut state);
            Ok(state)
        })
    }
}

/// An attribute, or None if it or the object is None.
fn attribute<'py>(
    object: &Bound<'py, PyAny>,
    name: &str,
    what: &str,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let own = object.getattr(name).map_err(|_| {
        let given = object.get_type().name().map_or_else(|_| String::new(), |n| n.to_string());
        wrong(format!("a prehend.{what} is expected, not of the type {given}"))
    })?;
    Ok(Some(own).filter(|own| !own.is_none()))
}

/// The arrays of a `State`.
pub(crate) fn state_arrays<'py>(state: &Bound<'py, PyAny>) -> PyResult<[Option<Numbers<'py>>; 4]> {
    let [q, v, act, fixed] = FIELDS.map(|name| -> PyResult<Option<Numbers<'py>>> {
        attribute(state, name, "State")?.map(|own| own.extract()).transpose()
    });
    Ok([q?, v?, act?, fixed?])
}

/// The arrays of a `Run`.
pub(crate) fn run_arrays<'py>(run: &Bound<'py, PyAny>) -> PyResult<[Option<Numbers<'py>>; 5]> {
    let bodies = attribute(run, "bodies", "Run")?.map(|own| own.extract()).transpose()?;
    let [q, v, act, fixed] = match attribute(run, "state", "Run")? {
        Some(state) => state_arrays(&state)?,
        None => [None, None, None, None],
    };
    Ok([q, v, act, fixed, bodies])
}

/// Calls the class of that name in `prehend.state`.
fn call<'py>(
    class: &'static PyOnceLock<Py<PyType>>,
    name: &str,
    fields: impl pyo3::call::PyCallArgs<'py>,
    py: Python<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    class.import(py, "prehend.state", name)?.call1(fields)
}

/// A `State`.
pub(crate) fn state_of<'py>(
    py: Python<'py>,
    [q, v, act, fixed]: [Array<'py>; 4],
) -> PyResult<Bound<'py, PyAny>> {
    static STATE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    call(&STATE, "State", (q, v, act, fixed), py)
}

/// A `Run`.
pub(crate) fn run_of<'py>(
    py: Python<'py>,
    [q, v, act, fixed, bodies]: [Array<'py>; 5],
) -> PyResult<Bound<'py, PyAny>> {
    static RUN: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    call(&RUN, "Run", (state_of(py, [q, v, act, fixed])?, bodies), py)
}

/// A `Gradient`.
pub(crate) fn gradient_of<'py>(
    py: Python<'py>,
    state: [Array<'py>; 4],
    others: [Bound<'py, PyAny>; 2],
) -> PyResult<Bound<'py, PyAny>> {
    static GRADIENT: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let [parameters, controls] = others;
    call(&GRADIENT, "Gradient", (state_of(py, state)?, parameters, controls), py)
}
