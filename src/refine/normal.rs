//! Normal equations of fixed size: what residuals and priors add to, and their solution by Cholesky.
//!
//! The unknowns of size `D` are a rotation vector (left perturbation, radians), a translation (metres) and
//! `D - 6` shape coefficients.

use nalgebra::Vector6;

use crate::geometry::pose::Pose;
use crate::model::shape_model::MAX_MODES;
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};

/// Pose and shape coefficients.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    pub(crate) pose: Pose,
    pub(crate) coefficients: [f64; MAX_MODES],
}

impl State {
    /// The state after a step.
    pub(crate) fn moved<const D: usize>(&self, step: &[f64; D]) -> Self {
        let pose = self.pose.perturbed(&Vector6::from_column_slice(&step[..6]));
        let mut coefficients = self.coefficients;
        for m in 0..D - 6 {
            coefficients[m] += step[6 + m];
        }
        Self { pose, coefficients }
    }
}

/// Normal equations at a state, and the cost there.
pub(crate) struct Normal<const D: usize> {
    /// Upper triangle; the lower one is zero.
    pub(crate) h: [[f64; D]; D],
    pub(crate) gradient: [f64; D],
    pub(crate) cost: f64,
}

/// Size of the unknowns for a number of modes: few sizes, so that few copies of the code exist. Modes a model
/// does not have get a zero Jacobian and stay zero.
pub(crate) fn padded_modes(modes: usize) -> usize {
    [0, 5].into_iter().find(|&m| modes <= m).unwrap_or(MAX_MODES)
}

/// Adds one weighted row to the upper triangle of the normal equations.
#[inline(always)]
pub(crate) fn add_row<const D: usize, const N: usize>(
    normal: &mut Normal<D>,
    j: &[f64; N],
    residual: f64,
    weight: f64,
) {
    for a in 0..N {
        let wa = weight * j[a];
        normal.gradient[a] += wa * residual;
        for b in a..N {
            normal.h[a][b] += wa * j[b];
        }
    }
}

impl<const D: usize> Normal<D> {
    pub(crate) const ZERO: Self = Self { h: [[0.0; D]; D], gradient: [0.0; D], cost: 0.0 };
}

/// Numbers of a row of the largest normal equations with their right side, in whole vectors.
const WIDTH: usize = (6 + MAX_MODES + 1).next_multiple_of(LANES);

/// `-(H + damping diag(H))^-1 gradient`; `None` when the matrix is not positive definite.
#[inline]
pub(crate) fn solve_damped<const D: usize>(unit: VectorUnit, normal: &Normal<D>, damping: f64) -> Option<[f64; D]> {
    if D > 6 {
        return unit.run(SolveDamped { normal, damping });
    }
    // A pose alone fits into registers, where nothing waits for what was written.
    let mut h = normal.h;
    for i in 0..D {
        h[i][i] += damping * h[i][i];
    }
    cholesky(&mut h)?;
    let mut x = normal.gradient;
    for g in &mut x {
        *g = -*g;
    }
    solve_cholesky(&h, &mut x);
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// The same by whole vectors.
struct SolveDamped<'a, const D: usize> {
    normal: &'a Normal<D>,
    damping: f64,
}

impl<const D: usize> HotLoop for SolveDamped<'_, D> {
    type Output = Option<[f64; D]>;

    /// The elimination of [`cholesky`] with the gradient as one more column, row by row in whole vectors: what is left of
    /// the diagonal is not used. The factors are kept apart: a number written into a row would make the next vector that
    /// is read of it wait.
    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> Self::Output {
        let vectors = (D + 1).div_ceil(LANES);
        let mut rows = [[0.0; WIDTH]; D];
        for i in 0..D {
            rows[i][..D].copy_from_slice(&self.normal.h[i]);
            rows[i][i] += self.damping * rows[i][i];
            rows[i][D] = -self.normal.gradient[i];
        }
        let (mut inverses, mut factors) = ([0.0; D], [[0.0; D]; D]);
        for j in 0..D {
            let pivot = rows[j][j];
            let scale = self.normal.h[j][j];
            if !(pivot > SMALLEST_PIVOT * (scale + self.damping * scale)) {
                return None;
            }
            inverses[j] = 1.0 / pivot;
            let (above, below) = rows.split_at_mut(j + 1);
            let row = &above[j];
            for i in j + 1..D {
                let factor = row[i] * inverses[j];
                factors[j][i] = factor;
                let (from, into) = (row.as_chunks::<LANES>().0, below[i - j - 1].as_chunks_mut::<LANES>().0);
                for k in i / LANES..vectors {
                    into[k] = (unit.load(Lanes(into[k])) - unit.load(Lanes(from[k])) * factor).lanes().0;
                }
            }
        }
        let mut x = [0.0; D];
        for i in (0..D).rev() {
            let mut s = rows[i][D] * inverses[i];
            for k in i + 1..D {
                s -= factors[i][k] * x[k];
            }
            x[i] = s;
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }
}

/// A pivot below this fraction of its diagonal: a direction the data says nothing about.
const SMALLEST_PIVOT: f64 = 1e-14;

/// `H = U^T D U` in place of the upper triangle, `U` with a unit diagonal and `D` inverted on the diagonal: Cholesky
/// without square roots; `None` when the matrix is not positive definite.
#[inline(always)]
pub(crate) fn cholesky<const D: usize>(h: &mut [[f64; D]; D]) -> Option<()> {
    let mut scales = [0.0; D];
    for j in 0..D {
        scales[j] = h[j][j];
    }
    for j in 0..D {
        let pivot = h[j][j];
        if !(pivot > SMALLEST_PIVOT * scales[j]) {
            return None;
        }
        let inverse = 1.0 / pivot;
        h[j][j] = inverse;
        for i in j + 1..D {
            let factor = h[j][i] * inverse;
            for k in i..D {
                h[i][k] -= factor * h[j][k];
            }
            h[j][i] = factor;
        }
    }
    Some(())
}

/// Solves `U^T D U x = b` in place with the factors of [`cholesky`].
#[inline(always)]
pub(crate) fn solve_cholesky<const D: usize>(u: &[[f64; D]; D], x: &mut [f64; D]) {
    for i in 0..D {
        for k in i + 1..D {
            x[k] -= u[i][k] * x[i];
        }
    }
    for i in (0..D).rev() {
        let mut s = x[i] * u[i][i];
        for k in i + 1..D {
            s -= u[i][k] * x[k];
        }
        x[i] = s;
    }
}

/// [`solve_cholesky`] of four right sides at once.
#[inline(always)]
pub(crate) fn solve_columns<V: Vector, const D: usize>(u: &[[f64; D]; D], x: &mut [V; D]) {
    for i in 0..D {
        for k in i + 1..D {
            x[k] = x[k] - x[i] * u[i][k];
        }
    }
    for i in (0..D).rev() {
        let mut s = x[i] * u[i][i];
        for k in i + 1..D {
            s = s - x[k] * u[i][k];
        }
        x[i] = s;
    }
}
