//! Options by name: one table for reading, for writing and for messages.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::choose;
use crate::estimate::options::{Options, Solver};
use crate::minimal::p1p::Cases;
use crate::refine::schedule::Refinement;
use crate::search::score::Scoring;

#[pyclass(frozen, name = "Options", module = "groundpose._core")]
pub(crate) struct PyOptions(pub(crate) Options);

/// Named values of an option, in one table for both directions.
pub(crate) struct Choices<T: 'static>(&'static str, &'static [(&'static str, T)]);

const SOLVERS: Choices<Solver> = Choices(
    "solver",
    &[
        ("auto", Solver::Auto),
        ("p1p", Solver::P1p),
        ("p3p", Solver::P3p),
        ("up2p", Solver::Up2p),
        ("p1p_height", Solver::P1pHeight),
    ],
);
pub(crate) const CASES: Choices<Cases> = Choices("cases", &[("all", Cases::All), ("paper", Cases::Paper)]);
const SCORINGS: Choices<Scoring> = Choices("scoring", &[("msac", Scoring::Msac), ("inliers", Scoring::Inliers)]);
const REFINEMENTS: Choices<Refinement> = Choices(
    "refinement",
    &[
        ("default", Refinement::Default),
        ("hre", Refinement::Hre),
        ("re", Refinement::Re),
        ("gn", Refinement::Gn),
        ("none", Refinement::None),
    ],
);

impl<T: Copy + PartialEq> Choices<T> {
    pub(crate) fn parse(&self, name: &str) -> PyResult<T> {
        choose(self.0, name, self.1)
    }

    fn name(&self, value: T) -> &'static str {
        self.1.iter().find(|(_, v)| *v == value).map_or("", |(n, _)| n)
    }
}

/// One option: how it is read from Python and written to it.
struct Field {
    name: &'static str,
    read: fn(&mut Options, &Bound<'_, PyAny>) -> PyResult<()>,
    write: fn(&Options, &Bound<'_, PyDict>, &str) -> PyResult<()>,
}

/// A row of [`FIELDS`]: a plain value, or one of named choices.
macro_rules! field {
    ($name:ident) => {
        Field {
            name: stringify!($name),
            read: |options, value| value.extract().map(|value| options.$name = value),
            write: |options, dict, name| dict.set_item(name, options.$name),
        }
    };
    ($name:ident of $choices:ident) => {
        Field {
            name: stringify!($name),
            read: |options, value| $choices.parse(value.extract()?).map(|value| options.$name = value),
            write: |options, dict, name| dict.set_item(name, $choices.name(options.$name)),
        }
    };
}

const FIELDS: [Field; 24] = [
    field!(inlier_threshold),
    field!(relative_threshold),
    field!(confidence),
    field!(solver of SOLVERS),
    field!(cases of CASES),
    field!(scoring of SCORINGS),
    field!(refinement of REFINEMENTS),
    Field {
        name: "hre_thresholds",
        read: |options, value| value.extract().map(|value| options.hre_thresholds = value),
        // a tuple: a list may not be a default in Python
        write: |options, dict, name| dict.set_item(name, <(f64, f64, f64)>::from(options.hre_thresholds)),
    },
    field!(tilt_sigma),
    field!(shape_prior),
    field!(bbox_sigma),
    field!(covariance),
    field!(max_iterations),
    field!(min_keypoints),
    field!(max_log10_nfa),
    field!(keypoint_error_factor),
    field!(keypoint_error_dof),
    field!(keypoint_error_shift),
    field!(keypoint_error_turn),
    field!(probability_coefficients),
    field!(ambiguity_coefficients),
    field!(min_probability),
    field!(score_weights),
    field!(seed),
];

#[pymethods]
impl PyOptions {
    #[new]
    #[pyo3(signature = (**fields))]
    fn new(fields: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut options = Options::default();
        for (name, value) in fields.into_iter().flatten() {
            let name: String = name.extract()?;
            let Some(field) = FIELDS.iter().find(|field| field.name == name) else { return Err(unknown(&name)) };
            (field.read)(&mut options, &value).map_err(|e| wrong_type(&name, &value, e))?;
        }
        options.check()?;
        Ok(Self(options))
    }
}

fn unknown(name: &str) -> PyErr {
    let names = FIELDS.map(|field| field.name).join(", ");
    PyTypeError::new_err(format!("Options: expected one of {names}, got {name:?}"))
}

/// A type error names option and type; other errors say enough.
fn wrong_type(name: &str, value: &Bound<'_, PyAny>, cause: PyErr) -> PyErr {
    if !cause.is_instance_of::<PyTypeError>(value.py()) {
        return cause;
    }
    let got = value.get_type().name().map_or_else(|_| "another type".to_owned(), |n| n.to_string());
    PyTypeError::new_err(format!("{name}: {cause}, got {got}"))
}

/// Every option with its default: the place of defaults for Python too.
#[pyfunction]
pub(crate) fn default_options(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let (options, dict) = (Options::default(), PyDict::new(py));
    for field in &FIELDS {
        (field.write)(&options, &dict, field.name)?;
    }
    Ok(dict)
}
