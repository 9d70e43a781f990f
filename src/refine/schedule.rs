//! Refinement: a schedule of stages is data.

use crate::geometry::math::square;
use crate::geometry::pose::Pose;
use crate::model::shape_model::MAX_MODES;
use crate::refine::kernels::Kernel;
use crate::refine::lm::Limits;
use crate::refine::mad::mad_scale;
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
            let residuals = &mut scratch[..objective.keypoints.visible.len()];
            objective.keypoints.residuals(state, residuals);
            let scale = mad_scale(objective.keypoints.unit, residuals).clamp(lowest, highest);
            Kernel::Tukey { c2: square(TUKEY_EFFICIENCY * scale) }
        }
    };
    let modes = if stage.joint { objective.keypoints.model.eigenvalues().len() } else { 0 };
    let limits = Limits { iterations: stage.max_iterations, tolerance: stage.tolerance };
    let follows = matches!(stage.kernel, StageKernel::MadTukey { .. });
    match padded_modes(modes) {
        0 => objective.minimise::<6>(state, limits, follows, kernel_at),
        5 => objective.minimise::<11>(state, limits, follows, kernel_at),
        _ => objective.minimise::<{ 6 + MAX_MODES }>(state, limits, follows, kernel_at),
    }
}
