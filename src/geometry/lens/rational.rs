//! OpenCV's model of 8, 12 or 14 coefficients: rational radial terms, a thin prism, a tilted sensor.
//!
//! With $`r^2 = x^2 + y^2`$ and $`q = \dfrac{1 + k_1 r^2 + k_2 r^4 + k_3 r^6}{1 + k_4 r^2 + k_5 r^4 + k_6 r^6}`$
//!
//! ```math
//! \begin{aligned}
//! x'' &= q \, x + 2 p_1 x y + p_2 (r^2 + 2 x^2) + s_1 r^2 + s_2 r^4 \\
//! y'' &= q \, y + p_1 (r^2 + 2 y^2) + 2 p_2 x y + s_3 r^2 + s_4 r^4 ,
//! \end{aligned}
//! ```
//!
//! and on a sensor turned by $`R = R_y(\tau_y) \, R_x(\tau_x)`$
//!
//! ```math
//! \begin{bmatrix} x' \\ y' \\ 1 \end{bmatrix} \sim
//! \begin{bmatrix} R_{33} & 0 & -R_{13} \\ 0 & R_{33} & -R_{23} \\ 0 & 0 & 1 \end{bmatrix}
//! R \begin{bmatrix} x'' \\ y'' \\ 1 \end{bmatrix} .
//! ```

use crate::geometry::lens::{Distorted, LensModel, PlaneModel};
use crate::geometry::math::{cos, sin};

/// Coefficients `k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y`, in OpenCV's order.
///
/// ```
/// use groundpose::geometry::lens::brown_conrady::BrownConrady;
/// use groundpose::geometry::lens::rational::Rational;
/// use groundpose::{Camera, Lens};
///
/// // Without its own terms it is the model of Brown and Conrady.
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?;
/// let mut k = [0.0; 14];
/// (k[0], k[1]) = (-0.3, 0.1);
/// let rational = camera.with_lens(Lens::Rational(Rational::new(k)))?;
/// let brown = camera.with_lens(Lens::BrownConrady(BrownConrady::new([-0.3, 0.1, 0.0, 0.0, 0.0])))?;
/// assert!((rational.distort([1900.0, 1000.0])[0] - brown.distort([1900.0, 1000.0])[0]).abs() < 1e-9);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rational {
    coefficients: [f64; 14],
}

impl Rational {
    /// Name of the model.
    ///
    /// ```
    /// assert_eq!(groundpose::geometry::lens::rational::Rational::NAME, "rational");
    /// ```
    pub const NAME: &'static str = "rational";

    /// From the coefficients; [`Camera::with_lens`](crate::Camera::with_lens) checks them.
    #[must_use]
    pub const fn new(coefficients: [f64; 14]) -> Self {
        Self { coefficients }
    }

    /// From the first 8, 12 or 14 coefficients, the others 0; `None` for another number of them.
    pub(crate) fn of(given: &[f64]) -> Option<Self> {
        let mut coefficients = [0.0; 14];
        matches!(given.len(), 8 | 12 | 14).then(|| {
            coefficients[..given.len()].copy_from_slice(given);
            Self { coefficients }
        })
    }

    /// On a sensor across the optical axis.
    fn untilted(&self, [x, y]: [f64; 2]) -> Distorted {
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, ..] = self.coefficients;
        let r2 = x * x + y * y;
        let over = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let under = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
        let radial = over / under;
        let rise = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3) - radial * (k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6));
        let slope = 2.0 * rise / under;
        let point = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4),
        ];
        let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let (prism_x, prism_y) = (2.0 * (s1 + 2.0 * r2 * s2), 2.0 * (s3 + 2.0 * r2 * s4));
        let jacobian = [
            radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + x * prism_x,
            mixed + y * prism_x,
            mixed + x * prism_y,
            radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + y * prism_y,
        ];
        // Beyond a pole of the rational term the image is of another sheet.
        if under > 0.0 { Distorted { point, jacobian } } else { Distorted { point, jacobian: [0.0; 4] } }
    }
}

/// The point and its derivatives on a sensor turned by these two angles.
fn tilted([tau_x, tau_y]: [f64; 2], untilted: &Distorted) -> Distorted {
    let (cx, sx, cy, sy) = (cos(tau_x), sin(tau_x), cos(tau_y), sin(tau_y));
    let rotation = [[cy, sy * sx, -sy * cx], [0.0, cx, sx], [sy, -cy * sx, cy * cx]];
    let [[_, _, r13], [_, _, r23], last] = rotation;
    let row = |k: usize, shift: f64| [0, 1, 2].map(|j| last[2] * rotation[k][j] - shift * last[j]);
    let (rows, [x, y], [a, b, c, d]) = ([row(0, r13), row(1, r23), last], untilted.point, untilted.jacobian);
    let [u, v, w] = rows.map(|[p, q, r]| p * x + q * y + r);
    let point = [u / w, v / w];
    let by_untilted = |k: usize, j: usize| (rows[k][j] - point[k] * last[j]) / w;
    let by_point = |k: usize| {
        let (e, f) = (by_untilted(k, 0), by_untilted(k, 1));
        [e * a + f * c, e * b + f * d]
    };
    let ([xx, xy], [yx, yy]) = (by_point(0), by_point(1));
    Distorted { point, jacobian: [xx, xy, yx, yy] }
}

impl LensModel for Rational {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    fn is_ideal(&self) -> bool {
        self.coefficients.iter().all(|&c| c == 0.0)
    }
}

impl PlaneModel for Rational {
    fn at(&self, point: [f64; 2]) -> Distorted {
        let untilted = self.untilted(point);
        let [.., tau_x, tau_y] = self.coefficients;
        if tau_x == 0.0 && tau_y == 0.0 { untilted } else { tilted([tau_x, tau_y], &untilted) }
    }
}
