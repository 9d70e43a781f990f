//! From keypoints to the best hypotheses: random samples, their score, the noise, and what chance would explain.

pub(crate) mod false_alarms;
pub(crate) mod noise;
pub mod ransac;
pub(crate) mod sampler;
pub mod score;
