//! Values over time.

/// Values at moments \[ns\], in order.
#[derive(Clone, Debug)]
pub(super) struct Series<T>(Vec<(i64, T)>);

impl<T> Default for Series<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Copy> Series<T> {
    /// Keeps `value`. Of several at one moment the last counts.
    pub(super) fn push(&mut self, at: i64, value: T) {
        // Messages come nearly in order.
        let place = self.0.partition_point(|(known, _)| *known <= at);
        match place.checked_sub(1) {
            Some(before) if self.0[before].0 == at => self.0[before].1 = value,
            _ => self.0.insert(place, (at, value)),
        }
    }

    /// The value at the moment `at`: in between by `mix`, which is given how far from the first to the second it is; before the first
    /// and after the last that of these, for as long as `slack` \[ns\].
    pub(super) fn at(&self, at: i64, slack: i64, mix: impl Fn(&T, &T, f64) -> T) -> Option<T> {
        let place = self.0.partition_point(|(known, _)| *known <= at);
        let before = place.checked_sub(1).and_then(|k| self.0.get(k));
        match (before, self.0.get(place)) {
            (Some((known, value)), _) if *known == at => Some(*value),
            (Some((from, first)), Some((to, second))) => {
                Some(mix(first, second, (at - from) as f64 / (to - from) as f64))
            }
            (Some((known, value)), None) | (None, Some((known, value))) => {
                ((known - at).abs() <= slack).then_some(*value)
            }
            (None, None) => None,
        }
    }

    /// The value nearest to the moment `at`, if it is not farther than `slack` \[ns\].
    pub(super) fn nearest(&self, at: i64, slack: i64) -> Option<T> {
        let place = self.0.partition_point(|(known, _)| *known <= at);
        let around = &self.0[place.saturating_sub(1)..(place + 1).min(self.0.len())];
        let nearest = around.iter().min_by_key(|(known, _)| (known - at).abs());
        nearest.filter(|(known, _)| (known - at).abs() <= slack).map(|(_, value)| *value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_mixed_between_moments_and_held_for_a_while_beyond() {
        let mut series = Series::default();
        for (at, value) in [(20, 2.0), (10, 1.0), (30, 7.0), (30, 3.0)] {
            series.push(at, value);
        }
        let at = |at| series.at(at, 5, |a, b, part| a + (b - a) * part);
        assert_eq!(
            [4, 6, 10, 15, 30, 35, 36].map(at),
            [None, Some(1.0), Some(1.0), Some(1.5), Some(3.0), Some(3.0), None]
        );
        assert_eq!([14, 26, 40].map(|at| series.nearest(at, 5)), [Some(1.0), Some(3.0), None]);
        assert_eq!(Series::<f64>::default().nearest(0, i64::MAX), None);
    }
}
