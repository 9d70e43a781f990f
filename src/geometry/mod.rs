//! Cameras, views, poses and boxes: what the rest computes with.

pub mod bbox;
pub mod camera;
pub mod footprint;
pub mod lens;
pub(crate) mod local_view;
pub(crate) mod math;
pub mod pose;
pub mod view;
