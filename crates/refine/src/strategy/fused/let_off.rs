//! Evidence that does not fit is let off.

use strum::IntoStaticStr;

use super::{Fused, FusedSettings, Modality, Posterior};
use crate::error::RefineError;
use crate::problem::State;
use crate::scene::Frame;
use crate::strategy::{Estimate, Observer};

/// Where model and data are right with less probability, something does not fit.
const FITS: f64 = 0.5;
/// Where the pose is right with more without a kind of evidence, that was it. Without colors a wrong pose may look as right as another one does: of two
/// alike, neither has so much.
const CONVINCES: f64 = 0.75;

/// What may be let off: colors of another texture or under odd lights, depth of what shines or lets light through, a skin that feels what is not
/// there, cameras that are elsewhere; and each factor from outside. Outlines, and that things are not in the same place, always count.
const KINDS: [Kind; 4] = [Kind::Color, Kind::Depth, Kind::Touch, Kind::Views];

#[derive(Clone, Copy, PartialEq, Eq, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
enum Kind {
    Color,
    Depth,
    Touch,
    Views,
}

impl Kind {
    /// What of the settings it is.
    fn modalities(self) -> &'static [Modality] {
        match self {
            Self::Color => &[Modality::Color],
            Self::Depth => &[Modality::Depth, Modality::FreeSpace],
            Self::Touch => &[Modality::Touch, Modality::Quiet],
            Self::Views => &[],
        }
    }

    /// Whether `frame` brings it, and it is used.
    fn is_in(self, frame: &Frame<'_>, settings: &FusedSettings) -> bool {
        let used = self.modalities().iter().any(|kind| settings.modalities.contains(kind));
        match self {
            Self::Color => used && frame.observation().has_colors(),
            Self::Depth => used && frame.masked_depths(1000).is_ok(),
            Self::Touch => {
                let hand = frame.hand().map(|(_, hand)| hand);
                used && hand.is_some_and(|h| !h.forces.is_empty() || !h.touch.is_empty())
            }
            Self::Views => settings.views && !frame.views().is_empty(),
        }
    }
}

fn probability(found: &Estimate) -> f64 {
    found.posterior.as_ref().map_or(0.0, Posterior::probability)
}

/// Takes what was found without `name` in place of `best`, if it is convincing.
fn take_if_better(best: &mut Estimate, mut other: Estimate, name: &'static str) {
    if probability(&other) > probability(best).max(CONVINCES) {
        if let Some(posterior) = &mut other.posterior {
            posterior.let_off = Some(name);
        }
        *best = other;
    }
}

impl Fused {
    /// `found` in `frame` from `initial`, or, if something does not fit there, the best that is found without one kind of evidence, if that fits.
    pub(super) fn without_misfits(
        &self,
        frame: &Frame<'_>,
        initial: &State,
        found: Estimate,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        // What was broken off is not judged.
        let fit = |found: &Estimate| Some(found.posterior.as_ref()?.fit.as_ref()?.probability);
        if fit(&found).is_none_or(|fit| fit >= FITS) {
            return Ok(found);
        }
        let mut best = found;
        // First a factor from outside: where all that was sensed fits without it, no sensor is let off in its stead.
        for k in 0..self.factors.len() {
            let mut fused = self.clone();
            let name = fused.factors.remove(k).name();
            let other = fused.run_from(frame, initial, frame.rivals(), observe)?;
            if fit(&other).is_none() {
                return Ok(best);
            }
            take_if_better(&mut best, other, name);
        }
        if best.posterior.as_ref().is_some_and(|posterior| posterior.let_off.is_some()) {
            return Ok(best);
        }
        for kind in KINDS.into_iter().filter(|kind| kind.is_in(frame, &self.settings)) {
            let mut fused = self.clone();
            fused.settings.modalities.retain(|modality| !kind.modalities().contains(modality));
            fused.settings.views &= kind != Kind::Views;
            // What only colors tell apart is not known without them, wherever the start was.
            let rivals = frame.rivals().or_else(|| (kind == Kind::Color).then_some(&[]));
            let other = fused.run_from(frame, initial, rivals, observe)?;
            if fit(&other).is_none() {
                break;
            }
            take_if_better(&mut best, other, kind.into());
        }
        Ok(best)
    }
}
