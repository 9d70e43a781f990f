//! The scale of residuals by their median absolute deviation.

use core::cmp::Ordering;

use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

/// Turns a median absolute deviation into a standard deviation.
const MAD_TO_SIGMA: f64 = 1.0 / 0.6745;
/// Up to so many values are compared all with all: no branch depends on them, so none is mispredicted.
const FEW: usize = 32;

/// `median(|r - median(r)|) / 0.6745` (paper, below eq. 10) of residuals that are numbers or infinite; infinite where
/// half of them are. They become something else.
pub(crate) fn mad_scale(unit: VectorUnit, residuals: &mut [f64]) -> f64 {
    let centre = median(unit, residuals);
    // Half the points behind the camera: no scale, nothing is an outlier.
    if !centre.is_finite() {
        return f64::INFINITY;
    }
    for r in residuals.iter_mut() {
        *r = (*r - centre).abs();
    }
    median(unit, residuals) * MAD_TO_SIGMA
}

/// Median; reorders the values. Not a number where there is none.
fn median(unit: VectorUnit, values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, middle) = if n <= FEW { unit.run(MiddleOfFew(values)) } else { middle_of_many(values) };
    if n % 2 == 1 { middle } else { 0.5 * (below + middle) }
}

/// The value of rank `n / 2` and, of an even number, the one before it.
fn middle_of_many(values: &mut [f64]) -> (f64, f64) {
    let n = values.len();
    let (lower, &mut middle, _) = values.select_nth_unstable_by(n / 2, by_size);
    (lower.iter().copied().fold(f64::NEG_INFINITY, f64::max), middle)
}

/// One comparison in machine code, where a total order that includes what is not a number takes six instructions.
#[inline(always)]
fn by_size(a: &f64, b: &f64) -> Ordering {
    if a < b {
        Ordering::Less
    } else if a > b {
        Ordering::Greater
    } else {
        Ordering::Equal
    }
}

/// [`middle_of_many`] of at most [`FEW`]: of the values that at least so many are at most, the smallest.
struct MiddleOfFew<'a>(&'a [f64]);

impl HotLoop for MiddleOfFew<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> (f64, f64) {
        let values = self.0;
        let infinity = unit.splat(f64::INFINITY);
        let mut candidates = [f64::INFINITY; FEW];
        candidates[..values.len()].copy_from_slice(values);
        let half = values.len() as f64 * 0.5;
        let (mut below, mut middle) = (infinity, infinity);
        // Four vectors of candidates at a time, so that their counts stay in registers.
        for candidates in candidates[..values.len().next_multiple_of(LANES)].chunks(4 * LANES) {
            let mut counts = [unit.zero(); 4];
            let mut vectors = [infinity; 4];
            for (vector, candidates) in vectors.iter_mut().zip(candidates.as_chunks::<LANES>().0) {
                *vector = unit.load(Lanes(*candidates));
            }
            for &value in values {
                let value = unit.splat(value);
                for k in 0..4 {
                    counts[k] += value.at_most(vectors[k]);
                }
            }
            for k in 0..4 {
                // At most the value of rank r are r + 1 or more: n / 2 for the one below, n / 2 + 1 for the middle.
                below = vectors[k].where_positive(counts[k] - unit.splat(half - 0.25), infinity).min(below);
                middle = vectors[k].where_positive(counts[k] - unit.splat(half + 0.25), infinity).min(middle);
            }
        }
        (smallest(below), smallest(middle))
    }
}

#[inline(always)]
fn smallest<V: Vector>(vector: V) -> f64 {
    let [a, b, c, d] = vector.lanes().0;
    a.min(b).min(c.min(d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_odd_and_even_counts() {
        let of = |mut values: Vec<f64>| median(VectorUnit::detect(), &mut values);
        assert_eq!(of(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(of(vec![4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(of(vec![]).is_nan());
    }

    /// Ties and what is behind the camera included.
    #[test]
    fn few_and_many_have_one_median() {
        let mut state = 1_u64;
        for n in 1..=FEW {
            for trial in 0..50 {
                let mut values: Vec<f64> = (0..n)
                    .map(|_| {
                        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                        let number = (state >> 40) % if trial % 2 == 0 { 5 } else { 1 << 20 };
                        if number == 3 { f64::INFINITY } else { number as f64 }
                    })
                    .collect();
                let few = VectorUnit::detect().run(MiddleOfFew(&values));
                let many = middle_of_many(&mut values);
                assert_eq!(few.1, many.1, "{values:?}");
                assert!(n % 2 == 1 || few.0 == many.0, "{values:?}");
            }
        }
    }
}
