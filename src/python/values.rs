//! Memory of results: the core's own for small arrays, NumPy's for large ones.

use numpy::{Element, IntoPyArray, PyArray1, PyArrayMethods, PyReadwriteArray1};
use pyo3::prelude::*;

/// Bytes from which NumPy asks the system for large pages; the first write to one of 4 kB costs more than an object's
/// numbers do.
const LARGE: usize = 4 << 20;

/// Numbers that become an array when they are asked for.
pub(super) enum Values<T> {
    /// Not yet asked for.
    Own(Vec<T>),
    /// An array.
    Array(Py<PyArray1<T>>),
}

/// Numbers that are being written.
pub(super) enum Lent<'a, 'py, T: Element> {
    /// Of the core.
    Own(&'a mut [T]),
    /// Of an array that nobody else has seen yet.
    Array(PyReadwriteArray1<'py, T>),
}

impl<T: Element + Copy + Default> Values<T> {
    pub(super) fn new(py: Python<'_>, count: usize) -> Self {
        if count * size_of::<T>() < LARGE {
            // Zeros cost nothing before they are written to.
            Self::Own(vec![T::default(); count])
        } else {
            Self::Array(PyArray1::zeros(py, count, false).unbind())
        }
    }

    pub(super) fn lend<'py>(&mut self, py: Python<'py>) -> PyResult<Lent<'_, 'py, T>> {
        Ok(match self {
            Self::Own(values) => Lent::Own(values),
            Self::Array(array) => Lent::Array(array.bind(py).try_readwrite()?),
        })
    }

    /// The array: the same memory whenever it is asked for.
    pub(super) fn array<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<T>> {
        if let Self::Own(values) = self {
            *self = Self::Array(std::mem::take(values).into_pyarray(py).unbind());
        }
        match self {
            Self::Array(array) => array.bind(py).clone(),
            Self::Own(_) => unreachable!("it was made an array"),
        }
    }
}

impl<T: Element> Lent<'_, '_, T> {
    pub(super) fn slice(&mut self) -> PyResult<&mut [T]> {
        Ok(match self {
            Self::Own(values) => values,
            Self::Array(array) => array.as_slice_mut()?,
        })
    }
}
