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

    /// The box without the sides that another one does not know.
    pub(crate) fn known_where(&self, other: &Self) -> Self {
        let unless = |other: f64, side: f64| if other.is_nan() { other } else { side };
        Self {
            left: unless(other.left, self.left),
            top: unless(other.top, self.top),
            right: unless(other.right, self.right),
            bottom: unless(other.bottom, self.bottom),
        }
    }

    /// Column and row of its middle; NaN where a side is not known.
    pub(crate) fn middle(&self) -> [f64; 2] {
        [0.5 * (self.left + self.right), 0.5 * (self.top + self.bottom)]
    }

    /// The box after each side moved as its middle does; a side whose middle goes nowhere becomes unknown. `fallback`:
    /// where a middle is taken to be along an axis of which no side is known.
    pub(crate) fn moved_by_middles(&self, fallback: [f64; 2], moved: impl Fn([f64; 2]) -> Option<[f64; 2]>) -> Self {
        // An unknown side does not tell where the middle of its neighbours is: theirs is taken at the other end.
        let middle = |a: f64, b: f64, fallback: f64| {
            let m = 0.5 * (a + b);
            if !m.is_nan() {
                m
            } else if !a.is_nan() {
                a
            } else if !b.is_nan() {
                b
            } else {
                fallback
            }
        };
        let (u, v) = (middle(self.left, self.right, fallback[0]), middle(self.top, self.bottom, fallback[1]));
        let side = |pixel: [f64; 2], axis: usize| moved(pixel).map_or(f64::NAN, |p| p[axis]);
        Self {
            left: side([self.left, v], 0),
            top: side([u, self.top], 1),
            right: side([self.right, v], 0),
            bottom: side([u, self.bottom], 1),
        }
    }
}
