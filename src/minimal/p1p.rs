//! P1P: pose of an upright object from one keypoint, two sides of its 2D box and the tilt (paper, sec. 3.2).
//!
//! In the ground frame let `k` be the keypoint's ray with length one in the bird's-eye view, `l_C` the
//! keypoint's distance there, `d_c` the offset from the keypoint to corner `c` of the 3D box in object axes and
//! `n_L`, `n_R` the inward normals of the planes through the box's sides. Corner `i` on the left plane and
//! corner `j` on the right one mean
//!
//! ```text
//! n_L . (l_C k + R(yaw) d_i) = 0,    n_R . (l_C k + R(yaw) d_j) = 0,
//! ```
//!
//! linear in `(l_C, cos yaw, sin yaw)`. Eliminating `l_C` is eq. (2) of the paper without its angles: no
//! arcsine that loses a sign (erratum: `phi_y = arcsin(v_C . v_K)` of Appendix B is a dot product, and
//! `theta_L`, `theta_R`, `psi` by arccosine lose theirs), and no branch per case: a case is a row `(i, j)`.
//!
//! The paper takes the side planes as perpendicular to the ground. Under pitch they are not; their y component
//! adds a known constant, which gives a right-hand side and two roots per case. Feasibility (`l_C > 0`, every
//! corner of the 3D box between the planes) replaces Table 1. Erratum: one keypoint does *not* give a unique
//! solution; 2 or 3 are feasible on average and all are returned.

use nalgebra::Vector3;

use super::MinimalSolver;
use crate::camera::View;
use crate::lanes::{LANES, Lanes, Unit, Vector};
use crate::math::{norm2, sqrt};
use crate::object::{Bbox, Footprint, MAX_CORNERS, ShapeModel};
use crate::observation::Observation;
use crate::pose::Pose;
use crate::simd::{HotLoop, VectorUnit};

/// Which corners may touch the sides of the 2D box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cases {
    /// All ordered pairs of footprint corners: always contains the truth.
    All,
    /// The paper's four diagonal cases (Fig. 2): misses views with one visible face (8 % at 10 to 50 m).
    Paper,
}

/// The paper's cases 1 to 4 as (left, right) rows of [`Footprint::rectangle`]; its corners 1 to 4 are rows 0 to 3.
const PAPER_CASES: [(usize, usize); 4] = [(3, 1), (2, 0), (0, 2), (1, 3)];

/// Corners may lie outside the side planes by this share of the keypoint's distance: room for noise
/// (method: 3 % served well with 2 px).
pub(super) const FEASIBILITY_TOLERANCE: f64 = 0.03;

/// The solver for one object in one view.
pub struct P1p<'a> {
    unit: VectorUnit,
    view: &'a View,
    observation: &'a Observation<'a>,
    planes: [Vector3<f64>; 2],
    footprint: Footprint,
    /// Height (y, object frame) of the corner that touches each plane first, and of the other one.
    touching_y: [f64; 2],
    cases: Cases,
}

/// Most groups of [`LANES`] corners.
const GROUPS: usize = MAX_CORNERS / LANES;

/// One plane seen from one keypoint: corner `c` lies on it when `a l_C + p_c cos + q_c sin + g = 0`.
struct PlaneEquation {
    a: f64,
    g: f64,
    /// Of every corner, padded by repeating the last.
    p: [Lanes; GROUPS],
    q: [Lanes; GROUPS],
}

impl PlaneEquation {
    #[inline(always)]
    fn new(
        plane: &Vector3<f64>,
        touching_y: f64,
        footprint: &Footprint,
        ray: &Vector3<f64>,
        keypoint: [f64; 3],
    ) -> Self {
        let (mut p, mut q) = ([Lanes::splat(0.0); GROUPS], [Lanes::splat(0.0); GROUPS]);
        let corners = footprint.corners();
        for c in 0..corners.len().next_multiple_of(LANES) {
            let [x, z] = corners[c.min(corners.len() - 1)];
            let (dx, dz) = (x - keypoint[0], z - keypoint[2]);
            // R(yaw) d = (c dx + s dz, dy, c dz - s dx)
            p[c / LANES].0[c % LANES] = plane.x * dx + plane.z * dz;
            q[c / LANES].0[c % LANES] = plane.x * dz - plane.z * dx;
        }
        Self { a: plane.dot(ray), g: plane.y * (touching_y - keypoint[1]), p, q }
    }

    /// `(p, q)` of a corner.
    #[inline(always)]
    fn corner(&self, c: usize) -> (f64, f64) {
        (self.p[c / LANES].0[c % LANES], self.q[c / LANES].0[c % LANES])
    }

    /// By how much the corner that is furthest out is on the inner side, tolerance included.
    #[inline(always)]
    fn margin<U: Unit>(&self, unit: U, count: usize, yaw: Yaw<U::Vector>, distance: U::Vector) -> U::Vector {
        let mut furthest = unit.splat(f64::INFINITY);
        for c in 0..count {
            let (p, q) = self.corner(c);
            furthest = (yaw.cosine * p + yaw.sine * q).min(furthest);
        }
        furthest + (distance * (FEASIBILITY_TOLERANCE + self.a) + unit.splat(self.g))
    }
}

/// Yaws of four cases.
#[derive(Clone, Copy)]
struct Yaw<V> {
    cosine: V,
    sine: V,
}

impl<'a> P1p<'a> {
    /// The solver for an object whose left and right box sides are known.
    #[must_use]
    pub fn new(view: &'a View, observation: &'a Observation<'a>, bbox: &Bbox, cases: Cases) -> Self {
        let planes = view.side_planes(bbox.left, bbox.right);
        let model = observation.model();
        let footprint = match cases {
            Cases::All => *model.footprint(),
            Cases::Paper => Footprint::rectangle(model.bbox_3d()),
        };
        let unit = VectorUnit::detect();
        Self { unit, view, observation, planes, footprint, touching_y: touching_heights(&planes, model), cases }
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
        let ray = self.view.ground_ray(self.observation.keypoints_2d()[index]);
        let keypoint = self.observation.model().mean()[index];
        let equation =
            |k: usize| PlaneEquation::new(&self.planes[k], self.touching_y[k], &self.footprint, &ray, keypoint);
        let planes = &[equation(0), equation(1)];
        let count = self.footprint.corners().len();
        let mut solve_left = |left: usize, is_case: &dyn Fn(usize) -> bool| {
            for group in 0..count.div_ceil(LANES) {
                let solutions = self.unit.run(CasesOfLeft { planes, count, left, group });
                for lane in 0..LANES {
                    let right = group * LANES + lane;
                    if right >= count || !is_case(right) {
                        continue;
                    }
                    for solution in &solutions {
                        if solution.margin.0[lane] >= 0.0 {
                            let (cosine, sine) = (solution.cosine.0[lane], solution.sine.0[lane]);
                            let distance = solution.distance.0[lane];
                            emit(pose_at(self.view, &ray, keypoint, cosine, sine, distance));
                        }
                    }
                }
            }
        };
        match self.cases {
            Cases::Paper => PAPER_CASES.iter().for_each(|&(left, right)| solve_left(left, &|c| c == right)),
            Cases::All => (0..count).for_each(|left| solve_left(left, &|c| c != left)),
        }
    }
}

/// One root of four cases: a left corner and four right ones.
#[derive(Clone, Copy, Default)]
struct Solutions {
    cosine: Lanes,
    sine: Lanes,
    distance: Lanes,
    /// Negative, or not a number, where the case has no solution or a corner is outside.
    margin: Lanes,
}

/// Both roots of the cases of one left corner with a group of right ones.
struct CasesOfLeft<'a> {
    planes: &'a [PlaneEquation; 2],
    count: usize,
    left: usize,
    group: usize,
}

impl HotLoop for CasesOfLeft<'_> {
    type Output = [Solutions; 2];

    #[inline(always)]
    fn run<U: Unit>(self, unit: U) -> [Solutions; 2] {
        let [on_left, on_right] = self.planes;
        let (p_left, q_left) = on_left.corner(self.left);
        let (p_right, q_right) = (unit.load(on_right.p[self.group]), unit.load(on_right.q[self.group]));
        // l_C eliminated: p cos + q sin + g = 0
        let p = unit.splat(on_right.a * p_left) - p_right * on_left.a;
        let q = unit.splat(on_right.a * q_left) - q_right * on_left.a;
        let g = on_right.a * on_left.g - on_left.a * on_right.g;
        let norm_squared = p * p + q * q;
        let discriminant = norm_squared - unit.splat(g * g);
        // Complex yaws, and those of planes that coincide, are not numbers: no margin is as large as zero.
        let inverse = (unit.splat(1.0) / norm_squared).where_positive(discriminant, unit.splat(f64::NAN));
        let root = discriminant.sqrt();
        // Of the two equations the one whose plane is further from the ray gives the distance.
        let is_left = on_left.a.abs() > on_right.a.abs();
        let (plane, p_plane, q_plane) = if is_left {
            (on_left, unit.splat(p_left), unit.splat(q_left))
        } else {
            (on_right, p_right, q_right)
        };
        let (zero, per_a) = (unit.zero(), -1.0 / plane.a);
        let mut solutions = [Solutions::default(); 2];
        for (solution, sign) in solutions.iter_mut().zip([1.0, -1.0]) {
            let root = root * sign;
            let cosine = (root * q - p * g) * inverse;
            let sine = (zero - (root * p + q * g)) * inverse;
            let yaw = Yaw { cosine, sine };
            let distance = (p_plane * cosine + q_plane * sine + unit.splat(plane.g)) * per_a;
            let margins = (
                on_left.margin(unit, self.count, yaw, distance),
                on_right.margin(unit, self.count, yaw, distance),
            );
            let margin = margins.0.min(margins.1).where_positive(distance, unit.splat(-1.0));
            *solution = Solutions {
                cosine: cosine.lanes(),
                sine: sine.lanes(),
                distance: distance.lanes(),
                margin: margin.lanes(),
            };
        }
        solutions
    }
}
