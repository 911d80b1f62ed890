//! Which states to keep so that a chain can be visited backwards with the fewest recomputed steps.
//!
//! A. Griewank, A. Walther, "Algorithm 799: revolve", ACM Trans. Math. Softw. 26 (2000).

/// The states of a chain, of which few are kept and the others computed again when asked for.
pub(super) struct Snapshots<T> {
    initial: T,
    /// States after the initial one by rising number, at most `limit - 1`.
    later: Vec<(usize, T)>,
    limit: usize,
}

impl<T: Clone> Snapshots<T> {
    /// A chain from `initial`, of which at most `limit` states are kept; the initial one always is.
    pub(super) fn new(initial: T, limit: usize) -> Self {
        Self { initial, later: Vec::new(), limit: limit.max(1) }
    }

    /// State number `index`, where `advance` turns the state of the number that it is given into the next.
    ///
    /// States beyond `index` are forgotten, and on the way there those are kept that make it cheapest to ask
    /// for `index`, `index - 1`, …, 0: together [`fewest_advances`] calls of `advance`. In any other order
    /// the answers are as right, only not as cheap.
    pub(super) fn state(&mut self, index: usize, mut advance: impl FnMut(usize, &mut T)) -> T {
        while self.later.pop_if(|(kept, _)| *kept > index).is_some() {}
        let (mut at, mut state) = match self.later.last() {
            Some((at, state)) => (*at, state.clone()),
            None => (0, self.initial.clone()),
        };
        // Two states need no snapshot between them: the second is the one in hand.
        while index - at > 1 && self.later.len() + 1 < self.limit {
            let next = at + split(index - at + 1, self.limit - self.later.len());
            (at..next).for_each(|i| advance(i, &mut state));
            self.later.push((next, state.clone()));
            at = next;
        }
        (at..index).for_each(|i| advance(i, &mut state));
        state
    }
}

/// How far from the first of `length` states to put the next snapshot, if `snapshots` may be held, that of the
/// first included (both at least 2).
///
/// With β(s, r) = C(s + r, s) and r the least for which `length` ≤ β(s, r), every distance between β(s, r−2) and
/// β(s, r−1) that leaves β(s−1, r−1) to β(s−1, r) states behind it is optimal. This is the largest.
fn split(length: usize, snapshots: usize) -> usize {
    if snapshots >= length {
        return 1;
    }
    let (length, s) = (length as u128, snapshots as u128);
    // β(s, r−1), for r = 1 to begin with.
    let (mut reach, mut r) = (1, 1);
    loop {
        let next = reach * (s + r) / r;
        if next >= length {
            break;
        }
        (reach, r) = (next, r + 1);
    }
    let behind = reach * s / (s + r - 1);
    reach.min(length - behind) as usize
}

/// The fewest snapshots with which no state of `length` is computed more than `times` times: the least s with
/// C(s + `times`, s) ≥ `length`.
pub(super) fn fewest_snapshots(length: usize, times: usize) -> usize {
    let (length, times) = (length as u128, times.max(1) as u128);
    let (mut reach, mut s) = (1 + times, 1);
    while reach < length {
        s += 1;
        reach = reach * (s + times) / s;
    }
    s as usize
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::collections::HashMap;
    use std::rc::Rc;

    use super::*;

    /// A state that knows its number and how many of its kind are alive.
    struct Counted {
        number: usize,
        alive: Rc<Cell<usize>>,
        peak: Rc<Cell<usize>>,
    }

    impl Clone for Counted {
        fn clone(&self) -> Self {
            let (alive, peak) = (self.alive.clone(), self.peak.clone());
            alive.set(alive.get() + 1);
            peak.set(peak.get().max(alive.get()));
            Self { number: self.number, alive, peak }
        }
    }

    impl Drop for Counted {
        fn drop(&mut self) {
            self.alive.set(self.alive.get() - 1);
        }
    }

    /// Fewest advances to visit `length` states backwards, by trying every first snapshot.
    fn by_search(length: usize, s: usize, known: &mut HashMap<(usize, usize), usize>) -> usize {
        if length <= 1 {
            return 0;
        }
        if s == 1 {
            return length * (length - 1) / 2;
        }
        if let Some(&advances) = known.get(&(length, s)) {
            return advances;
        }
        let best = (1..length)
            .map(|m| m + by_search(length - m, s - 1, known) + by_search(m, s, known))
            .min()
            .unwrap();
        known.insert((length, s), best);
        best
    }

    /// The same by the formula of the paper: r·length − β(s + 1, r − 1).
    fn by_formula(length: usize, s: usize) -> usize {
        let beta = |s: usize, r: usize| (1..=r).fold(1, |b, k| b * (s + k) / k);
        let r = (0..).find(|&r| beta(s, r) >= length).unwrap();
        if r == 0 { 0 } else { r * length - beta(s + 1, r - 1) }
    }

    #[test]
    fn a_chain_is_visited_backwards_with_the_fewest_advances_and_states() {
        let mut known = HashMap::new();
        for limit in 1..=9 {
            for length in 1..=70 {
                let (alive, peak) = (Rc::new(Cell::new(1)), Rc::new(Cell::new(1)));
                let first = Counted { number: 0, alive: alive.clone(), peak: peak.clone() };
                let mut snapshots = Snapshots::new(first, limit);
                let mut visits = vec![0; length];
                for pass in 1..=2 {
                    for index in (0..length).rev() {
                        let state = snapshots.state(index, |i, state| {
                            assert_eq!(state.number, i);
                            state.number += 1;
                            visits[i] += 1;
                        });
                        assert_eq!(state.number, index);
                    }
                    let advances = visits.iter().sum::<usize>();
                    assert_eq!(advances, pass * by_search(length, limit, &mut known));
                    assert_eq!(advances, pass * by_formula(length, limit));
                    assert_eq!(alive.get(), 1, "only the initial state is left");
                }
                // The one in hand comes on top of those kept.
                assert!(peak.get() <= limit + 1, "{length} {limit} {}", peak.get());
                let times = visits.iter().max().unwrap() / 2;
                assert!(length == 1 || fewest_snapshots(length, times) <= limit);
                assert!(times <= 1 || fewest_snapshots(length, times - 1) > limit);
            }
        }
    }

    #[test]
    fn states_may_be_asked_for_in_any_order() {
        let mut snapshots = Snapshots::new(0, 3);
        for index in [5, 17, 3, 0, 40, 40, 39, 2] {
            assert_eq!(snapshots.state(index, |i, state| *state = i + 1), index);
            assert!(snapshots.later.len() < 3);
        }
    }

    #[test]
    fn no_limit_computes_no_state_twice() {
        let mut snapshots = Snapshots::new((), usize::MAX);
        let mut advances = 0;
        (0..1000).rev().for_each(|index| snapshots.state(index, |_, ()| advances += 1));
        assert_eq!((advances, fewest_snapshots(1000, 1)), (999, 999));
    }
}
