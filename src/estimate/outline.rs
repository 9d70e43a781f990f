//! Where an object ends in a picture: the extent of its prism, a footprint between two heights.

use nalgebra::Vector3;

use crate::geometry::math::square;
use crate::model::shape_model::ShapeModel;

/// Points of an edge, its ends included.
const SAMPLES: usize = 5;

/// The edges of the prism of a shape, object frame, metres.
pub(crate) struct Outline<'a> {
    model: &'a ShapeModel<'a>,
    bbox_3d: [[f64; 3]; 2],
}

impl<'a> Outline<'a> {
    pub(crate) fn of(model: &'a ShapeModel<'a>, coefficients: &[f64]) -> Self {
        Self { model, bbox_3d: model.bbox_3d_of(coefficients) }
    }

    /// Corner `k` of the footprint at the height of the top (0) or the bottom (1).
    fn corner(&self, k: usize, height: usize) -> Vector3<f64> {
        let corners = self.model.footprint().corners();
        let [x, z] = corners[k % corners.len()];
        let along = |axis: usize, value: f64| {
            let (factor, offset) = self.model.footprint_stretch(&self.bbox_3d, axis);
            factor * value + offset
        };
        Vector3::new(along(0, x), self.bbox_3d[height][1], along(2, z))
    }

    /// Left, top, right and bottom in a picture that shows straight edges straight; `None` where a corner is not shown.
    pub(crate) fn extent_of_corners(&self, shown: impl Fn(&Vector3<f64>) -> Option<[f64; 2]>) -> Option<[f64; 4]> {
        let mut extent = Extent::NONE;
        for k in 0..self.model.footprint().corners().len() {
            for height in 0..2 {
                extent.add(shown(&self.corner(k, height))?);
            }
        }
        Some(extent.0)
    }

    /// The same in a picture that bends them; `None` where a part of an edge is not shown.
    pub(crate) fn extent_of_edges(&self, shown: impl Fn(&Vector3<f64>) -> Option<[f64; 2]>) -> Option<[f64; 4]> {
        let mut extent = Extent::NONE;
        for k in 0..self.model.footprint().corners().len() {
            let ends = [
                [self.corner(k, 0), self.corner(k + 1, 0)],
                [self.corner(k, 1), self.corner(k + 1, 1)],
                [self.corner(k, 0), self.corner(k, 1)],
            ];
            for [from, to] in ends {
                let mut points = [[0.0; 2]; SAMPLES];
                for (i, point) in points.iter_mut().enumerate() {
                    *point = shown(&from.lerp(&to, i as f64 / (SAMPLES - 1) as f64))?;
                }
                extent.add_curve(&points);
            }
        }
        Some(extent.0)
    }
}

/// Left, top, right, bottom.
struct Extent([f64; 4]);

impl Extent {
    const NONE: Self = Self([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY]);

    fn add(&mut self, [u, v]: [f64; 2]) {
        let [left, top, right, bottom] = self.0;
        self.0 = [left.min(u), top.min(v), right.max(u), bottom.max(v)];
    }

    /// A smooth curve through points: between three of them, the middle one outermost, it is a parabola.
    fn add_curve(&mut self, points: &[[f64; 2]; SAMPLES]) {
        points.iter().for_each(|&point| self.add(point));
        for axis in 0..2 {
            for three in points.windows(3) {
                let [a, b, c] = [three[0][axis], three[1][axis], three[2][axis]];
                if (b - a) * (b - c) > 0.0 {
                    let vertex = b - square(c - a) / (8.0 * (a - 2.0 * b + c));
                    self.0[axis] = self.0[axis].min(vertex);
                    self.0[axis + 2] = self.0[axis + 2].max(vertex);
                }
            }
        }
    }
}
