//! Resident memory over time.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use plotters::prelude::*;

const PERIOD: Duration = Duration::from_millis(100);

/// Resident memory of a process over time.
pub(super) struct Memory {
    /// When \[s\], and how much \[MB\].
    samples: Vec<(f64, f64)>,
}

impl Memory {
    /// Memory of `process` while `work` goes on.
    ///
    /// # Errors
    /// Those of `work`, and if the system does not tell memory as Linux does.
    pub(super) fn of<T>(process: u32, work: impl FnOnce() -> Result<T>) -> Result<(T, Self)> {
        resident(std::process::id()).context("this system does not tell memory as Linux does")?;
        let done = AtomicBool::new(false);
        thread::scope(|scope| {
            let watch = scope.spawn(|| {
                let (start, mut samples) = (Instant::now(), Vec::new());
                while !done.load(Ordering::Relaxed) {
                    // None of a process that has ended.
                    samples.extend(resident(process).map(|mb| (start.elapsed().as_secs_f64(), mb)));
                    thread::sleep(PERIOD);
                }
                samples
            });
            // The watch must end even if the work panics.
            let result = catch_unwind(AssertUnwindSafe(work));
            done.store(true, Ordering::Relaxed);
            let samples = watch.join().map_err(|_| anyhow!("the watch broke off"))?;
            let result = result.unwrap_or_else(|panic| resume_unwind(panic))?;
            samples.first().context("the process ended before it was looked at")?;
            Ok((result, Self { samples }))
        })
    }

    /// The most \[MB\].
    pub(super) fn peak(&self) -> f64 {
        self.samples.iter().fold(0.0, |most, &(_, mb)| mb.max(most))
    }

    /// The mean of the last tenth of the time less that of the third tenth \[MB\].
    pub(super) fn growth(&self) -> f64 {
        let end = self.samples.last().map_or(0.0, |&(time, _)| time);
        let mean = |from: f64, to: f64| {
            let within = |time: f64| time >= from * end && time <= to * end;
            let chosen: Vec<f64> =
                self.samples.iter().filter(|s| within(s.0)).map(|s| s.1).collect();
            chosen.iter().sum::<f64>() / chosen.len().max(1) as f64
        };
        mean(0.9, 1.0) - mean(0.2, 0.3)
    }

    /// As a curve.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(super) fn draw(&self, file: &Path, title: &str) -> Result<()> {
        let end = self.samples.last().map_or(1.0, |&(time, _)| time);
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, (720, 240)).into_drawing_area();
            area.fill(&WHITE)?;
            let mut chart = ChartBuilder::on(&area)
                .margin(12)
                .caption(title.replace('`', ""), ("sans-serif", 15))
                .x_label_area_size(34)
                .y_label_area_size(52)
                .build_cartesian_2d(0.0..end, 0.0..1.15 * self.peak())?;
            chart
                .configure_mesh()
                .disable_x_mesh()
                .max_light_lines(0)
                .x_desc("s")
                .x_label_formatter(&|x| format!("{x:.0}"))
                .y_desc("resident memory [MB]")
                .y_label_formatter(&|y| format!("{y:.0}"))
                .draw()?;
            // No more than a picture can show.
            let step = self.samples.len().div_ceil(700);
            let points = self.samples.iter().step_by(step).copied();
            chart.draw_series(LineSeries::new(points, &BLUE))?;
            area.present()?;
        }
        std::fs::write(file, svg).with_context(|| file.display().to_string())
    }
}

fn resident(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()? / 1e3)
}
