//! The search of one object: which minimal solver its box allows, in which order its keypoints are drawn.

use crate::estimate::options::{Options, Solver};
use crate::estimate::points::Points;
use crate::geometry::bbox::Bbox;
use crate::geometry::view::View;
use crate::minimal::p1p::P1p;
use crate::minimal::p1p_height::P1pHeight;
use crate::minimal::p3p::P3p;
use crate::minimal::up2p::Up2p;
use crate::model::observation::Observation;
use crate::search::ransac::{Candidates, RansacStatistics, Search};
use crate::search::sampler::Stream;
use crate::simd::dispatch::VectorUnit;

/// What hypotheses are made from.
pub(crate) struct Hypothesise<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) options: &'a Options,
    pub(crate) view: &'a View,
    pub(crate) observation: &'a Observation<'a>,
    /// Fewest samples drawn, however good the first is.
    pub(crate) min_draws: usize,
    /// Largest depth of a hypothesis, metres.
    pub(crate) farthest: f64,
    /// How far the corners of the 3D box may be outside the sides of its 2D box, in inlier thresholds.
    pub(crate) room: f64,
}

/// The box as given; unknown sides are NaN.
fn given_bbox(observation: &Observation) -> Bbox {
    let nan = f64::NAN;
    observation.bbox().unwrap_or(Bbox { left: nan, top: nan, right: nan, bottom: nan })
}

/// The box without the sides that the image border cuts.
pub(crate) fn usable_bbox(view: &View, observation: &Observation) -> Bbox {
    view.uncut_bbox(given_bbox(observation))
}

impl Hypothesise<'_> {
    /// Fills `candidates` with the hypotheses of a solver; what the search did. Object `index` of a batch has draws of
    /// its own.
    pub(crate) fn run(
        &self,
        solver: Solver,
        bbox: &Bbox,
        points: &mut Points,
        index: u64,
        candidates: &mut Candidates,
    ) -> RansacStatistics {
        let mut stream = Stream::new(self.options.seed, index);
        self.order_draws(points, &mut stream);
        let (view, observation) = (self.view, self.observation);
        let order = &points.buffers.order[..points.count];
        let search = Search {
            unit: self.unit,
            camera: &view.camera,
            blocks: points.blocks(),
            visible: points.visible(),
            scoring: self.options.scoring,
            inlier_threshold: points.inlier_threshold,
            confidence: self.options.confidence,
            max_iterations: self.options.max_iterations,
            min_draws: self.min_draws,
            farthest: self.farthest,
        };
        match solver {
            Solver::P1p => {
                let share = self.room * search.inlier_threshold / view.camera.fx;
                let solver = P1p::new(view, observation, bbox, self.options.cases).with_tolerance(share);
                search.one_point(&solver, order, candidates)
            }
            Solver::P1pHeight => match view.height {
                Some(height) => search.one_point(&P1pHeight::new(view, observation, bbox, height), order, candidates),
                None => RansacStatistics::default(),
            },
            Solver::P3p => search.many_points(&P3p::new(&view.camera, observation), &mut stream, candidates),
            Solver::Up2p | Solver::Auto => search.many_points(&Up2p::new(view, observation), &mut stream, candidates),
        }
    }

    /// The solver asked for with the box as given, or the one that the usable box sides allow.
    pub(crate) fn choose_solver(&self) -> (Solver, Bbox) {
        if self.options.solver != Solver::Auto {
            return (self.options.solver, given_bbox(self.observation));
        }
        let bbox = usable_bbox(self.view, self.observation);
        let solver = match (bbox.left.is_nan(), bbox.right.is_nan(), self.view.height) {
            (false, false, _) => Solver::P1p,
            (true, true, _) | (_, _, None) => Solver::Up2p,
            _ => Solver::P1pHeight,
        };
        (solver, bbox)
    }

    /// A random order of the keypoints; by falling score where there are scores.
    fn order_draws(&self, points: &mut Points, stream: &mut Stream) {
        let count = points.count;
        let buffers = &mut points.buffers;
        let order = &mut buffers.order[..count];
        for (k, o) in order.iter_mut().enumerate() {
            *o = k as u32;
        }
        if !self.observation.has_scores() {
            stream.shuffle(order);
            return;
        }
        // Equal scores in a random order, whatever the sorting algorithm.
        let salt = stream.bits();
        let key = |&k: &u32| {
            let tie = (salt ^ u64::from(k)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            (self.observation.score(buffers.visible[k as usize] as usize), tie)
        };
        order.sort_unstable_by(|a, b| {
            let ((score_a, tie_a), (score_b, tie_b)) = (key(a), key(b));
            score_b.total_cmp(&score_a).then(tie_a.cmp(&tie_b))
        });
    }
}
