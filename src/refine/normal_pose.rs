//! Sums over keypoints, four at a time: the robust cost of a pose, its gradient and its normal equations.

use crate::geometry::camera::Camera;
use crate::geometry::pose::Pose;
use crate::refine::box_sides::{SPEAKS_OF_COLUMN, SPEAKS_OF_ROW, Sides};
use crate::refine::kernels::{Kernel, Rho, WithRho};
use crate::refine::normal::Normal;
use crate::simd::blocks::Block;
use crate::simd::dispatch::HotLoop;
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};
use crate::simd::projection::Projected;

/// What a cost is summed over.
#[derive(Clone, Copy)]
pub(crate) struct Summands<'a> {
    pub(crate) blocks: &'a [Block],
    pub(crate) sides: Option<&'a Sides>,
    pub(crate) camera: &'a Camera,
    pub(crate) pose: &'a Pose,
    pub(crate) kernel: Kernel,
}

impl Summands<'_> {
    /// Calls `add` with everything that has a residual: where it is, its cost, the weights of its column and row.
    #[inline(always)]
    pub(crate) fn each<U: Unit>(&self, unit: U, add: impl Add<U::Vector>) {
        self.kernel.with(Each { summands: self, unit, add });
    }

    #[inline(always)]
    fn project<U: Unit>(&self, unit: U, block: &Block) -> Projected<U::Vector> {
        Projected::new(unit, self.camera, self.pose, block)
    }
}

/// What is done with four points.
pub(crate) trait Add<V>: FnMut(Projected<V>, V, [V; 2]) {}
impl<V, F: FnMut(Projected<V>, V, [V; 2])> Add<V> for F {}

/// [`Summands::each`] once the kernel is known.
struct Each<'a, U, F> {
    summands: &'a Summands<'a>,
    unit: U,
    add: F,
}

impl<U: Unit, F: Add<U::Vector>> WithRho for Each<'_, U, F> {
    #[inline(always)]
    fn run(self, kernel: impl Rho) {
        let Self { summands, unit, mut add } = self;
        let (zero, infinity) = (unit.zero(), unit.splat(f64::INFINITY));
        for block in summands.blocks {
            let active = unit.load(block.active);
            let q = summands.project(unit, block);
            let (rho, weight) = kernel.lanes(unit, (q.du * q.du + q.dv * q.dv).where_positive(q.depth, infinity));
            let cost = (rho * active).where_positive(active, zero);
            let w = (weight * active).where_positive(q.depth, zero);
            add(q, cost, [w, w]);
        }
        if let Some(sides) = summands.sides {
            let (column, row) = (unit.load(SPEAKS_OF_COLUMN), unit.load(SPEAKS_OF_ROW));
            let known = unit.load(sides.block.weight);
            let q = summands.project(unit, &sides.block);
            let (rho, weight) = sides.kernel().lanes(unit, q.du * q.du * column + q.dv * q.dv * row);
            let w = weight * known * sides.scale;
            add(q, rho * known * sides.scale, [w * column, w * row]);
        }
    }
}

/// The cost alone.
pub(crate) struct Cost<'a>(pub(crate) Summands<'a>);

impl HotLoop for Cost<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> f64 {
        let mut sum = unit.zero();
        self.0.each(
            unit,
            #[inline(always)]
            |_, cost, _| sum += cost,
        );
        sum.sum()
    }
}

/// Cost, gradient and normal equations of the six unknowns of a pose, into the leading ones.
pub(crate) struct Linearise<'a, const D: usize> {
    pub(crate) summands: Summands<'a>,
    pub(crate) normal: &'a mut Normal<D>,
}

impl<const D: usize> HotLoop for Linearise<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) {
        let Summands { blocks, camera, .. } = self.summands;
        let mut sums = [unit.zero(); SUMS];
        let mut one_by_one = self.summands;
        if blocks.len() > FEW_BLOCKS {
            one_by_one.blocks = &[];
            let mut weighed = Weighed::NONE;
            for blocks in blocks.chunks(BLOCKS) {
                Summands { blocks, sides: None, ..self.summands }.each(
                    unit,
                    #[inline(always)]
                    |q, cost, [w, _]| {
                        sums[SUMS - 1] += cost;
                        weighed.push(unit, &q, w);
                    },
                );
                weighed.add_vectors(unit, camera, &mut sums);
            }
            weighed.add_rest(unit, camera, &mut sums);
        }
        let mut held = [(Projected::none(unit.zero()), [unit.zero(); 2]); AT_A_TIME + 1];
        let (blocks, last) = (one_by_one.blocks, one_by_one.blocks.len().saturating_sub(1) / AT_A_TIME);
        for group in 0..=last {
            let rest = blocks.get(group * AT_A_TIME..).unwrap_or_default();
            let blocks = &rest[..rest.len().min(AT_A_TIME)];
            let sides = if group == last { one_by_one.sides } else { None };
            let mut free = held.iter_mut();
            Summands { blocks, sides, ..one_by_one }.each(
                unit,
                #[inline(always)]
                |q, cost, w| {
                    sums[SUMS - 1] += cost;
                    if let Some(place) = free.next() {
                        *place = (q, w);
                    }
                },
            );
            for (q, w) in &held[..blocks.len() + usize::from(sides.is_some())] {
                add_points(q, *w, &mut sums);
            }
        }
        put_in_order(&add_up(&sums), self.normal);
    }
}

/// Up to so many blocks, points with a weight are not brought together: it costs more than it saves.
const FEW_BLOCKS: usize = 16;
/// Blocks that are weighed before they are summed, and the sides of the box with the last: the sums do not wait for one
/// division after the other.
const AT_A_TIME: usize = 3;
/// The same where points are brought together.
const BLOCKS: usize = 4;
/// Numbers of a point, and room for each: of the points of these blocks, of less than a vector left over, and of a vector
/// of which only the front counts.
const NUMBERS: usize = 9;
const ROOM: usize = BLOCKS * LANES + 2 * LANES;
const WEIGHT: usize = 8;

/// Points with a weight, side by side: an outlier's place in its block costs nothing in the sums that follow.
struct Weighed {
    /// Rotated model point, pixel, inverse depth, residuals, weight: of the first point, the second ...
    numbers: [f64; NUMBERS * ROOM],
    count: usize,
}

impl Weighed {
    const NONE: Self = Self { numbers: [0.0; NUMBERS * ROOM], count: 0 };

    /// Four points from place `k` on, number by number.
    #[inline(always)]
    fn at(&mut self, k: usize) -> Option<&mut [f64; (NUMBERS - 1) * ROOM + LANES]> {
        self.numbers.get_mut(k..)?.first_chunk_mut()
    }

    /// Adds those of four points that have a weight.
    #[inline(always)]
    fn push<U: Unit>(&mut self, unit: U, q: &Projected<U::Vector>, weight: U::Vector) {
        let bits = (weight - unit.splat(f64::MIN_POSITIVE)).bits_at_least_zero();
        if bits == 0 {
            return;
        }
        let [px, py, pz] = q.p;
        let numbers = [px, py, pz, q.u, q.v, q.inverse, q.du, q.dv, weight];
        if let Some(place) = self.at(self.count) {
            for k in 0..NUMBERS {
                place[k * ROOM..k * ROOM + LANES].copy_from_slice(&unit.packed(numbers[k], bits).lanes().0);
            }
        }
        self.count += bits.count_ones() as usize;
    }

    /// Adds the points from place `k` on to the sums.
    #[inline(always)]
    fn add<U: Unit>(&mut self, unit: U, camera: &Camera, k: usize, sums: &mut [U::Vector; SUMS]) {
        let Some(place) = self.at(k) else { return };
        let mut n = [unit.zero(); NUMBERS];
        for k in 0..NUMBERS {
            n[k] = unit.load(Lanes([place[k * ROOM], place[k * ROOM + 1], place[k * ROOM + 2], place[k * ROOM + 3]]));
        }
        let [px, py, pz, u, v, inverse, du, dv, w] = n;
        let (a, d) = (inverse * camera.fx, inverse * camera.fy);
        add_points(&Projected { p: [px, py, pz], depth: pz, inverse, a, d, u, v, du, dv }, [w, w], sums);
    }

    /// Adds whole vectors of points to the sums; what is left over comes to the front.
    #[inline(always)]
    fn add_vectors<U: Unit>(&mut self, unit: U, camera: &Camera, sums: &mut [U::Vector; SUMS]) {
        let whole = self.count / LANES * LANES;
        for k in (0..whole).step_by(LANES) {
            self.add(unit, camera, k, sums);
        }
        if whole > 0 {
            for k in 0..NUMBERS {
                self.numbers.copy_within(k * ROOM + whole..k * ROOM + whole + LANES, k * ROOM);
            }
        }
        self.count -= whole;
    }

    /// Adds less than a vector, filled up by its first point without a weight.
    #[inline(always)]
    fn add_rest<U: Unit>(&mut self, unit: U, camera: &Camera, sums: &mut [U::Vector; SUMS]) {
        if self.count > 0 {
            for k in 0..NUMBERS {
                let first = if k == WEIGHT { 0.0 } else { self.numbers[k * ROOM] };
                self.numbers[k * ROOM + self.count..k * ROOM + LANES].fill(first);
            }
            self.add(unit, camera, 0, sums);
        }
    }
}

/// The sum of every vector, of which there are a multiple of four.
#[inline(always)]
pub(crate) fn add_up<V: Vector, const N: usize>(vectors: &[V; N]) -> [f64; N] {
    let mut totals = [0.0; N];
    for (totals, vectors) in totals.as_chunks_mut().0.iter_mut().zip(vectors.as_chunks().0) {
        *totals = V::sums(*vectors);
    }
    totals
}

/// Gradient, normal equations without the zero between the translations along x and y, cost.
pub(crate) const SUMS: usize = 28;

/// Adds four points to gradient and normal equations, up to the signs of [`put_in_order`].
///
/// With `G` the gradients of a residual by the point in the camera frame, (a, 0, b) of a column and (0, d, e) of a
/// row, `M = sum w G^T G` is the block of the translation, `[P]x M` couples the rotation with it, and
/// `[P]x M [P]x^T` is the block of the rotation; `P` is the rotated model point.
#[inline(always)]
pub(crate) fn add_points<V: Vector>(q: &Projected<V>, [wc, wr]: [V; 2], sums: &mut [V; SUMS]) {
    let [px, py, pz] = q.p;
    // -b and -e
    let (b, e) = (q.u * q.inverse, q.v * q.inverse);
    let (wa, wb, wd, we) = (wc * q.a, wc * b, wr * q.d, wr * e);
    let (m0, m1, m2) = (wa * q.du, wd * q.dv, wb * q.du + we * q.dv);
    sums[0] += py * m2 + pz * m1;
    sums[1] += pz * m0 + px * m2;
    sums[2] += px * m1 - py * m0;
    sums[3] += m0;
    sums[4] += m1;
    sums[5] += m2;
    let (m00, m02, m11, m12, m22) = (wa * q.a, wa * b, wd * q.d, wd * e, wb * b + we * e);
    sums[6] += m00;
    sums[7] += m02;
    sums[8] += m11;
    sums[9] += m12;
    sums[10] += m22;
    let (n00, n01, n02) = (py * m02, py * m12 + pz * m11, py * m22 + pz * m12);
    sums[11] += n00;
    sums[12] += n01;
    sums[13] += n02;
    sums[14] += py * n02 + pz * n01;
    sums[15] += pz * n00 + px * n02;
    sums[16] += py * n00 - px * n01;
    let (n10, n11, n12) = (pz * m00 + px * m02, px * m12, pz * m02 + px * m22);
    sums[17] += n10;
    sums[18] += n11;
    sums[19] += n12;
    sums[20] += pz * n10 + px * n12;
    sums[21] += px * n11 - py * n10;
    let (n20, n21) = (py * m00, px * m11);
    sums[22] += n20;
    sums[23] += n21;
    sums[24] += n00 - n11;
    sums[25] += px * n21 + py * n20;
}

/// The sums of [`add_points`] with their signs, where they belong.
#[inline(always)]
pub(crate) fn put_in_order<const D: usize>(s: &[f64; SUMS], normal: &mut Normal<D>) {
    normal.cost = s[SUMS - 1];
    normal.gradient[..6].copy_from_slice(&[-s[0], s[1], s[2], s[3], s[4], -s[5]]);
    let h = &mut normal.h;
    h[0][..6].copy_from_slice(&[s[14], -s[15], s[16], -s[11], -s[12], s[13]]);
    h[1][1..6].copy_from_slice(&[s[20], s[21], s[17], s[18], -s[19]]);
    h[2][2..6].copy_from_slice(&[s[25], -s[22], s[23], s[24]]);
    h[3][3..6].copy_from_slice(&[s[6], 0.0, -s[7]]);
    h[4][4..6].copy_from_slice(&[s[8], -s[9]]);
    h[5][5] = s[10];
}
