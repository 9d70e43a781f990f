//! Lens models: where a real lens puts a point that an ideal pinhole would have put elsewhere.
//!
//! A model of planes maps normalised coordinates, $`(x, y) = (X / Z, Y / Z)`$ in the camera frame, from before the lens to
//! behind it. A model of rays maps directions, also those of 90 degrees and more from the axis, which have no normalised
//! coordinates. One file per model; here stand the choice between them and what they share. A new model is a file, a
//! variant of [`Lens`] and a row of [`Lens::MODELS`].

pub mod brown_conrady;
pub mod double_sphere;
pub mod equidistant;
pub mod field_of_view;
pub mod omnidirectional;
pub mod rational;

use nalgebra::Vector3;

use crate::error::{Got, InputError, require};
use crate::geometry::lens::brown_conrady::BrownConrady;
use crate::geometry::lens::double_sphere::DoubleSphere;
use crate::geometry::lens::equidistant::Equidistant;
use crate::geometry::lens::field_of_view::FieldOfView;
use crate::geometry::lens::omnidirectional::Omnidirectional;
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
    /// Two spheres one after the other.
    DoubleSphere(DoubleSphere),
    /// An angle that grows with the distance from the middle, by one coefficient.
    FieldOfView(FieldOfView),
    /// A sphere, then the model of Brown and Conrady.
    Omnidirectional(Omnidirectional),
}

/// What the file of a model says of it.
pub(crate) trait LensModel {
    /// Its name in [`Lens::MODELS`].
    fn name(&self) -> &'static str;

    /// The coefficients in the order of its constructor.
    fn coefficients(&self) -> &[f64];

    /// # Errors
    /// Finite coefficients that the model cannot have.
    fn check(&self) -> Result<(), InputError> {
        Ok(())
    }

    /// Whether the lens moves no point.
    fn is_ideal(&self) -> bool {
        false
    }
}

/// A model of normalised points.
pub(crate) trait PlaneModel: LensModel {
    /// Where the lens puts a normalised point, with the derivatives.
    fn at(&self, point: [f64; 2]) -> Distorted;

    /// Where the lens puts a normalised point.
    fn distort(&self, point: [f64; 2]) -> [f64; 2] {
        self.at(point).point
    }

    /// The normalised point that the lens puts at `target`; `None` where there is none.
    fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        newton(target, |point| self.at(point))
    }
}

/// A model of directions.
pub(crate) trait RayModel: LensModel {
    /// Where the lens puts a direction of length one; `None` beyond its limit.
    fn image_of(&self, ray: &Vector3<f64>) -> Option<[f64; 2]>;

    /// The direction, of length one, that the lens puts at `target`; `None` where there is none.
    fn ray_of(&self, target: [f64; 2]) -> Option<Vector3<f64>>;
}

/// What a model maps.
enum Maps<'a> {
    Planes(&'a dyn PlaneModel),
    Rays(&'a dyn RayModel),
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
/// Beyond a fold a model may grow once more. Parts of the way from the middle after which it is looked for.
const ON_THE_WAY: u32 = 6;

impl Lens {
    /// Every model by name, with its constructor: `None` for another number of coefficients than the model has.
    pub const MODELS: [(&'static str, FromCoefficients); 6] = [
        (BrownConrady::NAME, |k| Some(Self::BrownConrady(BrownConrady::new(k.try_into().ok()?)))),
        (Rational::NAME, |k| Rational::of(k).map(Self::Rational)),
        (Equidistant::NAME, |k| Some(Self::Equidistant(Equidistant::new(k.try_into().ok()?)))),
        (DoubleSphere::NAME, |k| Some(Self::DoubleSphere(DoubleSphere::new(k.try_into().ok()?)))),
        (FieldOfView::NAME, |k| Some(Self::FieldOfView(FieldOfView::new(k.try_into().ok()?)))),
        (Omnidirectional::NAME, |k| Some(Self::Omnidirectional(Omnidirectional::new(k.try_into().ok()?)))),
    ];

    fn maps(&self) -> Maps<'_> {
        match self {
            Self::BrownConrady(model) => Maps::Planes(model),
            Self::Rational(model) => Maps::Planes(model),
            Self::Equidistant(model) => Maps::Rays(model),
            Self::DoubleSphere(model) => Maps::Rays(model),
            Self::FieldOfView(model) => Maps::Rays(model),
            Self::Omnidirectional(model) => Maps::Rays(model),
        }
    }

    fn model(&self) -> &dyn LensModel {
        match self.maps() {
            Maps::Planes(model) => model,
            Maps::Rays(model) => model,
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

    /// Whether it is a model of directions, whose pictures are too wide for one pinhole.
    pub(crate) fn is_wide(&self) -> bool {
        matches!(self.maps(), Maps::Rays(_))
    }

    /// # Errors
    /// Coefficients that are not finite or that the model cannot have.
    pub(crate) fn check(&self) -> Result<(), InputError> {
        for &c in self.coefficients() {
            require(c.is_finite(), "distortion", "finite numbers", Got::Number(c))?;
        }
        self.model().check()
    }

    /// Where the lens puts a normalised point; not a number beyond the limit of a model of rays.
    pub(crate) fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.maps() {
            Maps::Planes(model) => model.distort([x, y]),
            Maps::Rays(model) => {
                direction(&Vector3::new(x, y, 1.0)).and_then(|ray| model.image_of(&ray)).unwrap_or([f64::NAN; 2])
            }
        }
    }

    /// The normalised point that the lens puts at `target`. `None` where there is none, as beyond the radius at which
    /// the model folds over, or 90 degrees and more from the axis.
    pub(crate) fn undistort(&self, target: [f64; 2]) -> Option<[f64; 2]> {
        match self.maps() {
            Maps::Planes(model) => model.undistort(target),
            Maps::Rays(model) => {
                let ray = model.ray_of(target)?;
                (ray.z > 0.0).then(|| [ray.x / ray.z, ray.y / ray.z])
            }
        }
    }

    /// Where the lens puts a point of the camera frame; `None` where it does not show it.
    pub(crate) fn image_of(&self, point: &Vector3<f64>) -> Option<[f64; 2]> {
        match self.maps() {
            Maps::Rays(model) => model.image_of(&direction(point)?),
            Maps::Planes(model) => {
                let ideal = (point.z > 0.0).then(|| [point.x / point.z, point.y / point.z])?;
                shown(model, ideal)
            }
        }
    }

    /// The direction, of length one, of what the lens puts at `target`; `None` where there is none.
    pub(crate) fn ray_of(&self, target: [f64; 2]) -> Option<Vector3<f64>> {
        match self.maps() {
            Maps::Rays(model) => model.ray_of(target),
            Maps::Planes(model) => model.undistort(target).map(|[x, y]| Vector3::new(x, y, 1.0).normalize()),
        }
    }
}

/// The direction, of length one, of a point whose squares need not be numbers; `None` for the middle of the camera.
fn direction(point: &Vector3<f64>) -> Option<Vector3<f64>> {
    let largest = point.amax();
    (largest > 0.0 && largest.is_finite()).then(|| (point / largest).normalize())
}

/// Where a model puts a normalised point; `None` beyond its fold, where it would put it onto the image of another one.
pub(crate) fn shown(model: &dyn PlaneModel, ideal: [f64; 2]) -> Option<[f64; 2]> {
    let Distorted { point, jacobian } = model.at(ideal);
    (keeps_order(&jacobian) && is_before_the_fold(ideal, |point| model.at(point))).then_some(point)
}

/// Whether a model with this Jacobian neither folds nor turns back: it did where the sum of the eigenvalues or their
/// product is not positive.
fn keeps_order(&[a, b, c, d]: &[f64; 4]) -> bool {
    a * d - b * c > SMALLEST_DETERMINANT && a + d > 0.0
}

/// Whether a model keeps the order of points all the way from the middle to a point.
fn is_before_the_fold([x, y]: [f64; 2], distort: impl Fn([f64; 2]) -> Distorted) -> bool {
    (1..ON_THE_WAY).all(|step| {
        let fraction = f64::from(step) / f64::from(ON_THE_WAY);
        keeps_order(&distort([fraction * x, fraction * y]).jacobian)
    })
}

/// The point that `distort` puts at `target`: Newton's method on the forward model from there. `None` where it does not
/// come back.
pub(crate) fn newton(target: [f64; 2], distort: impl Fn([f64; 2]) -> Distorted) -> Option<[f64; 2]> {
    let [mut x, mut y] = target;
    for _ in 0..MAX_STEPS {
        let Distorted { point, jacobian: [a, b, c, d] } = distort([x, y]);
        let (ex, ey) = (point[0] - target[0], point[1] - target[1]);
        let determinant = a * d - b * c;
        if determinant <= SMALLEST_DETERMINANT || a + d <= 0.0 {
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
    let comes_back = norm2(back[0] - target[0], back[1] - target[1]) < LARGEST_ERROR;
    (comes_back && is_before_the_fold([x, y], distort)).then_some([x, y])
}
