//! A report of films.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use prehend_refine::EstimatorInput;
use prehend_refine::data::bop::{DatasetError, ResultRow};
use prehend_refine::data::{AssetError, FrameInput, Target};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::report::{
    Chart, DrawnFrame, FrameDrawing, FrameReport, Report, Series,
};
use prehend_refine::strategy::PosteriorSummary;
use prehend_refine::tracker::{TrackStatus, Tracked};

use crate::report::{self, MILLISECONDS, MOMENT};

/// Frames that are drawn at most of all films, and of one: pages stay small enough to be opened. Of each film half are drawn as time passes, and half
/// where something has happened.
const DRAWN: usize = 200;
const OF_A_FILM: usize = 120;

/// Of a film whose length nobody knows, every so manieth frame is drawn.
const EVERY: usize = 30;

/// A report that grows while films are followed.
pub(super) struct FilmReport {
    report: Report,
    frames: Vec<Reported>,
    /// Of the film that is followed now: every so manieth frame is drawn, at most so many; so many have come, and so many were drawn.
    every: usize,
    most: usize,
    come: usize,
    drawn: usize,
}

/// A frame that was followed.
struct Reported {
    target: Target,
    row: ResultRow,
    moment: f64,
    seconds: f64,
    status: TrackStatus,
    doubt: Option<String>,
    posterior: Option<PosteriorSummary>,
    drawing: Option<DrawnFrame>,
}

impl FilmReport {
    pub(super) fn create(folder: &Path) -> Result<Self, DatasetError> {
        let report = Report::create(folder, "Tracked objects")?;
        Ok(Self { report, frames: Vec::new(), every: EVERY, most: OF_A_FILM, come: 0, drawn: 0 })
    }

    /// Says how many films will come.
    pub(super) fn share(&mut self, films: usize) {
        self.most = (DRAWN / films.max(1)).clamp(2, OF_A_FILM);
    }

    /// Goes on with a film of so many frames, if their number is known.
    pub(super) fn begin(&mut self, count: Option<u64>) {
        let count = count.and_then(|count| usize::try_from(count).ok()).filter(|count| *count > 0);
        self.every = count.map_or(EVERY, |count| count.div_ceil(self.most / 2));
        (self.come, self.drawn) = (0, 0);
    }

    /// Adds a frame: drawn if it is its turn, or if something has happened.
    ///
    /// # Errors
    /// If it cannot be drawn; it is in the table all the same.
    pub(super) fn add(
        &mut self,
        (target, time): (Target, Duration),
        input: &FrameInput,
        tracked: &Tracked,
        row: ResultRow,
    ) -> Result<(), AssetError> {
        let last = self.frames.last().filter(|_| self.come > 0);
        let calm = last.is_some_and(|last| last.status == tracked.status);
        let wanted = (self.come.is_multiple_of(self.every) || !calm) && self.drawn < self.most;
        self.come += 1;
        let posterior = tracked.posterior.as_ref().map(PosteriorSummary::from);
        self.drawn += usize::from(wanted);
        let draw = || {
            self.report.draw(&FrameDrawing {
                input: &EstimatorInput::new(&input.frame, &input.object),
                initial: None,
                t_cam_object: &tracked.t_cam_object,
                covariance: posterior.as_ref().map(|p| &p.covariance),
                trace: None,
            })
        };
        let (drawing, outcome) = match wanted.then(draw).transpose() {
            Ok(drawing) => (drawing, Ok(())),
            Err(error) => (None, Err(error)),
        };
        self.frames.push(Reported {
            target,
            row,
            moment: time.as_secs_f64(),
            seconds: tracked.timing.total().as_secs_f64(),
            status: tracked.status,
            doubt: tracked.rejection.map(|doubt| doubt.to_string()),
            posterior,
            drawing,
        });
        outcome
    }

    /// Writes the page and returns its path; errors of poses are in it if `scorer` knows the truth.
    /// Of truth that is broken `failures` hears.
    ///
    /// # Errors
    /// If the page cannot be written.
    pub(super) fn finish(
        self,
        scorer: Option<&Scorer<'_>>,
        failures: &mut Vec<String>,
    ) -> Result<PathBuf, DatasetError> {
        let Self { mut report, frames, .. } = self;
        let drawn = frames.iter().filter(|frame| frame.drawing.is_some()).count();
        report.add_fact("version", env!("CARGO_PKG_VERSION"));
        report.add_fact("drawn", format!("{drawn} of {} frames", frames.len()));
        let mut curves: BTreeMap<String, [Vec<[f64; 2]>; 3]> = BTreeMap::new();
        for frame in frames {
            let Reported { target, row, moment, seconds, status, doubt, posterior, drawing } =
                frame;
            let error = scorer.and_then(|scorer| {
                scorer.pose_error(&row).unwrap_or_else(|error| {
                    failures.push(format!("{target}: report: {error}"));
                    None
                })
            });
            let mut film = format!("scene {} object {}", target.scene_id, target.obj_id);
            let mut name = target.to_string();
            if target.instance > 0 {
                let instance = format!(" instance {}", target.instance);
                film += &instance;
                name += &instance;
            }
            let values =
                [row.score, error.map_or(f64::NAN, |[meters, _]| 1e3 * meters), 1e3 * seconds];
            for (curve, value) in curves.entry(film).or_default().iter_mut().zip(values) {
                curve.push([moment, value]);
            }
            let mut figures = report::pose_figures(error, posterior.as_ref());
            figures.extend([MOMENT.figure(Some(moment)), MILLISECONDS.figure(Some(1e3 * seconds))]);
            let frame = FrameReport {
                name,
                status: status.name().to_owned(),
                flags: posterior.as_ref().map_or_else(Vec::new, report::flags),
                remarks: doubt.into_iter().collect(),
                figures,
                posterior,
            };
            report.add_frame(frame, drawing);
        }
        for (k, (title, unit)) in [
            ("Probability of being right", ""),
            ("Error of position", "mm"),
            ("Time a frame", "ms"),
        ]
        .into_iter()
        .enumerate()
        {
            let series = curves
                .iter()
                .map(|(name, curves)| Series { name: name.clone(), points: curves[k].clone() });
            let series: Vec<Series> = series.collect();
            if series.iter().any(|s| s.points.iter().any(|[_, value]| value.is_finite())) {
                let axes = ["s".to_owned(), unit.to_owned()];
                report.add_chart(Chart {
                    title: title.to_owned(),
                    axes,
                    logarithmic: false,
                    series,
                });
            }
        }
        report.finish()
    }
}
