//! Two kinds of failure that are never mixed: the caller's mistake and data without an answer.

use core::fmt;

/// A value the caller passed is not what the argument takes.
///
/// ```
/// use groundpose::{Bbox, Got, InputError};
///
/// let error: InputError = Bbox::new([700.0, 400.0, 500.0, 600.0]).unwrap_err();
/// assert_eq!((error.argument, error.got), ("bbox", Got::Pair(700.0, 500.0)));
/// assert_eq!(error.to_string(), "bbox: expected left < right, got 700 and 500");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputError {
    /// Name of the argument or field.
    pub argument: &'static str,
    /// What it takes.
    pub expected: &'static str,
    /// What it was.
    pub got: Got,
}

/// What an argument was instead of what it takes.
///
/// ```
/// use groundpose::Got;
///
/// assert_eq!(Got::Count(3).to_string(), "3");
/// assert_eq!(Got::Text("NaN or infinite").to_string(), "NaN or infinite");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Got {
    /// A number.
    Number(f64),
    /// A length or an index.
    Count(usize),
    /// Two numbers in the wrong relation.
    Pair(f64, f64),
    /// Anything else, in words.
    Text(&'static str),
}

impl fmt::Display for Got {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Got::Number(x) => write!(f, "{x}"),
            Got::Count(n) => write!(f, "{n}"),
            Got::Pair(a, b) => write!(f, "{a} and {b}"),
            Got::Text(s) => f.write_str(s),
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: expected {}, got {}", self.argument, self.expected, self.got)
    }
}

impl core::error::Error for InputError {}

/// `Err(InputError)` unless `ok`.
#[inline]
pub(crate) fn require(ok: bool, argument: &'static str, expected: &'static str, got: Got) -> Result<(), InputError> {
    if ok { Ok(()) } else { Err(InputError { argument, expected, got }) }
}

/// Why an object has no pose. The data has no answer; nobody made a mistake.
///
/// ```
/// use groundpose::NoPose;
///
/// assert_eq!(NoPose::NoConsensus.name(), "no_consensus");
/// // The numbers are those of `status` in Python and in files.
/// assert_eq!(NoPose::NAMES[NoPose::NoConsensus as usize], NoPose::NoConsensus.to_string());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum NoPose {
    /// Fewer visible keypoints than a pose needs.
    TooFewKeypoints = 1,
    /// The visible keypoints, in the image or on the model, are one point or lie on one line; or the inliers leave a
    /// direction of pose and shape free, so that the covariance asked for does not exist.
    Degenerate = 2,
    /// No sample gave a pose in front of the camera that agrees with the box.
    NoHypothesis = 3,
    /// The best pose explains so few keypoints that chance explains them as well.
    NoConsensus = 4,
    /// The object's own numbers are not usable (only batches report this; alone it is an [`InputError`]).
    InvalidInput = 5,
    /// The best pose is less probable to be right than the options ask, or its box is far smaller than the given one.
    Improbable = 6,
}

impl NoPose {
    /// Every reason with its name; a status of 0 is `"ok"`.
    pub const NAMES: [&'static str; 7] =
        ["ok", "too_few_keypoints", "degenerate", "no_hypothesis", "no_consensus", "invalid_input", "improbable"];

    /// The name used in Python and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

impl fmt::Display for NoPose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl core::error::Error for NoPose {}

/// Why an estimate of one object did not return a pose: the two kinds of failure, apart.
///
/// ```
/// use groundpose::{EstimateError, InputError, NoPose, Options};
///
/// let wrong: InputError = Options { confidence: 99.0, ..Options::default() }.check().unwrap_err();
/// let texts = [EstimateError::Input(wrong), EstimateError::NoPose(NoPose::NoConsensus)].map(|e| e.to_string());
/// assert_eq!(texts, ["confidence: expected a probability between 0 and 1, got 99", "no_consensus"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EstimateError {
    /// The caller's mistake.
    Input(InputError),
    /// The data has no answer.
    NoPose(NoPose),
}

impl From<InputError> for EstimateError {
    fn from(error: InputError) -> Self {
        Self::Input(error)
    }
}

impl From<NoPose> for EstimateError {
    fn from(reason: NoPose) -> Self {
        Self::NoPose(reason)
    }
}

impl fmt::Display for EstimateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(error) => error.fmt(f),
            Self::NoPose(reason) => reason.fmt(f),
        }
    }
}

impl core::error::Error for EstimateError {}
