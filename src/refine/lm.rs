//! Damped iteratively reweighted least squares over pose and shape coefficients: fixed size, no allocation. A step is
//! accepted on the true robust cost, priors included.

use crate::refine::kernels::Kernel;
use crate::refine::normal::{Normal, State, solve_damped};
use crate::refine::objective::Objective;
use crate::tuning::{
    DAMPING_ACCEPTED, DAMPING_LIMITS, DAMPING_REJECTED, DAMPING_SINGULAR, DAMPING_START, LAST_STEP, MAX_REJECTIONS,
};

impl Objective<'_> {
    /// Robust cost and normal equations are minimised from `state` with a fixed kernel for at most
    /// `max_iterations` steps, or until the cost falls by less than `tolerance` of itself.
    /// `kernel_at` gives the kernel after each accepted step (the scale may follow the residuals).
    pub(crate) fn minimise<const D: usize>(
        &mut self,
        state: &mut State,
        max_iterations: usize,
        tolerance: f64,
        mut kernel_at: impl FnMut(&mut Self, &State) -> Kernel,
    ) -> (f64, usize) {
        let mut kernel = kernel_at(self, state);
        let mut both = [const { Normal::<D>::ZERO }; 2];
        let [mut normal, mut next] = both.each_mut();
        self.linearise(state, kernel, normal);
        let (mut damping, mut rejections) = (DAMPING_START, 0);
        for iteration in 0..max_iterations {
            let Some(step) = solve_damped(normal, damping) else {
                damping = (damping * DAMPING_SINGULAR).min(DAMPING_LIMITS[1]);
                rejections += 1;
                if rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration);
                }
                continue;
            };
            let trial = state.moved(&step);
            let predicted = -0.5 * (0..D).map(|i| step[i] * normal.gradient[i]).sum::<f64>();
            if predicted <= LAST_STEP * tolerance * normal.cost || iteration + 1 == max_iterations {
                // Its normal equations are of no use.
                let cost = self.cost(&trial, kernel);
                if cost < normal.cost {
                    *state = trial;
                    return (cost, iteration + 1);
                }
                return (normal.cost, iteration + 1);
            }
            self.linearise(&trial, kernel, next);
            if next.cost < normal.cost {
                let decrease = normal.cost - next.cost;
                let converged = decrease <= tolerance * normal.cost;
                *state = trial;
                rejections = 0;
                damping = (damping * DAMPING_ACCEPTED).max(DAMPING_LIMITS[0]);
                let next_kernel = kernel_at(self, state);
                let kernel_settled = next_kernel == kernel;
                if !kernel_settled {
                    kernel = next_kernel;
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
        (normal.cost, max_iterations)
    }
}
