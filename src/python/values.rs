//! Memory of results: the core's own for small arrays, NumPy's for large ones.

use numpy::ndarray::{Array, ArrayView, IxDyn};
use numpy::{Element, IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn, ToPyArray};
use pyo3::prelude::*;

/// Bytes from which NumPy asks the system for large pages; the first write to one of 4 kB costs more than an object's
/// numbers do.
const LARGE: usize = 4 << 20;
/// Bytes up to which a copy into NumPy's memory takes less time than telling NumPy whose memory it is.
const SMALL: usize = 4 << 10;

/// Numbers that become an array when they are asked for.
pub(super) enum Values<T> {
    /// Not yet asked for.
    Own(Vec<T>),
    /// An array.
    Array(Py<PyArrayDyn<T>>),
}

/// Numbers that are being written.
pub(super) enum Lent<'a, 'py, T: Element> {
    /// Of the core.
    Own(&'a mut [T]),
    /// Of an array that nobody else has seen yet.
    Array(PyReadwriteArrayDyn<'py, T>),
}

impl<T: Element + Copy + Default> Values<T> {
    pub(super) fn new(py: Python<'_>, shape: &[usize]) -> Self {
        let count = shape.iter().product::<usize>();
        if count * size_of::<T>() < LARGE {
            // Zeros cost nothing before they are written to.
            Self::Own(vec![T::default(); count])
        } else {
            Self::of_numpy(py, shape)
        }
    }

    /// An array from the beginning, which can be shared.
    pub(super) fn of_numpy(py: Python<'_>, shape: &[usize]) -> Self {
        Self::Array(PyArrayDyn::zeros(py, shape, false).unbind())
    }

    /// No numbers at all.
    pub(super) const fn none() -> Self {
        Self::Own(Vec::new())
    }

    pub(super) fn lend<'py>(&mut self, py: Python<'py>) -> PyResult<Lent<'_, 'py, T>> {
        Ok(match self {
            Self::Own(values) => Lent::Own(values),
            Self::Array(array) => Lent::Array(array.bind(py).try_readwrite()?),
        })
    }

    /// The array, of the shape of the beginning: the same one whenever it is asked for.
    pub(super) fn array<'py>(&mut self, py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        let values = match self {
            Self::Array(array) => return Ok(array.bind(py).clone()),
            Self::Own(values) => std::mem::take(values),
        };
        let array = if values.len() * size_of::<T>() <= SMALL {
            ArrayView::from_shape(IxDyn(shape), &values).map_err(unfit)?.to_pyarray(py)
        } else {
            Array::from_shape_vec(IxDyn(shape), values).map_err(unfit)?.into_pyarray(py)
        };
        *self = Self::Array(array.clone().unbind());
        Ok(array)
    }

    /// An array of its own.
    pub(super) fn copy<'py>(&mut self, py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        Ok(self.array(py, shape)?.try_readonly()?.as_array().to_pyarray(py))
    }

    /// The same array for someone who reads it meanwhile; none where it is the core's own memory.
    pub(super) fn shared(&self, py: Python<'_>) -> Option<Py<PyArrayDyn<T>>> {
        match self {
            Self::Array(array) => Some(array.clone_ref(py)),
            Self::Own(_) => None,
        }
    }
}

impl Values<u8> {
    /// A copy; these are few, and small.
    pub(super) fn bytes(&self, py: Python<'_>) -> Vec<u8> {
        match self {
            Self::Own(values) => values.clone(),
            Self::Array(array) => array.bind(py).to_vec().unwrap_or_default(),
        }
    }
}

impl Values<u32> {
    /// An array of integers as NumPy has them.
    pub(super) fn widened<'py>(&self, py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        match self {
            Self::Own(values) => {
                Ok(ArrayView::from_shape(IxDyn(shape), values).map_err(unfit)?.mapv(i64::from).into_pyarray(py))
            }
            Self::Array(array) => Ok(array.bind(py).try_readonly()?.as_array().mapv(i64::from).into_pyarray(py)),
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

/// An array that nobody writes to, to be read.
pub(super) fn read<'py, T: Element>(
    py: Python<'py>,
    array: &Py<PyArrayDyn<T>>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    Ok(array.bind(py).try_readonly()?)
}

/// A bug here, told as an error of Python.
fn unfit(error: numpy::ndarray::ShapeError) -> PyErr {
    pyo3::exceptions::PyRuntimeError::new_err(error.to_string())
}
