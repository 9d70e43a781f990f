//! A 2D box in the image.

use crate::error::{Got, InputError, require};

/// A 2D box in pixels. A side that is NaN is not known.
///
/// ```
/// use groundpose::Bbox;
///
/// let cut_on_the_right = Bbox::new([1500.0, 400.0, f64::NAN, 700.0])?;
/// assert_eq!(cut_on_the_right.longer_side(), Some(300.0));
/// assert_eq!(
///     Bbox::new([700.0, 400.0, 500.0, 600.0]).unwrap_err().to_string(),
///     "bbox: expected left < right, got 700 and 500"
/// );
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bbox {
    /// Left side, column.
    pub left: f64,
    /// Top side, row.
    pub top: f64,
    /// Right side, column.
    pub right: f64,
    /// Bottom side, row.
    pub bottom: f64,
}

impl Bbox {
    /// A box from `left, top, right, bottom`; NaN stands for a side that is not known.
    ///
    /// # Errors
    /// An infinite side, `left >= right` or `top >= bottom`.
    pub fn new(sides: [f64; 4]) -> Result<Self, InputError> {
        let [left, top, right, bottom] = sides;
        for side in sides {
            require(!side.is_infinite(), "bbox", "finite sides, or NaN for an unknown one", Got::Number(side))?;
        }
        require(!(left >= right), "bbox", "left < right", Got::Pair(left, right))?;
        require(!(top >= bottom), "bbox", "top < bottom", Got::Pair(top, bottom))?;
        Ok(Self { left, top, right, bottom })
    }

    /// The longer side in pixels, of those known (`l` of the paper, sec. 4.2.4).
    #[must_use]
    pub fn longer_side(&self) -> Option<f64> {
        let longer = (self.right - self.left).max(self.bottom - self.top);
        longer.is_finite().then_some(longer)
    }
}
