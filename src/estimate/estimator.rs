//! The front door of the estimate of one object: what the caller gives is checked, a lens is taken away.

use crate::error::{EstimateError, Got, InputError, NoPose, require};
use crate::estimate::describe::Estimate;
use crate::estimate::options::{Options, Solver};
use crate::estimate::pipeline::estimate_ideal;
use crate::estimate::wide::estimate_wide;
use crate::estimate::workspace::{Buffers, Workspace};
use crate::geometry::bbox::Bbox;
use crate::geometry::view::View;
use crate::model::observation::Observation;

/// Estimates poses with options that were checked once.
///
/// ```
/// use groundpose::{
///     Camera, EstimateError, Estimator, FixedWorkspace, NoPose, Observation, Options, Pose, ShapeModel, Tilt, View, Workspace,
/// };
///
/// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
/// let points = [
///     [-0.8, -0.3, 1.3], [0.8, -0.3, 1.3], [0.8, -0.3, -1.3], [-0.8, -0.3, -1.3],
///     [-0.5, -1.4, 0.3], [0.5, -1.4, 0.3], [0.5, -1.4, -1.3], [-0.5, -1.4, -1.3],
/// ];
/// let model = ShapeModel::rigid(&points, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?;
/// let truth = Pose::upright(&view, 0.7, [2.0, 1.5, 15.0].into());
/// let mut pixels = points.map(|x| view.camera.project(&truth.transform(x)).unwrap());
/// pixels[3] = [400.0, 300.0];
///
/// let estimator = Estimator::new(Options { inlier_threshold: Some(4.0), ..Options::default() })?;
/// let mut workspace = FixedWorkspace::<8>::new();
/// // No box is known, so the search uses two keypoints at a time.
/// let observation = Observation::new(&pixels, &model)?;
/// let estimate = estimator.estimate(&view, &observation, &mut workspace).expect("a pose");
/// assert!((estimate.pose.t - truth.t).norm() < 1e-3);
/// assert_eq!(estimate.inlier_count, 7);
/// assert!(workspace.residuals()[3] > 100.0);
/// // As object 5 of a batch: its draws are its own.
/// let fifth = estimator.estimate_indexed(&view, &observation, &mut workspace, 5).expect("a pose");
/// assert!((fifth.pose.t - truth.t).norm() < 1e-3);
///
/// let unseen = [[f64::NAN; 2]; 8];
/// let nothing = estimator.estimate(&view, &Observation::new(&unseen, &model)?, &mut workspace);
/// assert_eq!(nothing.unwrap_err(), EstimateError::NoPose(NoPose::TooFewKeypoints));
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Estimator {
    options: Options,
}

impl Estimator {
    /// An estimator with these options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: Options) -> Result<Self, InputError> {
        options.check()?;
        Ok(Self { options })
    }

    /// The options.
    ///
    /// ```
    /// use groundpose::{Estimator, Options};
    ///
    /// let estimator = Estimator::new(Options { seed: 7, ..Options::default() })?;
    /// assert_eq!(estimator.options().seed, 7);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The pose of one object; the draws depend on the seed alone. Allocates nothing but what `workspace` grows by.
    ///
    /// # Errors
    /// [`EstimateError::NoPose`]: the data has no answer. [`EstimateError::Input`]: the solver needs a height that
    /// `view` does not have, or the object has more keypoints than `workspace` holds.
    pub fn estimate(
        &self,
        view: &View,
        observation: &Observation,
        workspace: &mut impl Workspace,
    ) -> Result<Estimate, EstimateError> {
        self.estimate_indexed(view, observation, workspace, 0)
    }

    /// As [`Estimator::estimate`], for object `index` of a batch: the draws depend on (seed, index).
    ///
    /// # Errors
    /// Those of [`Estimator::estimate`].
    pub fn estimate_indexed(
        &self,
        view: &View,
        observation: &Observation,
        workspace: &mut impl Workspace,
        index: u64,
    ) -> Result<Estimate, EstimateError> {
        self.check_view(view)?;
        let keypoints = observation.keypoints_2d().len();
        let buffers = workspace.buffers_for(keypoints, observation.model().eigenvalues().len()).ok_or(InputError {
            argument: "keypoints_2d",
            expected: "at most as many keypoints as the workspace holds",
            got: Got::Count(keypoints),
        })?;
        Ok(self.estimate_checked(view, observation, buffers, index)?)
    }

    /// # Errors
    /// The solver asked for needs a height that the view does not have.
    pub(crate) fn check_view(&self, view: &View) -> Result<(), InputError> {
        let has_what_it_needs = self.options.solver != Solver::P1pHeight || view.height.is_some();
        require(has_what_it_needs, "view", "a height, for solver \"p1p_height\"", Got::Text("none"))
    }

    /// What [`Estimator::estimate_indexed`] does in a view that [`Estimator::check_view`] found right.
    pub(crate) fn estimate_checked(
        &self,
        view: &View,
        observation: &Observation,
        mut buffers: Buffers,
        index: u64,
    ) -> Result<Estimate, NoPose> {
        let Some(lens) = view.camera.lens else {
            return estimate_ideal(view, observation, &self.options, index, buffers);
        };
        if lens.is_wide() {
            return estimate_wide(view, observation, &self.options, index, buffers);
        }
        let pixels = core::mem::take(&mut buffers.pixels);
        let (view, bbox) = without_lens(view, observation, pixels);
        estimate_ideal(&view, &observation.seen_ideally(pixels, bbox), &self.options, index, buffers)
    }
}

/// The view without its lens, which is not wide, the box in it, and the keypoints in it as pixels.
#[inline(always)]
pub(crate) fn without_lens(view: &View, observation: &Observation, pixels: &mut [[f64; 2]]) -> (View, Option<Bbox>) {
    for (pixel, &distorted) in pixels.iter_mut().zip(observation.keypoints_2d()) {
        *pixel = view.camera.undistort(distorted).unwrap_or([f64::NAN; 2]);
    }
    (view.ideal(), observation.bbox().map(|bbox| view.undistort_bbox(view.uncut_bbox(bbox))))
}
