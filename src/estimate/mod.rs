//! The estimate of one object, of many, and of the frame they stand in.
//!
//! An estimate of one object reads from `pipeline` on.

#[cfg(feature = "python")]
pub(crate) mod again;
pub mod alternative;
#[cfg(feature = "rayon")]
pub(crate) mod answers;
pub(crate) mod attempt;
#[cfg(feature = "rayon")]
pub mod batch;
pub mod camera_state;
pub mod describe;
pub mod estimator;
pub mod frame;
pub mod frame_answer;
pub mod frame_object;
pub mod frame_priors;
pub mod frame_tilt;
pub(crate) mod looks;
pub(crate) mod object;
pub mod options;
pub(crate) mod outline;
pub(crate) mod pipeline;
pub mod probability;
#[cfg(feature = "rayon")]
pub(crate) mod queue;
pub(crate) mod refine;
pub(crate) mod search;
pub(crate) mod verify;
pub(crate) mod wide;
pub mod workspace;
