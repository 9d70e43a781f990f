//! Robust kernels: how a cost grows with a residual.
//!
//! A kernel is a function $`\rho(r)`$ with the weight $`w(r) = \rho'(r) / r`$ of iteratively reweighted least squares.
//! All take squared residuals, so that no square root is needed, and all are $`r^2 / 2`$ near zero.
//!
//! A new kernel is a row of the table below and the function it names; the tests go over the table.

use crate::geometry::math::log;
use crate::simd::lanes::{Lanes, Unit, Vector};

/// A kernel with its scale at hand.
pub(crate) trait Rho: Copy {
    /// `(rho, rho'(r) / r)` at the squared residual `r2`.
    fn evaluate(self, r2: f64) -> (f64, f64);

    /// The same for four residuals; one after the other where a kernel has nothing better.
    #[inline(always)]
    fn lanes<U: Unit>(self, unit: U, r2: U::Vector) -> (U::Vector, U::Vector) {
        let both = r2.lanes().0.map(|r2| self.evaluate(r2));
        (unit.load(Lanes(both.map(|b| b.0))), unit.load(Lanes(both.map(|b| b.1))))
    }
}

/// What is done with the kernel that a [`Kernel`] turns out to be.
pub(crate) trait WithRho {
    fn run(self, rho: impl Rho);
}

/// Makes [`Kernel`] out of the table: its variants, the choice between them, and examples of all for the tests.
macro_rules! kernels {
    ($($(#[$about:meta])* $name:ident $({ $($(#[$meaning:meta])* $parameter:ident),* })?
        => $rho:expr, for example |$scale2:ident| $example:expr;)*) => {
        /// A robust kernel with its scale.
        ///
        /// ```
        /// use groundpose::Kernel;
        ///
        /// let tukey = Kernel::Tukey { c2: 4.0 * 4.0 };
        /// let (near, weight_near) = tukey.evaluate(0.1 * 0.1);
        /// assert!((near - 0.005).abs() < 1e-5 && weight_near > 0.99);
        /// let (_, weight_far) = tukey.evaluate(5.0 * 5.0);
        /// assert_eq!(weight_far, 0.0);
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Kernel {
            $($(#[$about])* $name $({ $($(#[$meaning])* $parameter: f64),* })?,)*
        }

        impl Kernel {
            /// `(rho, rho'(r) / r)` at the squared residual `r2`.
            #[inline(always)]
            #[must_use]
            pub fn evaluate(self, r2: f64) -> (f64, f64) {
                match self {
                    $(Self::$name $({ $($parameter),* })? => $rho.evaluate(r2),)*
                }
            }

            /// Runs a task that is compiled for each kernel.
            #[inline(always)]
            pub(crate) fn with(self, task: impl WithRho) {
                match self {
                    $(Self::$name $({ $($parameter),* })? => task.run($rho),)*
                }
            }

            /// One example of every kernel at a squared scale.
            #[cfg(test)]
            pub(crate) const EXAMPLES: &[fn(f64) -> Self] = &[$(|$scale2| $example),*];
        }
    };
}

kernels! {
    /// Least squares, $`\rho = r^2 / 2`$ and $`w = 1`$.
    LeastSquares => LeastSquares, for example |_scale2| Self::LeastSquares;

    /// Tukey's biweight (paper, eq. 10); no influence beyond the scale `c`.
    ///
    /// ```math
    /// \rho = \frac{c^2}{6} \bigl( 1 - y^3 \bigr), \qquad w = y^2, \qquad y = \max(0,\; 1 - r^2 / c^2)
    /// ```
    Tukey {
        /// `c^2`.
        c2
    } => Tukey::new(c2), for example |c2| Self::Tukey { c2 };

    /// Student's t with `dof` degrees of freedom $`\nu`$ and the scale `s`: heavy tails, never flat.
    ///
    /// ```math
    /// \rho = \frac{s^2 \nu}{2} \log x, \qquad w = \frac{1}{x}, \qquad x = 1 + \frac{r^2}{s^2 \nu}
    /// ```
    Student {
        /// `s^2`.
        s2,
        /// Degrees of freedom.
        dof
    } => Student { s2, dof }, for example |s2| Self::Student { s2, dof: 8.0 };
}

#[derive(Clone, Copy)]
struct LeastSquares;

impl Rho for LeastSquares {
    #[inline(always)]
    fn evaluate(self, r2: f64) -> (f64, f64) {
        (0.5 * r2, 1.0)
    }

    #[inline(always)]
    fn lanes<U: Unit>(self, unit: U, r2: U::Vector) -> (U::Vector, U::Vector) {
        (r2 * 0.5, unit.splat(1.0))
    }
}

/// See [`Kernel::Tukey`].
#[derive(Clone, Copy)]
pub(crate) struct Tukey {
    c2: f64,
    inverse_c2: f64,
}

impl Tukey {
    #[inline(always)]
    pub(crate) fn new(c2: f64) -> Self {
        Self { c2, inverse_c2: 1.0 / c2 }
    }
}

impl Rho for Tukey {
    #[inline(always)]
    fn evaluate(self, r2: f64) -> (f64, f64) {
        // A residual that is not a number (a point in the camera plane) counts as beyond the scale.
        let x = if r2 < self.c2 { r2 * self.inverse_c2 } else { 1.0 };
        let y = 1.0 - x;
        (self.c2 / 6.0 * (1.0 - y * y * y), y * y)
    }

    #[inline(always)]
    fn lanes<U: Unit>(self, unit: U, r2: U::Vector) -> (U::Vector, U::Vector) {
        let one = unit.splat(1.0);
        let y = one - (r2 * self.inverse_c2).min(one);
        let weight = y * y;
        ((one - weight * y) * (self.c2 / 6.0), weight)
    }
}

#[derive(Clone, Copy)]
struct Student {
    s2: f64,
    dof: f64,
}

impl Rho for Student {
    #[inline(always)]
    fn evaluate(self, r2: f64) -> (f64, f64) {
        let x = 1.0 + r2 / (self.s2 * self.dof);
        (0.5 * self.s2 * self.dof * log(x), 1.0 / x)
    }
}
