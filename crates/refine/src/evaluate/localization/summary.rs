//! Average recalls over targets.

use std::collections::BTreeMap;

use serde::Serialize;

use super::target::TargetScore;
use crate::evaluate::metrics::{Recall, THRESHOLDS, Table, VSD_TOLERANCES};

/// BOP's average recalls over some targets (0..=1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AverageRecall {
    /// Number of instances to be found.
    pub targets: usize,
    /// Number of estimates that count, at most one an instance.
    pub estimates: usize,
    /// Average recall of the visible surface discrepancy, over tolerances and thresholds; none unless depth was measured of all targets.
    pub ar_vsd: Option<f64>,
    /// Average recall of the maximum symmetry-aware surface distance, over thresholds.
    pub ar_mssd: f64,
    /// Average recall of the maximum symmetry-aware projection distance, over thresholds.
    pub ar_mspd: f64,
    /// The mean of the three, if there are three.
    pub ar: Option<f64>,
}

/// Average recalls over all targets and over those of each object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LocalizationSummary {
    /// Over all targets.
    pub overall: AverageRecall,
    /// Over the targets of each object id.
    pub per_object: BTreeMap<u32, AverageRecall>,
}

impl AverageRecall {
    /// Zero without targets.
    fn of<'a>(scores: impl Iterator<Item = &'a TargetScore>) -> Self {
        let (mut targets, mut estimates, mut found) = (0, 0, [0; 3]);
        let mut has_depth = true;
        for score in scores {
            has_depth &= score.has_depth;
            targets += score.target.instances;
            estimates += score.estimates;
            found.iter_mut().zip(score.found).for_each(|(sum, of_target)| *sum += of_target);
        }
        let recall = |found: usize, settings: usize| match targets {
            0 => 0.0,
            _ => found as f64 / (targets * settings) as f64,
        };
        let recall = Recall {
            vsd: recall(found[0], VSD_TOLERANCES.len() * THRESHOLDS.len()),
            mssd: recall(found[1], THRESHOLDS.len()),
            mspd: recall(found[2], THRESHOLDS.len()),
        };
        let [ar_vsd, ar] = [recall.vsd, recall.average()].map(|r| has_depth.then_some(r));
        Self { targets, estimates, ar_vsd, ar_mssd: recall.mssd, ar_mspd: recall.mspd, ar }
    }
}

/// Summarizes targets; their order does not matter.
pub fn summarize_localization(scores: &[TargetScore]) -> LocalizationSummary {
    let mut of_object: BTreeMap<u32, Vec<&TargetScore>> = BTreeMap::new();
    for score in scores {
        of_object.entry(score.target.obj_id).or_default().push(score);
    }
    let average =
        |(id, scores): (u32, Vec<&TargetScore>)| (id, AverageRecall::of(scores.into_iter()));
    LocalizationSummary {
        overall: AverageRecall::of(scores.iter()),
        per_object: of_object.into_iter().map(average).collect(),
    }
}

impl LocalizationSummary {
    /// A table with a line an object and one over all; `name` gives the label of an object id.
    pub fn table(&self, name: impl Fn(u32) -> String) -> Table {
        let header =
            ["average recall", "targets", "estimates", "AR_VSD", "AR_MSSD", "AR_MSPD", "AR"];
        let mut table = Table::new(header);
        let objects = self.per_object.iter().map(|(&id, average)| (name(id), average));
        for (label, average) in objects.chain([("all".into(), &self.overall)]) {
            let AverageRecall { targets, estimates, ar_vsd, ar_mssd, ar_mspd, ar } = average;
            let recalls = [*ar_vsd, Some(*ar_mssd), Some(*ar_mspd), *ar];
            let recalls =
                recalls.map(|r| r.map_or_else(|| "–".to_owned(), |recall| format!("{recall:.4}")));
            let counts = [targets, estimates].map(usize::to_string);
            table.push([label].into_iter().chain(counts).chain(recalls).collect());
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::super::target::LocalizationTarget;
    use super::*;

    fn score(obj_id: u32, instances: usize, estimates: usize, found: [usize; 3]) -> TargetScore {
        let target = LocalizationTarget { scene_id: 1, im_id: 0, obj_id, instances };
        TargetScore { target, estimates, found, has_depth: true }
    }

    #[test]
    fn recall_is_over_instances_and_those_without_an_estimate_are_missed() {
        let scores =
            [score(7, 1, 1, [100, 10, 10]), score(7, 2, 1, [50, 4, 2]), score(3, 1, 0, [0; 3])];
        let summary = summarize_localization(&scores);
        let all = summary.overall;
        assert_eq!((all.targets, all.estimates), (4, 2));
        assert_eq!((all.ar_vsd, all.ar_mssd, all.ar_mspd), (Some(150.0 / 400.0), 14.0 / 40.0, 0.3));
        assert!((all.ar.unwrap() - (0.375 + 0.35 + 0.3) / 3.0).abs() < 1e-15);
        assert_eq!(summary.per_object[&7].ar_mssd, 14.0 / 30.0);
        assert_eq!(summary.per_object[&3].ar, Some(0.0));
        assert_eq!(summarize_localization(&[]).overall.ar, Some(0.0));
        let unmeasured = TargetScore { has_depth: false, ..score(7, 1, 1, [0, 10, 5]) };
        let of_color = summarize_localization(&[unmeasured]);
        let AverageRecall { ar_vsd, ar_mssd, ar_mspd, ar, .. } = of_color.overall;
        assert_eq!((ar_vsd, ar_mssd, ar_mspd, ar), (None, 1.0, 0.5, None));
        let line = of_color.table(|id| id.to_string()).to_string();
        assert!(line.lines().last().unwrap().contains('–'), "{line}");

        let text = summary.table(|id| format!("object {id}")).to_string();
        let last: Vec<&str> = text.lines().last().unwrap().split_whitespace().collect();
        assert_eq!(last, ["all", "4", "2", "0.3750", "0.3500", "0.3000", "0.3417"]);
        let json = serde_json::to_value(&summary).unwrap();
        assert_eq!(json["per_object"]["7"]["targets"], 3);
    }
}
