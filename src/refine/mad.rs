//! The scale of residuals by their median absolute deviation.

use core::cmp::Ordering;

use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

/// Turns a median absolute deviation into a standard deviation.
const MAD_TO_SIGMA: f64 = 1.0 / 0.6745;
/// Up to so many values are sorted, by comparisons on which no branch depends: none is mispredicted.
const FEW: usize = 32;
/// Beyond them, a vector that neighbours end in.
const ROOM: usize = FEW + LANES;

/// `median(|r - median(r)|) / 0.6745` (paper, below eq. 10) of residuals that are numbers or infinite; infinite where
/// half of them are. They become something else.
pub(crate) fn mad_scale(unit: VectorUnit, residuals: &mut [f64]) -> f64 {
    let deviation = if residuals.len() <= FEW { unit.run(DeviationOfFew(residuals)) } else { of_many(residuals) };
    deviation * MAD_TO_SIGMA
}

/// The median absolute deviation: infinite where the median is.
fn of_many(residuals: &mut [f64]) -> f64 {
    let centre = median(residuals);
    // Half the points behind the camera: no scale, nothing is an outlier.
    if !centre.is_finite() {
        return f64::INFINITY;
    }
    for r in residuals.iter_mut() {
        *r = (*r - centre).abs();
    }
    median(residuals)
}

/// Median; reorders the values. Not a number where there is none.
fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (lower, &mut middle, _) = values.select_nth_unstable_by(n / 2, by_size);
    let below = lower.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    halfway(n, below, middle)
}

/// The median of `n` values of which these are in the middle.
#[inline(always)]
fn halfway(n: usize, below: f64, middle: f64) -> f64 {
    if n % 2 == 1 { middle } else { 0.5 * (below + middle) }
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

/// [`of_many`] of at most [`FEW`]. Sorted values with the smallest deviations are neighbours, of which the first or the
/// last deviates most: of all neighbours so many, those whose largest deviation is the smallest.
struct DeviationOfFew<'a>(&'a [f64]);

impl HotLoop for DeviationOfFew<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let n = self.0.len();
        if n == 0 {
            return f64::INFINITY;
        }
        // Infinite beyond the values, and where neighbours would end beyond them.
        let mut values = [f64::INFINITY; ROOM];
        values[..n].copy_from_slice(self.0);
        sort(unit, &mut values);
        let middle = n / 2;
        let centre = halfway(n, values[middle.saturating_sub(1)], values[middle]);
        if !centre.is_finite() {
            return f64::INFINITY;
        }
        let (at_centre, infinity) = (unit.splat(centre), unit.splat(f64::INFINITY));
        let (mut below, mut least) = (infinity, infinity);
        for first in (0..n - middle + 1).step_by(LANES) {
            let on_the_left = at_centre - four(unit, &values, first);
            let last = first + middle;
            least = on_the_left.max(four(unit, &values, last) - at_centre).min(least);
            below = on_the_left.max(four(unit, &values, last.saturating_sub(1)) - at_centre).min(below);
        }
        halfway(n, smallest(below), smallest(least))
    }
}

/// Four numbers from a place on.
#[inline(always)]
fn four<U: Unit>(unit: U, values: &[f64; ROOM], first: usize) -> U::Vector {
    let [a, b, c, d] = values[first..].first_chunk().copied().unwrap_or([f64::INFINITY; LANES]);
    unit.load(Lanes([a, b, c, d]))
}

#[inline(always)]
fn smallest<V: Vector>(vector: V) -> f64 {
    let [a, b, c, d] = vector.lanes().0;
    a.min(b).min(c.min(d))
}

/// Comparisons, of the upper place with the lower, that sort eight numbers (Knuth, The Art of Computer Programming 3, 5.3.4).
const EIGHT: [[usize; 19]; 2] = [
    [0, 1, 4, 5, 0, 1, 2, 3, 0, 2, 4, 6, 2, 3, 1, 3, 1, 3, 5],
    [2, 3, 6, 7, 4, 5, 6, 7, 1, 3, 5, 7, 4, 5, 4, 6, 2, 4, 6],
];

/// Sorts the first [`FEW`]: by lanes, then Batcher's bitonic merges of two and two of these.
#[inline(always)]
fn sort<U: Unit>(unit: U, values: &mut [f64; ROOM]) {
    let mut lanes = [unit.zero(); FEW / LANES];
    for (vector, values) in lanes.iter_mut().zip(values.as_chunks::<LANES>().0) {
        *vector = unit.load(Lanes(*values));
    }
    for k in 0..EIGHT[0].len() {
        compare(&mut lanes, EIGHT[0][k], EIGHT[1][k]);
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    let (first, last) = (U::Vector::transposed([a, b, c, d], unit), U::Vector::transposed([e, f, g, h], unit));
    let [a, b, c, d] = merged(unit, [first[0], last[0]], [first[1], last[1]]);
    let [e, f, g, h] = merged(unit, [first[2], last[2]], [first[3], last[3]]);
    let mut all = [a, b, c, d, h.reversed(unit), g.reversed(unit), f.reversed(unit), e.reversed(unit)];
    for (a, b) in [(0, 4), (1, 5), (2, 6), (3, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 1), (2, 3), (4, 5), (6, 7)] {
        compare(&mut all, a, b);
    }
    let [a, b, c, d, e, f, g, h] = all;
    let halves = [sorted_within(unit, [a, b, c, d]), sorted_within(unit, [e, f, g, h])];
    for (values, vector) in values.as_chunks_mut::<LANES>().0.iter_mut().zip(halves.as_flattened()) {
        *values = vector.lanes().0;
    }
}

/// The numbers of two and two vectors in order.
#[inline(always)]
fn merged<U: Unit>(unit: U, [a, b]: [U::Vector; 2], [c, d]: [U::Vector; 2]) -> [U::Vector; LANES] {
    let mut both = [a, b, d.reversed(unit), c.reversed(unit)];
    for (a, b) in [(0, 2), (1, 3), (0, 1), (2, 3)] {
        compare(&mut both, a, b);
    }
    sorted_within(unit, both)
}

/// Four vectors, each of numbers that rise and fall, as vectors of numbers that rise.
#[inline(always)]
fn sorted_within<U: Unit>(unit: U, vectors: [U::Vector; LANES]) -> [U::Vector; LANES] {
    let mut lanes = U::Vector::transposed(vectors, unit);
    for (a, b) in [(0, 2), (1, 3), (0, 1), (2, 3)] {
        compare(&mut lanes, a, b);
    }
    U::Vector::transposed(lanes, unit)
}

/// The smaller numbers to the first of two vectors.
#[inline(always)]
fn compare<V: Vector, const N: usize>(vectors: &mut [V; N], a: usize, b: usize) {
    let (x, y) = (vectors[a], vectors[b]);
    (vectors[a], vectors[b]) = (x.min(y), x.max(y));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_odd_and_even_counts() {
        let of = |mut values: Vec<f64>| median(&mut values);
        assert_eq!(of(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(of(vec![4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(of(vec![]).is_nan());
    }

    /// Ties and what is behind the camera included, on every vector unit.
    #[test]
    fn few_and_many_have_one_deviation() {
        let mut state = 1_u64;
        for n in 1..=FEW {
            for trial in 0..50 {
                let mut values: Vec<f64> = (0..n)
                    .map(|_| {
                        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                        let number = (state >> 40) % if trial % 2 == 0 { 5 } else { 1 << 20 };
                        if number == 3 { f64::INFINITY } else { (number as f64).sqrt() }
                    })
                    .collect();
                let few = VectorUnit::all().into_iter().map(|unit| unit.run(DeviationOfFew(&values)));
                let few: Vec<u64> = few.map(f64::to_bits).collect();
                let many = of_many(&mut values).to_bits();
                assert!(few.iter().all(|&few| few == many), "{values:?}");
            }
        }
    }

    #[test]
    fn no_residuals_have_no_scale() {
        assert_eq!(mad_scale(VectorUnit::detect(), &mut []), f64::INFINITY);
    }
}
