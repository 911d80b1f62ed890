//! Exact sums and products of floating-point numbers.
//!
//! A number is held as a sum of doubles that do not overlap, smallest first (Shewchuk, "Adaptive precision
//! floating-point arithmetic and fast robust geometric predicates", 1997). Every operation here is exact as long as
//! nothing over- or underflows. The capacities add up at compile time, so nothing is allocated.

/// A sum of at most `N` doubles that do not overlap, in increasing magnitude; zeros are left out.
#[derive(Clone, Copy)]
pub(super) struct Expansion<const N: usize> {
    terms: [f64; N],
    len: usize,
}

impl<const N: usize> Expansion<N> {
    pub(super) const ZERO: Self = Self { terms: [0.0; N], len: 0 };

    fn push(&mut self, term: f64) {
        if term != 0.0 {
            self.terms[self.len] = term;
            self.len += 1;
        }
    }

    fn terms(&self) -> &[f64] {
        &self.terms[..self.len]
    }

    /// The value, its sign exact and its rounding error a few units of the last place.
    pub(super) fn value(&self) -> f64 {
        self.terms().iter().sum()
    }

    pub(super) fn negated(mut self) -> Self {
        self.terms[..self.len].iter_mut().for_each(|t| *t = -*t);
        self
    }

    /// The sum; `M` must hold the terms of both (Shewchuk's fast expansion sum).
    pub(super) fn plus<const K: usize, const M: usize>(
        &self,
        other: &Expansion<K>,
    ) -> Expansion<M> {
        let (e, f) = (self.terms(), other.terms());
        let (mut i, mut j) = (0, 0);
        let mut sum = Expansion::ZERO;
        let mut carry = 0.0;
        while i < e.len() || j < f.len() {
            let from_e = j == f.len() || (i < e.len() && e[i].abs() < f[j].abs());
            let next = if from_e { e[i] } else { f[j] };
            (i, j) = if from_e { (i + 1, j) } else { (i, j + 1) };
            let (high, low) = two_sum(carry, next);
            sum.push(low);
            carry = high;
        }
        sum.push(carry);
        sum
    }

    /// The product with a double; `M` is at least `2 N`.
    fn scaled<const M: usize>(&self, factor: f64) -> Expansion<M> {
        let mut product = Expansion::ZERO;
        let mut carry = 0.0;
        for &term in self.terms() {
            let (high, low) = two_product(term, factor);
            let (middle, least) = two_sum(carry, low);
            product.push(least);
            let (top, rest) = two_sum(high, middle);
            product.push(rest);
            carry = top;
        }
        product.push(carry);
        product
    }

    /// The product with a sum of two doubles; `H` is at least `2 N` and `M` at least `2 H`.
    pub(super) fn times<const H: usize, const M: usize>(
        &self,
        other: &Expansion<2>,
    ) -> Expansion<M> {
        let part = |i: usize| -> Expansion<H> {
            other.terms().get(i).map_or(Expansion::ZERO, |t| self.scaled(*t))
        };
        part(0).plus(&part(1))
    }
}

/// `a − b`, exactly.
pub(super) fn difference(a: f64, b: f64) -> Expansion<2> {
    let (high, low) = two_sum(a, -b);
    let mut result = Expansion::ZERO;
    result.push(low);
    result.push(high);
    result
}

/// The rounded sum and its error (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// The rounded product and its error (Dekker and Veltkamp: no fused operation is assumed).
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let c = 134_217_729.0 * x;
        let high = c - (c - x);
        (high, x - high)
    };
    let product = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (product, al * bl - (((product - ah * bh) - al * bh) - ah * bl))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn sums_and_products_of_integers_are_exact() {
        // Integers of 40 bits and fractions of 40 more: the parts of a product do not fit in a double.
        let mut random = SplitMix64::new(1);
        let mut integer = || ((random.uniform() - 0.5) * (1_u64 << 41) as f64).round();
        for _ in 0..2000 {
            let [a, b, c, d] = std::array::from_fn(|_| integer());
            let small = 2.0_f64.powi(-50);
            let e = difference(a, b * small);
            let f = difference(c, d * small);
            let product: Expansion<8> = e.times::<4, 8>(&f);
            // (a − bs)(c − ds) = ac − (ad + bc)s + bd s², each a number of 128 bits.
            let [a, b, c, d] = [a, b, c, d].map(|x| x as i128);
            let mut left = product;
            for (whole, scale) in [(a * c, 1.0), (-(a * d + b * c), small), (b * d, small * small)]
            {
                // Taken away in pieces of 40 bits.
                let (mut rest, mut unit) = (whole, 1.0);
                while rest != 0 {
                    let piece = rest % (1 << 40);
                    rest /= 1 << 40;
                    let wide: Expansion<9> =
                        left.plus(&difference(0.0, piece as f64 * unit * scale));
                    left = Expansion::ZERO;
                    wide.terms().iter().for_each(|t| left.push(*t));
                    unit *= (1_u64 << 40) as f64;
                }
            }
            assert_eq!(left.len, 0, "{:?}", left.terms());
        }
    }

    #[test]
    fn a_difference_keeps_what_rounding_drops() {
        let d = difference(1.0, 1e-20);
        assert_eq!(d.terms(), [-1e-20, 1.0]);
        let nothing: Expansion<4> = d.plus(&d.negated());
        assert_eq!((nothing.len, nothing.value()), (0, 0.0));
    }
}
