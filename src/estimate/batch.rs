//! Many objects on many cores. Results do not depend on the number of threads.

use crate::error::{Got, InputError, NoPose, require};
use crate::estimate::answers::{Answer, Answers, Objects, Places};
use crate::estimate::describe::Estimate;
use crate::estimate::estimator::Estimator;
use crate::estimate::frame_tilt::{FrameTilt, UpAxis, frame_tilt};
use crate::estimate::options::Options;
use crate::estimate::queue::{Pace, Queue};
use crate::estimate::workspace::{GrowingWorkspace, Workspace};
use crate::geometry::view::View;
use crate::model::observation::Observation;

/// Fewest objects for which other threads are woken: enough to hide the cost of handing them out.
///
/// ```
/// use groundpose::OBJECTS_PER_TASK;
///
/// // Up to this many objects a batch stays on the caller's thread.
/// assert_eq!(OBJECTS_PER_TASK, 16);
/// ```
pub const OBJECTS_PER_TASK: usize = 16;

/// What objects say of the tilt of their frame.
pub(crate) struct Axes<'a> {
    view: &'a View,
    axes: &'a mut [Option<UpAxis>],
}

impl Places for Axes<'_> {
    fn len(&self) -> usize {
        self.axes.len()
    }

    fn split_at(self, k: usize) -> (Self, Self) {
        let (these, others) = self.axes.split_at_mut(k);
        (Self { axes: these, ..self }, Axes { axes: others, ..self })
    }
}

impl Answers for Axes<'_> {
    fn store(&mut self, k: usize, answer: Answer, _: &[f64]) {
        let axis = |e: Estimate| e.covariance.map(|covariance| UpAxis::new(self.view, &e.pose, &covariance));
        self.axes[k] = answer.ok().and_then(axis);
    }
}

/// Objects to be estimated in one view.
pub(crate) struct Batch<'a, O: ?Sized> {
    estimator: &'a Estimator,
    view: &'a View,
    objects: &'a O,
}

impl<O: ?Sized> Batch<'_, O> {
    /// The answers of the objects from `first` on, as long as `go_on` says so between two of them.
    pub(crate) fn on_this_thread<A: Answers>(
        &self,
        workspace: &mut GrowingWorkspace,
        first: usize,
        mut answers: A,
        mut go_on: impl FnMut() -> bool,
    ) where
        O: Objects<A>,
    {
        for k in 0..answers.len() {
            if !go_on() {
                return;
            }
            let i = first + k;
            let answer = self.objects.observe(i, &mut answers, k, |observation| {
                let buffers =
                    workspace.grown(observation.keypoints_2d().len(), observation.model().eigenvalues().len());
                self.estimator.estimate_checked(self.view, observation, buffers, i as u64)
            });
            answers.store(k, answer.unwrap_or(Err(NoPose::InvalidInput)), workspace.residuals());
        }
    }

    /// The answers of objects that this thread takes from a queue, as long as there are any and `go_on` says so.
    pub(crate) fn until_empty<A: Answers>(
        &self,
        workspace: &mut GrowingWorkspace,
        queue: &Queue<A>,
        mut go_on: impl FnMut() -> bool,
    ) where
        O: Objects<A>,
    {
        let mut pace = Pace::new();
        while let Some((first, answers)) = queue.take(&mut pace) {
            self.on_this_thread(workspace, first, answers, &mut go_on);
        }
    }

    /// All answers, on this thread and the others of the current pool.
    fn on_threads<A: Answers>(&self, answers: A)
    where
        O: Objects<A>,
    {
        let threads = rayon::current_num_threads();
        if threads == 1 || answers.len() <= OBJECTS_PER_TASK {
            return self.on_this_thread(&mut GrowingWorkspace::new(), 0, answers, || true);
        }
        let queue = Queue::new(0, answers, threads);
        let work = || self.until_empty(&mut GrowingWorkspace::new(), &queue, || true);
        rayon::in_place_scope(|scope| {
            (1..threads).for_each(|_| scope.spawn(|_| work()));
            work();
        });
    }
}

impl Estimator {
    /// One result per object, in order, on the current rayon pool. Object `i` draws from the stream (seed, i).
    ///
    /// ```
    /// use groundpose::{Bbox, Camera, Estimator, Observation, Options, ShapeModel, Tilt, View};
    ///
    /// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: -0.07, roll: 0.0 })?;
    /// let points = [
    ///     [-0.8, -0.3, 1.35], [0.8, -0.3, 1.35], [0.8, -0.3, -1.35], [-0.8, -0.3, -1.35],
    ///     [-0.65, -0.7, 2.1], [0.65, -0.7, 2.1], [0.7, -0.9, -2.15], [-0.7, -0.9, -2.15],
    /// ];
    /// let model = ShapeModel::rigid(&points, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?;
    /// let car = [
    ///     [919.3, 560.1], [813.5, 565.4], [725.2, 552.5], [820.8, 547.6],
    ///     [942.8, 533.3], [854.3, 537.5], [708.1, 509.2], [790.8, 507.7],
    /// ];
    /// let hidden = [[f64::NAN; 2]; 8];
    /// let observations = [
    ///     Observation::new(&car, &model)?.with_bbox(Bbox::new([694.1, 470.1, 963.0, 597.8])?),
    ///     Observation::new(&hidden, &model)?,
    /// ];
    ///
    /// let results = Estimator::new(Options::default())?.estimate_batch(&view, &observations)?;
    /// assert!((results[0].as_ref().unwrap().yaw - 2.5).abs() < 0.1);
    /// assert!(results[1].is_err(), "one object without an answer costs the others nothing");
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    ///
    /// # Errors
    /// The solver needs a height that `view` does not have.
    pub fn estimate_batch(
        &self,
        view: &View,
        observations: &[Observation],
    ) -> Result<Vec<Result<Estimate, NoPose>>, InputError> {
        let mut answers = vec![Err(NoPose::InvalidInput); observations.len()];
        self.batch(view, observations)?.on_threads(&mut answers[..]);
        Ok(answers)
    }

    /// A frame whose nominal tilt may be off for all objects by `frame_tilt_sigma` (radians, standard deviation): poses
    /// without a tilt prior first, the frame's tilt from all of them, then poses in the view with that tilt.
    ///
    /// ```
    /// use groundpose::{Camera, Estimator, Observation, Options, Pose, ShapeModel, Tilt, View};
    ///
    /// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
    /// let nominal = View::new(camera, Tilt::default())?;
    /// let truth = View::new(camera, Tilt { pitch: 0.1, roll: 0.0 })?;
    /// let points = [
    ///     [-0.8, -0.3, 1.3], [0.8, -0.3, 1.3], [0.8, -0.3, -1.3], [-0.8, -0.3, -1.3],
    ///     [-0.5, -1.4, 0.3], [0.5, -1.4, 0.3], [0.5, -1.4, -1.3], [-0.5, -1.4, -1.3],
    /// ];
    /// let model = ShapeModel::rigid(&points, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?;
    /// let seen = [(0.7, -3.0), (2.0, 0.0), (-0.4, 3.0)].map(|(yaw, x)| {
    ///     let pose = Pose::upright(&truth, yaw, [x, 1.5, 15.0].into());
    ///     points.map(|point| camera.project(&pose.transform(point)).unwrap())
    /// });
    /// let observations = seen.each_ref().map(|pixels| Observation::new(pixels, &model).unwrap());
    ///
    /// let estimator = Estimator::new(Options { inlier_threshold: Some(4.0), ..Options::default() })?;
    /// let (frame, poses) = estimator.estimate_frame(&nominal, &observations, 0.2)?;
    /// assert!((frame.view.tilt.pitch - 0.1).abs() < 5e-3, "{}", frame.view.tilt.pitch);
    /// assert!(poses.iter().all(Result::is_ok));
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    ///
    /// # Errors
    /// A standard deviation that is not positive; the solver needs a height that `view` does not have.
    pub fn estimate_frame(
        &self,
        view: &View,
        observations: &[Observation],
        frame_tilt_sigma: f64,
    ) -> Result<(FrameTilt, Vec<Result<Estimate, NoPose>>), InputError> {
        let frame = self.frame_tilt(view, observations.len(), frame_tilt_sigma, |free, axes| {
            free.batch(view, observations)?.on_threads(axes);
            Ok::<(), InputError>(())
        })?;
        let estimates = self.estimate_batch(&frame.view, observations)?;
        Ok((frame, estimates))
    }

    /// The tilt of a frame of so many objects; `estimate_all` estimates them by an estimator whose poses are free of the
    /// nominal tilt.
    pub(crate) fn frame_tilt<E: From<InputError>>(
        &self,
        view: &View,
        objects: usize,
        sigma: f64,
        estimate_all: impl FnOnce(&Self, Axes) -> Result<(), E>,
    ) -> Result<FrameTilt, E> {
        let positive = sigma.is_finite() && sigma > 0.0;
        require(positive, "frame_tilt_sigma", "a positive number of radians", Got::Number(sigma))?;
        let free = Self::new(self.options().without_tilt())?;
        let mut axes = vec![None; objects];
        estimate_all(&free, Axes { view, axes: &mut axes })?;
        let axes: Vec<UpAxis> = axes.into_iter().flatten().collect();
        Ok(frame_tilt(view, &axes, Options::OBJECT_TILT_SIGMA, sigma))
    }

    /// # Errors
    /// The solver needs a height that `view` does not have.
    pub(crate) fn batch<'a, O: ?Sized>(&'a self, view: &'a View, objects: &'a O) -> Result<Batch<'a, O>, InputError> {
        self.check_view(view)?;
        Ok(Batch { estimator: self, view, objects })
    }
}
