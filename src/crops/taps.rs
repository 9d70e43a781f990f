//! A triangle filter along one side: which pixels an output pixel is made of, with which weights.
//!
//! The numbers are those of Pillow's `BILINEAR` (`Resample.c`), step by step, so that its pixels are met: the networks
//! were trained on them.

use core::ops::Range;

/// Bits behind the point of a weight.
pub const BITS: u32 = 22;
/// A half, so that cutting the bits behind the point rounds.
pub const HALF: i32 = 1 << (BITS - 1);

/// Weights of all output pixels of a side, in whole numbers of 2^-[`BITS`].
#[derive(Clone, Debug, Default)]
pub struct Taps {
    /// First pixel of each output pixel; they never go back.
    pub first: Vec<usize>,
    /// `most` weights of each; those that are not needed are 0.
    pub weights: Vec<i32>,
    /// Weights of an output pixel.
    pub most: usize,
    ranges: Vec<Range<usize>>,
}

impl Taps {
    /// Those of `out` pixels that show `low` to `high` of `count` pixels, whose outer sides are 0 and `count`.
    /// Enlarging interpolates, shrinking averages.
    pub fn set(&mut self, count: usize, low: f32, high: f32, out: usize) {
        let scale = f64::from(high - low) / out as f64;
        let support = scale.max(1.0);
        let centre = |pixel: usize| f64::from(low) + (pixel as f64 + 0.5) * scale;
        self.ranges.clear();
        self.ranges.extend((0..out).map(centre).map(|centre| {
            let begin = ((centre - support + 0.5) as usize).min(count - 1);
            begin..((centre + support + 0.5) as usize).clamp(begin + 1, count)
        }));
        self.most = self.ranges.iter().map(|range| range.len()).max().unwrap_or(0);
        self.first.clear();
        self.weights.clear();
        self.weights.resize(out * self.most, 0);
        for (pixel, range) in self.ranges.iter().enumerate() {
            // Whoever reads `most` pixels reads none beyond the end.
            let first = range.start.min(count - self.most);
            self.first.push(first);
            let weights = &mut self.weights[pixel * self.most..][range.start - first..];
            weigh(range.clone(), centre(pixel), 1.0 / support, weights);
        }
    }

    /// Takes the weights of pixels that are not in `inside` away; the sums of what an output pixel has lost are put
    /// to `lost`. Nothing happens, and `false` is the answer, where so few are inside that reads would leave them.
    pub fn keep(&mut self, inside: &Range<usize>, lost: &mut Vec<i32>) -> bool {
        lost.clear();
        lost.resize(self.first.len(), 0);
        if inside.len() < self.most {
            return false;
        }
        for ((weights, first), lost) in self.weights.chunks_exact_mut(self.most).zip(&mut self.first).zip(lost) {
            let kept = (*first).clamp(inside.start, inside.end - self.most);
            let (before, beyond) = (kept.saturating_sub(*first), first.saturating_sub(kept));
            let gone = weights.len().min(before.max(beyond));
            if before > 0 {
                *lost = weights[..gone].iter().sum();
                weights.rotate_left(gone);
                let stay = weights.len() - gone;
                weights[stay..].fill(0);
            } else if beyond > 0 {
                let stay = weights.len() - gone;
                *lost = weights[stay..].iter().sum();
                weights.rotate_right(gone);
                weights[..gone].fill(0);
            }
            *first = kept;
        }
        true
    }

    /// The pixels that any output pixel is made of.
    pub fn reach(&self) -> Range<usize> {
        let end = |last: &usize| last + self.most;
        self.first.first().copied().unwrap_or(0)..self.first.last().map_or(0, end)
    }
}

/// Weights of the pixels of a range, with the sum 1 but for rounding.
fn weigh(range: Range<usize>, centre: f64, inverse_support: f64, weights: &mut [i32]) {
    let triangle = |place: usize| (1.0 - ((place as f64 - centre + 0.5) * inverse_support).abs()).max(0.0);
    let sum: f64 = range.clone().map(triangle).sum();
    for (place, weight) in range.zip(weights) {
        let share = if sum == 0.0 { 0.0 } else { triangle(place) / sum };
        *weight = (0.5 + share * f64::from(1u32 << BITS)) as i32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taps(count: usize, low: f32, high: f32, out: usize) -> Taps {
        let mut taps = Taps::default();
        taps.set(count, low, high, out);
        taps
    }

    #[test]
    fn the_same_size_takes_every_pixel_as_it_is() {
        let same = taps(7, 0.0, 7.0, 7);
        for pixel in 0..7 {
            for (k, &weight) in same.weights[pixel * same.most..][..same.most].iter().enumerate() {
                assert_eq!(weight, if same.first[pixel] + k == pixel { 1 << BITS } else { 0 });
            }
        }
    }

    #[test]
    fn weights_are_one_together_and_inside() {
        for (count, low, high, out) in
            [(1, 0.0, 1.0, 5), (3, 0.2, 2.9, 128), (900, 10.5, 777.25, 96), (50, 7.0, 7.0, 4)]
        {
            let found = taps(count, low, high, out);
            assert_eq!((found.first.len(), found.weights.len()), (out, out * found.most));
            assert!(found.first.is_sorted() && found.reach().end <= count);
            for weights in found.weights.chunks_exact(found.most) {
                assert!(weights.iter().all(|&w| w >= 0));
                assert!((weights.iter().sum::<i32>() - (1 << BITS)).unsigned_abs() as usize <= found.most);
            }
        }
    }

    #[test]
    fn what_is_not_inside_is_lost() {
        let all = taps(40, 0.0, 40.0, 16);
        for inside in [0..40, 0..30, 7..40, 11..19, 0..6] {
            let (mut kept, mut lost) = (all.clone(), vec![]);
            assert!(kept.keep(&inside, &mut lost));
            for pixel in 0..16 {
                let weight = |taps: &Taps, place: usize| {
                    let k = place.checked_sub(taps.first[pixel]).filter(|&k| k < taps.most);
                    k.map_or(0, |k| taps.weights[pixel * taps.most + k])
                };
                let outside = (0..40).filter(|place| !inside.contains(place));
                assert_eq!(lost[pixel], outside.map(|place| weight(&all, place)).sum::<i32>());
                assert!(inside.clone().all(|place| weight(&kept, place) == weight(&all, place)));
                assert!(kept.first[pixel] >= inside.start && kept.first[pixel] + kept.most <= inside.end);
            }
        }
        let mut same = all.clone();
        assert!(!same.keep(&(3..4), &mut vec![]) && same.weights == all.weights);
    }

    #[test]
    fn shrinking_by_two_reaches_over_four() {
        let half = taps(8, 0.0, 8.0, 4);
        let unit = 1 << (BITS - 3);
        assert_eq!(half.most, 4);
        assert_eq!(half.weights[4..8], [unit, 3 * unit, 3 * unit, unit]);
    }
}
