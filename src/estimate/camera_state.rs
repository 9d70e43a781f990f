//! One camera over many frames: its height and the sizes of vehicles stay, its mean tilt stays during a drive, the tilt
//! of each frame is another one about it.
//!
//! With what is carried, $`\mu \sim N(m, \Sigma)`$, a frame's unknowns are $`\theta = \mu + \delta`$ with
//! $`\delta \sim N(0, F)`$. When the frame's objects alone have the information $`I`$ about $`\theta`$ and
//! $`y = I \hat\theta`$, then of $`\mu`$ they say
//!
//! ```math
//! I_\mu = (1 + I F)^{-1} I, \qquad y_\mu = (1 + I F)^{-1} y ,
//! ```
//!
//! of which a small part is taken: the same vehicles and the same errors of a network are in many frames. What the priors
//! tell of a frame is the sum of both, so that the first frame is solved as if it were alone.

use core::ops::Range;

use crate::error::InputError;
use crate::estimate::frame::{
    Between, Frame, HEIGHT, Knowledge, PITCH, ROLL, UNKNOWNS, Unknowns, conflict, inverted, solve_from,
};
use crate::estimate::frame_answer::FrameAnswer;
use crate::estimate::frame_object::FrameObject;
use crate::estimate::frame_priors::FramePriors;
use crate::geometry::math::square;
use crate::geometry::view::View;
use crate::tuning::{CARRIED_INFORMATION, HEIGHT_OF_FRAMES, MOST_OF_FRAMES, PITCH_OF_FRAMES, ROLL_OF_FRAMES};

/// Numbers of a [`CameraState`]: mean pitch, roll, log height over the nominal one, log sizes.
///
/// ```
/// use groundpose::{CAMERA_NUMBERS, MAX_CLASSES};
///
/// assert_eq!(CAMERA_NUMBERS, 3 + MAX_CLASSES);
/// ```
pub const CAMERA_NUMBERS: usize = UNKNOWNS;

/// What is known of a camera and of the vehicles before it, and grows from frame to frame.
///
/// ```
/// use groundpose::{Camera, CameraState, FrameAnswer, FrameObject, FramePriors, Pose, PoseCovariance, Tilt, View};
///
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// let nominal = View::new(camera, Tilt::default())?.with_height(1.5)?;
/// let mut state = CameraState::new(&nominal, FramePriors::default())?;
/// // The camera looks down by one degree.
/// let truth = View::new(camera, Tilt { pitch: -0.0175, roll: 0.0 })?;
/// let covariance = PoseCovariance::identity() * 1e-3;
/// let mut answers = [FrameAnswer::default(); 2];
/// for k in 0..1000 {
///     let z = 10.0 + f64::from(k % 7) * 4.0;
///     let cars = [[-3.0, z], [3.0, z + 8.0]].map(|[x, z]| {
///         FrameObject::new(Pose::upright(&truth, 0.0, [x, 1.5, z].into()), covariance, [0.0; 3], 0).unwrap()
///     });
///     state.solve(&cars, &mut answers)?;
/// }
/// assert!((state.mean()[0] + 0.0175).abs() < 4e-3, "{}", state.mean()[0]);
/// // Another drive: the tilt is as open as before, height and sizes are kept.
/// state.start_drive();
/// assert_eq!(state.mean()[0], 0.0);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct CameraState {
    view: View,
    priors: FramePriors,
    mean: Unknowns,
    covariance: Between,
}

impl CameraState {
    /// A camera of which only the nominal view is known.
    ///
    /// # Errors
    /// Priors or a height that cannot be.
    pub fn new(view: &View, priors: FramePriors) -> Result<Self, InputError> {
        priors.check(view)?;
        let Knowledge { mean, covariance } = at_first(view, &priors);
        Ok(Self { view: *view, priors, mean, covariance })
    }

    /// The same camera with numbers that were kept, of the same nominal view; what is no covariance counts as nothing
    /// known.
    ///
    /// ```
    /// use groundpose::{Camera, CameraState, FramePriors, Tilt, View};
    ///
    /// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?.with_height(1.5)?;
    /// let state = CameraState::new(&view, FramePriors::default())?;
    /// let again = state.with_numbers(state.mean(), state.covariance());
    /// assert_eq!(again.mean(), state.mean());
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn with_numbers(
        mut self,
        mean: [f64; CAMERA_NUMBERS],
        covariance: [[f64; CAMERA_NUMBERS]; CAMERA_NUMBERS],
    ) -> Self {
        let covariance = Between::from(covariance);
        let finite = mean.iter().chain(covariance.iter()).all(|x| x.is_finite());
        if finite && inverted(&covariance).is_some() {
            (self.mean, self.covariance) = (mean.into(), covariance);
        }
        self
    }

    /// Mean pitch, roll, log height over the nominal one, log size of each class.
    #[must_use]
    pub fn mean(&self) -> [f64; CAMERA_NUMBERS] {
        self.mean.into()
    }

    /// Their covariance.
    #[must_use]
    pub fn covariance(&self) -> [[f64; CAMERA_NUMBERS]; CAMERA_NUMBERS] {
        self.covariance.into()
    }

    /// Standard deviations by which the vehicles of all frames and the nominal height disagree, positive when they say that
    /// the camera is higher; none without either.
    ///
    /// ```
    /// use groundpose::{Camera, CameraState, FramePriors, Tilt, View};
    ///
    /// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?.with_height(1.5)?;
    /// assert_eq!(CameraState::new(&view, FramePriors::default())?.height_conflict(), None);
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    #[must_use]
    pub fn height_conflict(&self) -> Option<f64> {
        let first = at_first(&self.view, &self.priors);
        conflict(&self.view, &first, &self.mean, &self.covariance)
    }

    /// The mean tilt is as open as it was at first: another drive, or the camera was touched.
    pub fn start_drive(&mut self) {
        self.forget(PITCH..HEIGHT);
    }

    /// Nothing is known of some unknowns but what was known at first.
    fn forget(&mut self, unknowns: Range<usize>) {
        let first = at_first(&self.view, &self.priors);
        for k in unknowns {
            self.mean[k] = first.mean[k];
            self.covariance.row_mut(k).fill(0.0);
            self.covariance.column_mut(k).fill(0.0);
            self.covariance[(k, k)] = first.covariance[(k, k)];
        }
    }

    /// As [`solve_frame`], with what is known of the camera, which then knows more.
    ///
    /// [`solve_frame`]: crate::estimate::frame::solve_frame
    ///
    /// # Errors
    /// Not one answer per object.
    pub fn solve(&mut self, objects: &[FrameObject], answers: &mut [FrameAnswer]) -> Result<Frame, InputError> {
        let between_frames = between_frames(&self.view, &self.priors);
        let known = Knowledge { mean: self.mean, covariance: self.covariance + between_frames };
        let (frame, found) = solve_from(&self.view, &self.priors, &known, objects, answers)?;
        if let Some((mean, covariance)) = self.learned(&known, &found, &between_frames) {
            (self.mean, self.covariance) = (mean, covariance);
        }
        if self.view.height.is_none() {
            // Without a height the sizes would drift: only the tilt is carried.
            self.forget(HEIGHT..UNKNOWNS);
        }
        Ok(frame)
    }

    /// What is carried after a frame.
    fn learned(&self, known: &Knowledge, found: &Knowledge, between_frames: &Between) -> Option<(Unknowns, Between)> {
        let (before, after) = (inverted(&known.covariance)?, inverted(&found.covariance)?);
        let seen = after - before;
        let pull = after * found.mean - before * known.mean;
        let factor = (Between::identity() + seen * between_frames).try_inverse()?;
        let (seen, pull) = (factor * seen, factor * pull);
        let own = inverted(&self.covariance)?;
        let seen = (seen + seen.transpose()) * (0.5 * CARRIED_INFORMATION);
        let covariance = inverted(&(own + seen))?;
        Some((covariance * (own * self.mean + pull * CARRIED_INFORMATION), covariance))
    }
}

/// How frames of one camera differ: its car brakes, loads and rolls. Sizes of classes do not.
fn between_frames(view: &View, priors: &FramePriors) -> Between {
    let mut sigmas = Unknowns::zeros();
    (sigmas[PITCH], sigmas[ROLL], sigmas[HEIGHT]) = (PITCH_OF_FRAMES, ROLL_OF_FRAMES, HEIGHT_OF_FRAMES);
    let told = Knowledge::of(view, priors).covariance.diagonal();
    Between::from_diagonal(&sigmas.map(square).zip_map(&told, |between, all| between.min(MOST_OF_FRAMES * all)))
}

/// What is known of a camera before its first frame.
fn at_first(view: &View, priors: &FramePriors) -> Knowledge {
    let Knowledge { mean, covariance } = Knowledge::of(view, priors);
    Knowledge { mean, covariance: covariance - between_frames(view, priors) }
}
