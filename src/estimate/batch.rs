//! Many objects on many cores. Results do not depend on the number of threads.

use rayon::prelude::*;

use crate::error::{Got, InputError, NoPose, require};
use crate::estimate::estimator::{Estimate, Estimator};
use crate::estimate::frame_tilt::{FrameTilt, UpAxis, frame_tilt};
use crate::estimate::options::Options;
use crate::estimate::workspace::GrowingWorkspace;
use crate::geometry::view::View;
use crate::model::observation::Observation;

/// Objects a thread takes at once: enough to hide the cost of handing them out.
///
/// ```
/// use groundpose::OBJECTS_PER_TASK;
///
/// // Up to this many objects a batch stays on the caller's thread.
/// assert_eq!(OBJECTS_PER_TASK, 16);
/// ```
pub const OBJECTS_PER_TASK: usize = 16;

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
    /// let results = Estimator::new(Options::default())?.estimate_batch(&view, &observations);
    /// assert!((results[0].as_ref().unwrap().yaw - 2.5).abs() < 0.1);
    /// assert!(results[1].is_err(), "one object without an answer costs the others nothing");
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn estimate_batch(&self, view: &View, observations: &[Observation]) -> Vec<Result<Estimate, NoPose>> {
        observations
            .par_iter()
            .enumerate()
            .with_min_len(OBJECTS_PER_TASK)
            .map_init(GrowingWorkspace::new, |workspace, (i, observation)| {
                self.estimate_indexed(view, observation, workspace, i as u64)
            })
            .collect()
    }

    /// A frame whose told tilt may be off for all objects by `frame_tilt_sigma` (radians, standard deviation): poses
    /// without a tilt prior first, the frame's tilt from all of them, then poses in the view with that tilt.
    ///
    /// ```
    /// use groundpose::{Camera, Estimator, Observation, Options, Pose, ShapeModel, Tilt, View};
    ///
    /// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
    /// let told = View::new(camera, Tilt::default())?;
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
    /// let (frame, poses) = estimator.estimate_frame(&told, &observations, 0.2)?;
    /// assert!((frame.view.tilt.pitch - 0.1).abs() < 5e-3, "{}", frame.view.tilt.pitch);
    /// assert!(poses.iter().all(Result::is_ok));
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    ///
    /// # Errors
    /// A standard deviation that is not positive.
    pub fn estimate_frame(
        &self,
        view: &View,
        observations: &[Observation],
        frame_tilt_sigma: f64,
    ) -> Result<(FrameTilt, Vec<Result<Estimate, NoPose>>), InputError> {
        let positive = frame_tilt_sigma.is_finite() && frame_tilt_sigma > 0.0;
        require(positive, "frame_tilt_sigma", "a positive number of radians", Got::Number(frame_tilt_sigma))?;
        let free = Self::new(self.options().without_tilt())?;
        let first = free.estimate_batch(view, observations);
        let axis = |e: &Estimate| e.covariance.map(|covariance| UpAxis::new(view, &e.pose, &covariance));
        let axes: Vec<UpAxis> = first.iter().flatten().filter_map(axis).collect();
        let frame = frame_tilt(view, &axes, Options::OBJECT_TILT_SIGMA, frame_tilt_sigma);
        let estimates = self.estimate_batch(&frame.view, observations);
        Ok((frame, estimates))
    }
}
