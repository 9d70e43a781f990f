//! `cut_crops`: what windows of an image show, all in one call, the GIL released.

use numpy::ndarray::{ArrayView3, Axis};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::arrays::rows;
use super::input_error;
use super::threads::pool;
use crate::crops::cut::{Scratch, cut};
use crate::crops::picture::{CHANNELS, Picture};

/// Fewer crops than this are cut sooner than other threads wake.
const FEW: usize = 4;
/// Farthest corner of a window, in pixels from the image's origin.
const FARTHEST: f64 = 1e9;

/// An image of any layout.
struct Image<'a>(ArrayView3<'a, u8>);

impl Picture for Image<'_> {
    fn size(&self) -> [usize; 2] {
        [self.0.shape()[1], self.0.shape()[0]]
    }

    fn row(&self, y: usize) -> Option<&[u8]> {
        match self.0.to_slice() {
            Some(bytes) => Some(&bytes[y * self.0.shape()[1] * CHANNELS..]),
            None => self.0.index_axis(Axis(0), y).to_slice(),
        }
    }

    fn pixel(&self, x: usize, y: usize) -> [u8; CHANNELS] {
        [0, 1, 2].map(|channel| self.0[(y, x, channel)])
    }
}

/// Writes what the windows (N, 4) of an image (H, W, 3) show to `out` (N, height, width, 3).
#[pyfunction]
pub(crate) fn cut_crops(
    py: Python<'_>,
    image: PyReadonlyArray3<'_, u8>,
    windows: PyReadonlyArray2<'_, f64>,
    mut out: PyReadwriteArray4<'_, u8>,
    threads: usize,
) -> PyResult<()> {
    let windows = rows::<4, _>("windows", &windows)?;
    let (pixels, shape) = (image.as_array(), image.shape());
    if shape[2] != CHANNELS || pixels.is_empty() {
        return Err(input_error("image", "shape (H, W, 3)", &format!("{shape:?}")));
    }
    let &[count, height, width, channels] = out.shape() else { unreachable!("four lengths") };
    if count != windows.len() || channels != CHANNELS || height * width == 0 {
        let expected = format!("shape ({}, height, width, 3)", windows.len());
        return Err(input_error("out", &expected, &format!("{:?}", out.shape())));
    }
    for window in windows {
        let [left, top, right, bottom] = *window;
        if !(window.iter().all(|side| side.abs() <= FARTHEST) && left <= right && top <= bottom) {
            let expected = format!("left, top, right, bottom within {FARTHEST:e} pixels");
            return Err(input_error("windows", &expected, &format!("{window:?}")));
        }
    }
    let out = out.as_slice_mut().map_err(|_| input_error("out", "a C-contiguous array", "another layout"))?;
    let (size, image) = (height * width * CHANNELS, &Image(pixels));
    let one = |scratch: &mut Scratch, (crop, &window): (&mut [u8], &[f64; 4])| cut(image, window, width, crop, scratch);
    if threads == 1 || count < FEW {
        py.detach(|| {
            let mut scratch = Scratch::default();
            out.chunks_exact_mut(size).zip(windows).for_each(|item| one(&mut scratch, item));
        });
        return Ok(());
    }
    let pool = pool(threads)?;
    py.detach(|| {
        pool.install(|| {
            out.par_chunks_exact_mut(size).zip(windows).for_each_init(Scratch::default, one);
        });
    });
    Ok(())
}
