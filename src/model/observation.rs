//! What one image tells of one object, borrowed and checked once.

use crate::error::{Got, InputError, require};
use crate::geometry::bbox::Bbox;
use crate::model::shape_model::ShapeModel;

/// Keypoints, scores and box of one object in one image.
///
/// ```
/// use groundpose::{Bbox, Observation, ShapeModel, VIEWING_ANGLES};
///
/// let points = [[-0.8, -0.3, 1.35], [0.8, -0.3, 1.35], [0.5, -1.4, -1.3]];
/// let model = ShapeModel::rigid(&points, [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]])?;
/// let pixels = [[919.3, 560.1], [813.5, 565.4], [f64::NAN, f64::NAN]];
/// let observation = Observation::new(&pixels, &model)?
///     .with_scores(&[0.9, 0.7, 0.0])?
///     .with_bbox(Bbox::new([694.1, 470.1, 963.0, 597.8])?);
/// assert!(observation.is_visible(1) && !observation.is_visible(2));
///
/// // What it was made of, and a threshold of its own.
/// assert_eq!((observation.keypoints_2d()[1], observation.score(1)), (pixels[1], 0.7));
/// assert!(observation.has_scores() && observation.bbox().is_some());
/// assert_eq!(observation.model().keypoint_count(), 3);
/// assert_eq!(observation.inlier_threshold(), None);
/// assert_eq!(observation.with_inlier_threshold(4.0)?.inlier_threshold(), Some(4.0));
///
/// // What a network says besides: that it is a vehicle, and from which side it sees it.
/// let seen_from = [1.0 / VIEWING_ANGLES as f64; VIEWING_ANGLES];
/// let observation = observation.with_vehicle_probability(0.97)?.with_viewing_angles(&seen_from)?;
/// assert_eq!((observation.vehicle_probability(), observation.viewing_angles()), (Some(0.97), Some(&seen_from)));
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    keypoints_2d: &'a [[f64; 2]],
    keypoint_scores: Option<&'a [f64]>,
    bbox: Option<Bbox>,
    inlier_threshold: Option<f64>,
    vehicle_probability: Option<f64>,
    viewing_angles: Option<&'a [f64; VIEWING_ANGLES]>,
    model: &'a ShapeModel<'a>,
}

/// Probabilities of single-precision networks end a little above 1.
const ROUNDING: f64 = 1e-6;

/// Bins of the viewing angle, the angle from which the camera sees an object: KITTI's alpha,
/// `rotation_y - atan2(x, z)`, bin b centred on `b * 2 pi / 16`.
///
/// ```
/// use groundpose::VIEWING_ANGLES;
///
/// // A network that sees the rear of a vehicle that drives ahead: alpha = -pi / 2, bin 12.
/// let mut angles = [0.0; VIEWING_ANGLES];
/// angles[12] = 1.0;
/// ```
pub const VIEWING_ANGLES: usize = 16;

impl<'a> Observation<'a> {
    /// Keypoints in pixels, one per keypoint of the model; a NaN coordinate means not seen.
    ///
    /// # Errors
    /// Another number of keypoints than the model has; an infinite coordinate.
    pub fn new(keypoints_2d: &'a [[f64; 2]], model: &'a ShapeModel<'a>) -> Result<Self, InputError> {
        require(
            keypoints_2d.len() == model.keypoint_count(),
            "keypoints_2d",
            "one row per keypoint of the model",
            Got::Count(keypoints_2d.len()),
        )?;
        for &x in keypoints_2d.iter().flatten() {
            require(!x.is_infinite(), "keypoints_2d", "finite pixels, or NaN for not seen", Got::Number(x))?;
        }
        Ok(Self {
            keypoints_2d,
            keypoint_scores: None,
            bbox: None,
            inlier_threshold: None,
            vehicle_probability: None,
            viewing_angles: None,
            model,
        })
    }

    /// With the object's 2D box.
    #[must_use]
    pub fn with_bbox(mut self, bbox: Bbox) -> Self {
        self.bbox = Some(bbox);
        self
    }

    /// With one score per keypoint, on any non-negative scale that is the same for all.
    /// A keypoint of score zero (or NaN) counts as not seen.
    ///
    /// # Errors
    /// Another number of scores than keypoints; a negative or infinite score.
    pub fn with_scores(mut self, keypoint_scores: &'a [f64]) -> Result<Self, InputError> {
        require(
            keypoint_scores.len() == self.keypoints_2d.len(),
            "keypoint_scores",
            "one score per keypoint",
            Got::Count(keypoint_scores.len()),
        )?;
        for &s in keypoint_scores {
            require(!(s < 0.0 || s.is_infinite()), "keypoint_scores", "finite numbers >= 0", Got::Number(s))?;
        }
        self.keypoint_scores = Some(keypoint_scores);
        Ok(self)
    }

    /// With an inlier threshold of its own, in pixels.
    ///
    /// # Errors
    /// A threshold that is not positive and finite.
    pub fn with_inlier_threshold(mut self, pixels: f64) -> Result<Self, InputError> {
        let valid = pixels.is_finite() && pixels > 0.0;
        require(valid, "inlier_threshold", "a positive number of pixels", Got::Number(pixels))?;
        self.inlier_threshold = Some(pixels);
        Ok(self)
    }

    /// With the probability that there is a vehicle at all, as a network says it.
    ///
    /// # Errors
    /// Not a probability.
    pub fn with_vehicle_probability(mut self, probability: f64) -> Result<Self, InputError> {
        let valid = (0.0..=1.0 + ROUNDING).contains(&probability);
        require(valid, "vehicle_probability", "a probability, 0 to 1", Got::Number(probability))?;
        self.vehicle_probability = Some(probability);
        Ok(self)
    }

    /// With the probabilities of the viewing angles, as a network says them: they tell a pose from its reading turned
    /// round.
    ///
    /// # Errors
    /// Numbers that are no probabilities or do not add up to 1 within 1 %.
    pub fn with_viewing_angles(mut self, probabilities: &'a [f64; VIEWING_ANGLES]) -> Result<Self, InputError> {
        let expected = "probabilities that add up to 1";
        for &p in probabilities {
            require((0.0..=1.0 + ROUNDING).contains(&p), "viewing_angle_probabilities", expected, Got::Number(p))?;
        }
        let sum: f64 = probabilities.iter().sum();
        require((sum - 1.0).abs() < 0.01, "viewing_angle_probabilities", expected, Got::Number(sum))?;
        self.viewing_angles = Some(probabilities);
        Ok(self)
    }

    /// The same object as an ideal lens shows it.
    pub(crate) fn seen_ideally<'b>(&'b self, keypoints_2d: &'b [[f64; 2]], bbox: Option<Bbox>) -> Observation<'b> {
        Observation { keypoints_2d, bbox, ..*self }
    }

    /// Keypoints in pixels; NaN = not seen.
    #[must_use]
    pub fn keypoints_2d(&self) -> &'a [[f64; 2]] {
        self.keypoints_2d
    }

    /// Score of keypoint `i`; 1 without scores.
    #[inline]
    #[must_use]
    pub fn score(&self, i: usize) -> f64 {
        self.keypoint_scores.map_or(1.0, |s| s[i])
    }

    /// Whether there are scores.
    #[must_use]
    pub fn has_scores(&self) -> bool {
        self.keypoint_scores.is_some()
    }

    /// Whether keypoint `i` takes part.
    #[inline]
    #[must_use]
    pub fn is_visible(&self, i: usize) -> bool {
        let [u, v] = self.keypoints_2d[i];
        !u.is_nan() && !v.is_nan() && self.score(i) > 0.0
    }

    /// The 2D box, if known.
    #[must_use]
    pub fn bbox(&self) -> Option<Bbox> {
        self.bbox
    }

    /// The object's own threshold in pixels.
    #[must_use]
    pub fn inlier_threshold(&self) -> Option<f64> {
        self.inlier_threshold
    }

    /// Probability that there is a vehicle at all, if a network says it.
    #[must_use]
    pub fn vehicle_probability(&self) -> Option<f64> {
        self.vehicle_probability
    }

    /// Probabilities of the viewing angles, if a network says them.
    #[must_use]
    pub fn viewing_angles(&self) -> Option<&'a [f64; VIEWING_ANGLES]> {
        self.viewing_angles
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &'a ShapeModel<'a> {
        self.model
    }
}
