//! How large a vehicle is, from all its frames.

use crate::geometry::math::{exp, log, sqrt, square};

/// Sums of the logarithms of length, height and width.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SizeEstimate {
    weights: [f64; 3],
    logs: [f64; 3],
    /// Smallest variance that a frame stated.
    least: [f64; 3],
}

impl SizeEstimate {
    /// Another frame; `weight`: how much of it was not in the frames before.
    pub(crate) fn add(&mut self, size: &[f64; 3], sigma: &[f64; 3], weight: f64) {
        for k in 0..3 {
            let variance = square(sigma[k] / size[k]).max(1e-6);
            if !(size[k] > 0.0 && variance.is_finite()) {
                continue;
            }
            let w = weight / variance;
            self.least[k] = if self.weights[k] > 0.0 { self.least[k].min(variance) } else { variance };
            self.weights[k] += w;
            self.logs[k] += w * log(size[k]);
        }
    }

    /// Metres, if its poses are not too large; NaN where nothing was seen.
    pub(crate) fn length(&self) -> f64 {
        if self.weights[0] > 0.0 { exp(self.logs[0] / self.weights[0]) } else { f64::NAN }
    }

    /// Metres with standard deviations, for a log scale that its poses are too large by; NaN where nothing was seen.
    /// `shared` and `own`: of a stated variance, what all frames share and what each has of its own.
    pub(crate) fn of(&self, scale: f64, scale_variance: f64, (shared, own): (f64, f64)) -> ([f64; 3], [f64; 3]) {
        let (mut size, mut sigma) = ([f64::NAN; 3], [f64::NAN; 3]);
        for k in 0..3 {
            if self.weights[k] > 0.0 {
                size[k] = exp(self.logs[k] / self.weights[k] - scale);
                // The part that frames share holds the error of the scale, of which `scale_variance` is left.
                let shared = shared * self.least[k];
                let own = own / self.weights[k];
                sigma[k] = size[k] * sqrt(shared.max(scale_variance) + own);
            }
        }
        (size, sigma)
    }
}
