//! Cutting a window out of a picture: the one resampling there is.
//!
//! Two passes, along the rows and then along the columns, with bytes between them, as Pillow has them.

use core::ops::Range;

use crate::crops::picture::{CHANNELS, FILL, Picture};
use crate::crops::taps::{BITS, HALF, Taps};
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::Unit;

/// Pixels that are read for one of the crop at least, where more could be: large objects are read in steps, and the
/// time no longer grows with the object.
const ENOUGH: f64 = 1.5;
/// Bytes that are read of a pixel at once.
const READ: usize = 4;
/// Bytes that the second pass makes side by side.
const BLOCK: usize = 32;

/// Sums of a pixel's bytes; the last one is of a byte that is not the pixel's.
type Pixel = [i32; READ];

/// What cutting needs beside its input, kept from one crop to the next.
///
/// ```
/// let scratch = groundpose::crops::cut::Scratch::default();
/// ```
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    across: Taps,
    down: Taps,
    lost: Vec<i32>,
    padded: Vec<u8>,
    begun: Vec<Pixel>,
    sums: Vec<Pixel>,
    between: Vec<u8>,
    row: Vec<u8>,
}

/// Every `step`-th pixel along a side of the picture, from `first` (which may lie before it), and what of them is shown.
#[derive(Clone, Copy, Debug)]
struct Side {
    first: i64,
    step: i64,
    count: usize,
    shown: [f32; 2],
}

impl Side {
    /// Of a window from `low` to `high`, outer corners, where pixels have integer ones.
    fn new(low: f64, high: f64, step: i64) -> Self {
        let first = low.floor() as i64 - step;
        let end = high.ceil() as i64 + step;
        let count = (end - first + step - 1) / step;
        let place = |x: f64| ((x - first as f64 - 0.5) / step as f64 + 0.5) as f32;
        Self { first, step, count: count as usize, shown: [place(low), place(high)] }
    }

    /// The pixels of `range` that lie in a picture of this size.
    fn inside(&self, size: usize, range: &Range<usize>) -> Range<usize> {
        let from = |place: i64| ((place - self.first).max(0) + self.step - 1) / self.step;
        let (begin, end) = (from(0) as usize, from(size as i64) as usize);
        let begin = begin.clamp(range.start, range.end);
        begin..end.clamp(begin, range.end)
    }

    /// The picture's own pixel.
    fn at(&self, pixel: usize) -> usize {
        (self.first + pixel as i64 * self.step) as usize
    }
}

/// Writes what the window `left, top, right, bottom` of a picture shows to `out`, rows of `width` pixels.
///
/// Pixels have integer centres, so that a picture of width W reaches from -0.5 to W - 0.5. Shrinking averages with a
/// triangle filter over what a pixel of the crop covers, enlarging interpolates linearly. Outside there is [`FILL`].
/// The window is finite, at most 1e9 from the origin, and its right and bottom are at least its left and top.
/// Time and memory grow with how differently its two sides are shrunk: windows should have about the crop's shape.
///
/// ```
/// use groundpose::crops::cut::{Scratch, cut};
/// use groundpose::crops::picture::{FILL, Rows};
///
/// let grey = [128; 40 * 30 * 3];
/// let picture = Rows::new(&grey, 40).expect("whole rows");
/// let (mut crop, mut scratch) = ([0; 8 * 6 * 3], Scratch::default());
/// cut(&picture, [4.0, 3.0, 20.0, 15.0], 8, &mut crop, &mut scratch);
/// assert!(crop.iter().all(|&byte| byte == 128));
/// cut(&picture, [100.0, 3.0, 116.0, 15.0], 8, &mut crop, &mut scratch);
/// assert_eq!(crop[..3], FILL);
/// ```
pub fn cut(picture: &impl Picture, window: [f64; 4], width: usize, out: &mut [u8], scratch: &mut Scratch) {
    let height = out.len() / (width * CHANNELS);
    let [left, top, right, bottom] = window.map(|side| side + 0.5);
    let scale = ((right - left) / width as f64).min((bottom - top) / height as f64);
    let step = ((scale / ENOUGH) as i64).max(1);
    let (columns, rows) = (Side::new(left, right, step), Side::new(top, bottom, step));
    scratch.across.set(columns.count, columns.shown[0], columns.shown[1], width);
    scratch.down.set(rows.count, rows.shown[0], rows.shown[1], height);
    VectorUnit::detect().run(Passes { picture, columns, rows, scratch, out });
}

struct Passes<'a, P> {
    picture: &'a P,
    columns: Side,
    rows: Side,
    scratch: &'a mut Scratch,
    out: &'a mut [u8],
}

impl<P: Picture> HotLoop for Passes<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, _unit: U) {
        let Self { picture, columns, rows, scratch, out } = self;
        let Scratch { across, down, lost, padded, begun, sums, between, row: made } = scratch;
        let ([width, height], used) = (picture.size(), down.reach());
        let (seen, inside) = (rows.inside(height, &used), columns.inside(width, &(0..columns.count)));
        padded.clear();
        if across.keep(&inside, lost) {
            padded.resize(columns.count * READ, 0);
        } else {
            padded.extend(FILL.iter().chain(&[0]).cycle().take(columns.count * READ));
        }
        let (reach, length) = (across.reach(), across.first.len() * READ);
        let fill = [FILL[0], FILL[1], FILL[2], 0];
        begun.clear();
        begun.extend(lost.iter().map(|lost| fill.map(|byte| HALF + lost * i32::from(byte))));
        sums.resize(begun.len(), [0; READ]);
        between.resize(used.len() * length, 0);
        for (pixel, between) in used.clone().zip(between.chunks_exact_mut(length)) {
            if !seen.contains(&pixel) {
                between.as_chunks_mut::<READ>().0.fill(fill);
                continue;
            }
            // The row itself where all that is read lies in it, else a copy.
            let y = rows.at(pixel);
            let row = picture.row(y).filter(|_| inside.start <= reach.start && reach.end <= inside.end);
            let row = row.and_then(|row| row.get(columns.at(reach.start) * CHANNELS..));
            let stride = columns.step as usize * CHANNELS;
            match row.filter(|row| row.len() >= (reach.len() - 1) * stride + READ) {
                Some(row) => along_row(row, stride, reach.start, across, begun, sums),
                None => {
                    pad(picture, &columns, inside.clone(), y, padded);
                    along_row(padded, READ, 0, across, begun, sums);
                }
            }
            for (byte, &sum) in between.iter_mut().zip(sums.as_flattened()) {
                [*byte] = bytes_of([sum]);
            }
        }
        made.resize(length, 0);
        for (y, row) in out.chunks_exact_mut(length / READ * CHANNELS).enumerate() {
            let above = down.first[y] - used.start;
            along_columns(&between[above * length..], length, &down.weights[y * down.most..][..down.most], made);
            for (pixel, bytes) in row.as_chunks_mut::<CHANNELS>().0.iter_mut().zip(made.as_chunks::<READ>().0) {
                *pixel = [bytes[0], bytes[1], bytes[2]];
            }
        }
    }
}

/// Copies the pixels of a row that are `inside` to their places, four bytes each.
#[inline(always)]
fn pad(picture: &impl Picture, columns: &Side, inside: Range<usize>, y: usize, padded: &mut [u8]) {
    let row = picture.row(y);
    for pixel in inside {
        let x = columns.at(pixel);
        let bytes = match row {
            Some(row) => [row[x * CHANNELS], row[x * CHANNELS + 1], row[x * CHANNELS + 2]],
            None => picture.pixel(x, y),
        };
        padded[pixel * READ..pixel * READ + CHANNELS].copy_from_slice(&bytes);
    }
}

/// The first pass: the sums of a row's output pixels, which begin with what is known of them. Pixels are `stride` bytes
/// apart; the usual distances and numbers of weights have loops of their own.
#[inline(always)]
fn along_row(row: &[u8], stride: usize, from: usize, taps: &Taps, begun: &[Pixel], sums: &mut [Pixel]) {
    match stride {
        CHANNELS => row_apart(row, CHANNELS, from, taps, begun, sums),
        READ => row_apart(row, READ, from, taps, begun, sums),
        _ => row_apart(row, stride, from, taps, begun, sums),
    }
}

#[inline(always)]
fn row_apart(row: &[u8], stride: usize, from: usize, taps: &Taps, begun: &[Pixel], sums: &mut [Pixel]) {
    match taps.most {
        2 => pixels_of_row(row, stride, from, taps, 2, begun, sums),
        3 => pixels_of_row(row, stride, from, taps, 3, begun, sums),
        4 => pixels_of_row(row, stride, from, taps, 4, begun, sums),
        5 => pixels_of_row(row, stride, from, taps, 5, begun, sums),
        6 => pixels_of_row(row, stride, from, taps, 6, begun, sums),
        most => pixels_of_row(row, stride, from, taps, most, begun, sums),
    }
}

#[inline(always)]
fn pixels_of_row(
    row: &[u8],
    stride: usize,
    from: usize,
    taps: &Taps,
    most: usize,
    begun: &[Pixel],
    sums: &mut [Pixel],
) {
    let each = taps.first.iter().zip(taps.weights.chunks_exact(most)).zip(begun).zip(sums);
    for (((&first, weights), &begun), sum) in each {
        *sum = add_pixels(&row[(first - from) * stride..][..(most - 1) * stride + READ], stride, weights, begun);
    }
}

/// Adds pixels times their weights.
#[inline(always)]
fn add_pixels(row: &[u8], stride: usize, weights: &[i32], mut sums: Pixel) -> Pixel {
    for (k, &weight) in weights.iter().enumerate() {
        let pixel: [u8; READ] = row[k * stride..][..READ].try_into().expect("four bytes");
        for (sum, byte) in sums.iter_mut().zip(pixel) {
            *sum += weight * i32::from(byte);
        }
    }
    sums
}

/// Whole numbers of sums.
#[inline(always)]
fn bytes_of<const N: usize>(sums: [i32; N]) -> [u8; N] {
    sums.map(|sum| (sum >> BITS).min(255) as u8)
}

/// The second pass: an output row of rows that follow each other.
#[inline(always)]
fn along_columns(rows: &[u8], length: usize, weights: &[i32], out: &mut [u8]) {
    let (blocks, rest) = out.as_chunks_mut::<BLOCK>();
    let covered = blocks.len() * BLOCK;
    for (block, out) in blocks.iter_mut().enumerate() {
        *out = column_bytes(&rows[block * BLOCK..], length, weights);
    }
    for (column, out) in rest.iter_mut().enumerate() {
        [*out] = column_bytes(&rows[covered + column..], length, weights);
    }
}

/// Bytes side by side of an output row.
#[inline(always)]
fn column_bytes<const N: usize>(rows: &[u8], length: usize, weights: &[i32]) -> [u8; N] {
    let mut sums = [HALF; N];
    for (k, &weight) in weights.iter().enumerate() {
        let bytes: &[u8; N] = rows[k * length..][..N].try_into().expect("as many bytes");
        for (sum, &byte) in sums.iter_mut().zip(bytes) {
            *sum += weight * i32::from(byte);
        }
    }
    bytes_of(sums)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crops::picture::Rows;

    const SIZE: [usize; 2] = [37, 23];

    fn bytes() -> Vec<u8> {
        (0..SIZE[0] * SIZE[1] * CHANNELS).map(|k| (k * k * 31 % 251) as u8).collect()
    }

    fn crop(picture: &impl Picture, window: [f64; 4], size: [usize; 2]) -> Vec<u8> {
        let mut out = vec![0; size[0] * size[1] * CHANNELS];
        cut(picture, window, size[0], &mut out, &mut Scratch::default());
        out
    }

    /// A picture of which no two bytes lie together.
    struct Apart<'a>(Rows<'a>);

    impl Picture for Apart<'_> {
        fn size(&self) -> [usize; 2] {
            self.0.size()
        }

        fn row(&self, _: usize) -> Option<&[u8]> {
            None
        }

        fn pixel(&self, x: usize, y: usize) -> [u8; CHANNELS] {
            self.0.pixel(x, y)
        }
    }

    #[test]
    fn the_window_of_the_picture_is_the_picture() {
        let bytes = bytes();
        let picture = Rows::new(&bytes, SIZE[0]).expect("whole rows");
        let all = [-0.5, -0.5, SIZE[0] as f64 - 0.5, SIZE[1] as f64 - 0.5];
        assert_eq!(crop(&picture, all, SIZE), bytes);
    }

    #[test]
    fn the_layout_in_memory_changes_nothing() {
        let bytes = bytes();
        let picture = Rows::new(&bytes, SIZE[0]).expect("whole rows");
        for window in [
            [3.2, 4.1, 20.7, 17.0],
            [-5.0, 2.0, 9.0, 12.5],
            [30.0, 18.0, 36.5, 22.5],
            [-40.0, -30.0, 90.0, 70.0],
            [8.0, 8.0, 8.5, 8.25],
            [-900.0, -700.0, 800.0, 900.0],
        ] {
            assert_eq!(crop(&picture, window, [16, 12]), crop(&Apart(picture), window, [16, 12]), "{window:?}");
        }
    }

    #[test]
    fn outside_there_is_the_fill() {
        let bytes = bytes();
        let picture = Rows::new(&bytes, SIZE[0]).expect("whole rows");
        for window in [[-90.0, 3.0, -50.0, 20.0], [3.0, 90.0, 20.0, 99.0], [1e9, 1e9, 1e9, 1e9]] {
            assert!(crop(&picture, window, [8, 6]).as_chunks::<CHANNELS>().0.iter().all(|pixel| *pixel == FILL));
        }
    }

    #[test]
    fn pieces_of_rows_are_no_picture() {
        assert!(Rows::new(&[0; 7], 2).is_none() && Rows::new(&[], 2).is_none() && Rows::new(&[0; 6], 0).is_none());
    }
}
