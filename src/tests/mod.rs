//! Tests of what is private: Jacobians, kernels, and every refinement against the independent implementation.

mod certainty;
mod fixture;
mod jacobians;
mod kernels;
mod refinement;
mod track;
mod units;
