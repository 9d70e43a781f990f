//! From a hypothesis to the best pose and shape, and how uncertain they are.

pub(crate) mod box_extremes;
pub(crate) mod box_sides;
pub mod covariance;
pub mod kernels;
pub(crate) mod keypoints;
pub(crate) mod lm;
pub(crate) mod mad;
pub(crate) mod modes;
pub(crate) mod normal;
pub(crate) mod normal_joint;
pub(crate) mod normal_pose;
pub(crate) mod objective;
pub(crate) mod priors;
pub mod region;
pub mod schedule;
