//! Where along a line across the outline the object ends.

/// Steps that lines reach to either side of the outline.
pub(super) const REACH: i32 = 8;
/// Pixels on a line.
pub(super) const SAMPLES: usize = 2 * REACH as usize + 1;

/// Likelihood of the border's place along a line of pixels.
///
/// The model's outline is off from the border by a normal deviation σ: a border at d and an outline at δ, both outward from the middle of the line
/// \[steps\], have the likelihood exp(S(d) − ½ (d − δ)²/σ²), where S(d) is the sum of the log-likelihood ratios of object and others
/// over the pixels within d, and that of a border at d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Border {
    /// exp(S) before the first pixel and after each, the largest one.
    likelihoods: [f64; SAMPLES + 1],
    precision: f64,
    /// Logarithm of the largest likelihood of all places of the outline.
    highest: f64,
    /// Cost of an outline that nothing is seen of \[nat\].
    limit: f64,
}

/// Cost of an outline on a line \[nat\], with its derivative by the outline's place \[nat/step\] and its information \[nat/step²\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Misfit {
    pub(super) cost: f64,
    pub(super) slope: f64,
    pub(super) information: f64,
}

impl Border {
    /// From the log-likelihood ratios of the pixels on a line, from within outward, and of a border before the first of them and after each \[nat\], and the
    /// deviation σ \[steps\]. Where the border is farther in,
    /// the outline may be hidden, which costs `hidden`; where it is farther out the object goes on, which costs `exceeded` at most \[nat\].
    pub(super) fn new(
        evidence: &[f64; SAMPLES],
        edges: &[f64; SAMPLES + 1],
        sigma: f64,
        [hidden, exceeded]: [f64; 2],
    ) -> Self {
        let mut likelihoods = [0.0; SAMPLES + 1];
        let mut sum = 0.0;
        for (after, evidence) in likelihoods[1..].iter_mut().zip(evidence) {
            sum += evidence;
            *after = sum;
        }
        likelihoods.iter_mut().zip(edges).for_each(|(sum, edge)| *sum += edge);
        let largest = likelihoods.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        likelihoods.iter_mut().for_each(|sum| *sum = (*sum - largest).exp());
        let mut border = Self {
            likelihoods,
            precision: sigma.powi(-2),
            highest: f64::NEG_INFINITY,
            limit: hidden,
        };
        // exp(−½ (d − δ)²/σ²) by d − δ, of outlines at whole steps.
        let normal: [f64; 2 * SAMPLES] =
            std::array::from_fn(|k| border.normal(k as f64 - (SAMPLES as f64 - 0.5)));
        for step in -REACH..=REACH {
            let offsets = &normal[(REACH - step) as usize..];
            let products = border.likelihoods.iter().zip(offsets).map(|(s, normal)| s * normal);
            let likelihood = products.fold(f64::MIN_POSITIVE, |sum, product| sum + product).ln();
            if likelihood > border.highest {
                border.highest = likelihood;
                border.limit = if step > 0 { exceeded } else { hidden };
            }
        }
        border
    }

    /// exp(−½ (d − δ)²/σ²) of a border at d that is `off` from the outline at δ \[steps\].
    fn normal(&self, off: f64) -> f64 {
        (-0.5 * self.precision * off * off).exp()
    }

    /// Likelihood of an outline at `place`, and mean and variance of the border's place from there.
    fn moments(&self, place: f64) -> [f64; 3] {
        let [mut mass, mut first, mut second] = [f64::MIN_POSITIVE, 0.0, 0.0];
        for (k, likelihood) in self.likelihoods.iter().enumerate() {
            let off = k as f64 - f64::from(REACH) - 0.5 - place;
            let joint = likelihood * self.normal(off);
            mass += joint;
            first += joint * off;
            second += joint * off * off;
        }
        let mean = first / mass;
        [mass, mean, (second / mass - mean * mean).max(0.0)]
    }

    /// Misfit of an outline at `place` \[steps\].
    pub(super) fn misfit(&self, place: f64) -> Misfit {
        let [likelihood, mean, variance] = self.moments(place);
        let relative = (likelihood.ln() - self.highest).exp();
        let unseen = (-self.limit).exp();
        let total = (1.0 - unseen) * relative + unseen;
        let seen = (1.0 - unseen) * relative / total;
        let curvature = (self.precision * (1.0 - self.precision * variance)).max(0.0);
        Misfit {
            cost: -total.ln(),
            slope: -seen * self.precision * mean,
            information: seen * curvature,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(last: i32) -> [f64; SAMPLES] {
        std::array::from_fn(|k| if k as i32 - REACH <= last { 2.0 } else { -2.0 })
    }

    #[test]
    fn the_border_is_where_evidence_changes() {
        for last in -4..4 {
            let border = Border::new(&line(last), &[0.0; SAMPLES + 1], 0.8, [2.0, 8.0]);
            let at = f64::from(last) + 0.5;
            assert!(border.misfit(at).slope.abs() < 1e-3);
            let off = border.misfit(at + 1.0);
            assert!(off.cost > 0.2 && off.slope > 0.1 && off.information > 0.0);
        }
    }

    #[test]
    fn what_is_hidden_pulls_nowhere() {
        let nothing =
            Border::new(&[0.0; SAMPLES], &[0.0; SAMPLES + 1], 0.8, [2.0, 8.0]).misfit(0.0);
        assert!(nothing.cost < 0.01 && nothing.slope.abs() < 1e-9 && nothing.information < 0.1);
        let hidden =
            Border::new(&[-2.0; SAMPLES], &[0.0; SAMPLES + 1], 0.8, [2.0, 8.0]).misfit(0.0);
        assert!((hidden.cost - 2.0).abs() < 0.01 && hidden.slope < 0.1);
        let exceeded =
            Border::new(&[2.0; SAMPLES], &[0.0; SAMPLES + 1], 0.8, [2.0, 8.0]).misfit(0.0);
        assert!((exceeded.cost - 8.0).abs() < 0.1);
    }

    #[test]
    fn slope_matches_differences() {
        let mixed = std::array::from_fn(|k| (1.3 * k as f64).sin() - 0.2 * (k as f64 - 8.0));
        for place in [-2.3, -0.4, 0.0, 0.7, 3.1] {
            let border = Border::new(&mixed, &[0.0; SAMPLES + 1], 0.9, [2.0, 8.0]);
            let numeric =
                (border.misfit(place + 1e-6).cost - border.misfit(place - 1e-6).cost) / 2e-6;
            let slope = border.misfit(place).slope;
            assert!((numeric - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{numeric} {slope}");
        }
    }
}
