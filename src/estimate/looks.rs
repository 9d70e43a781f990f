//! How a pose looks: the projected 3D box beside the 2D box.

use crate::estimate::object::Object;
use crate::estimate::refine::priors;
use crate::geometry::math::{sqrt, square};
use crate::refine::normal::State;
use crate::refine::priors::{PriorTerms, Priors};
use crate::simd::lanes::LANES;
use crate::tuning::{MISFIT_CUT, MISFIT_SIGMA};

/// Root mean square of the distances between the usable sides of the 2D box and those of the projected 3D box, as a
/// fraction of the longer side; zero where no side is known, infinite where a corner is behind the camera.
pub(crate) fn misfit(object: &Object, state: &State) -> f64 {
    let Some(longer_side) = object.observation.bbox().and_then(|bbox| bbox.longer_side()) else { return 0.0 };
    // Where the box only makes hypotheses, its sides still tell how well it agrees.
    let priors = Priors { bbox_sigma: 1.0, ..priors(object, 1.0) };
    let terms = PriorTerms { unit: object.unit, priors: &priors, view: object.view, model: object.observation.model() };
    let Some(sides) = terms.sides(state) else { return f64::INFINITY };
    let (residuals, known) = (sides.residuals(), sides.block.weight.0);
    let squares: f64 = (0..LANES).map(|side| known[side] * square(residuals[side])).sum();
    sqrt(squares / known.iter().sum::<f64>().max(1.0)) / longer_side
}

/// What a misfit says against a pose: log10 of the likelihood of four sides that agree against that of its own.
pub(crate) fn log10_against(misfit: f64) -> f64 {
    let sigmas = (misfit / MISFIT_SIGMA).min(MISFIT_CUT);
    0.5 * LANES as f64 * square(sigmas) / core::f64::consts::LN_10
}
