//! Times several ways to do one job, taking turns so that a disturbance of the machine hits all of them
//! alike, and prints a Markdown table.
//!
//! Times are processor times of this process: everything runs on one thread, and other programs on the
//! machine disturb that far less than the time on the clock.

use std::hint::black_box;
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;

/// Turns that each way gets, if they take no longer than [`PATIENCE`]; the median counts.
const ROUNDS: usize = 15;
const FEWEST_ROUNDS: usize = 3;
/// Time that the turns of one job may take before the fewest rounds must do.
const PATIENCE: Duration = Duration::from_secs(20);

/// Ways to do one job, which all answer with a list of numbers.
pub(crate) struct Comparison<'a> {
    job: String,
    unit: &'static str,
    tolerance: f64,
    truth: Vec<(usize, f64)>,
    reference: Option<Vec<f64>>,
    ways: Vec<Way<'a>>,
}

struct Way<'a> {
    name: &'static str,
    run: Box<dyn FnMut() -> Duration + 'a>,
    verdict: Verdict,
}

impl<'a> Comparison<'a> {
    /// An answer is right if its numbers, in `unit`, are within `tolerance` of the true ones; `truth` has those
    /// of some entries.
    pub(crate) fn new(
        job: impl Into<String>,
        unit: &'static str,
        tolerance: f64,
        truth: Vec<(usize, f64)>,
    ) -> Self {
        Self { job: job.into(), unit, tolerance, truth, reference: None, ways: Vec::new() }
    }

    /// Adds a way to do the job. `run` is what is timed; `answer` turns its result into numbers, NaN for
    /// those that it failed to give.
    ///
    /// The first way must be right by the truth. The others are compared with all that the first one said, or
    /// with the truth where that is complete, and shown with their error.
    ///
    /// # Panics
    /// If the first way is wrong.
    pub(crate) fn add<T>(
        &mut self,
        name: &'static str,
        mut run: impl FnMut() -> T + 'a,
        answer: impl FnOnce(T) -> Vec<f64>,
    ) {
        let given = answer(run());
        let verdict = match &self.reference {
            Some(reference) if self.truth.len() < reference.len() => {
                let whole = reference.iter().copied().enumerate();
                Verdict::of(&given, whole, self.tolerance)
            }
            _ => Verdict::of(&given, self.truth.iter().copied(), self.tolerance),
        };
        if self.reference.is_none() {
            assert_eq!(verdict.wrong, 0, "{}, {name}: off by {:e}", self.job, verdict.largest);
            self.reference = Some(given);
        }
        let run = move || {
            let start = ProcessTime::now();
            let result = black_box(run());
            let elapsed = start.elapsed();
            drop(result);
            elapsed
        };
        self.ways.push(Way { name, run: Box::new(run), verdict });
    }

    /// Times all the ways and prints a row for each.
    fn print(mut self) {
        let mut times = vec![Vec::with_capacity(ROUNDS); self.ways.len()];
        let start = Instant::now();
        for round in 0..ROUNDS {
            if round >= FEWEST_ROUNDS && start.elapsed() > PATIENCE {
                break;
            }
            for (way, times) in self.ways.iter_mut().zip(&mut times) {
                times.push((way.run)().as_secs_f64() * 1e3);
            }
        }
        let mut first = None;
        for (way, mut times) in self.ways.iter().zip(times) {
            times.sort_by(f64::total_cmp);
            let (median, best) = (times[times.len() / 2], times[0]);
            let ratio = median / *first.get_or_insert(median);
            let (job, name, error) = (&self.job, way.name, way.verdict.show(self.unit));
            let [median, best] = [median, best].map(|ms| {
                let digits = if ms < 10.0 {
                    2
                } else if ms < 1000.0 {
                    1
                } else {
                    0
                };
                format!("{ms:.digits$}")
            });
            println!("| {job} | {name} | {median} | {best} | {ratio:.2} | {error} |");
        }
    }
}

/// How far an answer is from the right one.
struct Verdict {
    largest: f64,
    wrong: usize,
    failed: usize,
    count: usize,
}

impl Verdict {
    fn of(given: &[f64], right: impl Iterator<Item = (usize, f64)>, tolerance: f64) -> Self {
        let mut verdict = Self { largest: 0.0, wrong: 0, failed: 0, count: 0 };
        for (i, right) in right {
            let off = (given.get(i).copied().unwrap_or(f64::NAN) - right).abs();
            verdict.count += 1;
            verdict.failed += usize::from(off.is_nan());
            verdict.wrong += usize::from(off.is_nan() || off > tolerance);
            verdict.largest = verdict.largest.max(off);
        }
        verdict
    }

    fn show(&self, unit: &str) -> String {
        let Self { largest, wrong, failed, count } = *self;
        let size = if largest == 0.0 { "0".into() } else { format!("{largest:.1e} {unit}") };
        match (wrong, failed) {
            (0, _) => size,
            (_, 0) => format!("**{wrong} of {count} wrong**, {size}"),
            _ => format!("**{wrong} of {count} wrong** ({failed} without answer), {size}"),
        }
    }
}

/// Prints the rows of all the jobs that the command line picks: those with one of its words in their names, or all.
pub(crate) fn print(comparisons: Vec<Comparison>) {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    println!("| job | by | median ms | best ms | × first | largest error |");
    println!("|---|---|--:|--:|--:|---|");
    for comparison in comparisons {
        if words.is_empty() || words.iter().any(|word| comparison.job.contains(word)) {
            comparison.print();
        }
    }
}
