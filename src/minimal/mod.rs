//! Minimal solvers: poses from the fewest points. One file each, one interface for all.

pub mod p1p;
pub mod p1p_height;
pub mod p3p;
pub mod up2p;

use crate::pose::Pose;

/// A solver that makes pose hypotheses from `SIZE` keypoints.
pub trait MinimalSolver<const SIZE: usize> {
    /// Calls `emit` with every pose that the sampled keypoints (indices into the model) allow.
    fn solve(&self, sample: [usize; SIZE], emit: &mut impl FnMut(Pose));
}
