//! From one calibrated image, the 6-DoF pose and shape of every vehicle on the ground.
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "rayon")]
pub mod batch;
pub mod camera;
pub mod error;
pub mod estimate;
mod lm;
pub mod loss;
mod math;
pub mod minimal;
mod noise;
pub mod object;
pub mod observation;
pub mod options;
pub mod pose;
mod priors;
#[cfg(feature = "python")]
mod python;
pub mod ransac;
pub mod refine;
mod residual;
mod sampler;
pub mod score;
mod simd;
#[cfg(feature = "synthetic")]
pub mod synthetic;
pub mod workspace;
