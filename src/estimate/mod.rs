//! The estimate of one object, of many, and of the frame they stand in.

#[cfg(feature = "rayon")]
pub mod batch;
pub mod estimator;
pub mod frame_tilt;
pub(crate) mod hypothesise;
pub(crate) mod job;
pub mod options;
pub(crate) mod points;
pub mod workspace;
