//! What is known of a frame before its objects are looked at.

use core::f64::consts::FRAC_PI_2;

use crate::error::{Got, InputError, require};
use crate::geometry::view::View;
use crate::tuning::{
    CLASS_SIZE_SIGMA, FRAME_PITCH_SIGMA, FRAME_ROLL_SIGMA, HEIGHT_SIGMA, HEIGHTS, OWN_SIZE_SIGMA, ROAD_CURVATURE,
    ROAD_ROUGHNESS, ROAD_SLOPE, UNKNOWN_HEIGHT_SIGMA,
};

/// Most classes with a size of their own.
///
/// ```
/// use groundpose::{FramePriors, MAX_CLASSES};
///
/// assert_eq!(FramePriors::default().scales.len(), MAX_CLASSES);
/// ```
pub const MAX_CLASSES: usize = 8;

/// How large vehicles of a class are, as logarithms of sizes of their model.
///
/// ```
/// use groundpose::ScalePrior;
///
/// // Vehicles of the class are as large as the model, each of them within 5 %, their mean within 8 %.
/// let prior = ScalePrior::default();
/// assert_eq!((prior.log_mean, prior.own_sigma, prior.sigma), (0.0, 0.05, 0.08));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalePrior {
    /// Mean.
    pub log_mean: f64,
    /// Standard deviation of the mean: how surely the class is as large as that.
    pub sigma: f64,
    /// Standard deviation of a vehicle about the mean of its class, beyond what its shape says.
    pub own_sigma: f64,
}

impl Default for ScalePrior {
    fn default() -> Self {
        Self { log_mean: 0.0, sigma: CLASS_SIZE_SIGMA, own_sigma: OWN_SIZE_SIGMA }
    }
}

/// How surely a frame's tilt and height are known, how even roads are, and how large vehicles are: standard deviations.
///
/// ```
/// use groundpose::{FramePriors, ScalePrior};
///
/// let mut priors = FramePriors { height_sigma: 0.01, ..FramePriors::default() };
/// // Cars are 4 % larger here than their model.
/// priors.scales[0] = ScalePrior { log_mean: 0.04, ..ScalePrior::default() };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePriors {
    /// Of the frame's pitch about the nominal one, radians.
    pub pitch_sigma: f64,
    /// Of the frame's roll about the nominal one, radians.
    pub roll_sigma: f64,
    /// Of the nominal view's height as a fraction of it; not read where the view has none.
    pub height_sigma: f64,
    /// Of the road under a vehicle about the plane through all, metres.
    pub roughness: f64,
    /// The same in proportion to the distance, radians.
    pub slope: f64,
    /// How the road bends up and down, 1 / metres: under a vehicle it is off the plane by half of it times the squared
    /// distance.
    pub curvature: f64,
    /// The sizes of each class.
    pub scales: [ScalePrior; MAX_CLASSES],
}

impl Default for FramePriors {
    fn default() -> Self {
        Self {
            pitch_sigma: FRAME_PITCH_SIGMA,
            roll_sigma: FRAME_ROLL_SIGMA,
            height_sigma: HEIGHT_SIGMA,
            roughness: ROAD_ROUGHNESS,
            slope: ROAD_SLOPE,
            curvature: ROAD_CURVATURE,
            scales: [ScalePrior::default(); MAX_CLASSES],
        }
    }
}

impl FramePriors {
    /// Whether every number can be, together with the nominal view.
    ///
    /// ```
    /// use groundpose::{Camera, FramePriors, Tilt, View};
    ///
    /// let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt::default())?;
    /// assert!(FramePriors::default().check(&view).is_ok());
    /// let wrong = FramePriors { pitch_sigma: -0.1, ..FramePriors::default() };
    /// assert_eq!(wrong.check(&view).unwrap_err().argument, "pitch_sigma");
    /// assert_eq!(FramePriors::default().check(&view.with_height(1500.0)?).unwrap_err().argument, "height");
    /// # Ok::<(), groundpose::InputError>(())
    /// ```
    ///
    /// # Errors
    /// A standard deviation that is not positive or absurdly large, a size that is not finite, an absurd height.
    pub fn check(&self, view: &View) -> Result<(), InputError> {
        let angle = "radians above 0, below pi/2";
        let fraction = "a fraction above 0, at most 1";
        let scale = |f: fn(&ScalePrior) -> f64| self.scales.iter().map(f);
        let sigmas = [
            ("pitch_sigma", angle, self.pitch_sigma, FRAC_PI_2),
            ("roll_sigma", angle, self.roll_sigma, FRAC_PI_2),
            ("height_sigma", fraction, self.height_sigma, 1.0),
            ("roughness", "metres above 0, at most 1", self.roughness, 1.0),
            ("slope", angle, self.slope, FRAC_PI_2),
            ("curvature", "1 / metres above 0, at most 1", self.curvature, 1.0),
        ];
        let own = scale(|s| s.own_sigma).map(|x| ("own_sigma", fraction, x, 1.0));
        let class = scale(|s| s.sigma).map(|x| ("sigma", fraction, x, 1.0));
        for (argument, expected, x, largest) in sigmas.into_iter().chain(own).chain(class) {
            require(x > 0.0 && x <= largest, argument, expected, Got::Number(x))?;
        }
        for x in scale(|s| s.log_mean) {
            require(x.abs() <= 2.0, "log_mean", "a logarithm between -2 and 2", Got::Number(x))?;
        }
        let height = view.height.unwrap_or(HEIGHTS[0]);
        let can_be = (HEIGHTS[0]..=HEIGHTS[1]).contains(&height);
        require(can_be, "height", "0.1 to 300 metres, to put vehicles on the road", Got::Number(height))
    }

    /// Of the logarithm of the height.
    pub(crate) fn log_height_sigma(&self, view: &View) -> f64 {
        if view.height.is_some() { self.height_sigma } else { UNKNOWN_HEIGHT_SIGMA }
    }
}
