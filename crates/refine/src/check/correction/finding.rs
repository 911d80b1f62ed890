//! Corrections that explain many frames.

use std::collections::BTreeMap;

use super::kind::{Correction, FieldNames, Scope, candidate_count};
use super::settings::CorrectionSettings;
use super::size::find_sizes;
use super::trial::{CorrectionTrial, Tried};
use crate::check::warning::{Subject, Warning};
use crate::scene::{Target, median};

/// A correction that makes frames agree with what they show.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Correction of the mistake.
    pub correction: Correction,
    /// Its factor.
    pub factor: f64,
    /// Correction that would do as well, with its factor.
    pub alternative: Option<(Correction, f64)>,
    /// Indices of the frames.
    pub frames: Vec<usize>,
    /// Mean agreement as the inputs are and with the correction, 0 to 1; none where it is the size that tells.
    pub agreement: Option<[f64; 2]>,
    /// Standard deviation of the factor, where it is measured.
    pub sigma: Option<f64>,
}

/// Corrections that make `trials`, each of a target, agree with what they show: first what all have in common, then what those of an object or of a scene
/// have, then single ones. Nothing for frames that agree, and for those that no correction helps.
pub fn find_corrections(
    trials: &[(Target, CorrectionTrial)],
    settings: &CorrectionSettings,
) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut explained = vec![false; trials.len()];
    let admits_all = |_: &Attempt| true;
    let of_object = |a: &Attempt| a.correction.scope() == Scope::Object;
    let of_scene = |a: &Attempt| a.correction.scope() == Scope::Scene;
    // Of one frame alone only what nothing else could be.
    let of_frame = |a: &Attempt| {
        let is_vague = a.correction.is_rotation() || a.correction.is_unnamed();
        !is_vague && a.agreement >= settings.good && a.given < settings.least
    };
    let alone = (0..trials.len()).map(|k| vec![k]).collect();
    let levels: [(Admits<'_>, Vec<Vec<usize>>); 4] = [
        (&admits_all, groups(trials, |_| 0)),
        (&of_object, groups(trials, |target| target.obj_id)),
        (&of_scene, groups(trials, |target| target.scene_id)),
        (&of_frame, alone),
    ];
    for (admits, groups) in levels {
        for group in groups {
            let open: Vec<usize> = group.into_iter().filter(|&k| !explained[k]).collect();
            if let Some(finding) = explain(trials, &open, admits, settings) {
                finding.frames.iter().for_each(|&k| explained[k] = true);
                found.push(finding);
            }
        }
    }
    found.extend(find_sizes(trials, &explained, settings));
    found
}

/// Indices of the trials of each `key`.
pub(super) fn groups(
    trials: &[(Target, CorrectionTrial)],
    key: impl Fn(&Target) -> u32,
) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, (target, _)) in trials.iter().enumerate() {
        groups.entry(key(target)).or_default().push(k);
    }
    groups.into_values().collect()
}

/// Attempts that are looked at.
type Admits<'a> = &'a dyn Fn(&Attempt) -> bool;

/// A correction of a group of frames, with means over those in which it was tried.
struct Attempt {
    correction: Correction,
    factor: f64,
    frames: Vec<usize>,
    given: f64,
    agreement: f64,
    oddness: f64,
}

/// The correction that explains a group best, if one of those that `admits` lets through does.
fn explain(
    trials: &[(Target, CorrectionTrial)],
    group: &[usize],
    admits: Admits<'_>,
    settings: &CorrectionSettings,
) -> Option<Finding> {
    let attempts: Vec<Attempt> =
        (0..candidate_count()).filter_map(|c| attempt(trials, group, c)).collect();
    let [always, of_one] = settings.gain;
    let helps = |a: &&Attempt| {
        let count = a.frames.len();
        let gain = match a.correction.is_unnamed() {
            true => settings.unnamed_gain,
            false => always + of_one / (count as f64).sqrt(),
        };
        // Most of the group must need it.
        2 * count > group.len()
            && a.agreement >= settings.least
            && a.agreement - a.given >= gain
            && admits(a)
    };
    let helpful: Vec<&Attempt> = attempts.iter().filter(helps).collect();
    let most = helpful.iter().map(|a| a.agreement).reduce(f64::max)?;
    let mut best: Vec<&Attempt> =
        helpful.into_iter().filter(|a| most - a.agreement < settings.tie).collect();
    // Equal ones stay in their order.
    best.sort_by(|a, b| {
        let unnamed = a.correction.is_unnamed().cmp(&b.correction.is_unnamed());
        unnamed.then(a.oddness.total_cmp(&b.oddness))
    });
    let first = best[0];
    let other = best[1..].iter().find(|a| {
        let differs = a.correction != first.correction;
        differs && !a.correction.is_unnamed() && a.oddness - first.oddness < settings.oddness
    });
    Some(Finding {
        correction: first.correction,
        factor: first.factor,
        alternative: other.map(|a| (a.correction, a.factor)),
        frames: group.to_vec(),
        agreement: Some([first.given, first.agreement]),
        sigma: None,
    })
}

/// Candidate number `c` on the frames of a group in which it was tried, if there are any.
fn attempt(trials: &[(Target, CorrectionTrial)], group: &[usize], c: usize) -> Option<Attempt> {
    let tried = |&k: &usize| Some((k, trials[k].1.tried.get(c).copied().flatten()?));
    let tried: Vec<(usize, Tried)> = group.iter().filter_map(tried).collect();
    let (_, Tried { correction, .. }) = tried.first()?;
    let mean = |of: &dyn Fn(&(usize, Tried)) -> f64| {
        tried.iter().map(of).sum::<f64>() / tried.len() as f64
    };
    Some(Attempt {
        correction: *correction,
        factor: median(tried.iter().map(|(_, tried)| tried.value))?,
        frames: tried.iter().map(|(k, _)| *k).collect(),
        given: mean(&|(k, _)| trials[*k].1.given),
        agreement: mean(&|(_, tried)| tried.agreement),
        oddness: mean(&|(_, tried)| tried.oddness),
    })
}

impl Finding {
    /// Mistake with file and field, what to do about it, and what tells so.
    pub fn message(&self, names: &FieldNames) -> String {
        let mut text = self.correction.message(names, self.factor);
        if let Some((correction, factor)) = self.alternative {
            text += &format!("; or {}", correction.message(names, factor));
        }
        let count = self.frames.len();
        let frames = if count == 1 { "frame" } else { "frames" };
        if let Some([given, corrected]) = self.agreement.map(|shares| shares.map(|s| 1e2 * s)) {
            text += &format!(
                " (object, mask and depth of {count} {frames} then agree by {corrected:.0} %, as they are by {given:.0} %)"
            );
        }
        if let Some(sigma) = self.sigma {
            text += &format!(" (from outlines and depth of {count} {frames}, ± {sigma:.3})");
        }
        text
    }

    /// True of a warning about what the correction would mend.
    pub fn explains(&self, warning: &Warning) -> bool {
        let (kind, by_agreement) = (self.correction, self.agreement.is_some());
        let is_unit = matches!(kind, Correction::ModelUnit | Correction::ModelAndPoseUnit);
        match warning.subject {
            Subject::Model => is_unit && warning.unit == "m",
            // Where the object is, not how hard it is felt.
            Subject::Touch => by_agreement && warning.unit == "cm",
            Subject::Hand => kind == Correction::FocalLength || by_agreement,
            Subject::Pose | Subject::Mask | Subject::Depth => true,
        }
    }
}
