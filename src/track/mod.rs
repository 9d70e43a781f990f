//! Vehicles followed over time on the ground plane: one filter per vehicle, forward and smoothed backward.
//!
//! A vehicle is a place, a velocity, an axis and its turning; three more numbers are the errors that its poses share:
//!
//! | state | unit | over time |
//! |---|---|---|
//! | place x, z, from the camera, in the scale of the pictures | m | moves with the velocity, against the camera |
//! | velocity x, z, in that scale | m/s | turns with the yaw rate, changes with the acceleration |
//! | axis | rad | turns with the yaw rate; which end is the front is decided apart, see `facing` |
//! | yaw rate | rad/s | random walk |
//! | acceleration along the axis | m/s^2 | forgets within seconds |
//! | log scale | | constant: a class-mean size that is wrong puts every pose of the vehicle as much too far |
//! | errors of distance, bearing, heading | distances, rad | errors of a network, the same as long as the picture is |
//!
//! Poses of one vehicle share errors. Taken as independent they would make a filter that is sure and wrong.

#[cfg(feature = "std")]
mod associate;
pub mod facing;
pub mod filter;
mod measure;
pub mod model;
pub mod options;
pub mod row;
pub mod sighting;
mod size;
#[cfg(feature = "std")]
mod smooth;
mod standing;
#[cfg(feature = "std")]
pub mod tracker;
#[cfg(feature = "std")]
mod vehicle;
