//! Damped iteratively reweighted least squares over pose and shape coefficients: fixed size, no allocation. A step is
//! accepted on the true robust cost, priors included.

use crate::refine::kernels::Kernel;
use crate::refine::normal::{Normal, State, solve_damped};
use crate::refine::objective::Objective;

/// Limits of the damping factor.
const DAMPING: (f64, f64) = (1e-10, 1e8);
/// Rejected steps in a row before giving up.
const MAX_REJECTIONS: usize = 6;
/// A step that the linear model expects to lower the cost by less than this share of the tolerance is the last one:
/// robust kernels give more than the model expects, but not so much more.
const LAST_STEP: f64 = 0.5;

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
        if D > 6 {
            self.set_shape(&state.coefficients);
        }
        let mut kernel = kernel_at(self, state);
        let mut both = [const { Normal::<D>::ZERO }; 2];
        let [mut normal, mut next] = both.each_mut();
        self.linearise(state, kernel, normal);
        let (mut damping, mut rejections) = (1e-6, 0);
        for iteration in 0..max_iterations {
            let Some(step) = solve_damped(normal, damping) else {
                damping = (damping * 100.0).min(DAMPING.1);
                rejections += 1;
                if rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration);
                }
                continue;
            };
            let trial = state.moved(&step);
            if D > 6 {
                self.set_shape(&trial.coefficients);
            }
            let predicted = -0.5 * (0..D).map(|i| step[i] * normal.gradient[i]).sum::<f64>();
            if predicted <= LAST_STEP * tolerance * normal.cost || iteration + 1 == max_iterations {
                // Its normal equations are of no use.
                let cost = self.cost(&trial, kernel);
                if cost < normal.cost {
                    *state = trial;
                    return (cost, iteration + 1);
                }
                self.set_shape(&state.coefficients);
                return (normal.cost, iteration + 1);
            }
            self.linearise(&trial, kernel, next);
            if next.cost < normal.cost {
                let decrease = normal.cost - next.cost;
                let converged = decrease <= tolerance * normal.cost;
                *state = trial;
                rejections = 0;
                damping = (damping * 0.1).max(DAMPING.0);
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
                if D > 6 {
                    self.set_shape(&state.coefficients);
                }
                // No step can lower the cost: rounding, or a minimum.
                rejections += 1;
                damping = (damping * 10.0).min(DAMPING.1);
                if 2.0 * predicted <= tolerance * normal.cost || rejections > MAX_REJECTIONS {
                    return (normal.cost, iteration + 1);
                }
            }
        }
        (normal.cost, max_iterations)
    }
}
