//! Lens models: where a real lens puts a point that an ideal pinhole would have put elsewhere.
//!
//! A model maps normalised coordinates, $`(x, y) = (X / Z, Y / Z)`$ in the camera frame, from before the lens to behind
//! it. One file per model; here stand the choice between them and what they share, the inverse by Newton's method.
//! A new model is a file, a variant of [`Lens`] and a row of [`Lens::MODELS`].

pub mod brown_conrady;
pub mod equidistant;
pub mod rational;

use crate::geometry::lens::brown_conrady::BrownConrady;
use crate::geometry::lens::equidistant::Equidistant;
use crate::geometry::lens::rational::Rational;
use crate::geometry::math::norm2;

/// A lens model with its coefficients.
///
/// ```
/// use groundpose::Lens;
///
/// let (name, with_coefficients) = Lens::MODELS[0];
/// let lens = with_coefficients(&[-0.3, 0.1, 0.0, 0.0, 0.0]).expect("five coefficients");
/// assert_eq!((lens.name(), lens.coefficients()[0]), (name, -0.3));
/// assert_eq!(with_coefficients(&[-0.3, 0.1]), None, "another number of coefficients");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// OpenCV's radial and tangential model.
    BrownConrady(BrownConrady),
    /// OpenCV's model of 8, 12 or 14 coefficients.
    Rational(Rational),
    /// OpenCV's fisheye.
    Equidistant(Equidistant),
}

/// What the file of a model says of it.
pub(crate) trait LensModel {
    /// Its name in [`Lens::MODELS`].
    fn name(&self) -> &'static str;

    /// The coefficients in the order of its constructor.
    fn coefficients(&self) -> &[f64];

    /// Whether the lens moves no point: usually where all coefficients are 0.
    fn is_ideal(&self) -> bool {
        self.coefficients().iter().all(|&c| c == 0.0)
    }

    /// Where the lens puts a normalised point.
    fn distort(&self, point: [f64; 2]) -> [f64; 2];

    /// The normalised point that the lens puts at `target`; `None` where there is none.
    fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]>;
}

/// A normalised point behind the lens, and its derivatives by the point before the lens.
pub(crate) struct Distorted {
    pub(crate) point: [f64; 2],
    /// Row by row: `[dx/dx, dx/dy, dy/dx, dy/dy]`.
    pub(crate) jacobian: [f64; 4],
}

/// A constructor of a model; `None` for another number of coefficients than the model has.
type FromCoefficients = fn(&[f64]) -> Option<Lens>;

/// Most steps of Newton's method.
const MAX_STEPS: usize = 30;
/// From the centre outwards a model is invertible as long as the determinant of its Jacobian stays above this.
const SMALLEST_DETERMINANT: f64 = 1e-6;
/// Newton's method ends at a step this small, relative to the point.
const SMALLEST_STEP: f64 = 1e-14;
/// An inverse that comes back further than this from the given point is none.
const LARGEST_ERROR: f64 = 1e-9;

impl Lens {
    /// Every model by name, with its constructor: `None` for another number of coefficients than the model has.
    pub const MODELS: [(&'static str, FromCoefficients); 3] = [
        (BrownConrady::NAME, |k| Some(Self::BrownConrady(BrownConrady::new(k.try_into().ok()?)))),
        (Rational::NAME, |k| Rational::of(k).map(Self::Rational)),
        (Equidistant::NAME, |k| Some(Self::Equidistant(Equidistant::new(k.try_into().ok()?)))),
    ];

    fn model(&self) -> &dyn LensModel {
        match self {
            Self::BrownConrady(model) => model,
            Self::Rational(model) => model,
            Self::Equidistant(model) => model,
        }
    }

    /// Name of the model.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.model().name()
    }

    /// Coefficients in the order of the model.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        self.model().coefficients()
    }

    /// Whether the lens moves no point.
    pub(crate) fn is_ideal(&self) -> bool {
        self.model().is_ideal()
    }

    /// Where the lens puts a normalised point.
    pub(crate) fn distort(&self, point: [f64; 2]) -> [f64; 2] {
        self.model().distort(point)
    }

    /// The normalised point that the lens puts at `target`. `None` where there is none, as beyond the radius at which
    /// the model folds over.
    pub(crate) fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        self.model().undistort(target)
    }
}

/// The point that `distort` puts at `target`: Newton's method on the forward model from there. `None` where it does not
/// come back.
pub(crate) fn newton(target: [f64; 2], distort: impl Fn([f64; 2]) -> Distorted) -> Option<[f64; 2]> {
    let [mut x, mut y] = target;
    for _ in 0..MAX_STEPS {
        let Distorted { point, jacobian: [a, b, c, d] } = distort([x, y]);
        let (ex, ey) = (point[0] - target[0], point[1] - target[1]);
        let determinant = a * d - b * c;
        if determinant <= SMALLEST_DETERMINANT {
            return None;
        }
        let (dx, dy) = ((d * ex - b * ey) / determinant, (a * ey - c * ex) / determinant);
        x -= dx;
        y -= dy;
        if dx.abs() + dy.abs() < SMALLEST_STEP * (1.0 + x.abs() + y.abs()) {
            break;
        }
    }
    let back = distort([x, y]).point;
    (norm2(back[0] - target[0], back[1] - target[1]) < LARGEST_ERROR).then_some([x, y])
}
