//! Sums over keypoints, four at a time, for pose and shape together.

use crate::model::shape_model::ShapeModel;
use crate::refine::normal::Normal;
use crate::refine::normal_pose::Summands;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};
use crate::simd::projection::Projected;

/// Cost, gradient and normal equations of the pose and the coefficients of a shape.
pub(crate) struct LineariseJoint<'a, const D: usize> {
    pub(crate) summands: Summands<'a>,
    pub(crate) model: &'a ShapeModel<'a>,
    /// Index in the model of every keypoint of the blocks.
    pub(crate) visible: &'a [u32],
    pub(crate) normal: &'a mut Normal<D>,
}

impl<const D: usize> HotLoop for LineariseJoint<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        let zero = unit.zero();
        let (mut cost, mut gradient, mut h) = (zero, [zero; D], [[zero; D]; D]);
        let mut first = 0;
        self.summands.each(
            unit,
            #[inline(always)]
            |q, rho, [w, _]| {
                cost += rho;
                let (ju, jv) = self.rows(unit, &q, first);
                for i in 0..D {
                    let (wu, wv) = (w * ju[i], w * jv[i]);
                    gradient[i] += wu * q.du + wv * q.dv;
                    for j in i..D {
                        h[i][j] += wu * ju[j] + wv * jv[j];
                    }
                }
                first += LANES;
            },
        );
        self.normal.cost = cost.sum();
        for i in 0..D {
            self.normal.gradient[i] = gradient[i].sum();
            for j in i..D {
                self.normal.h[i][j] = h[i][j].sum();
            }
        }
    }
}

impl<const D: usize> LineariseJoint<'_, D> {
    /// Jacobians of column and row of the four keypoints from `first` on: rotation (P x gradient), translation, shape.
    #[inline(always)]
    fn rows<U: Unit>(&self, unit: U, q: &Projected<U::Vector>, first: usize) -> ([U::Vector; D], [U::Vector; D]) {
        let zero = unit.zero();
        let ([px, py, pz], a, d) = (q.p, q.a, q.d);
        // Gradients by the point in the camera frame: (a, 0, b) of u and (0, d, e) of v.
        let (b, e) = (zero - q.u * q.inverse, zero - q.v * q.inverse);
        let (mut ju, mut jv) = ([zero; D], [zero; D]);
        (ju[0], ju[1], ju[2], ju[3], ju[5]) = (py * b, pz * a - px * b, zero - py * a, a, b);
        (jv[0], jv[1], jv[2], jv[4], jv[5]) = (py * e - pz * d, zero - px * e, px * d, d, e);
        for m in 0..self.model.eigenvalues().len() {
            for axis in 0..3 {
                let basis = unit.load(self.basis(m, first, axis));
                let r = [0, 1, 2].map(|i| self.summands.pose.r[(i, axis)]);
                ju[6 + m] += (a * r[0] + b * r[2]) * basis;
                jv[6 + m] += (d * r[1] + e * r[2]) * basis;
            }
        }
        (ju, jv)
    }

    /// Displacement of four keypoints in a mode along an axis; lanes beyond the last repeat it.
    #[inline(always)]
    fn basis(&self, mode: usize, first: usize, axis: usize) -> Lanes {
        let last = self.visible.len() - 1;
        let of = |k: usize| self.model.basis(mode, self.visible[k.min(last)] as usize)[axis];
        Lanes([of(first), of(first + 1), of(first + 2), of(first + 3)])
    }
}
