//! Many objects on many cores. Results do not depend on the number of threads.

use rayon::prelude::*;

use crate::camera::View;
use crate::error::NoPose;
use crate::estimate::{Estimate, Estimator};
use crate::observation::Observation;
use crate::workspace::GrowingWorkspace;

/// Objects a thread takes at once: enough to hide the cost of handing them out.
pub const OBJECTS_PER_TASK: usize = 16;

impl Estimator {
    /// One result per object, in order, on the current rayon pool. Object `i` draws from the stream (seed, i).
    #[must_use]
    pub fn estimate_batch(&self, view: &View, observations: &[Observation]) -> Vec<Result<Estimate, NoPose>> {
        observations
            .par_iter()
            .enumerate()
            .with_min_len(OBJECTS_PER_TASK)
            .map_init(GrowingWorkspace::new, |workspace, (i, observation)| {
                self.estimate_indexed(view, observation, workspace, i as u64)
            })
            .collect()
    }
}
