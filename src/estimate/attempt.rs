//! How an object is searched: with the solver that its box allows; where that is not sure, once more without the box, and
//! where what was found does not convince, at last without the ground.

use crate::estimate::object::Object;
use crate::estimate::options::{Options, Solver};
use crate::geometry::bbox::Bbox;
use crate::geometry::math::{sqrt, square};
use crate::geometry::pose::Pose;
use crate::refine::schedule::Refinement;
use crate::tuning::{
    BBOX_ROOM, CANDIDATES, DOUBTFUL, LAST_DRAWS, LAST_TRY, MIN_DRAWS, MISFIT_UNCONVINCING, MISFIT_WITHOUT_GROUND,
    SECOND_TRY, SMALLEST_LOOK, UNCONVINCING, WORST_CANDIDATE,
};

/// One way to find a pose.
pub(crate) struct Attempt {
    pub(crate) solver: Solver,
    /// The sides that the solver may use; NaN: unknown.
    pub(crate) bbox: Bbox,
    /// Largest depth, metres, where there is one.
    pub(crate) farthest: Option<f64>,
    /// Largest misfit of the 2D box, where there is one.
    pub(crate) worst_misfit: Option<f64>,
    /// What it costs to have tried: added to the log10 of false alarms.
    pub(crate) price: f64,
    pub(crate) plan: Plan,
}

/// What a refinement asks of the search.
#[derive(Clone, Copy)]
pub(crate) struct Plan {
    /// Most hypotheses to be refined.
    pub(crate) candidates: usize,
    /// A hypothesis that costs more than this multiple of the best is none of them.
    pub(crate) worst_ratio: f64,
    /// Fewest samples drawn, however good the first is.
    pub(crate) min_draws: usize,
    /// How far the corners of the 3D box may be outside the sides of its 2D box, in inlier thresholds.
    pub(crate) room: f64,
    /// Log10 of false alarms above which there is a second attempt. `None`: there is none.
    doubtful: Option<f64>,
}

impl Plan {
    /// Of ours, and of the paper's method.
    const DEFAULT: Self = Self {
        candidates: CANDIDATES,
        worst_ratio: WORST_CANDIDATE,
        min_draws: MIN_DRAWS,
        room: BBOX_ROOM,
        doubtful: Some(DOUBTFUL),
    };
    const PAPER: Self = Self { candidates: 1, worst_ratio: 1.0, min_draws: 1, room: f64::INFINITY, doubtful: None };
}

impl Attempt {
    /// The solver asked for with the box as given, or the one that the usable box sides allow.
    pub(crate) fn first(object: &Object) -> Self {
        let plan = if object.options.refinement == Refinement::Default { Plan::DEFAULT } else { Plan::PAPER };
        let (solver, bbox) = match object.options.solver {
            Solver::Auto => (allowed_solver(object), object.usable_bbox),
            solver => (solver, object.given_bbox()),
        };
        Self { solver, bbox, farthest: None, worst_misfit: None, price: 0.0, plan }
    }

    /// By two keypoints without the box, where the solver is ours to choose, the first attempt used the box, and what
    /// it found (log10 of false alarms) is doubtful.
    pub(crate) fn second(&self, object: &Object, log10_nfa: Option<f64>) -> Option<Self> {
        let used_the_box = object.options.solver == Solver::Auto && self.solver != Solver::Up2p;
        let is_settled = |limit| log10_nfa.is_some_and(|log10_nfa| log10_nfa <= limit);
        if !used_the_box || self.plan.doubtful.is_none_or(is_settled) {
            return None;
        }
        let farthest = Some(farthest(object, &self.bbox));
        Some(Self { solver: Solver::Up2p, farthest, price: SECOND_TRY, ..*self })
    }

    /// By three keypoints without the ground, of which the nominal tilt may be wrong, or on which the object may not
    /// stand: where the solver and the ground's say are ours to choose, and what was found (false alarms, misfit of the
    /// box) does not convince. With the options that forget the ground.
    pub(crate) fn last(&self, object: &Object, found: Option<[f64; 2]>) -> Option<(Self, Options)> {
        let options = object.options;
        let is_ours = options.solver == Solver::Auto && options.tilt_sigma.is_none() && self.plan.doubtful.is_some();
        let convinces = |[log10_nfa, misfit]: [f64; 2]| log10_nfa <= UNCONVINCING && misfit <= MISFIT_UNCONVINCING;
        if !is_ours || found.is_some_and(convinces) {
            return None;
        }
        let (farthest, worst_misfit) = (Some(farthest(object, &self.bbox)), Some(MISFIT_WITHOUT_GROUND));
        let attempt = Self { solver: Solver::P3p, farthest, worst_misfit, price: LAST_TRY, ..*self };
        let max_iterations = options.max_iterations.min(LAST_DRAWS);
        Some((attempt, Options { max_iterations, ..without_ground(options) }))
    }

    /// Whether a pose is where this attempt may find one (the refinement may have moved it), and looks as it must.
    pub(crate) fn allows(&self, pose: &Pose, misfit: f64) -> bool {
        self.farthest.is_none_or(|farthest| pose.t.z <= farthest)
            && self.worst_misfit.is_none_or(|worst| misfit <= worst)
    }
}

/// Options that forget what the ground says.
fn without_ground(options: &Options) -> Options {
    Options { tilt_sigma: Some(f64::INFINITY), ..*options }
}

/// The options by which an answer was refined: where the solver is ours to choose, only the attempt without the ground
/// draws three keypoints.
#[cfg(feature = "python")]
pub(crate) fn options_that_found(options: &Options, by_three_keypoints: bool) -> Options {
    if options.solver == Solver::Auto && by_three_keypoints { without_ground(options) } else { *options }
}

fn allowed_solver(object: &Object) -> Solver {
    let bbox = &object.usable_bbox;
    match (bbox.left.is_nan(), bbox.right.is_nan(), object.view.height) {
        (false, false, _) => Solver::P1p,
        (true, true, _) | (_, _, None) => Solver::Up2p,
        _ => Solver::P1pHeight,
    }
}

/// Depth, metres, beyond which the object could not look as large as its 2D box says. A detector that finds nothing
/// puts many keypoints in one place: they agree on an object far away.
fn farthest(object: &Object, bbox: &Bbox) -> f64 {
    let Some(longer_side) = bbox.longer_side() else { return f64::INFINITY };
    let [min, max] = *object.observation.model().bbox_3d();
    let diagonal = sqrt((0..3).map(|axis| square(max[axis] - min[axis])).sum());
    let camera = &object.view.camera;
    camera.fx.max(camera.fy) * diagonal / (SMALLEST_LOOK * longer_side)
}
