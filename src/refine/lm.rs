//! Damped iteratively reweighted least squares over pose and shape coefficients: fixed size, no allocation. A step is
//! accepted on the true robust cost, priors included.

use crate::refine::kernels::Kernel;
use crate::refine::normal::{Normal, State, solve_damped};
use crate::refine::objective::Objective;
use crate::tuning::{
    DAMPING_ACCEPTED, DAMPING_LIMITS, DAMPING_REJECTED, DAMPING_SINGULAR, DAMPING_START, LAST_STEP, MAX_REJECTIONS,
};

/// When a minimisation ends.
#[derive(Clone, Copy)]
pub(crate) struct Limits {
    /// Most steps.
    pub(crate) iterations: usize,
    /// Decrease of the cost, as a fraction of it, that is not worth another step.
    pub(crate) tolerance: f64,
}

impl Objective<'_> {
    /// Robust cost and normal equations are minimised from `state` within `limits`.
    /// `kernel_at` gives the kernel after each accepted step; where its scale `follows` the residuals, a trial is first
    /// looked at by its cost alone, and its normal equations are those of the kernel that it leads to.
    pub(crate) fn minimise<const D: usize>(
        &mut self,
        state: &mut State,
        limits: Limits,
        follows: bool,
        mut kernel_at: impl FnMut(&mut Self, &State) -> Kernel,
    ) -> (f64, usize) {
        let Limits { iterations, tolerance } = limits;
        let mut kernel = kernel_at(self, state);
        let mut both = [const { Normal::<D>::ZERO }; 2];
        let [mut normal, mut next] = both.each_mut();
        self.linearise(state, kernel, normal);
        let (mut damping, mut rejections) = (DAMPING_START, 0);
        for iteration in 0..iterations {
            let Some(step) = solve_damped(self.keypoints.unit, normal, damping) else {
                damping = (damping * DAMPING_SINGULAR).min(DAMPING_LIMITS[1]);
                rejections += 1;
                if rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration);
                }
                continue;
            };
            let trial = state.moved(&step);
            let predicted = -0.5 * (0..D).map(|i| step[i] * normal.gradient[i]).sum::<f64>();
            let is_last = predicted <= LAST_STEP * tolerance * normal.cost || iteration + 1 == iterations;
            let cost = if is_last || follows {
                self.cost(&trial, kernel)
            } else {
                self.linearise(&trial, kernel, next);
                next.cost
            };
            if is_last {
                // Its normal equations are of no use.
                if cost < normal.cost {
                    *state = trial;
                    return (cost, iteration + 1);
                }
                return (normal.cost, iteration + 1);
            }
            if cost < normal.cost {
                let converged = normal.cost - cost <= tolerance * normal.cost;
                *state = trial;
                rejections = 0;
                damping = (damping * DAMPING_ACCEPTED).max(DAMPING_LIMITS[0]);
                if follows {
                    kernel = kernel_at(self, state);
                    if converged {
                        return (self.cost(state, kernel), iteration + 1);
                    }
                    self.linearise(state, kernel, next);
                }
                core::mem::swap(&mut normal, &mut next);
                if converged {
                    return (normal.cost, iteration + 1);
                }
            } else {
                // No step can lower the cost: rounding, or a minimum.
                rejections += 1;
                damping = (damping * DAMPING_REJECTED).min(DAMPING_LIMITS[1]);
                if 2.0 * predicted <= tolerance * normal.cost || rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration + 1);
                }
            }
        }
        (normal.cost, iterations)
    }
}
