//! Values over time.

/// Values at moments \[ns\], in order.
#[derive(Clone, Debug)]
pub(super) struct TimeSeries<T>(Vec<(i64, T)>);

/// A value counts for so long before and after its moment \[ns\].
const HELD: i64 = 100_000_000;

impl<T> Default for TimeSeries<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Copy> TimeSeries<T> {
    /// Keeps `value`, in whatever order they come: see [`sort`](Self::sort).
    pub(super) fn push(&mut self, at: i64, value: T) {
        self.0.push((at, value));
    }

    /// Makes what was kept ready to be asked for. Of several values at one moment the last counts.
    pub(super) fn sort(&mut self) {
        self.0.sort_by_key(|(at, _)| *at);
        self.0.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            if is_same {
                kept.1 = next.1;
            }
            is_same
        });
    }

    /// The value at the moment `at`: between two that are near by `mix`, which is given how far from the first to the second it is, else the
    /// nearest one, as long as that counts.
    pub(super) fn at(&self, at: i64, mix: impl Fn(&T, &T, f64) -> T) -> Option<T> {
        let place = self.0.partition_point(|(known, _)| *known <= at);
        let before = place.checked_sub(1).and_then(|k| self.0.get(k));
        match (before, self.0.get(place)) {
            (Some((known, value)), _) if *known == at => Some(*value),
            (Some((from, first)), Some((to, second))) if to.saturating_sub(*from) <= 2 * HELD => {
                Some(mix(first, second, (at - from) as f64 / (to - from) as f64))
            }
            _ => self.nearest(at, HELD),
        }
    }

    /// The value nearest to the moment `at`, if it is not farther than `most` \[ns\].
    pub(super) fn nearest(&self, at: i64, most: i64) -> Option<T> {
        let place = self.0.partition_point(|(known, _)| *known <= at);
        let around = &self.0[place.saturating_sub(1)..(place + 1).min(self.0.len())];
        let distance = |known: i64| known.saturating_sub(at).saturating_abs();
        let nearest = around.iter().min_by_key(|(known, _)| distance(*known));
        nearest.filter(|(known, _)| distance(*known) <= most).map(|(_, value)| *value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_mixed_between_moments_and_held_for_a_while_beyond() {
        let mut series = TimeSeries::default();
        let ms = 1_000_000;
        for (at, value) in [(20, 2.0), (10, 1.0), (430, 7.0), (430, 3.0)] {
            series.push(at * ms, value);
        }
        series.sort();
        let at = |at| series.at(at * ms, |a, b, part| a + (b - a) * part);
        assert_eq!([-91, -89, 10, 15].map(at), [None, Some(1.0), Some(1.0), Some(1.5)]);
        // Nothing is known in a gap.
        assert_eq!([119, 121, 331, 531].map(at), [Some(2.0), None, Some(3.0), None]);
        assert_eq!([14, 26].map(|at| series.nearest(at * ms, 7 * ms)), [Some(1.0), Some(2.0)]);
        assert_eq!(series.nearest(i64::MIN, i64::MAX), Some(1.0));
        assert_eq!(TimeSeries::<f64>::default().nearest(0, i64::MAX), None);
    }
}
