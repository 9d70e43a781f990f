//! The same estimate another way: every unknown of frame and objects in one normal matrix, derivatives by differences,
//! many iterations, the inverse by elimination.

use groundpose::{MAX_CLASSES, Pose, PoseCovariance};
use nalgebra::{Rotation3, SMatrix, SVector, Vector3};

use crate::scene::{BOTTOM_CENTRE, Scene};

const FRAME: usize = 3 + MAX_CLASSES;
const ITERATIONS: usize = 60;
const DIFFERENCE: f64 = 1e-6;
/// Student's t of the contacts.
const DOF: f64 = 4.0;
/// Of the log of a height that the nominal view does not have.
const NO_HEIGHT_SIGMA: f64 = 1.0;

pub struct Dense {
    pub theta: Vec<f64>,
    pub height: f64,
    pub covariance: SMatrix<f64, FRAME, FRAME>,
    unknowns: Vec<f64>,
    inverse: Vec<Vec<f64>>,
}

/// The nominal height, or the median of what the objects say.
pub fn start_height(scene: &Scene) -> f64 {
    if let Some(height) = scene.nominal.height {
        return height;
    }
    let mut heights: Vec<f64> = (0..scene.objects.len())
        .map(|k| {
            let size = scene.priors.scales[scene.objects[k].2].log_mean;
            below(scene, k, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, size], scene.nominal.tilt.pitch, scene.nominal.tilt.roll)
        })
        .collect();
    heights.sort_by(f64::total_cmp);
    heights[heights.len() / 2]
}

fn bottom(scene: &Scene, k: usize, x: &[f64]) -> Vector3<f64> {
    let pose = &scene.objects[k].0;
    let r = Rotation3::new(Vector3::new(x[0], x[1], x[2])) * pose.r;
    (r * Vector3::from(BOTTOM_CENTRE) + pose.t + Vector3::new(x[3], x[4], x[5])) * x[6].exp()
}

fn below(scene: &Scene, k: usize, x: &[f64], pitch: f64, roll: f64) -> f64 {
    let normal = Rotation3::from_axis_angle(&Vector3::z_axis(), roll)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), -pitch)
        * Vector3::y();
    normal.dot(&bottom(scene, k, x))
}

/// The contact of object `k`: logarithm of its height over that of the camera, as a fraction.
fn contact(scene: &Scene, k: usize, unknowns: &[f64], height: f64) -> f64 {
    let x = &unknowns[FRAME + 7 * k..FRAME + 7 * (k + 1)];
    (below(scene, k, x, unknowns[0], unknowns[1]) / (height * unknowns[2].exp())).ln()
}

pub fn solve(scene: &Scene, height: f64) -> Dense {
    let (priors, count) = (&scene.priors, scene.objects.len());
    let size = FRAME + 7 * count;
    let mut unknowns = vec![0.0; size];
    let mut variances = [0.0; FRAME];
    (unknowns[0], variances[0]) = (scene.nominal.tilt.pitch, priors.pitch_sigma.powi(2));
    (unknowns[1], variances[1]) = (scene.nominal.tilt.roll, priors.roll_sigma.powi(2));
    variances[2] = if scene.nominal.height.is_some() { priors.height_sigma } else { NO_HEIGHT_SIGMA }.powi(2);
    for c in 0..MAX_CLASSES {
        (unknowns[3 + c], variances[3 + c]) = (priors.scales[c].log_mean, priors.scales[c].sigma.powi(2));
    }
    for (k, (_, _, class)) in scene.objects.iter().enumerate() {
        unknowns[FRAME + 7 * k + 6] = priors.scales[*class].log_mean;
    }
    let means = unknowns[..FRAME].to_vec();
    let mut inverse = vec![vec![0.0; size]; size];
    for i in 0..FRAME {
        inverse[i][i] = variances[i];
    }
    for _ in 0..ITERATIONS {
        let (mut h, mut g) = (vec![vec![0.0; size]; size], vec![0.0; size]);
        for i in 0..FRAME {
            h[i][i] += 1.0 / variances[i];
            g[i] += (unknowns[i] - means[i]) / variances[i];
        }
        for k in 0..count {
            add_object(scene, k, &unknowns, &mut h, &mut g);
            add_contact(scene, k, &unknowns, height, &inverse, &mut h, &mut g);
        }
        inverse = inverted(h);
        for i in 0..size {
            let step: f64 = (0..size).map(|j| inverse[i][j] * g[j]).sum();
            unknowns[i] -= step.clamp(-0.3, 0.3);
        }
    }
    let covariance = SMatrix::from_fn(|i, j| inverse[i][j]);
    Dense { theta: unknowns[..FRAME].to_vec(), height: height * unknowns[2].exp(), covariance, unknowns, inverse }
}

/// The Gaussians about the object's own estimate and the size of its class.
fn add_object(scene: &Scene, k: usize, unknowns: &[f64], h: &mut [Vec<f64>], g: &mut [f64]) {
    let (_, covariance, class) = &scene.objects[k];
    let (first, at) = (FRAME + 7 * k, 3 + class);
    let information = covariance.try_inverse().unwrap();
    for a in 0..6 {
        for b in 0..6 {
            h[first + a][first + b] += information[(a, b)];
            g[first + a] += information[(a, b)] * unknowns[first + b];
        }
    }
    let (own, size) = (1.0 / scene.priors.scales[*class].own_sigma.powi(2), first + 6);
    let off = unknowns[size] - unknowns[at];
    for (i, sign) in [(size, 1.0), (at, -1.0)] {
        g[i] += sign * own * off;
        h[i][size] += sign * own;
        h[i][at] -= sign * own;
    }
}

fn add_contact(
    scene: &Scene,
    k: usize,
    unknowns: &[f64],
    height: f64,
    inverse: &[Vec<f64>],
    h: &mut [Vec<f64>],
    g: &mut [f64],
) {
    let (_, covariance, class) = &scene.objects[k];
    let (priors, first, at) = (&scene.priors, FRAME + 7 * k, 3 + class);
    let z = contact(scene, k, unknowns, height);
    let mut row = vec![0.0; unknowns.len()];
    for i in (0..3).chain(first..first + 7) {
        let mut moved = unknowns.to_vec();
        moved[i] += DIFFERENCE;
        let ahead = contact(scene, k, &moved, height);
        moved[i] -= 2.0 * DIFFERENCE;
        row[i] = (ahead - contact(scene, k, &moved, height)) / (2.0 * DIFFERENCE);
    }
    let own = priors.scales[*class].own_sigma.powi(2);
    let by_pose = SVector::<f64, 6>::from_fn(|a, _| row[first + a]);
    let of_object = by_pose.dot(&(covariance * by_pose)) + own * row[first + 6].powi(2);
    let metres = height * unknowns[2].exp();
    let distance = bottom(scene, k, &unknowns[first..first + 7]).norm();
    let bend = 0.5 * priors.curvature * (distance.powi(2) - (metres * z.exp()).powi(2));
    let even = (priors.roughness.powi(2) + (priors.slope * distance).powi(2) + bend.powi(2)) / metres.powi(2);
    // The innovation: the contact if the object were where its own estimate is.
    let back: f64 = (0..6).map(|a| row[first + a] * unknowns[first + a]).sum();
    let innovation = z - back + row[first + 6] * (unknowns[at] - unknowns[first + 6]);
    let mut of_frame = [row[0], row[1], row[2], row[first + 6]];
    let seen = [0, 1, 2, at];
    of_frame[2] = -1.0;
    let frame: f64 =
        (0..4).map(|a| (0..4).map(|b| of_frame[a] * inverse[seen[a]][seen[b]] * of_frame[b]).sum::<f64>()).sum();
    let d2 = innovation.powi(2) / (even + of_object + frame);
    let weight = ((DOF + 1.0) / (DOF + d2)).min(1.0);
    let variance = (even + of_object) / weight - of_object;
    for i in 0..row.len() {
        g[i] += row[i] * z / variance;
        for j in 0..row.len() {
            h[i][j] += row[i] * row[j] / variance;
        }
    }
}

/// By elimination with pivots.
fn inverted(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = a.len();
    let mut b: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for column in 0..n {
        let pivot = (column..n).max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs())).unwrap();
        a.swap(column, pivot);
        b.swap(column, pivot);
        let factor = 1.0 / a[column][column];
        for row in 0..n {
            if row == column {
                continue;
            }
            let times = a[row][column] * factor;
            for j in 0..n {
                a[row][j] -= times * a[column][j];
                b[row][j] -= times * b[column][j];
            }
        }
        for j in 0..n {
            a[column][j] *= factor;
            b[column][j] *= factor;
        }
    }
    b
}

impl Dense {
    /// Pose, its covariance and log size of an object.
    pub fn object(&self, scene: &Scene, k: usize) -> (Pose, PoseCovariance, f64) {
        let first = FRAME + 7 * k;
        let x = &self.unknowns[first..first + 7];
        let estimate = &scene.objects[k].0;
        let scale = x[6].exp();
        let r = Rotation3::new(Vector3::new(x[0], x[1], x[2])) * estimate.r;
        let t = (estimate.t + Vector3::new(x[3], x[4], x[5])) * scale;
        let joint = SMatrix::<f64, 7, 7>::from_fn(|i, j| self.inverse[first + i][first + j]);
        let by_unknowns = SMatrix::<f64, 6, 7>::from_fn(|i, j| match (i, j) {
            (3.., 6) => t[i - 3],
            (0..3, _) if i == j => 1.0,
            (3.., _) if i == j => scale,
            _ => 0.0,
        });
        (Pose { r, t }, by_unknowns * joint * by_unknowns.transpose(), x[6])
    }
}
