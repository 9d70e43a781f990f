//! Checks of shapes, in one place.

use numpy::ndarray::{ArrayView, Dimension};
use numpy::{PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use super::input_error;

/// Rows of `N` numbers as arrays, checked to be contiguous.
pub(crate) fn rows<'a, const N: usize, D: Dimension>(
    argument: &str,
    array: &'a PyReadonlyArray<'_, f64, D>,
) -> PyResult<&'a [[f64; N]]> {
    let flat = flat(argument, array)?;
    let shape = array.shape();
    if shape.last() != Some(&N) {
        return Err(input_error(argument, &format!("shape (..., {N})"), &format!("{shape:?}")));
    }
    Ok(flat.as_chunks::<N>().0)
}

/// All numbers of a contiguous array.
pub(crate) fn flat<'a, D: Dimension>(argument: &str, array: &'a PyReadonlyArray<'_, f64, D>) -> PyResult<&'a [f64]> {
    // `as_slice` alone takes Fortran order too, and would read it transposed.
    let slice = array.as_slice().ok().filter(|_| array.is_c_contiguous());
    slice.ok_or_else(|| input_error(argument, "a C-contiguous float64 array", "another layout"))
}

/// An array of a fixed shape, row by row.
pub(crate) fn fixed<const R: usize, const C: usize, D: Dimension>(
    argument: &str,
    array: &PyReadonlyArray<'_, f64, D>,
) -> PyResult<[[f64; C]; R]> {
    let rows = rows::<C, D>(argument, array)?;
    rows.try_into().map_err(|_| input_error(argument, &format!("shape ({R}, {C})"), &format!("{:?}", array.shape())))
}

/// `got` text for a shape that does not fit.
pub(crate) fn require_shape<D: Dimension>(
    argument: &str,
    view: &ArrayView<'_, f64, D>,
    expected: &[usize],
) -> PyResult<()> {
    if view.shape() == expected {
        return Ok(());
    }
    Err(input_error(argument, &format!("shape {expected:?}"), &format!("{:?}", view.shape())))
}
