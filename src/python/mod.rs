//! The Python module `groundpose._core`: checks arrays, releases the GIL, maps errors. No mathematics.
#![allow(missing_docs, reason = "documented in _core.pyi")]

mod again;
mod arrays;
mod batch;
mod classes;
mod crops;
mod fields;
mod frame;
mod given;
mod models;
mod observe;
mod options;
mod outputs;
mod points;
mod solvers;
mod synthetic;
mod threads;
mod track;
mod values;
mod words;

use pyo3::prelude::*;

use crate::error::InputError;

mod exception {
    use pyo3::exceptions::PyValueError;

    pyo3::create_exception!(
        groundpose,
        InputError,
        PyValueError,
        "A value the caller passed is not what the argument takes: \"argument: expected ..., got ...\"."
    );
}

/// The one mapping of the core's errors to Python's.
impl From<InputError> for PyErr {
    fn from(error: InputError) -> Self {
        exception::InputError::new_err(error.to_string())
    }
}

/// An error of the caller's with a text made at run time.
pub(crate) fn input_error(argument: &str, expected: &str, got: &str) -> PyErr {
    exception::InputError::new_err(format!("{argument}: expected {expected}, got {got}"))
}

/// The value of a name in a table of choices.
pub(crate) fn choose<T: Copy>(argument: &str, name: &str, table: &[(&str, T)]) -> PyResult<T> {
    table.iter().find(|(n, _)| *n == name).map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = table.iter().map(|(n, _)| *n).collect();
        input_error(argument, &format!("one of {}", names.join(", ")), &format!("{name:?}"))
    })
}

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("InputError", module.py().get_type::<exception::InputError>())?;
    module.add_class::<classes::PyCamera>()?;
    module.add_class::<classes::PyView>()?;
    module.add_class::<classes::PyModel>()?;
    module.add_class::<options::PyOptions>()?;
    module.add_function(wrap_pyfunction!(options::default_options, module)?)?;
    module.add_class::<models::PyModels>()?;
    module.add_class::<batch::PyEstimator>()?;
    module.add_class::<batch::PyAnswers>()?;
    module.add_function(wrap_pyfunction!(frame::solve_frame, module)?)?;
    module.add_function(wrap_pyfunction!(frame::camera_state, module)?)?;
    module.add_function(wrap_pyfunction!(frame::default_frame_priors, module)?)?;
    module.add_function(wrap_pyfunction!(frame::check_frame_priors, module)?)?;
    module.add_function(wrap_pyfunction!(crops::cut_crops, module)?)?;
    module.add_function(wrap_pyfunction!(solvers::solve_p1p, module)?)?;
    module.add_function(wrap_pyfunction!(solvers::solve_p1p_height, module)?)?;
    module.add_function(wrap_pyfunction!(solvers::solve_p3p, module)?)?;
    module.add_function(wrap_pyfunction!(solvers::solve_up2p, module)?)?;
    module.add_class::<track::PyTracker>()?;
    module.add_function(wrap_pyfunction!(track::default_track_options, module)?)?;
    module.add_function(wrap_pyfunction!(synthetic::synthetic_scenes, module)?)?;
    module.add_function(wrap_pyfunction!(build_info, module)?)?;
    module.add_function(wrap_pyfunction!(region_radius2, module)?)?;
    module.add("EVIDENCE", crate::estimate::probability::EVIDENCE)?;
    module.add("VIEWING_ANGLES", crate::model::observation::VIEWING_ANGLES)?;
    let [red, green, blue] = crate::crops::picture::FILL;
    module.add("CROP_FILL", (red, green, blue))?;
    module.add("STATUS", crate::error::NoPose::NAMES.to_vec())?;
    module.add("STOP_REASONS", crate::search::ransac::StopReason::NAMES.to_vec())?;
    module.add("SOLVERS", crate::estimate::options::Solver::NAMES.to_vec())?;
    module.add("LENSES", crate::geometry::lens::Lens::MODELS.map(|(name, _)| name).to_vec())?;
    Ok(())
}

/// Squared Mahalanobis distance within which the truth lies with a probability.
#[pyfunction]
fn region_radius2(level: f64, dimensions: usize, dof: f64) -> PyResult<f64> {
    Ok(crate::refine::region::region_radius2(level, dimensions, dof)?)
}

/// How this module was built, and what it found on this machine.
#[pyfunction]
fn build_info(py: Python<'_>) -> PyResult<Bound<'_, pyo3::types::PyDict>> {
    let info = pyo3::types::PyDict::new(py);
    info.set_item("version", env!("CARGO_PKG_VERSION"))?;
    info.set_item("profile", if cfg!(debug_assertions) { "debug" } else { "release" })?;
    info.set_item("target", format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS))?;
    info.set_item("features", named(&FEATURES))?;
    info.set_item("compiled_target_features", named(&TARGET_FEATURES))?;
    info.set_item("vector_unit", crate::simd::dispatch::VectorUnit::detect().name())?;
    Ok(info)
}

/// Cargo's features, and those of the processor that the module takes for granted everywhere.
const FEATURES: [(&str, bool); 3] =
    [("std", cfg!(feature = "std")), ("rayon", cfg!(feature = "rayon")), ("synthetic", cfg!(feature = "synthetic"))];
const TARGET_FEATURES: [(&str, bool); 4] = [
    ("avx2", cfg!(target_feature = "avx2")),
    ("fma", cfg!(target_feature = "fma")),
    ("avx512f", cfg!(target_feature = "avx512f")),
    ("neon", cfg!(target_feature = "neon")),
];

fn named(switches: &[(&'static str, bool)]) -> Vec<&'static str> {
    switches.iter().filter_map(|(name, on)| on.then_some(*name)).collect()
}
