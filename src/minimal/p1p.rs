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
use crate::math::{norm2, sqrt};
use crate::object::{Bbox, Footprint, MAX_CORNERS, ShapeModel};
use crate::observation::Observation;
use crate::pose::{Pose, yaw_rotation};

/// Which corners may touch the sides of the 2D box.
///
/// ```
/// use groundpose::minimal::p1p::Cases;
/// use groundpose::options::Options;
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

/// Corners may lie outside the side planes by this share of the keypoint's distance: room for noise
/// (method: 3 % served well with 2 px).
pub(super) const FEASIBILITY_TOLERANCE: f64 = 0.03;

/// The solver for one object in one view.
///
/// The objects are those of the example of [`MinimalSolver`].
///
/// ```
/// # use groundpose::camera::{Camera, Tilt, View};
/// # use groundpose::minimal::MinimalSolver;
/// # use groundpose::object::{Bbox, ShapeModel};
/// # use groundpose::observation::Observation;
/// # use groundpose::pose::Pose;
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
/// # Ok::<(), groundpose::error::InputError>(())
/// ```
pub struct P1p<'a> {
    view: &'a View,
    observation: &'a Observation<'a>,
    planes: [Vector3<f64>; 2],
    footprint: Footprint,
    /// Height (y, object frame) of the corner that touches each plane first, and of the other one.
    touching_y: [f64; 2],
    cases: Cases,
}

/// One plane seen from one keypoint: corner `c` lies on it when `a l_C + p_c cos + q_c sin + g = 0`.
struct PlaneEquation {
    a: f64,
    g: f64,
    /// `(p, q)` of every corner.
    corners: [(f64, f64); MAX_CORNERS],
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
        let mut corners = [(0.0, 0.0); MAX_CORNERS];
        for (pq, &[x, z]) in corners.iter_mut().zip(footprint.corners()) {
            let (dx, dz) = (x - keypoint[0], z - keypoint[2]);
            // R(yaw) d = (c dx + s dz, dy, c dz - s dx)
            *pq = (plane.x * dx + plane.z * dz, plane.x * dz - plane.z * dx);
        }
        Self { a: plane.dot(ray), g: plane.y * (touching_y - keypoint[1]), corners }
    }

    /// Whether all corners are on the inner side, give or take the tolerance.
    #[inline(always)]
    fn holds(&self, count: usize, cosine: f64, sine: f64, distance: f64) -> bool {
        let limit = -(FEASIBILITY_TOLERANCE + self.a) * distance - self.g;
        self.corners[..count].iter().all(|(p, q)| p * cosine + q * sine >= limit)
    }
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
        Self { view, observation, planes, footprint, touching_y: touching_heights(&planes, model), cases }
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

/// Both solutions of one case, before the test of feasibility: cosine, sine, distance.
#[inline(always)]
fn solve_case(
    on_left: &PlaneEquation,
    on_right: &PlaneEquation,
    left: usize,
    right: usize,
) -> [Option<(f64, f64, f64)>; 2] {
    let ((p_left, q_left), (p_right, q_right)) = (on_left.corners[left], on_right.corners[right]);
    // l_C eliminated: p cos + q sin + g = 0
    let p = on_right.a * p_left - on_left.a * p_right;
    let q = on_right.a * q_left - on_left.a * q_right;
    let g = on_right.a * on_left.g - on_left.a * on_right.g;
    let Some(yaws) = solve_yaw(p, q, g) else { return [None, None] };
    // Of the two equations the one whose plane is further from the ray gives the distance.
    let (plane, (p_plane, q_plane)) =
        if on_left.a.abs() > on_right.a.abs() { (on_left, (p_left, q_left)) } else { (on_right, (p_right, q_right)) };
    yaws.map(|(cosine, sine)| {
        let distance = -(p_plane * cosine + q_plane * sine + plane.g) / plane.a;
        (distance > 0.0).then_some((cosine, sine, distance))
    })
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
    let length = norm2(cosine, sine);
    let r = yaw_rotation(cosine / length, sine / length);
    Pose::from_ground(view, r, ray * distance - r * Vector3::from(keypoint))
}

impl MinimalSolver<1> for P1p<'_> {
    fn solve(&self, [index]: [usize; 1], emit: &mut impl FnMut(Pose)) {
        let ray = self.view.ground_ray(self.observation.keypoints_2d()[index]);
        let keypoint = self.observation.model().mean()[index];
        let equation =
            |k: usize| PlaneEquation::new(&self.planes[k], self.touching_y[k], &self.footprint, &ray, keypoint);
        let (on_left, on_right) = (equation(0), equation(1));
        let count = self.footprint.corners().len();
        let mut try_case = |left: usize, right: usize| {
            for (cosine, sine, distance) in solve_case(&on_left, &on_right, left, right).into_iter().flatten() {
                let feasible =
                    on_left.holds(count, cosine, sine, distance) && on_right.holds(count, cosine, sine, distance);
                if feasible {
                    emit(pose_at(self.view, &ray, keypoint, cosine, sine, distance));
                }
            }
        };
        match self.cases {
            Cases::Paper => PAPER_CASES.iter().for_each(|&(left, right)| try_case(left, right)),
            Cases::All => {
                for left in 0..count {
                    for right in (0..count).filter(|&right| right != left) {
                        try_case(left, right);
                    }
                }
            }
        }
    }
}
