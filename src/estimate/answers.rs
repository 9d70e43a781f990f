//! Objects of a batch by their place in it, and places for their answers.

use crate::error::NoPose;
use crate::estimate::describe::Estimate;
use crate::model::observation::Observation;

/// A pose, or why there is none.
pub(crate) type Answer = Result<Estimate, NoPose>;

/// The objects of a batch by their place in it, whose answers go to places of the type `A`.
pub(crate) trait Objects<A>: Sync {
    /// Calls `f` with the observation of object `i`, whose answer will be the one of place `k`; none where its own
    /// numbers are not usable.
    fn observe<R>(&self, i: usize, answers: &mut A, k: usize, f: impl FnOnce(&Observation) -> R) -> Option<R>;
}

impl<A> Objects<A> for [Observation<'_>] {
    fn observe<R>(&self, i: usize, _: &mut A, _: usize, f: impl FnOnce(&Observation) -> R) -> Option<R> {
        Some(f(&self[i]))
    }
}

/// Places for what is found of objects that follow each other.
pub(crate) trait Places: Sized + Send {
    /// How many objects.
    fn len(&self) -> usize;

    /// The first `k` objects, and the others.
    fn split_at(self, k: usize) -> (Self, Self);
}

/// Places for answers.
pub(crate) trait Answers: Places {
    /// The answer of object `k` of these; `residuals` are those of a pose, one per keypoint.
    fn store(&mut self, k: usize, answer: Answer, residuals: &[f64]);
}

impl Places for &mut [Answer] {
    fn len(&self) -> usize {
        <[Answer]>::len(self)
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        self.split_at_mut(k)
    }
}

impl Answers for &mut [Answer] {
    fn store(&mut self, k: usize, answer: Answer, _: &[f64]) {
        self[k] = answer;
    }
}
