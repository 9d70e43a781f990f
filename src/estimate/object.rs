//! One object before the first step: its visible keypoints laid out for the hot loops, and what follows from them and
//! the box alone.

use nalgebra::Vector3;

use crate::error::NoPose;
use crate::estimate::options::Options;
use crate::estimate::workspace::Buffers;
use crate::geometry::bbox::Bbox;
use crate::geometry::math::{sqrt, square};
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::refine::keypoints::Keypoints;
use crate::search::noise::NoiseModel;
use crate::simd::blocks::Block;
use crate::simd::dispatch::VectorUnit;
use crate::simd::lanes::{LANES, Lanes};
use crate::simd::spread::Furthest;
use crate::tuning::{COLLAPSED, EXTENT_LEAVES_OUT, NOISE_PER_THRESHOLD};

/// Extent of the model's keypoints, metres, or of those seen, pixels, below which they are one point.
const SMALLEST_EXTENT: f64 = 1e-6;
/// Distance from a line, as a fraction of its length, below which points are collinear.
const COLLINEAR: f64 = 1e-6;

/// What is known of one object. No step changes it.
pub(crate) struct Object<'a> {
    pub(crate) unit: VectorUnit,
    pub(crate) options: &'a Options,
    pub(crate) view: &'a View,
    pub(crate) observation: &'a Observation<'a>,
    /// Its place in a batch, which chooses its draws.
    pub(crate) index: u64,
    /// The box without the sides that the image border cuts; NaN: unknown.
    pub(crate) usable_bbox: Bbox,
    /// Sum of the keypoints' weights.
    pub(crate) weight_sum: f64,
    /// Pixels.
    pub(crate) inlier_threshold: f64,
    /// What the noise is guessed to be, and where outliers fall.
    pub(crate) noise: NoiseModel,
}

/// Room to work in.
pub(crate) struct Memory<'a> {
    pub(crate) keypoints: Keypoints<'a>,
    /// Order of the draws: positions among the visible keypoints.
    pub(crate) order: &'a mut [u32],
    /// One number per visible keypoint.
    pub(crate) scratch: &'a mut [f64],
    /// Residuals of the returned pose, one per keypoint of the model.
    pub(crate) residuals: &'a mut [f64],
}

impl<'a> Object<'a> {
    /// # Errors
    /// Fewer keypoints than an answer needs, or all on one line.
    pub(crate) fn gather(
        view: &'a View,
        observation: &'a Observation<'a>,
        options: &'a Options,
        index: u64,
        buffers: Buffers<'a>,
    ) -> Result<(Self, Memory<'a>), NoPose> {
        let Buffers { blocks, modes, visible, order, scratch, residuals, .. } = buffers;
        residuals.fill(f64::NAN);
        let (count, weight_sum) = fill(view, observation, options.score_weights, blocks, visible);
        let visible: &'a [u32] = &visible[..count];
        if count < options.min_keypoints {
            return Err(NoPose::TooFewKeypoints);
        }
        let unit = VectorUnit::detect();
        check_spread(unit, observation, &blocks[..count.div_ceil(LANES)])?;
        let scratch = &mut scratch[..count];
        let inlier_threshold = threshold(observation, options, visible, scratch);
        let area = area(observation, visible, scratch);
        // Both are divided by: nothing is left of them when nearly all keypoints are one, or when one is far away.
        if !square(inlier_threshold).is_normal() || !area.is_normal() {
            return Err(NoPose::Degenerate);
        }
        let usable_bbox = view.uncut_bbox(given_bbox(observation));
        let noise = NoiseModel { guess: NOISE_PER_THRESHOLD * inlier_threshold, area };
        let object = Self { unit, options, view, observation, index, usable_bbox, weight_sum, inlier_threshold, noise };
        let blocks = &mut blocks[..count.div_ceil(LANES)];
        let keypoints = Keypoints::of_mean_shape(unit, &view.camera, observation.model(), visible, blocks, modes);
        Ok((object, Memory { keypoints, order: &mut order[..count], scratch, residuals }))
    }

    /// The box as given; unknown sides are NaN.
    pub(crate) fn given_bbox(&self) -> Bbox {
        given_bbox(self.observation)
    }

    /// How large it looks, pixels: the longer side of the box, of which keypoints stand for unknown sides.
    pub(crate) fn size(&self) -> f64 {
        // The side of a square of the same area is never the longer one of a box whose sides are all known.
        self.given_bbox().longer_side().unwrap_or(0.0).max(sqrt(self.noise.area))
    }
}

fn given_bbox(observation: &Observation) -> Bbox {
    let nan = f64::NAN;
    observation.bbox().unwrap_or(Bbox { left: nan, top: nan, right: nan, bottom: nan })
}

/// Visible keypoints into blocks, their indices, scores into weights of at most one; how many there are, and the sum of
/// their weights.
fn fill(
    view: &View,
    observation: &Observation,
    score_weights: bool,
    blocks: &mut [Block],
    indices: &mut [u32],
) -> (usize, f64) {
    let visible = (0..observation.keypoints_2d().len()).filter(|&i| observation.is_visible(i));
    let is_weighed = score_weights && observation.has_scores();
    let highest = if is_weighed { visible.clone().map(|i| observation.score(i)).fold(0.0, f64::max) } else { 1.0 };
    let (mut count, mut weight_sum) = (0, 0.0);
    for i in visible {
        let [x, y, z] = observation.model().mean()[i];
        let weight = if is_weighed { observation.score(i) / highest } else { 1.0 };
        let (block, lane) = (&mut blocks[count / LANES], count % LANES);
        (block.u.0[lane], block.v.0[lane]) = view.camera.centred(observation.keypoints_2d()[i]).into();
        (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (x, y, z);
        block.weight.0[lane] = weight;
        weight_sum += weight;
        indices[count] = i as u32;
        count += 1;
    }
    let first = blocks.first().copied().unwrap_or_default();
    for k in count..count.next_multiple_of(LANES) {
        // An empty lane repeats the first point with weight zero, so that it is never singular.
        let (block, lane) = (&mut blocks[k / LANES], k % LANES);
        (block.u.0[lane], block.v.0[lane]) = (first.u.0[0], first.v.0[0]);
        (block.x.0[lane], block.y.0[lane], block.z.0[lane]) = (first.x.0[0], first.y.0[0], first.z.0[0]);
        block.weight.0[lane] = 0.0;
    }
    (count, weight_sum)
}

/// One point, or points on one line, in the image or on the model, have no pose; nor have points that are as good as one
/// beside the 2D box.
fn check_spread(unit: VectorUnit, observation: &Observation, blocks: &[Block]) -> Result<(), NoPose> {
    let (pixel, point) = (|b: &Block| [b.u, b.v, Lanes::splat(0.0)], |b: &Block| [b.x, b.y, b.z]);
    let longer_side = observation.bbox().and_then(|bbox| bbox.longer_side()).unwrap_or(0.0);
    let collapsed = SMALLEST_EXTENT.max(COLLAPSED * longer_side);
    if is_collinear(unit, blocks, pixel, collapsed) || is_collinear(unit, blocks, point, SMALLEST_EXTENT) {
        return Err(NoPose::Degenerate);
    }
    Ok(())
}

/// Inlier threshold in pixels: the object's own, the option's, or relative to the longer side of the box
/// (without a box, of the extent of the keypoints).
fn threshold(observation: &Observation, options: &Options, visible: &[u32], scratch: &mut [f64]) -> f64 {
    observation.inlier_threshold().or(options.inlier_threshold).unwrap_or_else(|| {
        let longer = observation.bbox().and_then(|b| b.longer_side()).unwrap_or_else(|| {
            let [width, height] = extent(observation, visible, scratch);
            width.max(height)
        });
        options.relative_threshold * longer
    })
}

/// Where outliers fall, pixels squared: the box, or the extent of the keypoints.
fn area(observation: &Observation, visible: &[u32], scratch: &mut [f64]) -> f64 {
    let area = observation.bbox().map(|b| (b.right - b.left) * (b.bottom - b.top));
    area.filter(|area| !area.is_nan()).unwrap_or_else(|| {
        let [width, height] = extent(observation, visible, scratch);
        width * height
    })
}

/// Width and height, pixels, of the middle of the visible keypoints, scaled up to all of them.
fn extent(observation: &Observation, visible: &[u32], values: &mut [f64]) -> [f64; 2] {
    let (n, outer) = (visible.len(), visible.len() / EXTENT_LEAVES_OUT);
    [0, 1].map(|axis| {
        for (value, &i) in values.iter_mut().zip(visible) {
            *value = observation.keypoints_2d()[i as usize][axis];
        }
        values.sort_unstable_by(f64::total_cmp);
        (values[n - 1 - outer] - values[outer]) * (n as f64 / (n - 2 * outer) as f64)
    })
}

/// Whether points are as near to the first as `one_point`, or lie on one line. Empty lanes repeat the first.
fn is_collinear(
    unit: VectorUnit,
    blocks: &[Block],
    position: impl Fn(&Block) -> [Lanes; 3] + Copy,
    one_point: f64,
) -> bool {
    let place = |k: usize| Vector3::from(position(&blocks[k / LANES]).map(|numbers| numbers.0[k % LANES]));
    let (furthest, extent2) = unit.run(Furthest { blocks, position });
    let first = place(0);
    let (axis, limit) = (place(furthest) - first, square(COLLINEAR * extent2));
    let is_on_axis = |k: usize| (place(k) - first).cross(&axis).norm_squared() <= limit;
    extent2 <= square(one_point) || (0..LANES * blocks.len()).all(is_on_axis)
}
