//! A report of films.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use prehend_refine::EstimatorInput;
use prehend_refine::data::bop::DatasetError;
use prehend_refine::data::{AssetError, FrameInput};
use prehend_refine::evaluate::Scorer;
use prehend_refine::evaluate::report::{
    Chart, Column, DrawnFrame, FrameDrawing, FrameReport, Report, Series, flags, pose_figures,
};
use prehend_refine::strategy::PosteriorSummary;
use prehend_refine::tracker::{TrackStatus, Tracked};

use super::done::Done;
use crate::failures::Failures;

const MILLISECONDS: Column = Column::new("milliseconds", "time", "ms", 1);
const MOMENT: Column = Column::new("moment", "moment", "s", 2);

/// Frames that are drawn at most of all films, and of one: pages stay small enough to be opened. Of each film half are drawn as time passes, and half
/// where something has happened.
const DRAWN: usize = 200;
const OF_A_FILM: usize = 120;

/// Of a film whose length nobody knows, every so manieth frame is drawn.
const EVERY: usize = 30;

/// A report that grows while films are followed.
pub(super) struct FilmReport {
    report: Report,
    /// Of the film that is followed now: every so manieth frame is drawn, at most so many; so many have come, and so many were drawn.
    every: usize,
    most: usize,
    come: usize,
    drawn: usize,
    /// How its last frame was followed.
    last: Option<TrackStatus>,
}

impl FilmReport {
    pub(super) fn create(folder: &Path) -> Result<Self, DatasetError> {
        let report = Report::create(folder, "Tracked objects")?;
        Ok(Self { report, every: EVERY, most: OF_A_FILM, come: 0, drawn: 0, last: None })
    }

    /// Says how many films will come.
    pub(super) fn share(&mut self, films: usize) {
        self.most = (DRAWN / films.max(1)).clamp(2, OF_A_FILM);
    }

    /// Goes on with a film of so many frames, none if their number is not known.
    pub(super) fn begin(&mut self, count: usize) {
        self.every = if count > 0 { count.div_ceil(self.most / 2) } else { EVERY };
        (self.come, self.drawn, self.last) = (0, 0, None);
    }

    /// Draws a frame if it is its turn, or if something has happened.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub(super) fn draw(
        &mut self,
        input: &FrameInput,
        tracked: &Tracked,
        posterior: Option<&PosteriorSummary>,
    ) -> Result<Option<DrawnFrame>, AssetError> {
        let calm = self.last.replace(tracked.status) == Some(tracked.status);
        let wanted = (self.come.is_multiple_of(self.every) || !calm) && self.drawn < self.most;
        self.come += 1;
        if !wanted {
            return Ok(None);
        }
        self.drawn += 1;
        let drawing = FrameDrawing {
            input: &EstimatorInput::new(&input.frame, &input.object),
            initial: None,
            t_cam_object: &tracked.t_cam_object,
            covariance: posterior.map(|p| &p.covariance),
            trace: None,
        };
        self.report.draw(&drawing).map(Some)
    }

    /// Writes the page of `frames`, whose drawings it takes, and returns its path; errors of poses are in it if `scorer` knows the truth.
    /// Of truth that is broken `failures` hears.
    ///
    /// # Errors
    /// If the page cannot be written.
    pub(super) fn finish(
        self,
        frames: &mut [Done],
        scorer: Option<Scorer<'_>>,
        failures: &mut Failures,
    ) -> Result<PathBuf, DatasetError> {
        let mut report = self.report;
        let drawn = frames.iter().filter(|frame| frame.drawing.is_some()).count();
        report.add_fact("version", env!("CARGO_PKG_VERSION"));
        report.add_fact("drawn", format!("{drawn} of {} frames", frames.len()));
        let mut curves: BTreeMap<String, [Vec<[f64; 2]>; 3]> = BTreeMap::new();
        for frame in frames {
            let Done { target, row, time, track, timing, posterior, .. } = &*frame;
            let (moment, seconds) = (time.as_secs_f64(), timing.total().as_secs_f64());
            let error = scorer
                .as_ref()
                .map(|scorer| scorer.pose_error(row))
                .and_then(|error| failures.keep(format!("{target}: report"), error)?);
            let instance = match target.instance {
                0 => String::new(),
                more => format!(" instance {more}"),
            };
            let film = format!("scene {} object {}{instance}", target.scene_id, target.obj_id);
            let values =
                [row.score, error.map_or(f64::NAN, |[meters, _]| 1e3 * meters), 1e3 * seconds];
            for (curve, value) in curves.entry(film).or_default().iter_mut().zip(values) {
                curve.push([moment, value]);
            }
            let mut figures = pose_figures(error, posterior.as_ref());
            figures.extend([(MOMENT, Some(moment)), (MILLISECONDS, Some(1e3 * seconds))]);
            report.add_frame(FrameReport {
                name: format!("{target}{instance}"),
                status: track.status.name().to_owned(),
                flags: posterior.as_ref().map_or_else(Vec::new, flags),
                remarks: track.rejection.iter().map(ToString::to_string).collect(),
                figures,
                posterior: posterior.clone(),
                drawing: frame.drawing.take(),
            });
        }
        let charts = [
            ("Probability of being right", ""),
            ("Error of position", "mm"),
            ("Time a frame", "ms"),
        ];
        for (k, (title, unit)) in charts.into_iter().enumerate() {
            let one = |(name, curves): (&String, &[Vec<[f64; 2]>; 3])| Series {
                name: name.clone(),
                points: curves[k].clone(),
            };
            let series: Vec<Series> = curves.iter().map(one).collect();
            if series.iter().any(|s| s.points.iter().any(|[_, value]| value.is_finite())) {
                let (title, axes) = (title.to_owned(), ["s".to_owned(), unit.to_owned()]);
                report.add_chart(Chart { title, axes, logarithmic: false, series });
            }
        }
        report.finish()
    }
}
