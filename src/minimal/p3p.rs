//! P3P: pose from three keypoints, without any prior (what the paper compares with, RNSC-P3P).
//!
//! The depths $`d_i`$ along unit rays $`m_i`$ satisfy, for each pair of keypoints,
//!
//! ```math
//! d_i^2 + d_j^2 - 2 \, d_i d_j \, m_i^T m_j = \lVert X_i - X_j \rVert^2 .
//! ```
//!
//! Two combinations of the three equations are homogeneous: two conics whose common points are the solutions. One
//! degenerate member of their pencil (a cubic in one unknown) is a pair of lines, and each line meets a conic in
//! two points at most. This is the construction of Persson and Nordberg, "Lambda Twist" (ECCV 2018), with the
//! lines taken from the adjugate as in Ding et al., "Revisiting the P3P Problem" (CVPR 2023): of the real members
//! the one whose lines are best separated is split, which avoids the failures near a double root. Newton's method
//! on the three equations then removes the rounding errors.

use nalgebra::{Matrix3, Vector3};

use super::MinimalSolver;
use crate::geometry::camera::Camera;
use crate::geometry::math::{atan2, copysign, cos, sqrt};
use crate::geometry::pose::Pose;
use crate::model::observation::Observation;

/// The solver for one object.
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
/// use groundpose::minimal::p3p::P3p;
///
/// let observation = Observation::new(&pixels, &model)?;
/// let solver = P3p::new(&view.camera, &observation);
/// let mut nearest = f64::INFINITY;
/// solver.solve([0, 1, 2], &mut |pose| nearest = nearest.min((pose.t - truth.t).norm()));
/// assert!(nearest < 1e-6, "the truth is one of the solutions");
/// # Ok::<(), groundpose::InputError>(())
/// ```
pub struct P3p<'a> {
    camera: &'a Camera,
    observation: &'a Observation<'a>,
}

impl<'a> P3p<'a> {
    /// The solver.
    #[must_use]
    pub fn new(camera: &'a Camera, observation: &'a Observation<'a>) -> Self {
        Self { camera, observation }
    }
}

impl MinimalSolver<3> for P3p<'_> {
    fn solve(&self, sample: [usize; 3], emit: &mut impl FnMut(Pose)) {
        let model = self.observation.model().mean();
        let rays = sample.map(|i| self.camera.ray(self.observation.keypoints_2d()[i]));
        solve_p3p(sample.map(|i| Vector3::from(model[i])), rays, emit);
    }
}

/// Pairs of points, and the point that is left.
const PAIRS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// The three equations of the depths.
struct Depths {
    cosines: [f64; 3],
    squared_lengths: [f64; 3],
}

impl Depths {
    /// Symmetric matrix of the quadratic form of pair `k`.
    fn form(&self, k: usize) -> Matrix3<f64> {
        let (i, j) = PAIRS[k];
        let mut q = Matrix3::zeros();
        q[(i, i)] = 1.0;
        q[(j, j)] = 1.0;
        q[(i, j)] = -self.cosines[k];
        q[(j, i)] = -self.cosines[k];
        q
    }

    /// Two steps of Newton's method: quadratic convergence from a solution with rounding errors.
    fn polished(&self, mut d: Vector3<f64>) -> Vector3<f64> {
        for _ in 0..2 {
            let mut f = Vector3::zeros();
            let mut jacobian = Matrix3::zeros();
            for (k, &(i, j)) in PAIRS.iter().enumerate() {
                let c = self.cosines[k];
                f[k] = d[i] * d[i] + d[j] * d[j] - 2.0 * d[i] * d[j] * c - self.squared_lengths[k];
                jacobian[(k, i)] = 2.0 * (d[i] - d[j] * c);
                jacobian[(k, j)] = 2.0 * (d[j] - d[i] * c);
            }
            let Some(inverse) = jacobian.try_inverse() else {
                break;
            };
            let step = inverse * f;
            if step.norm_squared() > 0.01 * d.norm_squared() {
                break;
            }
            d -= step;
        }
        d
    }
}

/// Poses from three model points and their rays in the camera frame (any length); at most four.
pub(crate) fn solve_p3p(points: [Vector3<f64>; 3], rays: [Vector3<f64>; 3], emit: &mut impl FnMut(Pose)) {
    let m = rays.map(|r| r.normalize());
    let depths = Depths {
        cosines: PAIRS.map(|(i, j)| m[i].dot(&m[j])),
        squared_lengths: PAIRS.map(|(i, j)| (points[i] - points[j]).norm_squared()),
    };
    let [a12, a13, a23] = depths.squared_lengths;
    if depths.squared_lengths.iter().any(|&a| a.is_nan() || a <= 0.0) {
        return;
    }
    let (q12, q13, q23) = (depths.form(0), depths.form(1), depths.form(2));
    let c1 = q12 - q23 * (a12 / a23);
    let c2 = q13 - q23 * (a13 / a23);
    let Some(lines) = best_line_pair(&c1, &c2) else {
        return;
    };

    let model_frame = triangle_frame(&points);
    for line in lines {
        for direction in line_meets_conic(&line, &c1) {
            let sign = copysign(1.0, direction.x + direction.y + direction.z);
            let d = direction * sign;
            let length = (d.transpose() * q23 * d)[0];
            if d.min() <= 0.0 || length <= 0.0 {
                continue;
            }
            let d = depths.polished(d * sqrt(a23 / length));
            let y: [Vector3<f64>; 3] = core::array::from_fn(|i| m[i] * d[i]);
            let r = triangle_frame(&y) * model_frame.transpose();
            let pose = Pose { r, t: y[0] - r * points[0] };
            if d.min() > 0.0 && pose.is_finite() {
                emit(pose);
            }
        }
    }
}

/// Rotation whose axes are a triangle's first side, the direction in its plane across it, and its normal; NaN for
/// points on a line. A rotation made of two of these is one however thin the triangle.
fn triangle_frame(points: &[Vector3<f64>; 3]) -> Matrix3<f64> {
    let side = points[1] - points[0];
    let normal = side.cross(&(points[2] - points[0])).normalize();
    let along = side.normalize();
    Matrix3::from_columns(&[along, normal.cross(&along), normal])
}

/// The two lines of the best degenerate conic `c1 + gamma c2` whose lines are real.
fn best_line_pair(c1: &Matrix3<f64>, c2: &Matrix3<f64>) -> Option<[Vector3<f64>; 2]> {
    let cubic = [c2.determinant(), (adjugate(c2) * c1).trace(), (adjugate(c1) * c2).trace(), c1.determinant()];
    let mut best: Option<(f64, Matrix3<f64>, Vector3<f64>)> = None;
    for (alpha, beta) in homogeneous_cubic_roots(cubic).into_iter().flatten() {
        // det(beta c1 + alpha c2) = 0
        let conic = c1 * beta + c2 * alpha;
        let negative_adjugate = -adjugate(&conic);
        // The adjugate of a pair of lines p, q is -(p x q)(p x q)^T: its diagonal tells whether they are real.
        let k = negative_adjugate.diagonal().imax();
        let separation = negative_adjugate[(k, k)] / conic.norm_squared();
        if separation > best.as_ref().map_or(0.0, |b| b.0) {
            let crossing = negative_adjugate.column(k) / sqrt(negative_adjugate[(k, k)]);
            best = Some((separation, conic, crossing));
        }
    }
    let (_, conic, crossing) = best?;
    // conic + [p x q]_x has rank one: a column is one line, a row the other.
    let split = conic + crossing.cross_matrix();
    let (row, column) = split.iamax_full();
    Some([split.column(column).into_owned(), split.row(row).transpose()])
}

fn adjugate(m: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b, c) = (m.column(0), m.column(1), m.column(2));
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)]).transpose()
}

/// Points (up to scale) where a line meets a conic.
fn line_meets_conic(line: &Vector3<f64>, conic: &Matrix3<f64>) -> impl Iterator<Item = Vector3<f64>> {
    // Two points of the line, with the largest coefficient as divisor.
    let k = line.iamax();
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let on_line = |axis: usize| {
        let mut point = Vector3::zeros();
        point[axis] = 1.0;
        point[k] = -line[axis] / line[k];
        point
    };
    let (s, t) = (on_line(i), on_line(j));
    let (cs, ct) = (conic * s, conic * t);
    let (a, b, c) = (s.dot(&cs), s.dot(&ct), t.dot(&ct));
    let discriminant = b * b - a * c;
    // A double root that rounding has made complex: accepted, Newton's method decides.
    let nearly_real = discriminant >= -1e-12 * (b * b + (a * c).abs());
    let q = -(b + copysign(sqrt(discriminant.max(0.0)), b));
    // The roots of a x^2 + 2 b x y + c y^2 are (x : y) = (q : a) and (c : q).
    let roots = if nearly_real { [(q, a), (c, q)] } else { [(0.0, 0.0); 2] };
    roots.into_iter().map(move |(x, y)| s * x + t * y).filter(|p| p.norm_squared() > 0.0)
}

/// Real roots `(alpha : beta)` of `c0 alpha^3 + c1 alpha^2 beta + c2 alpha beta^2 + c3 beta^3`.
fn homogeneous_cubic_roots(c: [f64; 4]) -> [Option<(f64, f64)>; 3] {
    // The larger end as leading coefficient: no division by something small.
    if c[0].abs() >= c[3].abs() {
        if c[0] == 0.0 {
            return [None; 3];
        }
        monic_cubic_roots(c[1] / c[0], c[2] / c[0], c[3] / c[0]).map(|x| x.map(|x| (x, 1.0)))
    } else {
        monic_cubic_roots(c[2] / c[3], c[1] / c[3], c[0] / c[3]).map(|x| x.map(|x| (1.0, x)))
    }
}

/// Real roots of `x^3 + b x^2 + c x + d` (Cardano and Vieta), polished by Newton's method.
fn monic_cubic_roots(b: f64, c: f64, d: f64) -> [Option<f64>; 3] {
    let shift = b / 3.0;
    let p = c / 3.0 - shift * shift;
    let q = 0.5 * (d + shift * (2.0 * shift * shift - c));
    let discriminant = q * q + p * p * p;
    let roots = if discriminant > 0.0 {
        let r = libm::cbrt(q.abs() + sqrt(discriminant));
        let x = if r == 0.0 { 0.0 } else { r - p / r };
        [Some(copysign(x, -q)), None, None]
    } else {
        let angle = atan2(sqrt(-discriminant), -q) / 3.0;
        let radius = 2.0 * sqrt(-p);
        [0.0, 1.0, 2.0].map(|k| Some(radius * cos(angle + k * (2.0 * core::f64::consts::PI / 3.0))))
    };
    roots.map(|root| {
        root.map(|y| {
            let mut x = y - shift;
            for _ in 0..2 {
                let value = ((x + b) * x + c) * x + d;
                let slope = (3.0 * x + 2.0 * b) * x + c;
                if slope != 0.0 {
                    x -= value / slope;
                }
            }
            x
        })
    })
}

#[cfg(test)]
mod tests {
    use super::monic_cubic_roots;

    #[test]
    fn cubic_roots_are_roots() {
        for (b, c, d) in [(-6.0, 11.0, -6.0), (0.0, 0.0, 8.0), (3.0, -1.0, 5.0), (-3.0, 3.0, -1.0), (0.0, -1.0, 0.0)] {
            let roots = monic_cubic_roots(b, c, d);
            assert!(roots[0].is_some());
            for x in roots.into_iter().flatten() {
                let scale: f64 = 1.0 + x.abs().powi(3);
                assert!((((x + b) * x + c) * x + d).abs() < 1e-9 * scale, "{b} {c} {d}: {x}");
            }
        }
    }
}
