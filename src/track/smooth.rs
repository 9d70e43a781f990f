//! Backward: what later frames say of earlier ones (Rauch, Tung, Striebel 1965).

use core::array;

use crate::geometry::math::sqrt;
use crate::track::model::{Belief, Rows, State, StateMatrix, TRACK_NUMBERS, Transition, add, symmetric, transposed};
use crate::track::standing;

/// A frame of the filter, as smoothing needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Derivative of the prediction by the belief of the step before.
    pub(crate) by_before: Transition,
    pub(crate) predicted: PackedBelief,
    pub(crate) updated: PackedBelief,
    pub(crate) standing: bool,
}

/// A belief with one triangle of its covariance: a history is long.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PackedBelief {
    mean: State,
    triangle: [f64; TRACK_NUMBERS * (TRACK_NUMBERS + 1) / 2],
}

impl From<&Belief> for PackedBelief {
    fn from(belief: &Belief) -> Self {
        let mut triangle = [0.0; TRACK_NUMBERS * (TRACK_NUMBERS + 1) / 2];
        let mut left = &mut triangle[..];
        for (k, column) in belief.covariance.data.0.iter().enumerate() {
            let (part, rest) = left.split_at_mut(TRACK_NUMBERS - k);
            part.copy_from_slice(&column[k..]);
            left = rest;
        }
        Self { mean: belief.mean, triangle }
    }
}

impl From<&PackedBelief> for Belief {
    fn from(packed: &PackedBelief) -> Self {
        let mut covariance = StateMatrix::zeros();
        let columns = &mut covariance.data.0;
        let mut left = &packed.triangle[..];
        for k in 0..TRACK_NUMBERS {
            let (part, rest) = left.split_at(TRACK_NUMBERS - k);
            for (j, &x) in (k..).zip(part) {
                (columns[k][j], columns[j][k]) = (x, x);
            }
            left = rest;
        }
        Self { mean: packed.mean, covariance }
    }
}

/// Beliefs given all steps, the last step first, and whether the vehicle stands: one that stands later stood before, as far
/// back as nothing says that it moved. `moving_sigma`: of its velocity where it moves.
pub(crate) fn smoothed<'a>(
    steps: impl Iterator<Item = &'a Step>,
    moving_sigma: f64,
) -> impl Iterator<Item = (Belief, bool)> {
    steps.scan(None, move |later: &mut Option<Later<'a>>, step| {
        let mut found = (Belief::from(&step.updated), step.standing);
        if let Some((mut belief, stands_later)) = later.as_ref().and_then(|later| later.before(&found.0)) {
            let stood = !step.standing && stands_later && standing::is_likely(&belief, moving_sigma);
            if stood {
                standing::hold_still(&mut belief);
            }
            found = (belief, step.standing || stood);
        }
        *later = Some(Later { step, belief: found.0, stands: found.1 });
        Some(found)
    })
}

/// A step with what is known of it in the end.
struct Later<'a> {
    step: &'a Step,
    belief: Belief,
    stands: bool,
}

impl Later<'_> {
    /// What it says of the step before, where so much was known; and whether the vehicle stands after that.
    fn before(&self, now: &Belief) -> Option<(Belief, bool)> {
        let predicted = Belief::from(&self.step.predicted);
        let gain = solved(&predicted.covariance.data.0, self.step.by_before.times(&now.covariance.data.0))?;
        let mut mean = now.mean.data.0[0];
        gain.iter().enumerate().for_each(|(k, row)| add(&mut mean, self.belief.mean[k] - predicted.mean[k], row));
        let learned = self.belief.covariance - predicted.covariance;
        let by_learned: Rows = array::from_fn(|k| sum([0.0; TRACK_NUMBERS], learned.data.0[k], &gain));
        let before = &now.covariance.data.0;
        let of_columns = transposed(&gain);
        let covariance = array::from_fn(|k| sum(before[k], of_columns[k], &by_learned));
        Some((Belief { mean: mean.into(), covariance: symmetric(&covariance) }, self.stands))
    }
}

/// A row and so many times others.
fn sum(mut row: [f64; TRACK_NUMBERS], factors: [f64; TRACK_NUMBERS], rows: &Rows) -> [f64; TRACK_NUMBERS] {
    factors.into_iter().zip(rows).for_each(|(x, other)| add(&mut row, x, other));
    row
}

/// Rows of the inverse of a symmetric matrix times a matrix, by the Cholesky factor; none of one that is not positive.
fn solved(matrix: &Rows, mut rows: Rows) -> Option<Rows> {
    // Columns; what is above the diagonal is not looked at.
    let mut root = *matrix;
    let mut inverse = [0.0; TRACK_NUMBERS];
    for k in 0..TRACK_NUMBERS {
        let (before, from) = root.split_at_mut(k);
        before.iter().for_each(|column| add(&mut from[0], -column[k], column));
        let pivot = from[0][k];
        if !(pivot > 0.0) {
            return None;
        }
        inverse[k] = 1.0 / sqrt(pivot);
        from[0] = from[0].map(|x| x * inverse[k]);
    }
    for k in 0..TRACK_NUMBERS {
        rows[k] = rows[k].map(|x| x * inverse[k]);
        let row = rows[k];
        (k + 1..TRACK_NUMBERS).for_each(|j| add(&mut rows[j], -root[k][j], &row));
    }
    for k in (0..TRACK_NUMBERS).rev() {
        let (row, later) = rows[k..].split_first_mut().expect("a row");
        later.iter().zip(&root[k][k + 1..]).for_each(|(other, &x)| add(row, -x, other));
        *row = row.map(|x| x * inverse[k]);
    }
    Some(rows)
}
