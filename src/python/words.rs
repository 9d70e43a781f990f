//! Words for the core's numbers of them, as NumPy's arrays of text.

use numpy::{PyArray1, PyFixedUnicode};
use pyo3::prelude::*;

use crate::error::NoPose;
use crate::estimate::options::Solver;
use crate::search::ransac::StopReason;

pub(super) fn status<'py>(py: Python<'py>, numbers: &[u8]) -> Bound<'py, PyAny> {
    words::<{ longest(&NoPose::NAMES) }>(py, numbers, &NoPose::NAMES)
}

pub(super) fn stop_reason<'py>(py: Python<'py>, numbers: &[u8]) -> Bound<'py, PyAny> {
    words::<{ longest(&StopReason::NAMES) }>(py, numbers, &StopReason::NAMES)
}

pub(super) fn solver<'py>(py: Python<'py>, numbers: &[u8]) -> Bound<'py, PyAny> {
    words::<{ longest(&Solver::NAMES) }>(py, numbers, &Solver::NAMES)
}

/// Letters of the longest word.
const fn longest(table: &[&str]) -> usize {
    let (mut longest, mut k) = (0, 0);
    while k < table.len() {
        if table[k].len() > longest {
            longest = table[k].len();
        }
        k += 1;
    }
    longest
}

fn words<'py, const N: usize>(py: Python<'py>, numbers: &[u8], table: &[&str]) -> Bound<'py, PyAny> {
    let word = |&number: &u8| {
        let mut letters = [0; N];
        letters.iter_mut().zip(table[number as usize].bytes()).for_each(|(letter, byte)| *letter = u32::from(byte));
        PyFixedUnicode(letters)
    };
    if let [only] = numbers {
        return PyArray1::from_slice(py, &[word(only)]).into_any();
    }
    PyArray1::from_vec(py, numbers.iter().map(word).collect()).into_any()
}
