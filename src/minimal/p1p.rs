//! P1P: pose of an upright object from one keypoint, two sides of its 2D box and the tilt (paper, sec. 3.2).
//!
//! In the ground frame let $`k`$ be the keypoint's ray with length one in the bird's-eye view, $`l_C`$ the
//! keypoint's distance there, $`d_c`$ the offset from the keypoint to corner $`c`$ of the 3D box in object axes,
//! $`n_L`$ and $`n_R`$ the inward normals of the planes through the box's sides, and $`\psi`$ the yaw. Corner $`i`$ on
//! the left plane and corner $`j`$ on the right one mean
//!
//! ```math
//! n_L^T \bigl( l_C k + R_y(\psi) d_i \bigr) = 0, \qquad n_R^T \bigl( l_C k + R_y(\psi) d_j \bigr) = 0 ,
//! ```
//!
//! linear in $`(l_C, \cos \psi, \sin \psi)`$. Eliminating $`l_C`$ is eq. (2) of the paper without its angles: no
//! arcsine that loses a sign (erratum: $`\phi_y = \arcsin(v_C \cdot v_K)`$ of Appendix B is a dot product, and
//! $`\theta_L`$, $`\theta_R`$, $`\psi`$ by arccosine lose theirs), and no branch per case: a case is a row $`(i, j)`$.
//!
//! The paper takes the side planes as perpendicular to the ground. Under pitch they are not; their y component
//! adds a known constant, which gives a right-hand side and two roots per case. Feasibility ($`l_C > 0`$, every
//! corner of the 3D box between the planes) replaces Table 1. Erratum: one keypoint does *not* give a unique
//! solution; 2 or 3 are feasible on average and all are returned.

use nalgebra::Vector3;

use super::MinimalSolver;
use crate::geometry::bbox::Bbox;
use crate::geometry::footprint::{Footprint, MAX_CORNERS};
use crate::geometry::math::{norm2, sqrt};
use crate::geometry::pose::Pose;
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::model::shape_model::ShapeModel;
use crate::simd::dispatch::{HotLoop, VectorUnit};
use crate::simd::lanes::{LANES, Lanes, Unit, Vector};
use crate::tuning::FEASIBILITY_TOLERANCE;

/// Which corners may touch the sides of the 2D box.
///
/// ```
/// use groundpose::minimal::p1p::Cases;
/// use groundpose::Options;
///
/// let paper = Options { cases: Cases::Paper, ..Options::default() };
/// assert!(paper.check().is_ok() && Options::default().cases == Cases::All);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cases {
    /// All ordered pairs of footprint corners: always contains the truth.
    All,
    /// The paper's four diagonal cases (Fig. 2): misses views with one visible face (8 % at 10 to 50 m).
    Paper,
}

/// The paper's cases 1 to 4 as (left, right) rows of [`Footprint::rectangle`]; its corners 1 to 4 are rows 0 to 3.
const PAPER_CASES: [(usize, usize); 4] = [(3, 1), (2, 0), (0, 2), (1, 3)];

/// The solver for one object in one view.
///
/// The objects are those of the example of [`MinimalSolver`].
///
/// ```
/// # use groundpose::{Bbox, Camera, Observation, Pose, ShapeModel, Tilt, View};
/// # use groundpose::minimal::MinimalSolver;
/// # let view = View::new(Camera::new(1000.0, 1000.0, 960.0, 540.0)?, Tilt { pitch: -0.2, roll: 0.0 })?;
/// # let bbox_3d = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]];
/// # let points = [[-0.8, -0.3, 1.3], [0.5, -1.4, -1.3], [0.8, -0.3, -1.3]];
/// # let model = ShapeModel::rigid(&points, bbox_3d)?;
/// # let truth = Pose::upright(&view, 0.7, [2.0, 6.0, 15.0].into());
/// # let pixel = |x: [f64; 3]| view.camera.project(&truth.transform(x)).unwrap();
/// # let pixels = points.map(pixel);
/// # let corners = (0..8).map(|c| pixel(core::array::from_fn(|axis| bbox_3d[(c >> axis) & 1][axis])));
/// # let columns: Vec<f64> = corners.map(|corner| corner[0]).collect();
/// # let left = columns.iter().copied().fold(f64::INFINITY, f64::min);
/// # let right = columns.iter().copied().fold(f64::NEG_INFINITY, f64::max);
/// use groundpose::minimal::p1p::{Cases, P1p};
///
/// let bbox = Bbox::new([left, f64::NAN, right, f64::NAN])?;
/// let observation = Observation::new(&pixels, &model)?;
/// let solver = P1p::new(&view, &observation, &bbox, Cases::All);
/// let mut nearest = f64::INFINITY;
/// solver.solve([1], &mut |pose| nearest = nearest.min((pose.t - truth.t).norm()));
/// assert!(nearest < 1e-6, "the truth is one of the solutions");
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub struct P1p<'a> {
    unit: VectorUnit,
    view: &'a View,
    observation: &'a Observation<'a>,
    planes: [Vector3<f64>; 2],
    /// x and z of the corners of the footprint, padded by repeating the last.
    corners: [[f64; MAX_CORNERS]; 2],
    count: usize,
    /// Height (y, object frame) of the corner that touches each plane first, and of the other one.
    touching_y: [f64; 2],
    cases: Cases,
    /// See [`FEASIBILITY_TOLERANCE`].
    tolerance: f64,
}

/// One plane seen from one keypoint: corner `c` lies on it when `a l_C + p_c cos + q_c sin + g = 0`.
struct PlaneEquation {
    a: f64,
    g: f64,
    /// Of every corner, padded as they are.
    p: [f64; MAX_CORNERS],
    q: [f64; MAX_CORNERS],
}

/// Four of the numbers of the corners.
#[inline(always)]
fn group_of<U: Unit>(unit: U, numbers: &[f64; MAX_CORNERS], group: usize) -> U::Vector {
    unit.load(Lanes(numbers.as_chunks().0[group]))
}

impl PlaneEquation {
    #[inline(always)]
    fn new<U: Unit>(unit: U, solver: &P1p, side: usize, ray: &Vector3<f64>, keypoint: [f64; 3]) -> Self {
        let plane = &solver.planes[side];
        let height = solver.touching_y[side] - keypoint[1];
        let (mut p, mut q) = ([0.0; MAX_CORNERS], [0.0; MAX_CORNERS]);
        let (p_groups, q_groups) = (p.as_chunks_mut().0, q.as_chunks_mut().0);
        for group in 0..solver.count.div_ceil(LANES) {
            let dx = group_of(unit, &solver.corners[0], group) - unit.splat(keypoint[0]);
            let dz = group_of(unit, &solver.corners[1], group) - unit.splat(keypoint[2]);
            // R(yaw) d = (c dx + s dz, dy, c dz - s dx)
            p_groups[group] = (dx * plane.x + dz * plane.z).lanes().0;
            q_groups[group] = (dz * plane.x - dx * plane.z).lanes().0;
        }
        Self { a: plane.dot(ray), g: plane.y * height, p, q }
    }

    /// How far the corner that is furthest out is on the inner side, with a tolerance, for both roots.
    #[inline(always)]
    fn margins<U: Unit>(&self, unit: U, count: usize, tolerance: f64, roots: &[Yaw<U::Vector>; 2]) -> [U::Vector; 2] {
        let mut furthest = [unit.splat(f64::INFINITY); 2];
        for (&p, &q) in self.p[..count].iter().zip(&self.q[..count]) {
            let (p, q) = (unit.splat(p), unit.splat(q));
            furthest[0] = (roots[0].cosine * p + roots[0].sine * q).min(furthest[0]);
            furthest[1] = (roots[1].cosine * p + roots[1].sine * q).min(furthest[1]);
        }
        let (slope, g) = (unit.splat(tolerance + self.a), unit.splat(self.g));
        [furthest[0] + (roots[0].distance * slope + g), furthest[1] + (roots[1].distance * slope + g)]
    }
}

/// One root of four cases in memory.
#[derive(Clone, Copy, Default)]
struct Root {
    cosine: Lanes,
    sine: Lanes,
    distance: Lanes,
}

/// One root of four cases.
#[derive(Clone, Copy)]
struct Yaw<V> {
    cosine: V,
    sine: V,
    distance: V,
}

impl<'a> P1p<'a> {
    /// The solver for an object whose left and right box sides are known.
    #[must_use]
    pub fn new(view: &'a View, observation: &'a Observation<'a>, bbox: &Bbox, cases: Cases) -> Self {
        let planes = view.side_planes(bbox.left, bbox.right);
        let model = observation.model();
        let rectangle;
        let footprint = match cases {
            Cases::All => model.footprint(),
            Cases::Paper => {
                rectangle = Footprint::rectangle(model.bbox_3d());
                &rectangle
            }
        };
        let (outline, count) = (footprint.corners(), footprint.corners().len());
        let mut corners = [[0.0; MAX_CORNERS]; 2];
        for c in 0..count.next_multiple_of(LANES) {
            let [x, z] = outline[c.min(count - 1)];
            (corners[0][c], corners[1][c]) = (x, z);
        }
        let (unit, tolerance) = (VectorUnit::detect(), FEASIBILITY_TOLERANCE);
        let touching_y = touching_heights(&planes, model);
        Self { unit, view, observation, planes, corners, count, touching_y, cases, tolerance }
    }

    /// Bits of the right corners of a group that make a case with a left corner.
    #[inline(always)]
    fn cases_of(&self, left: usize, group: usize) -> u32 {
        let corners = (1 << (self.count - group * LANES).min(LANES)) - 1;
        let itself = if left / LANES == group { 1 << (left % LANES) } else { 0 };
        if left < self.count { corners & !itself } else { 0 }
    }

    /// The same on another vector unit.
    #[cfg(all(test, feature = "std"))]
    pub(crate) fn on(mut self, unit: VectorUnit) -> Self {
        self.unit = unit;
        self
    }

    /// The same with less room for noise: corners may lie outside by at most this fraction of the keypoint's distance.
    pub(crate) fn with_tolerance(mut self, fraction: f64) -> Self {
        self.tolerance = self.tolerance.min(fraction);
        self
    }
}

/// Cosine and sine of both yaws with `p cos + q sin + g = 0`; none where they coincide or are complex.
#[inline(always)]
pub(super) fn solve_yaw(p: f64, q: f64, g: f64) -> Option<[(f64, f64); 2]> {
    let norm_squared = p * p + q * q;
    let discriminant = norm_squared - g * g;
    if discriminant <= 0.0 {
        return None;
    }
    let (inverse, root) = (1.0 / norm_squared, sqrt(discriminant));
    Some([1.0, -1.0].map(|sign| ((-g * p + sign * root * q) * inverse, (-g * q - sign * root * p) * inverse)))
}

/// For each plane the height of the 3D box (top or bottom) at which it touches the box: the sign of the
/// normal's y component decides.
pub(super) fn touching_heights(planes: &[Vector3<f64>; 2], model: &ShapeModel) -> [f64; 2] {
    let [min, max] = model.bbox_3d();
    planes.map(|plane| if plane.y > 0.0 { min[1] } else { max[1] })
}

/// Pose of an upright object whose keypoint lies at `distance` (bird's-eye view) along `ray` (paper, eq. 3).
#[inline(always)]
pub(super) fn pose_at(
    view: &View,
    ray: &Vector3<f64>,
    keypoint: [f64; 3],
    cosine: f64,
    sine: f64,
    distance: f64,
) -> Pose {
    let inverse = 1.0 / norm2(cosine, sine);
    let (cosine, sine) = (cosine * inverse, sine * inverse);
    let [x, y, z] = keypoint;
    let turned = Vector3::new(cosine * x + sine * z, y, cosine * z - sine * x);
    Pose::from_yaw(view, cosine, sine, ray * distance - turned)
}

impl MinimalSolver<1> for P1p<'_> {
    fn solve(&self, [index]: [usize; 1], emit: &mut impl FnMut(Pose)) {
        let ray = &self.view.ground_ray(self.observation.keypoints_2d()[index]);
        let keypoint = self.observation.model().mean()[index];
        self.unit.run(Draw { solver: self, ray, keypoint, emit });
    }
}

/// All cases of one keypoint.
struct Draw<'a, F> {
    solver: &'a P1p<'a>,
    ray: &'a Vector3<f64>,
    keypoint: [f64; 3],
    emit: &'a mut F,
}

impl<F: FnMut(Pose)> HotLoop for Draw<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<U: Unit>(mut self, unit: U) {
        let s = self.solver;
        let planes = &[
            PlaneEquation::new(unit, s, 0, self.ray, self.keypoint),
            PlaneEquation::new(unit, s, 1, self.ray, self.keypoint),
        ];
        match s.cases {
            Cases::Paper => self.solve_lefts(unit, planes, PAPER_CASES.map(|(left, right)| (left, 1 << right)), 0),
            Cases::All => {
                for first in (0..s.count).step_by(LANES) {
                    for group in 0..s.count.div_ceil(LANES) {
                        let lefts = [first, first + 1, first + 2, first + 3];
                        self.solve_lefts(unit, planes, lefts.map(|left| (left, s.cases_of(left, group))), group);
                    }
                }
            }
        }
    }
}

/// Bit `l` of a number of four bits at bit `2 l`.
const SPREAD: [u32; 16] = [0, 1, 4, 5, 16, 17, 20, 21, 64, 65, 68, 69, 80, 81, 84, 85];

impl<F: FnMut(Pose)> Draw<'_, F> {
    /// The cases of four left corners with a group of right ones, those with a bit.
    #[inline(always)]
    fn solve_lefts<U: Unit>(
        &mut self,
        unit: U,
        planes: &[PlaneEquation; 2],
        lefts: [(usize, u32); LANES],
        group: usize,
    ) {
        let mut solved = [[Root::default(); 2]; LANES];
        // One bit a solution: left corner, then right corner, then root. One loop over them is easier to predict than
        // a branch for each.
        let mut bits = 0;
        for (k, (left, is_case)) in lefts.into_iter().enumerate() {
            let roots = solve_cases(unit, planes, left, group);
            let feasible = self.feasible(unit, planes, &roots);
            for (solved, root) in solved[k].iter_mut().zip(&roots) {
                *solved =
                    Root { cosine: root.cosine.lanes(), sine: root.sine.lanes(), distance: root.distance.lanes() };
            }
            let spread = |root: usize| SPREAD[(feasible[root] & is_case) as usize & 15] << root;
            bits |= (spread(0) | spread(1)) << (2 * LANES * k);
        }
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let (root, lane) = (&solved[bit / (2 * LANES)][bit % 2], bit / 2 % LANES);
            let (cosine, sine, distance) = (root.cosine.0[lane], root.sine.0[lane], root.distance.0[lane]);
            (self.emit)(pose_at(self.solver.view, self.ray, self.keypoint, cosine, sine, distance));
        }
    }

    /// For both roots one bit for every case whose keypoint is in front and whose corners are all inside.
    #[inline(always)]
    fn feasible<U: Unit>(&self, unit: U, planes: &[PlaneEquation; 2], roots: &[Yaw<U::Vector>; 2]) -> [u32; 2] {
        let (count, tolerance, outside) = (self.solver.count, self.solver.tolerance, unit.splat(-1.0));
        let left = planes[0].margins(unit, count, tolerance, roots);
        let right = planes[1].margins(unit, count, tolerance, roots);
        [
            left[0].min(right[0]).where_positive(roots[0].distance, outside).bits_at_least_zero(),
            left[1].min(right[1]).where_positive(roots[1].distance, outside).bits_at_least_zero(),
        ]
    }
}

/// Both roots of the cases of one left corner with a group of right ones; not numbers where there is none.
#[inline(always)]
fn solve_cases<U: Unit>(
    unit: U,
    [on_left, on_right]: &[PlaneEquation; 2],
    left: usize,
    group: usize,
) -> [Yaw<U::Vector>; 2] {
    let (p_left, q_left) = (on_left.p[left], on_left.q[left]);
    let (p_right, q_right) = (group_of(unit, &on_right.p, group), group_of(unit, &on_right.q, group));
    // l_C eliminated: p cos + q sin + g = 0
    let p = unit.splat(on_right.a * p_left) - p_right * on_left.a;
    let q = unit.splat(on_right.a * q_left) - q_right * on_left.a;
    let g = on_right.a * on_left.g - on_left.a * on_right.g;
    let norm_squared = p * p + q * q;
    let discriminant = norm_squared - unit.splat(g * g);
    // Complex yaws, and those of planes that coincide.
    let inverse = (unit.splat(1.0) / norm_squared).where_positive(discriminant, unit.splat(f64::NAN));
    let root = discriminant.sqrt();
    // Of the two equations the one whose plane is further from the ray gives the distance.
    let (plane, p_plane, q_plane) = if on_left.a.abs() > on_right.a.abs() {
        (on_left, unit.splat(p_left), unit.splat(q_left))
    } else {
        (on_right, p_right, q_right)
    };
    let (offset, per_a) = (unit.splat(plane.g), -1.0 / plane.a);
    let (root_p, root_q, g_p, g_q) = (root * p, root * q, p * g, q * g);
    let zero = unit.zero();
    let yaws = [
        ((root_q - g_p) * inverse, (zero - root_p - g_q) * inverse),
        ((zero - root_q - g_p) * inverse, (root_p - g_q) * inverse),
    ];
    let distances = [
        (p_plane * yaws[0].0 + q_plane * yaws[0].1 + offset) * per_a,
        (p_plane * yaws[1].0 + q_plane * yaws[1].1 + offset) * per_a,
    ];
    [
        Yaw { cosine: yaws[0].0, sine: yaws[0].1, distance: distances[0] },
        Yaw { cosine: yaws[1].0, sine: yaws[1].1, distance: distances[1] },
    ]
}
