//! The model of Brown and Conrady as OpenCV writes it: three radial terms and two tangential ones.
//!
//! With $`r^2 = x^2 + y^2`$ and $`q = 1 + k_1 r^2 + k_2 r^4 + k_3 r^6`$
//!
//! ```math
//! \begin{aligned}
//! x' &= q \, x + 2 p_1 x y + p_2 (r^2 + 2 x^2) \\
//! y' &= q \, y + p_1 (r^2 + 2 y^2) + 2 p_2 x y .
//! \end{aligned}
//! ```

use crate::geometry::lens::{Distorted, LensModel, PlaneModel};

/// Coefficients `k1, k2, p1, p2, k3`, in OpenCV's order.
///
/// ```
/// use groundpose::Camera;
/// use groundpose::Lens;
/// use groundpose::geometry::lens::brown_conrady::BrownConrady;
///
/// // A barrel lens draws the corners inwards.
/// let barrel = Lens::BrownConrady(BrownConrady::new([-0.3, 0.1, 0.0, 0.0, 0.0]));
/// let camera = Camera::new(1000.0, 1000.0, 960.0, 540.0)?.with_lens(barrel)?;
/// assert!(camera.distort([1900.0, 1000.0])[0] < 1900.0);
/// assert_eq!(barrel.name(), BrownConrady::NAME);
/// # Ok::<(), groundpose::InputError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrownConrady {
    coefficients: [f64; 5],
}

impl BrownConrady {
    /// Name of the model.
    pub const NAME: &'static str = "brown_conrady";

    /// From `k1, k2, p1, p2, k3`; [`Camera::with_lens`](crate::Camera::with_lens) checks them.
    #[must_use]
    pub const fn new(coefficients: [f64; 5]) -> Self {
        Self { coefficients }
    }
}

impl LensModel for BrownConrady {
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

impl PlaneModel for BrownConrady {
    fn at(&self, [x, y]: [f64; 2]) -> Distorted {
        let [k1, k2, p1, p2, k3] = self.coefficients;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let point = [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ];
        let mixed = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let jacobian = [
            radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        ];
        Distorted { point, jacobian }
    }
}
