//! How a pose looks: the projected 3D box beside the 2D box.

use crate::estimate::object::Object;
use crate::estimate::refine::priors;
use crate::geometry::bbox::Bbox;
use crate::geometry::math::{sqrt, square};
use crate::refine::box_sides::Sides;
use crate::refine::normal::State;
use crate::refine::priors::{PriorTerms, Priors};
use crate::simd::lanes::LANES;
use crate::tuning::{MISFIT_CUT, MISFIT_SIGMA, SMALLEST_LOOK};

/// The sides of the projected 3D box against the usable ones of the 2D box.
#[derive(Clone, Copy)]
pub(crate) struct Looks {
    /// Root mean square of their distances, as a fraction of the longer side; none where no side is known, or a corner
    /// is behind the camera.
    pub(crate) misfit: Option<f64>,
    /// Whether the projected box is far smaller along all directions that are known.
    pub(crate) too_small: bool,
}

impl Looks {
    pub(crate) fn of(object: &Object, state: &State) -> Self {
        let nothing = Self { misfit: None, too_small: false };
        if object.given_bbox().longer_side().is_none() {
            return nothing;
        }
        // Where the box only makes hypotheses, its sides still tell how well it agrees.
        let priors = Priors { bbox_sigma: 1.0, ..priors(object, 1.0) };
        let (unit, view, model) = (object.unit, object.view, object.observation.model());
        let Some(sides) = (PriorTerms { unit, priors: &priors, view, model }).sides(state) else { return nothing };
        let too_small = is_too_small(&sides, &object.usable_bbox);
        Self { misfit: rms(&sides).map(|rms| rms / object.size()), too_small }
    }

    /// What they say against a pose: log10 of the likelihood of four sides that agree against that of sides with this
    /// misfit.
    pub(crate) fn log10_against(&self) -> f64 {
        let sigmas = (self.misfit.unwrap_or(0.0) / MISFIT_SIGMA).min(MISFIT_CUT);
        0.5 * LANES as f64 * square(sigmas) / core::f64::consts::LN_10
    }
}

/// Root mean square over the known sides, pixels.
fn rms(sides: &Sides) -> Option<f64> {
    let (residuals, known) = (sides.residuals(), sides.block.weight.0);
    let count: f64 = known.iter().sum();
    let squares: f64 = (0..LANES).map(|side| known[side] * square(residuals[side])).sum();
    (count > 0.0).then(|| sqrt(squares / count))
}

fn is_too_small(sides: &Sides, usable: &Bbox) -> bool {
    let [left, top, right, bottom] = sides.residuals();
    let looks = [(usable.right - usable.left, right - left), (usable.bottom - usable.top, bottom - top)];
    // NaN: a side is unknown
    let known = || looks.iter().filter(|(given, _)| !given.is_nan());
    known().next().is_some() && known().all(|(given, longer_by)| given + longer_by < SMALLEST_LOOK * given)
}
