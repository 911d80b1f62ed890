//! All numbers of a study, one a line.

use std::fmt::Display;

use super::calibration::Calibration;
use super::tables::Tables;

const COLUMNS: &str = "study,level,object,row,metric,frames,n,mean,mean_low,mean_high,median,\
    change_percent,change_low,change_high,published_mean,reference,difference,difference_low,\
    difference_high,ratio,ratio_low,ratio_high,note";

/// The tables as CSV. A row that is compared with another one has that one's name, the difference of their means over the
/// frames that have both, and their ratio. `object` is empty over all objects; failures come last, with their reason as the note.
pub(super) fn csv(tables: &Tables) -> Result<Vec<u8>, ::csv::Error> {
    let mut out = ::csv::Writer::from_writer(Vec::new());
    out.write_record(COLUMNS.split(','))?;
    let study = tables.study.name();
    for table in &tables.all {
        for row in &table.rows {
            let compared = table.comparisons.iter().find(|c| c.row == row.name);
            for (m, metric) in tables.metrics.iter().enumerate() {
                let Some(estimate) = &row.metrics[m] else { continue };
                let [low, high] = ends(estimate.interval);
                let change = estimate.change.map(|c| c.percent);
                let [change_low, change_high] = ends(estimate.change.and_then(|c| c.interval));
                let published = row.published.and_then(|p| p[m]);
                let contrast = compared.and_then(|c| c.metrics[m]);
                let reference = compared.filter(|_| contrast.is_some()).map(|c| &c.reference);
                let difference = contrast.map(|c| c.difference);
                let [difference_low, difference_high] =
                    ends(contrast.and_then(|c| c.difference_interval));
                let ratio = contrast.and_then(|c| c.ratio);
                let [ratio_low, ratio_high] = ends(contrast.and_then(|c| c.ratio_interval));
                let (mean, median) = (Some(estimate.mean), Some(estimate.median));

                let names = [study, &table.level, &text(table.object), &row.name, metric];
                let counts = [table.frames, estimate.n].map(|n| n.to_string());
                let own = [mean, low, high, median, change, change_low, change_high, published];
                let other =
                    [difference, difference_low, difference_high, ratio, ratio_low, ratio_high];
                let cells = [&names.map(str::to_owned)[..], &counts, &own.map(text)];
                let rest = [&[text(reference)][..], &other.map(text), &[String::new()]];
                out.write_record([cells, rest].concat().concat())?;
            }
        }
    }
    for failure in &tables.failures {
        let (object, rows) = (text(failure.object), failure.rows.join(" "));
        let named = [study, &failure.level, &object, &rows, "failed"];
        let reason = format!("{}: {}", failure.frame, failure.reason);
        let empty = COLUMNS.split(',').count() - named.len() - 1;
        let cells = named.into_iter().chain(std::iter::repeat_n("", empty)).chain([&*reason]);
        out.write_record(cells)?;
    }
    out.into_inner().map_err(|e| e.into_error().into())
}

/// All numbers of calibrations as CSV, one a line.
pub(super) fn calibration_csv(calibrations: &[Calibration]) -> Result<Vec<u8>, ::csv::Error> {
    let mut out = ::csv::Writer::from_writer(Vec::new());
    out.write_record(["level", "method", "n", "what", "of", "value", "low", "high"])?;
    for c in calibrations {
        let mut line = |what: &str, of: &str, value: f64, interval: Option<[f64; 2]>| {
            let [low, high] = ends(interval).map(text);
            out.write_record([
                c.level.as_deref().unwrap_or(""),
                &c.method,
                &c.n.to_string(),
                what,
                of,
                &value.to_string(),
                &low,
                &high,
            ])
        };
        for error in &c.errors {
            line("root mean square", error.of, error.found, None)?;
            line("median", error.of, error.median, None)?;
            line("bound", error.of, error.bound, None)?;
        }
        for part in &c.coverage {
            let what = format!("coverage of {} %", 100.0 * part.nominal);
            line(&what, part.of, part.share, part.interval)?;
        }
        for event in &c.events {
            line("predicted", event.event, event.predicted, None)?;
            line("share", event.event, event.share, None)?;
            line("calibration error", event.event, event.calibration_error, None)?;
            line("calibration error by chance", event.event, event.by_chance, None)?;
            line("brier", event.event, event.brier, None)?;
        }
        line("failures", "", c.failures as f64, None)?;
        if let Some(auroc) = c.auroc {
            line("auroc", "failures", auroc, c.auroc_interval)?;
        }
    }
    out.into_inner().map_err(|e| e.into_error().into())
}

fn text<T: Display>(value: Option<T>) -> String {
    value.map_or_else(String::new, |v| v.to_string())
}

fn ends(interval: Option<[f64; 2]>) -> [Option<f64>; 2] {
    [interval.map(|i| i[0]), interval.map(|i| i[1])]
}

#[cfg(test)]
mod tests {
    use super::super::tables::tests::example;
    use super::*;

    #[test]
    fn every_estimate_and_every_failure_has_a_line() {
        let (design, records) = example();
        let tables = Tables::new(&design, &records);
        let text = String::from_utf8(csv(&tables).unwrap()).unwrap();
        let estimates = tables.all.iter().flat_map(|b| &b.rows).flat_map(|l| l.metrics).flatten();
        assert_eq!(text.lines().count(), 1 + estimates.count() + tables.failures.len());
        for expected in [
            "\nmain,low,,initial,PE cm,4,3,2,1,3,2,,,,0.65,,,,,,,,\n",
            "\nmain,high,,combined,PE cm,3,3,1,0.5,1.5,1,-75,-75,-75,1.45,robust-icp,-7,",
            ",0.125,0.125,0.125,\n",
            ",6,robust-icp,failed,,,,,,,,,,,,,,,,,,low: scene 1 image 2 object 6: no pixel\n",
        ] {
            assert!(text.contains(expected), "{expected} {text}");
        }
    }
}
