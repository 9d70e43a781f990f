//! Refinement: a schedule of stages is data.

use crate::geometry::math::{sqrt, square};
use crate::geometry::pose::Pose;
use crate::model::shape_model::MAX_MODES;
use crate::refine::kernels::Kernel;
use crate::refine::keypoints::Keypoints;
use crate::refine::normal::{State, padded_modes};
use crate::refine::objective::Objective;
use crate::tuning::{
    GN_ITERATIONS, HRE_ITERATIONS, PAPER_TOLERANCE, POLISH_ITERATIONS, POLISH_TOLERANCE, RE_ITERATIONS,
    WIDE_ITERATIONS, WIDE_SCALE, WIDE_TOLERANCE,
};

/// How a hypothesis becomes a pose.
///
/// ```
/// use groundpose::{Options, Refinement};
///
/// let paper = Options { refinement: Refinement::Hre, ..Options::default() };
/// assert!(paper.effective_tilt_sigma().is_infinite(), "the paper's refinement has no priors");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refinement {
    /// The hypothesis as it is.
    None,
    /// Least squares on the inliers of the hypothesis.
    Gn,
    /// Tukey with `c = 4.685 MAD / 0.6745` (paper, eq. 9, 10).
    Re,
    /// Hierarchical robust estimation (paper, Algorithm 1).
    Hre,
    /// Ours: annealed Tukey with tilt and shape priors.
    Default,
}

/// Most stages a schedule has.
///
/// ```
/// use groundpose::{MAX_STAGES, StageStatistics};
///
/// // `Estimate::stages`: an unused place has no iterations.
/// let stages = [StageStatistics::default(); MAX_STAGES];
/// assert!(stages.iter().all(|stage| stage.iterations == 0));
/// ```
pub const MAX_STAGES: usize = 3;

/// What a stage minimises.
#[derive(Clone, Copy)]
pub(crate) enum StageKernel {
    /// Least squares over the points within `tau` (pixels) of the pose at the start of the stage.
    Inliers { tau: f64 },
    /// Tukey, `c = 4.685 s`, `s` the MAD scale of the residuals clamped to these pixels.
    MadTukey { lowest: f64, highest: f64 },
    /// Tukey with a fixed scale `c` in pixels.
    FixedTukey { c: f64 },
    /// Tukey with the scale that suits the noise and the outliers found at the start of the stage; priors are weighed
    /// against that noise.
    NoiseTukey,
}

/// One stage.
#[derive(Clone, Copy)]
pub(crate) struct Stage {
    pub(crate) kernel: StageKernel,
    /// Pose and shape, or pose alone.
    pub(crate) joint: bool,
    /// Whether the sides of the 2D box take part.
    pub(crate) bbox: bool,
    pub(crate) max_iterations: usize,
    /// Relative decrease of the cost at which the stage ends.
    pub(crate) tolerance: f64,
}

/// Stages in order; unused places are `None`.
pub(crate) type Schedule = [Option<Stage>; MAX_STAGES];

/// Iterations and final cost of a stage.
///
/// ```
/// use groundpose::StageStatistics;
///
/// let StageStatistics { iterations, cost } = StageStatistics::default();
/// assert_eq!((iterations, cost), (0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageStatistics {
    /// Steps tried.
    pub iterations: usize,
    /// Robust cost at the end, priors included (pixels squared).
    pub cost: f64,
}

/// Turns a scale into Tukey's `c` at 95 % efficiency (paper, eq. 10).
const TUKEY_EFFICIENCY: f64 = 4.685;
/// Turns a median absolute deviation into a standard deviation.
const MAD_TO_SIGMA: f64 = 1.0 / 0.6745;
/// Smallest scale of RE, pixels: exact data has a MAD of zero.
const SMALLEST_SCALE: f64 = 1e-9;

/// The schedule of a refinement for an inlier threshold in pixels and `tau_1, tau_2, tau_3` as its multiples.
pub(crate) fn schedule(refinement: Refinement, threshold: f64, hre_thresholds: [f64; 3]) -> Schedule {
    let stage = |kernel, joint, max_iterations| {
        Some(Stage { kernel, joint, bbox: true, max_iterations, tolerance: PAPER_TOLERANCE })
    };
    let [tau1, tau2, tau3] = hre_thresholds.map(|m| m * threshold);
    match refinement {
        Refinement::None => [None; MAX_STAGES],
        Refinement::Gn => [stage(StageKernel::Inliers { tau: threshold }, true, GN_ITERATIONS), None, None],
        Refinement::Re => {
            let mad = StageKernel::MadTukey { lowest: SMALLEST_SCALE, highest: f64::INFINITY };
            [stage(mad, true, RE_ITERATIONS), None, None]
        }
        Refinement::Hre => [
            stage(StageKernel::MadTukey { lowest: tau2, highest: tau3 }, false, HRE_ITERATIONS[0]),
            stage(StageKernel::MadTukey { lowest: tau1, highest: tau2 }, true, HRE_ITERATIONS[1]),
            stage(StageKernel::Inliers { tau: tau1 }, true, HRE_ITERATIONS[2]),
        ],
        Refinement::Default => {
            let wide = Stage {
                kernel: StageKernel::FixedTukey { c: WIDE_SCALE * threshold },
                joint: false,
                bbox: false,
                max_iterations: WIDE_ITERATIONS,
                tolerance: WIDE_TOLERANCE,
            };
            let polish = Stage {
                kernel: StageKernel::NoiseTukey,
                joint: true,
                bbox: true,
                max_iterations: POLISH_ITERATIONS,
                tolerance: POLISH_TOLERANCE,
            };
            [Some(wide), Some(polish), None]
        }
    }
}

/// Runs a schedule from a pose. It ends after the first stage that leaves a pose and cost of which `is_worth_it` says
/// no.
pub(crate) fn refine(
    objective: &mut Objective,
    scratch: &mut [f64],
    start: &Pose,
    schedule: &Schedule,
    mut is_worth_it: impl FnMut(&Pose, f64) -> bool,
) -> (State, [StageStatistics; MAX_STAGES]) {
    let mut state = State { pose: *start, coefficients: [0.0; MAX_MODES] };
    let mut statistics = [StageStatistics::default(); MAX_STAGES];
    let stages = schedule.iter().flatten().count();
    for (k, (stage, statistics)) in schedule.iter().flatten().zip(&mut statistics).enumerate() {
        let (cost, iterations) = run_stage(objective, scratch, &mut state, stage);
        *statistics = StageStatistics { iterations, cost };
        if k + 1 < stages && !is_worth_it(&state.pose, cost) {
            break;
        }
    }
    (state, statistics)
}

fn run_stage(objective: &mut Objective, scratch: &mut [f64], state: &mut State, stage: &Stage) -> (f64, usize) {
    match stage.kernel {
        StageKernel::Inliers { tau } => objective.keypoints.activate_within(state, tau),
        _ => objective.keypoints.activate_all(),
    }
    objective.priors.use_bbox = stage.bbox;
    let mut noise_scale = f64::NAN;
    if let StageKernel::NoiseTukey = stage.kernel {
        let noise = objective.estimate_noise(state);
        objective.priors.noise_sigma = noise.sigma;
        noise_scale = objective.noise.tukey_scale(noise);
    }
    let kernel_at = |objective: &mut Objective, state: &State| match stage.kernel {
        StageKernel::Inliers { .. } => Kernel::LeastSquares,
        StageKernel::FixedTukey { c } => Kernel::Tukey { c2: square(c) },
        StageKernel::NoiseTukey => Kernel::Tukey { c2: square(noise_scale) },
        StageKernel::MadTukey { lowest, highest } => {
            let scale = mad_scale(&mut objective.keypoints, state, scratch).clamp(lowest, highest);
            Kernel::Tukey { c2: square(TUKEY_EFFICIENCY * scale) }
        }
    };
    let modes = if stage.joint { objective.keypoints.model.eigenvalues().len() } else { 0 };
    let (n, tolerance) = (stage.max_iterations, stage.tolerance);
    match padded_modes(modes) {
        0 => objective.minimise::<6>(state, n, tolerance, kernel_at),
        5 => objective.minimise::<11>(state, n, tolerance, kernel_at),
        _ => objective.minimise::<{ 6 + MAX_MODES }>(state, n, tolerance, kernel_at),
    }
}

/// `median(|r - median(r)|) / 0.6745` over the visible keypoints (paper, below eq. 10).
fn mad_scale(keypoints: &mut Keypoints, state: &State, scratch: &mut [f64]) -> f64 {
    let residuals = &mut scratch[..keypoints.visible.len()];
    let measured = keypoints.measure(state);
    for (k, r) in residuals.iter_mut().enumerate() {
        *r = sqrt(measured.squared(k));
    }
    let centre = median(residuals);
    for r in residuals.iter_mut() {
        *r = (*r - centre).abs();
    }
    let mad = median(residuals) * MAD_TO_SIGMA;
    // Half the points behind the camera: no scale, nothing is an outlier.
    if mad.is_nan() { f64::INFINITY } else { mad }
}

/// Median by selection; reorders the values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (lower, &mut middle, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return middle;
    }
    let below = lower.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    0.5 * (below + middle)
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn median_of_odd_and_even_counts() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 3.0, 2.0]), 2.5);
        assert!(median(&mut []).is_nan());
    }
}
