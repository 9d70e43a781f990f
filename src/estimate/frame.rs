//! A frame as a whole: all vehicles stand on one road, whose tilt and distance below the camera are nearly known, and
//! vehicles of a class are nearly as large as their model. What each object's own estimate leaves open, how far away and
//! how large it is, follows from all of this together.
//!
//! Unknowns are pitch, roll, log height and the log size of each class; an object's own pose and log size are eliminated
//! (see `frame_object.rs`). Student's t by iterative reweighting keeps wrong objects from deciding.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector};

use crate::error::{Got, InputError, require};
use crate::estimate::frame_answer::FrameAnswer;
use crate::estimate::frame_object::{Contact, FrameObject, FrameRow, Road};
use crate::estimate::frame_priors::{FramePriors, MAX_CLASSES};
use crate::geometry::math::{exp, sqrt, square};
use crate::geometry::view::{Tilt, View};
use crate::refine::normal::{cholesky, solve_cholesky};
use crate::tuning::{CONTACT_DOF, LARGEST_FRAME_STEP, SMALLEST_FRAME_STEP, SOLVE_ITERATIONS, STEEPEST_PITCH};

pub(crate) const PITCH: usize = 0;
pub(crate) const ROLL: usize = 1;
pub(crate) const HEIGHT: usize = 2;
pub(crate) const SCALES: usize = 3;
pub(crate) const UNKNOWNS: usize = SCALES + MAX_CLASSES;

/// Pitch, roll, log height, log size of each class.
pub(crate) type Unknowns = SVector<f64, UNKNOWNS>;
pub(crate) type Between = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// The size of the vehicles of a class in a frame.
///
/// ```
/// use groundpose::ClassScale;
///
/// let scale = ClassScale { log_mean: 0.02, sigma: 0.03 };
/// assert!(scale.log_mean.exp() > 1.02, "two percent larger than the model");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassScale {
    /// Logarithm of the mean size in sizes of the model.
    pub log_mean: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A frame as its objects show it.
///
/// ```
/// use groundpose::{Camera, Frame, FramePriors, Tilt, View, solve_frame};
///
/// // Without objects it is what was known before, as surely.
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?.with_height(1.5)?;
/// let priors = FramePriors::default();
/// let Frame { view, covariance, scales, objects, height_conflict } = solve_frame(&view, &priors, &[], &mut [])?;
/// assert_eq!((view.height, objects, height_conflict), (Some(1.5), 0.0, None));
/// assert!((covariance[(2, 2)].sqrt() - priors.height_sigma).abs() < 1e-12);
/// assert!((scales[0].sigma - priors.scales[0].sigma).abs() < 1e-12);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// With the estimated tilt and height; no height where neither the nominal view nor an object has one.
    pub view: View,
    /// Of pitch, roll (radians) and log height.
    pub covariance: Matrix3<f64>,
    /// One per class.
    pub scales: [ClassScale; MAX_CLASSES],
    /// Effective number of objects: those that disagree with all others count little.
    pub objects: f64,
    /// Standard deviations by which the vehicles and the nominal height disagree, positive when they say that the camera
    /// is higher; none without either.
    pub height_conflict: Option<f64>,
}

/// Tilt, height, sizes and poses of a frame's objects together. `view` is the nominal one, with or without a height.
/// Answers are written in the order of the objects. Allocates nothing.
///
/// ```
/// use groundpose::{Camera, FrameAnswer, FrameObject, FramePriors, Pose, PoseCovariance, Tilt, View, solve_frame};
///
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// let view = View::new(camera, Tilt::default())?.with_height(1.5)?;
/// // Three cars on the road that were all taken to be 6 % too large, and so 6 % too far away and too low.
/// let covariance = PoseCovariance::from_diagonal(&[1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-2].into());
/// let objects = [[-3.0, 12.0], [3.5, 20.0], [0.0, 30.0]].map(|[x, z]| {
///     let pose = Pose::upright(&view, 0.1, [1.06 * x, 1.06 * 1.5, 1.06 * z].into());
///     FrameObject::new(pose, covariance, [0.0; 3], 0).unwrap()
/// });
/// let mut answers = [FrameAnswer::default(); 3];
/// let priors = FramePriors { pitch_sigma: 0.003, roll_sigma: 0.01, ..FramePriors::default() };
/// let frame = solve_frame(&view, &priors, &objects, &mut answers)?;
/// assert!(answers[1].log_size < -0.03, "smaller");
/// assert!((answers[1].pose.t.z - 20.0).abs() < 0.6, "and nearer");
/// assert!(frame.height_conflict.unwrap().abs() < 2.0);
/// # Ok::<(), groundpose::InputError>(())
/// ```
///
/// # Errors
/// Priors or a height that cannot be; not one answer per object.
pub fn solve_frame(
    view: &View,
    priors: &FramePriors,
    objects: &[FrameObject],
    answers: &mut [FrameAnswer],
) -> Result<Frame, InputError> {
    priors.check(view)?;
    Ok(solve_from(view, priors, &Knowledge::of(view, priors), objects, answers)?.0)
}

/// What is known of the unknowns before a frame: a Gaussian.
pub(crate) struct Knowledge {
    pub(crate) mean: Unknowns,
    pub(crate) covariance: Between,
}

impl Knowledge {
    /// Of a nominal view; the log height is that over the height of the view.
    pub(crate) fn of(view: &View, priors: &FramePriors) -> Self {
        let (mut mean, mut sigmas) = (Unknowns::zeros(), Unknowns::zeros());
        (mean[PITCH], sigmas[PITCH]) = (view.tilt.pitch, priors.pitch_sigma);
        (mean[ROLL], sigmas[ROLL]) = (view.tilt.roll, priors.roll_sigma);
        sigmas[HEIGHT] = priors.log_height_sigma(view);
        for (k, scale) in priors.scales.iter().enumerate() {
            (mean[SCALES + k], sigmas[SCALES + k]) = (scale.log_mean, scale.sigma);
        }
        Self { mean, covariance: Between::from_diagonal(&sigmas.map(square)) }
    }
}

/// [`solve_frame`] from any knowledge; the frame, and the unknowns with their covariance.
pub(crate) fn solve_from(
    view: &View,
    priors: &FramePriors,
    known: &Knowledge,
    objects: &[FrameObject],
    answers: &mut [FrameAnswer],
) -> Result<(Frame, Knowledge), InputError> {
    require(answers.len() == objects.len(), "answers", "one per object", Got::Count(answers.len()))?;
    let height = view.height.or_else(|| typical_height(view, priors, objects, answers));
    let mut solver = Solver::new(priors, known, height.unwrap_or(1.0));
    for (object, answer) in objects.iter().zip(&mut *answers) {
        answer.contact = Contact::default();
        answer.set_state(&FrameObject::start(known.mean[SCALES + object.class]));
    }
    for _ in 0..SOLVE_ITERATIONS {
        if solver.step(objects, answers) < SMALLEST_FRAME_STEP {
            break;
        }
    }
    for (object, answer) in objects.iter().zip(&mut *answers) {
        answer.describe(object, priors, &solver.covariance_seen(seen_by(object.class)));
    }
    let frame = solver.frame(view, height.is_some(), answers.iter().map(|a| a.weight).sum());
    Ok((frame, Knowledge { mean: solver.theta, covariance: solver.covariance }))
}

/// Median height over the road, as the objects' own estimates have it.
fn typical_height(
    view: &View,
    priors: &FramePriors,
    objects: &[FrameObject],
    answers: &mut [FrameAnswer],
) -> Option<f64> {
    let road = Road::new(view.tilt.pitch, view.tilt.roll, 1.0);
    for (object, answer) in objects.iter().zip(&mut *answers) {
        // The answers serve as scratch before they are written.
        answer.log_size = object.below(&road, priors.scales[object.class].log_mean);
    }
    answers.sort_unstable_by(|a, b| a.log_size.total_cmp(&b.log_size));
    let below = |answer: &FrameAnswer| answer.log_size;
    let low = answers.partition_point(|answer| !(below(answer) > 0.0));
    let above_zero = &answers[low..];
    above_zero.get(above_zero.len() / 2).map(below)
}

/// The unknowns of a frame on their way.
struct Solver<'a> {
    priors: &'a FramePriors,
    /// The height is this times the exponential of its unknown.
    height: f64,
    known: &'a Knowledge,
    information: Between,
    theta: Unknowns,
    covariance: Between,
}

impl<'a> Solver<'a> {
    fn new(priors: &'a FramePriors, known: &'a Knowledge, height: f64) -> Self {
        let information = inverted(&known.covariance).unwrap_or_else(Between::zeros);
        Self { priors, height, known, information, theta: known.mean, covariance: known.covariance }
    }

    fn road(&self) -> Road {
        Road::new(self.theta[PITCH], self.theta[ROLL], self.height * exp(self.theta[HEIGHT]))
    }

    /// One step of Gauss-Newton with new weights; the largest change of an unknown.
    fn step(&mut self, objects: &[FrameObject], answers: &mut [FrameAnswer]) -> f64 {
        let road = self.road();
        let mut information = self.information;
        let mut step = self.information * (self.known.mean - self.theta);
        for (object, answer) in objects.iter().zip(&mut *answers) {
            let seen = seen_by(object.class);
            let contact = object.contact(&answer.state(), self.theta[seen[3]], &road, self.priors);
            let frame_variance = (self.covariance_seen(seen) * contact.row).dot(&contact.row);
            let d2 = square(contact.innovation) / (contact.variance + frame_variance);
            answer.weight = ((CONTACT_DOF + 1.0) / (CONTACT_DOF + d2)).min(1.0);
            let weight = answer.weight / contact.variance;
            for (a, &at) in seen.iter().enumerate() {
                step[at] -= weight * contact.row[a] * contact.innovation;
                for (b, &to) in seen.iter().enumerate() {
                    information[(at, to)] += weight * contact.row[a] * contact.row[b];
                }
            }
            answer.contact = contact;
        }
        // Positive definite: the prior alone is.
        self.covariance = inverted(&information).unwrap_or(self.covariance);
        let step = limited(self.covariance * step);
        self.theta += step;
        self.theta[PITCH] = self.theta[PITCH].clamp(-STEEPEST_PITCH, STEEPEST_PITCH);
        for (object, answer) in objects.iter().zip(&mut *answers) {
            let seen = seen_by(object.class);
            let step = FrameRow::from(seen.map(|at| step[at]));
            answer.set_state(&answer.contact.object_after(&step, self.theta[seen[3]], answer.contact_variance()));
        }
        step.amax()
    }

    fn covariance_seen(&self, seen: [usize; 4]) -> Matrix4<f64> {
        Matrix4::from_fn(|a, b| self.covariance[(seen[a], seen[b])])
    }

    fn frame(&self, view: &View, has_height: bool, objects: f64) -> Frame {
        let tilt = Tilt { pitch: self.theta[PITCH], roll: self.theta[ROLL] };
        let mut estimated = View::new(view.camera, tilt).unwrap_or(*view);
        estimated.height = has_height.then(|| self.height * exp(self.theta[HEIGHT]));
        let scale = |k: usize| ClassScale {
            log_mean: self.theta[SCALES + k],
            sigma: sqrt(self.covariance[(SCALES + k, SCALES + k)]),
        };
        Frame {
            view: estimated,
            covariance: self.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
            scales: core::array::from_fn(scale),
            objects,
            height_conflict: conflict(view, self.known, &self.theta, &self.covariance),
        }
    }
}

/// The unknowns of the frame that an object of a class sees.
fn seen_by(class: usize) -> [usize; 4] {
    [PITCH, ROLL, HEIGHT, SCALES + class]
}

/// How far the log height moved, in standard deviations of such moves: a mean of two independent opinions differs from the
/// first by a variance of the first less its own.
pub(crate) fn conflict(view: &View, before: &Knowledge, after: &Unknowns, covariance: &Between) -> Option<f64> {
    let variance = before.covariance[(HEIGHT, HEIGHT)];
    let learned = variance - covariance[(HEIGHT, HEIGHT)];
    let is_there = view.height.is_some() && learned > 1e-6 * variance;
    is_there.then(|| (after[HEIGHT] - before.mean[HEIGHT]) / sqrt(learned))
}

/// The inverse of a positive definite matrix.
pub(crate) fn inverted(matrix: &Between) -> Option<Between> {
    let mut factors: [[f64; UNKNOWNS]; UNKNOWNS] = (*matrix).into();
    cholesky(&mut factors)?;
    let mut inverse = Between::zeros();
    for k in 0..UNKNOWNS {
        let mut column = [0.0; UNKNOWNS];
        column[k] = 1.0;
        solve_cholesky(&factors, &mut column);
        inverse.column_mut(k).copy_from_slice(&column);
    }
    Some(inverse)
}

/// Unknowns are angles and logarithms: no step is so large that the linearised road means nothing.
fn limited(step: Unknowns) -> Unknowns {
    step.map(|x| x.clamp(-LARGEST_FRAME_STEP, LARGEST_FRAME_STEP))
}
