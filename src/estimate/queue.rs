//! Hands out the objects of a batch to threads: in chunks of equal time, ever smaller towards the end.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::estimate::answers::Places;

/// Of a chunk: long against handing it out (half a microsecond), short against what a look for an interrupt may wait.
const CHUNK: Duration = Duration::from_millis(1);

/// Objects of a thread's first chunk, before it knows how long one takes.
const FIRST: usize = 8;

/// Nobody takes more than this fraction of a thread's part of what is left, so that all end together.
const PARTS: usize = 2;

/// Objects that no thread has taken yet.
pub(crate) struct Queue<A> {
    left: Mutex<(usize, Option<A>)>,
    threads: usize,
}

/// How many objects a thread takes at once.
pub(crate) struct Pace {
    objects: usize,
    began: Option<Instant>,
}

impl<A: Places> Queue<A> {
    /// Places for the answers of objects from `first` on, for so many threads.
    pub(crate) fn new(first: usize, answers: A, threads: usize) -> Self {
        Self { left: Mutex::new((first, Some(answers))), threads }
    }

    /// The next objects for a thread: the number of the first, and places for their answers.
    pub(crate) fn take(&self, pace: &mut Pace) -> Option<(usize, A)> {
        pace.adapt();
        let mut left = self.locked();
        let (first, answers) = &mut *left;
        let all = answers.take()?;
        let share = all.len().div_ceil(PARTS * self.threads);
        let (these, others) = all.split_at(pace.objects.min(share));
        let taken = (*first, these);
        *first += taken.1.len();
        *answers = Some(others).filter(|others| others.len() > 0);
        drop(left);
        (taken.1.len() > 0).then_some(taken)
    }

    /// What a panic of another thread leaves is whole: only `take` changes it.
    fn locked(&self) -> MutexGuard<'_, (usize, Option<A>)> {
        self.left.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Pace {
    /// Of a thread that has done nothing yet.
    pub(crate) const fn new() -> Self {
        Self { objects: FIRST, began: None }
    }

    /// As many objects as would have taken the time of a chunk, at most four times as many as before.
    fn adapt(&mut self) {
        let now = Instant::now();
        if let Some(began) = self.began {
            let took = (now - began).max(CHUNK / 4);
            let fitting = self.objects as f64 * CHUNK.as_secs_f64() / took.as_secs_f64();
            self.objects = (fitting as usize).max(1);
        }
        self.began = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;

    use super::*;
    use crate::error::NoPose;
    use crate::estimate::answers::Answer;

    fn nothing(objects: usize) -> Vec<Answer> {
        vec![Err(NoPose::InvalidInput); objects]
    }

    #[test]
    fn every_object_is_handed_out_once_and_in_order() {
        for objects in [0, 1, 7, 100, 1000] {
            let mut answers = nothing(objects);
            let (queue, mut pace) = (Queue::new(5, &mut answers[..], 3), Pace::new());
            let mut next = 5;
            while let Some((first, these)) = queue.take(&mut pace) {
                assert_eq!(first, next);
                next += these.len();
            }
            assert_eq!(next, 5 + objects);
        }
    }

    #[test]
    fn chunks_get_smaller_where_objects_are_slow_and_towards_the_end() {
        let mut answers = nothing(10_000);
        let (queue, mut pace) = (Queue::new(0, &mut answers[..], 2), Pace::new());
        let mut taken = |wait| {
            let (_, these) = queue.take(&mut pace)?;
            sleep(wait);
            Some(these.len())
        };
        let fast: Vec<usize> = (0..4).filter_map(|_| taken(Duration::ZERO)).collect();
        assert!(fast[0] == FIRST && fast[3] > FIRST, "{fast:?}");
        let before = taken(4 * CHUNK);
        assert!(taken(Duration::ZERO) <= before.map(|objects| objects / 4 + 1));
        let rest: Vec<usize> = std::iter::from_fn(|| taken(Duration::ZERO)).collect();
        assert_eq!(rest.last(), Some(&1));
    }
}
