//! What windows of a picture show, resampled to one size: the input of a keypoint network (feature `std`).

pub mod cut;
pub mod picture;
pub(crate) mod taps;
