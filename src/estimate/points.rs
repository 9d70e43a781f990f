//! The visible keypoints of one object, laid out for the hot loops, and what follows from them and the box alone.

use nalgebra::Vector3;

use crate::error::NoPose;
use crate::estimate::options::Options;
use crate::estimate::workspace::Buffers;
use crate::geometry::camera::Camera;
use crate::geometry::math::square;
use crate::model::observation::Observation;
use crate::simd::blocks::Block;
use crate::simd::lanes::LANES;

/// Extent of the keypoints below which they are one point, pixels or metres.
const SMALLEST_EXTENT: f64 = 1e-6;
/// Distance from a line, as a share of its length, below which points are collinear.
const COLLINEAR: f64 = 1e-6;
/// Share of the keypoints left out at either end when their extent is measured.
const OUTER: usize = 10;

/// Visible keypoints in the caller's buffers.
pub(crate) struct Points<'a> {
    pub(crate) buffers: Buffers<'a>,
    pub(crate) count: usize,
    pub(crate) weight_sum: f64,
    /// Pixels.
    pub(crate) inlier_threshold: f64,
    /// Where an outlier falls, pixels squared.
    pub(crate) outlier_area: f64,
}

impl<'a> Points<'a> {
    /// # Errors
    /// Fewer keypoints than an answer needs, or all on one line.
    pub(crate) fn gather(
        camera: &Camera,
        observation: &Observation,
        options: &Options,
        buffers: Buffers<'a>,
    ) -> Result<Self, NoPose> {
        let mut points = Self { buffers, count: 0, weight_sum: 0.0, inlier_threshold: 0.0, outlier_area: 0.0 };
        points.fill(camera, observation, options.score_weights);
        if points.count < options.min_keypoints {
            return Err(NoPose::TooFewKeypoints);
        }
        points.check_spread(observation)?;
        points.inlier_threshold = points.threshold(observation, options);
        points.outlier_area = points.area(observation);
        // Both are divided by: nothing is left of them when nearly all keypoints are one, or when one is far away.
        if !square(points.inlier_threshold).is_normal() || !points.outlier_area.is_normal() {
            return Err(NoPose::Degenerate);
        }
        Ok(points)
    }

    /// Indices of the visible keypoints in the model.
    pub(crate) fn visible(&self) -> &[u32] {
        &self.buffers.visible[..self.count]
    }

    /// The blocks in use.
    pub(crate) fn blocks(&self) -> &[Block] {
        &self.buffers.blocks[..self.count.div_ceil(LANES)]
    }

    /// Keypoints into blocks; scores into weights of at most one.
    fn fill(&mut self, camera: &Camera, observation: &Observation, score_weights: bool) {
        self.buffers.residuals.fill(f64::NAN);
        let visible = (0..observation.keypoints_2d().len()).filter(|&i| observation.is_visible(i));
        let highest = visible.clone().map(|i| observation.score(i)).fold(0.0, f64::max);
        for i in visible {
            let [x, y, z] = observation.model().mean()[i];
            let weight = if score_weights { observation.score(i) / highest } else { 1.0 };
            let (block, lane) = (&mut self.buffers.blocks[self.count / LANES], self.count % LANES);
            (block.u.0[lane], block.v.0[lane]) = camera.centred(observation.keypoints_2d()[i]).into();
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (x, y, z);
            block.weight.0[lane] = weight;
            self.weight_sum += weight;
            self.buffers.visible[self.count] = i as u32;
            self.count += 1;
        }
        let first = self.buffers.blocks.first().copied().unwrap_or_default();
        for k in self.count..self.count.next_multiple_of(LANES) {
            // An empty lane repeats the first point with weight zero, so that it is never singular.
            let (block, lane) = (&mut self.buffers.blocks[k / LANES], k % LANES);
            (block.u.0[lane], block.v.0[lane]) = (first.u.0[0], first.v.0[0]);
            (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (first.x.0[0], first.y.0[0], first.z.0[0]);
            block.weight.0[lane] = 0.0;
        }
    }

    /// One point, or points on one line, in the image or on the model, have no pose.
    fn check_spread(&self, observation: &Observation) -> Result<(), NoPose> {
        let pixel = |i: u32| {
            let [u, v] = observation.keypoints_2d()[i as usize];
            Vector3::new(u, v, 0.0)
        };
        let point = |i: u32| Vector3::from(observation.model().mean()[i as usize]);
        if is_collinear(self.visible(), pixel) || is_collinear(self.visible(), point) {
            return Err(NoPose::Degenerate);
        }
        Ok(())
    }

    /// Inlier threshold in pixels: the object's own, the option's, or relative to the longer side of the box
    /// (without a box, of the extent of the keypoints).
    fn threshold(&mut self, observation: &Observation, options: &Options) -> f64 {
        observation.inlier_threshold().or(options.inlier_threshold).unwrap_or_else(|| {
            let longer = observation.bbox().and_then(|b| b.longer_side()).unwrap_or_else(|| {
                let [width, height] = self.extent(observation);
                width.max(height)
            });
            options.relative_threshold * longer
        })
    }

    /// The box, or the extent of the keypoints.
    fn area(&mut self, observation: &Observation) -> f64 {
        let area = observation.bbox().map(|b| (b.right - b.left) * (b.bottom - b.top));
        area.filter(|area| !area.is_nan()).unwrap_or_else(|| {
            let [width, height] = self.extent(observation);
            width * height
        })
    }

    /// Width and height, pixels, of the middle 80 % of the visible keypoints, scaled up to all of them.
    fn extent(&mut self, observation: &Observation) -> [f64; 2] {
        let (n, outer) = (self.count, self.count / OUTER);
        [0, 1].map(|axis| {
            let values = &mut self.buffers.scratch[..n];
            for (value, &i) in values.iter_mut().zip(&self.buffers.visible[..n]) {
                *value = observation.keypoints_2d()[i as usize][axis];
            }
            values.sort_unstable_by(f64::total_cmp);
            (values[n - 1 - outer] - values[outer]) * (n as f64 / (n - 2 * outer) as f64)
        })
    }
}

/// Whether points are one point or lie on one line.
fn is_collinear(indices: &[u32], position: impl Fn(u32) -> Vector3<f64>) -> bool {
    let first = position(indices[0]);
    let (mut axis, mut extent2) = (Vector3::zeros(), 0.0);
    for &i in indices {
        let d = position(i) - first;
        let distance2 = d.norm_squared();
        if distance2 > extent2 {
            (axis, extent2) = (d, distance2);
        }
    }
    let limit = square(COLLINEAR * extent2);
    extent2 <= square(SMALLEST_EXTENT)
        || indices.iter().all(|&i| (position(i) - first).cross(&axis).norm_squared() <= limit)
}
