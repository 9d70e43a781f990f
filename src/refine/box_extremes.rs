//! The corners of a 3D box that touch the sides of its 2D box.

use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};
use crate::simd::projection::centred;

/// Where a side of the projected box is, pixels relative to the principal point, and the corner there, metres.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Extreme {
    pub(crate) coordinate: f64,
    pub(crate) corner: [f64; 3],
}

/// Left, top, right and bottom of the projection of a prism: a footprint between two heights. Nothing when a corner
/// is behind the camera.
pub(crate) struct Outermost<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) pose: &'a Pose,
    /// Corners of the footprint, x and z in object axes.
    pub(crate) footprint: &'a [[f64; 2]],
    /// What they are stretched by and then moved by, along x and z.
    pub(crate) factor: [f64; 2],
    pub(crate) offset: [f64; 2],
    /// Top and bottom.
    pub(crate) heights: [f64; 2],
}

const COUNT: Lanes = Lanes([0.0, 1.0, 2.0, 3.0]);

impl HotLoop for Outermost<'_> {
    type Output = Option<[Extreme; 4]>;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> Self::Output {
        let (zero, infinity) = (unit.zero(), unit.splat(f64::INFINITY));
        let (r, t) = (&self.pose.r, &self.pose.t);
        // Coordinates of right and bottom are negated, so that the outermost is always the smallest.
        let (mut best, mut index) = ([infinity; 4], [zero; 4]);
        let mut nearest = infinity;
        for (k, corners) in self.footprint.chunks(LANES).enumerate() {
            let x = unit.load(coordinates(corners, 0)) * self.factor[0] + unit.splat(self.offset[0]);
            let z = unit.load(coordinates(corners, 1)) * self.factor[1] + unit.splat(self.offset[1]);
            for half in 0..2 {
                let y = self.heights[half];
                let (px, py, pz) = (
                    x * r[(0, 0)] + z * r[(0, 2)] + unit.splat(t.x + r[(0, 1)] * y),
                    x * r[(1, 0)] + z * r[(1, 2)] + unit.splat(t.y + r[(1, 1)] * y),
                    x * r[(2, 0)] + z * r[(2, 2)] + unit.splat(t.z + r[(2, 1)] * y),
                );
                nearest = nearest.min(pz);
                let [u, v] = centred(unit, self.camera, [px, py, pz]);
                let number = unit.load(COUNT) + unit.splat((LANES * (2 * k + half)) as f64);
                let coordinates = [u, v, zero - u, zero - v];
                for side in 0..4 {
                    index[side] = number.where_positive(best[side] - coordinates[side], index[side]);
                    best[side] = coordinates[side].min(best[side]);
                }
            }
        }
        let [a, b, c, d] = nearest.lanes().0;
        if !(a > 0.0 && b > 0.0 && c > 0.0 && d > 0.0) {
            return None;
        }
        let mut extremes = [Extreme::default(); 4];
        for side in 0..4 {
            let (coordinate, number) = smallest(best[side].lanes(), index[side].lanes());
            let (group, lane) = (number / LANES, number % LANES);
            let [x, z] = self.footprint[(group / 2 * LANES + lane).min(self.footprint.len() - 1)];
            let (x, z) = (x * self.factor[0] + self.offset[0], z * self.factor[1] + self.offset[1]);
            extremes[side].corner = [x, self.heights[group % 2], z];
            extremes[side].coordinate = if side < 2 { coordinate } else { -coordinate };
        }
        Some(extremes)
    }
}

/// One coordinate of up to four corners; lanes beyond the last one repeat it.
#[inline(always)]
fn coordinates(corners: &[[f64; 2]], axis: usize) -> Lanes {
    let last = corners.len() - 1;
    Lanes([corners[0][axis], corners[last.min(1)][axis], corners[last.min(2)][axis], corners[last.min(3)][axis]])
}

/// The smallest lane, the first of equals, and its index.
#[inline(always)]
fn smallest(values: Lanes, indices: Lanes) -> (f64, usize) {
    let mut smallest = (values.0[0], indices.0[0]);
    for l in 1..LANES {
        if values.0[l] < smallest.0 {
            smallest = (values.0[l], indices.0[l]);
        }
    }
    (smallest.0, smallest.1 as usize)
}
