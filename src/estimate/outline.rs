//! Where an object ends in a picture: the extent of its prism, a footprint between two heights.

use nalgebra::Vector3;

use crate::geometry::footprint::MAX_CORNERS;
use crate::geometry::math::square;
use crate::model::shape_model::ShapeModel;

/// The prism of a shape, object frame, metres.
pub(crate) struct Outline<'a> {
    model: &'a ShapeModel<'a>,
    bbox_3d: [[f64; 3]; 2],
}

impl<'a> Outline<'a> {
    pub(crate) fn of(model: &'a ShapeModel<'a>, coefficients: &[f64]) -> Self {
        Self { model, bbox_3d: model.bbox_3d_of(coefficients) }
    }

    /// Left, top, right and bottom in a picture that shows straight edges straight; `None` where a corner is not shown.
    pub(crate) fn extent_of_corners(&self, shown: impl Fn(&Vector3<f64>) -> Option<[f64; 2]>) -> Option<[f64; 4]> {
        let mut extent = Extent::NONE;
        for k in 0..self.count() {
            for height in 0..2 {
                extent.add(shown(&self.corner(k, height))?);
            }
        }
        Some(extent.0)
    }

    /// The same in a picture that bends them, each taken as a parabola; `None` where a part of an edge is not shown.
    pub(crate) fn extent_of_edges(&self, shown: impl Fn(&Vector3<f64>) -> Option<[f64; 2]>) -> Option<[f64; 4]> {
        let (count, mut corners) = (self.count(), [[[0.0; 2]; 2]; MAX_CORNERS]);
        for (k, pair) in corners[..count].iter_mut().enumerate() {
            *pair = [shown(&self.corner(k, 0))?, shown(&self.corner(k, 1))?];
        }
        let mut extent = Extent::NONE;
        for k in 0..count {
            let next = (k + 1) % count;
            // Along the top, along the bottom, down from the top.
            for [(from, above), (to, below)] in [[(k, 0), (next, 0)], [(k, 1), (next, 1)], [(k, 0), (k, 1)]] {
                let middle = self.corner(from, above).lerp(&self.corner(to, below), 0.5);
                extent.add_parabola([corners[from][above], shown(&middle)?, corners[to][below]]);
            }
        }
        Some(extent.0)
    }

    fn count(&self) -> usize {
        self.model.footprint().corners().len()
    }

    /// Corner `k` of the footprint at the height of the top (0) or the bottom (1).
    fn corner(&self, k: usize, height: usize) -> Vector3<f64> {
        let [x, z] = self.model.footprint().corners()[k];
        let stretched = |axis: usize, value: f64| {
            let (factor, offset) = self.model.footprint_stretch(&self.bbox_3d, axis);
            factor * value + offset
        };
        Vector3::new(stretched(0, x), self.bbox_3d[height][1], stretched(2, z))
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

    /// A curve through two ends and the point between them.
    fn add_parabola(&mut self, points: [[f64; 2]; 3]) {
        points.into_iter().for_each(|point| self.add(point));
        for axis in 0..2 {
            let [from, middle, to] = points.map(|point| point[axis]);
            // It turns back between the ends.
            if (to - from).abs() < 2.0 * (from - 2.0 * middle + to).abs() {
                let vertex = middle - square(to - from) / (8.0 * (from - 2.0 * middle + to));
                self.0[axis] = self.0[axis].min(vertex);
                self.0[axis + 2] = self.0[axis + 2].max(vertex);
            }
        }
    }
}
