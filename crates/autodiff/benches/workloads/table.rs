//! Times several ways to compute one gradient, taking turns so that a disturbance of the machine hits all
//! of them alike, and prints a Markdown table.

use std::hint::black_box;
use std::time::Instant;

use prehend_autodiff::check::compare_gradients;

/// Turns that each mode gets; its median counts.
const ROUNDS: usize = 101;
/// Fast modes repeat within a turn until it lasts about as long as this \[s\].
const TURN: f64 = 3e-4;
/// How far a gradient may be from the first one that was added, relative to its largest entry.
const TOLERANCE: f64 = 1e-9;

/// Writes a gradient at a point and returns the value there and the size of its tape, if known \[byte\].
type Run<'a, const N: usize> =
    Box<dyn FnMut(&[f64; N], &mut [f64; N]) -> (f64, Option<usize>) + 'a>;

struct Mode<'a, const N: usize> {
    name: &'static str,
    run: Run<'a, N>,
    tape: Option<usize>,
}

/// Ways to compute the gradient of one function of `N` inputs at one point.
pub(crate) struct Comparison<'a, const N: usize> {
    workload: &'static str,
    inputs: [f64; N],
    value: f64,
    gradient: Option<[f64; N]>,
    modes: Vec<Mode<'a, N>>,
    absent: Vec<(&'static str, &'static str)>,
}

impl<'a, const N: usize> Comparison<'a, N> {
    /// Comparison of the gradients of `primal` at `inputs`.
    pub(crate) fn new(
        workload: &'static str,
        inputs: [f64; N],
        primal: impl Fn(&[f64; N]) -> f64 + 'a,
    ) -> Self {
        let value = primal(&inputs);
        let run = Box::new(move |x: &_, _: &mut _| (primal(x), None));
        let modes = vec![Mode { name: "f64, no gradient", run, tape: None }];
        Self { workload, inputs, value, gradient: None, modes, absent: Vec::new() }
    }

    /// Adds a way to compute the gradient: `run` writes it and returns the value.
    ///
    /// # Panics
    /// If the value is not the primal's, or the gradient not that of the first mode added.
    pub(crate) fn add(
        &mut self,
        mode: &'static str,
        mut run: impl FnMut(&[f64; N], &mut [f64; N]) -> f64 + 'a,
    ) {
        self.push(mode, Box::new(move |x, gradient| (run(x, gradient), None)));
    }

    /// As [`add`](Self::add), with a `run` that also returns how large its tape became \[byte\].
    pub(crate) fn add_taped(
        &mut self,
        mode: &'static str,
        mut run: impl FnMut(&[f64; N], &mut [f64; N]) -> (f64, usize) + 'a,
    ) {
        let run = move |x: &_, gradient: &mut _| {
            let (value, bytes) = run(x, gradient);
            (value, Some(bytes))
        };
        self.push(mode, Box::new(run));
    }

    /// Says why there is no way to compute the gradient by `mode`.
    pub(crate) fn add_absent(&mut self, mode: &'static str, reason: &'static str) {
        self.absent.push((mode, reason));
    }

    fn push(&mut self, name: &'static str, mut run: Run<'a, N>) {
        let mut gradient = [0.0; N];
        let (value, tape) = run(&self.inputs, &mut gradient);
        let off = (value - self.value).abs() / self.value.abs();
        assert!(off <= TOLERANCE, "{}, {name}: value off by {off:e}", self.workload);
        let reference = self.gradient.get_or_insert(gradient);
        let off = compare_gradients(&gradient, reference).relative;
        assert!(off <= TOLERANCE, "{}, {name}: gradient off by {off:e}", self.workload);
        self.modes.push(Mode { name, run, tape });
    }

    /// Times all the modes.
    pub(crate) fn measure(mut self) -> Vec<Row> {
        let mut gradient = [0.0; N];
        let repeats: Vec<usize> = self
            .modes
            .iter_mut()
            .map(|mode| {
                // The second run is warm.
                let [_, once] = [0; 2].map(|_| time(1, mode, &self.inputs, &mut gradient));
                (TURN / once).clamp(1.0, 1e4) as usize
            })
            .collect();
        let mut seconds = vec![Vec::with_capacity(ROUNDS); self.modes.len()];
        for _ in 0..ROUNDS {
            for ((mode, &repeats), seconds) in self.modes.iter_mut().zip(&repeats).zip(&mut seconds)
            {
                // What the mode before left in the caches is no affair of this one.
                time(1, mode, &self.inputs, &mut gradient);
                seconds.push(time(repeats, mode, &self.inputs, &mut gradient));
            }
        }
        let workload = self.workload;
        let timed = self.modes.iter().zip(&mut seconds).map(|(mode, seconds)| {
            seconds.sort_by(f64::total_cmp);
            let result = Ok((seconds[ROUNDS / 2], mode.tape));
            Row { workload, mode: mode.name, result }
        });
        let absent = self.absent.iter().map(|&(mode, reason)| {
            let result = Err(reason);
            Row { workload, mode, result }
        });
        timed.chain(absent).collect()
    }
}

/// Time of one run in seconds, averaged over `repeats`.
fn time<const N: usize>(
    repeats: usize,
    mode: &mut Mode<N>,
    inputs: &[f64; N],
    gradient: &mut [f64; N],
) -> f64 {
    let start = Instant::now();
    for _ in 0..repeats {
        black_box((mode.run)(black_box(inputs), black_box(gradient)));
    }
    start.elapsed().as_secs_f64() / repeats as f64
}

/// One mode's median time \[s\] and the size of its tape \[byte\], or why it has none.
pub(crate) struct Row {
    workload: &'static str,
    mode: &'static str,
    result: Result<(f64, Option<usize>), &'static str>,
}

/// Prints the rows of all workloads; the first of each workload is the primal that the others are
/// divided by.
pub(crate) fn print(workloads: &[Vec<Row>]) {
    println!("| workload | mode | median µs | × primal | tape kB |");
    println!("|---|---|--:|--:|--:|");
    let mut notes: Vec<&str> = Vec::new();
    for rows in workloads {
        let mut primal = None;
        for Row { workload, mode, result } in rows {
            let cells = match *result {
                Ok((seconds, tape)) => {
                    let micros = seconds * 1e6;
                    let digits = if micros < 100.0 { 2 } else { 0 };
                    let ratio = seconds / *primal.get_or_insert(seconds);
                    let tape = tape.map_or(String::new(), |bytes| format!("{}", bytes / 1000));
                    format!("{micros:.digits$} | {ratio:.1} | {tape}")
                }
                Err(reason) => {
                    let number = notes.iter().position(|&note| note == reason);
                    let number = number.unwrap_or_else(|| {
                        notes.push(reason);
                        notes.len() - 1
                    });
                    format!("–[^{}] | – | ", number + 1)
                }
            };
            println!("| {workload} | {mode} | {cells} |");
        }
    }
    println!();
    for (number, note) in notes.iter().enumerate() {
        println!("[^{}]: {note}", number + 1);
    }
}
