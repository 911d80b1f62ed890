//! Corrections that explain many frames.

use std::collections::BTreeMap;

use super::kind::{Correction, FieldNames};
use super::settings::CorrectionSettings;
use super::size::find_sizes;
use super::trial::{CorrectionTrial, Tried};
use crate::check::warning::{Subject, Warning};
use crate::scene::{Target, median};

/// A correction that makes frames agree with what they show.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Correction of the mistake.
    pub(super) correction: Correction,
    /// Its factor.
    pub factor: f64,
    /// Correction that would do as well, with its factor.
    pub(super) alternative: Option<(Correction, f64)>,
    /// Indices of the frames.
    pub frames: Vec<usize>,
    /// Mean agreement as the inputs are and with the correction, 0 to 1; none where it is the size that tells.
    pub agreement: Option<[f64; 2]>,
    /// Standard deviation of the factor, where it is measured.
    pub sigma: Option<f64>,
}

/// Corrections that make `trials`, each of a target, agree with what they show: first what all have in common, then what those of an object or of a scene
/// have, then single ones. Nothing for frames that agree, and for those that no correction helps. Colors and sizes are compared where these corrections are not
/// needed.
pub fn find_corrections(
    trials: &[(Target, CorrectionTrial)],
    settings: &CorrectionSettings,
) -> Vec<Finding> {
    let (found, explained) = (Vec::new(), vec![false; trials.len()]);
    let mut search = FaultSearch { trials, settings, found, explained };
    search.intrinsics();
    let of_color = |t: &Tried| t.correction == Correction::ChannelsSwapped;
    search.level(|_, _| 0, &|t| !of_color(t));
    search.level(|_, target| target.obj_id, &|t| t.correction.is_of_model());
    search.level(|_, target| target.scene_id, &|t| t.correction.is_of_scene());
    // Of one frame alone only what nothing else could be.
    search.level(|k, _| k as u32, &|t| {
        let is_vague = t.correction.is_rotation() || t.correction.is_unnamed() || of_color(t);
        let [given, corrected] = t.agreement;
        !is_vague && corrected >= settings.good && given < settings.least
    });
    let sizes = find_sizes(trials, &search.explained, settings);
    search.level(|_, _| 0, &of_color);
    search.level(|_, target| target.scene_id, &of_color);
    search.found.extend(sizes);
    search.found
}

/// Corrections found, and which of the trials they explain.
struct FaultSearch<'a> {
    trials: &'a [(Target, CorrectionTrial)],
    settings: &'a CorrectionSettings,
    found: Vec<Finding>,
    explained: Vec<bool>,
}

impl FaultSearch<'_> {
    /// Adds the corrections of intrinsics that most frames of a scene need: a single one may be a crop.
    fn intrinsics(&mut self) {
        for group in groups(self.trials, |_, target| target.scene_id) {
            let told: Vec<_> = group.iter().filter_map(|&k| self.trials[k].1.intrinsics).collect();
            let Some(&(correction, factor)) = told.first() else { continue };
            let is_same = |k: &&usize| self.trials[**k].1.intrinsics == Some((correction, factor));
            let frames: Vec<usize> = group.iter().filter(is_same).copied().collect();
            if 2 * frames.len() <= group.len() {
                continue;
            }
            frames.iter().for_each(|&k| self.explained[k] = true);
            let (alternative, agreement, sigma) = (None, None, None);
            let finding = Finding { correction, factor, alternative, frames, agreement, sigma };
            self.found.push(finding);
        }
    }

    /// Adds what explains those trials of one `key`, of their index and target, that are not explained yet, of the corrections that `admits` lets through.
    fn level(&mut self, key: impl Fn(usize, &Target) -> u32, admits: &dyn Fn(&Tried) -> bool) {
        for mut group in groups(self.trials, key) {
            group.retain(|&k| !self.explained[k] && !self.trials[k].1.tried.is_empty());
            if let Some(finding) = explain(self.trials, &group, admits, self.settings) {
                finding.frames.iter().for_each(|&k| self.explained[k] = true);
                self.found.push(finding);
            }
        }
    }
}

/// Indices of the trials of each `key`.
pub(super) fn groups(
    trials: &[(Target, CorrectionTrial)],
    key: impl Fn(usize, &Target) -> u32,
) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, (target, _)) in trials.iter().enumerate() {
        groups.entry(key(k, target)).or_default().push(k);
    }
    groups.into_values().collect()
}

/// The correction that explains a group best, if one of those that `admits` lets through does.
fn explain(
    trials: &[(Target, CorrectionTrial)],
    group: &[usize],
    admits: &dyn Fn(&Tried) -> bool,
    settings: &CorrectionSettings,
) -> Option<Finding> {
    let candidates = group.iter().map(|&k| trials[k].1.tried.len()).max()?;
    let helps = |(tried, count): &(Tried, usize)| {
        let [given, corrected] = tried.agreement;
        // Most of the group must need it; few have colors. A rotation that fits one view better may be any.
        let (most, [always, of_one]) = match tried.correction {
            Correction::ChannelsSwapped => (0, settings.color_gain),
            unnamed if unnamed.is_unnamed() => (group.len() / 2, [settings.unnamed_gain, 0.0]),
            _ => (group.len() / 2, settings.gain),
        };
        *count > most
            && corrected >= settings.least
            && corrected - given >= always + of_one / (*count as f64).sqrt()
            && admits(tried)
    };
    let means = (0..candidates).filter_map(|c| mean(trials, group, c)).filter(helps);
    let mut best: Vec<Tried> = means.map(|(tried, _)| tried).collect();
    let most = best.iter().map(|t| t.agreement[1]).reduce(f64::max)?;
    best.retain(|t| most - t.agreement[1] < settings.tie);
    // Equal ones stay in their order.
    best.sort_by(|a, b| {
        let unnamed = a.correction.is_unnamed().cmp(&b.correction.is_unnamed());
        unnamed.then(a.oddness.total_cmp(&b.oddness))
    });
    let mut first = best[0];
    let is_certain = !first.correction.is_rotation() || group.len() > 2;
    let other = best[1..].iter().find(|t| {
        let differs = t.correction != first.correction;
        let is_usual = t.oddness - first.oddness < settings.oddness;
        is_certain && differs && !t.correction.is_unnamed() && is_usual
    });
    if !is_certain {
        first.correction = Correction::Rotation;
    }
    let mut frames = group.to_vec();
    if first.correction == Correction::ChannelsSwapped {
        let is_same = |tried: &Tried| tried.correction == first.correction;
        frames.retain(|&k| trials[k].1.tried.iter().flatten().any(is_same));
    }
    Some(Finding {
        frames,
        correction: first.correction,
        factor: first.value,
        alternative: other.map(|t| (t.correction, t.value)),
        agreement: Some(first.agreement),
        sigma: None,
    })
}

/// Candidate number `c` on average over the frames of a group in which it was tried, and their number, if there are any.
fn mean(trials: &[(Target, CorrectionTrial)], group: &[usize], c: usize) -> Option<(Tried, usize)> {
    let tried = |&k: &usize| trials[k].1.tried.get(c).copied().flatten();
    let tried: Vec<Tried> = group.iter().filter_map(tried).collect();
    let mean = |of: &dyn Fn(&Tried) -> f64| tried.iter().map(of).sum::<f64>() / tried.len() as f64;
    let mean = Tried {
        correction: tried.first()?.correction,
        value: median(tried.iter().map(|t| t.value))?,
        agreement: [0, 1].map(|k| mean(&|t| t.agreement[k])),
        oddness: mean(&|t| t.oddness),
    };
    Some((mean, tried.len()))
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
            let what = match self.correction {
                Correction::ChannelsSwapped => "colors of model and images",
                _ => "object, mask and depth",
            };
            text += &format!(
                " ({what} of {count} {frames} then agree by {corrected:.0} %, as they are by {given:.0} %)"
            );
        }
        if self.agreement.is_none() && self.sigma.is_none() {
            text += &format!(" (from the principal point of {count} {frames})");
        }
        if let Some(sigma) = self.sigma {
            text += &format!(" (from outlines and depth of {count} {frames}, ± {sigma:.3})");
        }
        text
    }

    /// True of a warning about what the correction would mend.
    pub fn explains(&self, warning: &Warning) -> bool {
        use Correction::*;
        let (kind, by_agreement) = (self.correction, self.agreement.is_some());
        let is_of_place = kind != ChannelsSwapped;
        match warning.subject {
            // What is felt where the object is, not how hard.
            Subject::Model | Subject::Touch => false,
            Subject::Camera => matches!(kind, PrincipalPointSwapped | CameraOfOtherSize),
            Subject::ModelUnit => matches!(kind, ModelUnit | ModelAndPoseUnit),
            Subject::Hand => is_of_place && (kind == FocalLength || by_agreement),
            Subject::TouchPlace => is_of_place && by_agreement,
            Subject::Pose | Subject::Mask | Subject::Depth => is_of_place,
        }
    }
}
