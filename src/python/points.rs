//! Copies of the keypoints given: in half the memory where single precision holds every number of them.

use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;

use super::values::{Lent, Values, read};

pub(super) enum Points {
    Double(Values<f64>),
    Single(Values<f32>),
}

/// Keypoints that are being written.
pub(super) enum LentPoints<'a, 'py> {
    Double(Lent<'a, 'py, f64>),
    Single(Lent<'a, 'py, f32>),
}

/// The keypoints of some objects.
pub(super) enum PointRows<'a> {
    Double(&'a mut [[f64; 2]]),
    /// Beside room for those of one object as they were.
    Single(&'a mut [[f32; 2]], Vec<[f64; 2]>),
}

/// Keypoints that somebody else may read meanwhile.
pub(super) enum SharedPoints {
    Double(Py<PyArrayDyn<f64>>),
    Single(Py<PyArrayDyn<f32>>),
}

/// Those of `SharedPoints` while they are read.
pub(super) enum ReadPoints<'py> {
    Double(PyReadonlyArrayDyn<'py, f64>),
    Single(PyReadonlyArrayDyn<'py, f32>),
}

/// Keypoints of all objects.
#[derive(Clone, Copy)]
pub(super) enum PointSlices<'a> {
    Double(&'a [[f64; 2]]),
    Single(&'a [[f32; 2]]),
}

/// Whether single precision holds every number, to the bit.
pub(super) fn are_single(points: &[[f64; 2]]) -> bool {
    points.as_flattened().iter().all(|x| f64::from(*x as f32).to_bits() == x.to_bits())
}

impl Points {
    pub(super) fn new(py: Python<'_>, shape: &[usize]) -> Self {
        Self::Double(Values::new(py, shape))
    }

    /// For these of a large call.
    pub(super) fn compact(py: Python<'_>, shape: &[usize], points: &[[f64; 2]]) -> Self {
        if are_single(points) {
            Self::Single(Values::of_numpy(py, shape))
        } else {
            Self::Double(Values::of_numpy(py, shape))
        }
    }

    pub(super) fn lend<'py>(&mut self, py: Python<'py>) -> PyResult<LentPoints<'_, 'py>> {
        Ok(match self {
            Self::Double(values) => LentPoints::Double(values.lend(py)?),
            Self::Single(values) => LentPoints::Single(values.lend(py)?),
        })
    }

    /// The array, the same one whenever it is asked for.
    pub(super) fn array<'py>(&mut self, py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        if let Self::Single(_) = self {
            *self = Self::Double(Values::Array(self.copy(py, shape)?.unbind()));
        }
        match self {
            Self::Double(values) => values.array(py, shape),
            Self::Single(_) => unreachable!("they were made double"),
        }
    }

    /// An array of its own.
    pub(super) fn copy<'py>(&mut self, py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        match self {
            Self::Double(values) => values.copy(py, shape),
            Self::Single(values) => {
                let single = values.array(py, shape)?.try_readonly()?;
                Ok(single.as_array().mapv(f64::from).into_pyarray(py))
            }
        }
    }

    pub(super) fn shared(&self, py: Python<'_>) -> Option<SharedPoints> {
        Some(match self {
            Self::Double(values) => SharedPoints::Double(values.shared(py)?),
            Self::Single(values) => SharedPoints::Single(values.shared(py)?),
        })
    }
}

impl LentPoints<'_, '_> {
    pub(super) fn rows(&mut self) -> PyResult<PointRows<'_>> {
        Ok(match self {
            Self::Double(lent) => PointRows::Double(lent.slice()?.as_chunks_mut().0),
            Self::Single(lent) => PointRows::Single(lent.slice()?.as_chunks_mut().0, Vec::new()),
        })
    }
}

impl<'a> PointRows<'a> {
    pub(super) fn split_at(self, k: usize) -> (Self, Self) {
        match self {
            Self::Double(points) => {
                let (these, others) = points.split_at_mut(k);
                (Self::Double(these), Self::Double(others))
            }
            Self::Single(points, room) => {
                let (these, others) = points.split_at_mut(k);
                (Self::Single(these, room), Self::Single(others, Vec::new()))
            }
        }
    }

    /// Copies keypoints to a place; the copy is what is worked on.
    pub(super) fn keep(&mut self, first: usize, points: &[[f64; 2]]) -> &[[f64; 2]] {
        let place = first..first + points.len();
        match self {
            Self::Double(copies) => {
                copies[place.clone()].copy_from_slice(points);
                &copies[place]
            }
            Self::Single(copies, room) => {
                let copies = &mut copies[place];
                for (copy, point) in copies.iter_mut().zip(points) {
                    *copy = point.map(|x| x as f32);
                }
                widened(copies, room)
            }
        }
    }
}

impl SharedPoints {
    pub(super) fn read<'py>(&self, py: Python<'py>) -> PyResult<ReadPoints<'py>> {
        Ok(match self {
            Self::Double(array) => ReadPoints::Double(read(py, array)?),
            Self::Single(array) => ReadPoints::Single(read(py, array)?),
        })
    }
}

impl ReadPoints<'_> {
    pub(super) fn slices(&self) -> PyResult<PointSlices<'_>> {
        Ok(match self {
            Self::Double(array) => PointSlices::Double(array.as_slice()?.as_chunks().0),
            Self::Single(array) => PointSlices::Single(array.as_slice()?.as_chunks().0),
        })
    }
}

impl<'a> PointSlices<'a> {
    /// Some of them, in `room` where they have to be made double.
    pub(super) fn of<'r>(&self, place: std::ops::Range<usize>, room: &'r mut Vec<[f64; 2]>) -> &'r [[f64; 2]]
    where
        'a: 'r,
    {
        match self {
            Self::Double(points) => &points[place],
            Self::Single(points) => widened(&points[place], room),
        }
    }
}

fn widened<'r>(points: &[[f32; 2]], room: &'r mut Vec<[f64; 2]>) -> &'r [[f64; 2]] {
    room.clear();
    room.extend(points.iter().map(|point| point.map(f64::from)));
    room
}
