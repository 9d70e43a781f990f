//! First step: hypotheses from few keypoints, drawn in a random order.

use crate::estimate::attempt::Attempt;
use crate::estimate::object::{Memory, Object};
use crate::estimate::options::Solver;
use crate::minimal::p1p::P1p;
use crate::minimal::p1p_height::P1pHeight;
use crate::minimal::p3p::P3p;
use crate::minimal::up2p::Up2p;
use crate::model::observation::Observation;
use crate::model::shape_model::MAX_MODES;
use crate::search::ransac::{Candidates, RansacStatistics, Search};
use crate::search::sampler::Stream;

/// What a search found.
pub(crate) struct Hypotheses {
    pub(crate) candidates: Candidates,
    pub(crate) ransac: RansacStatistics,
    pub(crate) solver: Solver,
}

/// Searches an object, with draws of its own, by the solver and the box of an attempt.
pub(crate) fn search(object: &Object, attempt: &Attempt, memory: &mut Memory) -> Hypotheses {
    let Object { options, view, observation, .. } = *object;
    let Attempt { solver, ref bbox, ref plan, .. } = *attempt;
    let mut candidates = Candidates::new(plan.candidates, plan.worst_ratio);
    let mut stream = Stream::new(options.seed, object.index);
    let visible = memory.keypoints.visible;
    order_draws(observation, visible, memory.order, &mut stream);
    let search = Search {
        unit: object.unit,
        camera: &view.camera,
        blocks: memory.keypoints.of_shape(&[0.0; MAX_MODES]),
        visible,
        scoring: options.scoring,
        inlier_threshold: object.inlier_threshold,
        confidence: options.confidence,
        max_iterations: options.max_iterations,
        min_draws: plan.min_draws,
        farthest: attempt.farthest.unwrap_or(f64::INFINITY),
    };
    let found = &mut candidates;
    let ransac = match solver {
        Solver::P1p => {
            let tolerance = plan.room * search.inlier_threshold / view.camera.fx;
            let solver = P1p::new(view, observation, bbox, options.cases).with_tolerance(tolerance);
            search.one_point(&solver, memory.order, found)
        }
        Solver::P1pHeight => {
            // It is known: the estimator has checked.
            let height = view.height.unwrap_or(f64::NAN);
            search.one_point(&P1pHeight::new(view, observation, bbox, height), memory.order, found)
        }
        Solver::P3p => search.many_points(&P3p::new(&view.camera, observation), &mut stream, found),
        Solver::Up2p | Solver::Auto => search.many_points(&Up2p::new(view, observation), &mut stream, found),
    };
    Hypotheses { candidates, ransac, solver }
}

/// A random order of the keypoints; by falling score where there are scores.
fn order_draws(observation: &Observation, visible: &[u32], order: &mut [u32], stream: &mut Stream) {
    for (k, o) in order.iter_mut().enumerate() {
        *o = k as u32;
    }
    if !observation.has_scores() {
        stream.shuffle(order);
        return;
    }
    // Equal scores in a random order, whatever the sorting algorithm.
    let salt = stream.bits();
    let key = |&k: &u32| {
        let tie = (salt ^ u64::from(k)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (observation.score(visible[k as usize] as usize), tie)
    };
    order.sort_unstable_by(|a, b| {
        let ((score_a, tie_a), (score_b, tie_b)) = (key(a), key(b));
        score_b.total_cmp(&score_a).then(tie_a.cmp(&tie_b))
    });
}
