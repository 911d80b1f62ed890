//! Evidence that does not fit is let off.

use super::{Fused, Modality, Posterior};
use crate::error::RefineError;
use crate::problem::State;
use crate::scene::Frame;
use crate::strategy::{Estimate, Observer};

/// Where the probability is less, something does not fit; where it is more without a kind of evidence, that was it.
const FITS: f64 = 0.5;

/// What may be let off: colors of another texture or under odd lights, depth of what shines or lets light through, a skin that feels what is not
/// there. Outlines, and that things are not in the same place, always count.
const KINDS: [&[Modality]; 3] = [
    &[Modality::Color],
    &[Modality::Depth, Modality::FreeSpace],
    &[Modality::Touch, Modality::Quiet],
];

fn probability(found: &Estimate) -> f64 {
    found.posterior.as_ref().map_or(0.0, Posterior::probability)
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
        let fit = found.posterior.as_ref().and_then(|posterior| posterior.fit.as_ref());
        if fit.is_none_or(|fit| fit.probability >= FITS) {
            return Ok(found);
        }
        let mut best = found;
        for kinds in KINDS {
            if !kinds.iter().any(|kind| self.settings.modalities.contains(kind)) {
                continue;
            }
            let mut fused = self.clone();
            fused.settings.modalities.retain(|modality| !kinds.contains(modality));
            // What only colors tell apart is not known without them, wherever the start was.
            let colorless = kinds.contains(&Modality::Color);
            let rivals = frame.rivals().or_else(|| colorless.then_some(&[]));
            let mut other = fused.run_from(frame, initial, rivals, observe)?;
            if probability(&other) > probability(&best).max(FITS) {
                if let Some(posterior) = &mut other.posterior {
                    posterior.let_off = kinds.to_vec();
                }
                best = other;
            }
        }
        Ok(best)
    }
}
