//! What is known of an object before its pose: its shape model, its keypoints and its box.

pub mod observation;
pub mod shape_model;
