//! Guarantees of the minimal solvers on exact data.

mod common;

use common::{Case, Random, angle_deg};
use groundpose::minimal::MinimalSolver;
use groundpose::minimal::p1p::{Cases, P1p};
use groundpose::minimal::p3p::P3p;
use groundpose::minimal::up2p::Up2p;
use groundpose::{Bbox, Camera, Observation, Pose, ShapeModel};
use nalgebra::Vector3;

/// Number of scenes; more with `GROUNDPOSE_SCENES=1000000 cargo test --test guarantee`.
fn scenes() -> u64 {
    std::env::var("GROUNDPOSE_SCENES").map_or(10_000, |n| n.parse().expect("GROUNDPOSE_SCENES: a number"))
}

/// All hypotheses of P1P from the first keypoint.
fn p1p(case: &Case, cases: Cases) -> Vec<Pose> {
    let bbox = Bbox::new(case.bbox.unwrap()).unwrap();
    let mut poses = vec![];
    case.with_observation(|o| P1p::new(&case.view, o, &bbox, cases).solve([0], &mut |pose| poses.push(pose)));
    poses
}

/// Degrees from the truth to the nearest hypothesis.
fn nearest(poses: &[Pose], truth: &Pose) -> f64 {
    poses.iter().map(|pose| angle_deg(&pose.r, &truth.r)).fold(f64::INFINITY, f64::min)
}

#[test]
fn p1p_contains_the_truth_in_every_exact_scene() {
    let (mut worst, mut most, mut total) = (0.0_f64, 0, 0);
    for k in 0..scenes() {
        let case = Random(k).exact_car(1);
        let poses = p1p(&case, Cases::All);
        let error = nearest(&poses, &case.truth);
        assert!(error < 1e-3, "scene {k}: nearest of {} hypotheses is {error} deg off: {case:?}", poses.len());
        worst = worst.max(error);
        most = most.max(poses.len());
        total += poses.len();
    }
    println!("worst {worst:e} deg; {} hypotheses on average, {most} at most", total as f64 / scenes() as f64);
}

/// A rounded front: the rectangle with its corners cut.
fn octagon([min, max]: [[f64; 3]; 2]) -> Vec<[f64; 2]> {
    let cut = 0.3 * (max[0] - min[0]);
    let (left, right, rear, front) = (min[0], max[0], min[2], max[2]);
    vec![
        [left + cut, front],
        [right - cut, front],
        [right, front - cut],
        [right, rear + cut],
        [right - cut, rear],
        [left + cut, rear],
        [left, rear + cut],
        [left, front - cut],
    ] // one rotation
}

#[test]
fn p1p_contains_the_truth_for_a_rounded_outline() {
    for k in 0..scenes() {
        let mut case = Random(k).exact_car(1);
        let outline = octagon(case.bbox_3d);
        let column = |&[x, z]: &[f64; 2], y| {
            let point = case.truth.transform([x, y, z]);
            case.view.camera.project(&point).expect("in front")[0]
        };
        let heights = [case.bbox_3d[0][1], case.bbox_3d[1][1]];
        let columns: Vec<f64> = outline.iter().flat_map(|c| heights.map(|y| column(c, y))).collect();
        let bbox = case.bbox.as_mut().unwrap();
        bbox[0] = columns.iter().copied().fold(f64::INFINITY, f64::min);
        bbox[2] = columns.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        case.footprint = Some(outline);
        let poses = p1p(&case, Cases::All);
        let error = nearest(&poses, &case.truth);
        assert!(error < 1e-3, "scene {k}: {error} deg, {} hypotheses: {case:?}", poses.len());
    }
}

#[test]
fn the_papers_four_cases_miss_some_views_and_are_among_all() {
    let (mut missed, count) = (0, scenes());
    for k in 0..count {
        let mut case = Random(k).exact_car(1);
        let all = p1p(&case, Cases::All);
        case.footprint = None;
        let paper = p1p(&case, Cases::Paper);
        assert!(paper.iter().all(|p| all.contains(p)), "scene {k}");
        missed += u64::from(nearest(&paper, &case.truth) > 1e-3);
    }
    let fraction = missed as f64 / count as f64;
    println!("the paper's cases miss {:.1} % of the truths", 100.0 * fraction);
    assert!((0.02..0.25).contains(&fraction), "{fraction}");
}

#[test]
fn up2p_contains_the_truth_in_every_exact_scene() {
    for k in 0..scenes() {
        let case = Random(k).exact_car(2);
        let mut poses = vec![];
        case.with_observation(|o| Up2p::new(&case.view, o).solve([0, 1], &mut |pose| poses.push(pose)));
        let error = nearest(&poses, &case.truth);
        assert!(poses.len() <= 2 && error < 1e-3, "scene {k}: {error} deg of {} poses: {case:?}", poses.len());
    }
}

/// A random P3P problem.
struct Triangle {
    camera: Camera,
    points: [[f64; 3]; 3],
    pixels: [[f64; 2]; 3],
    truth: Pose,
}

impl Triangle {
    /// Rotation uniform; the points of every other triangle lie in a cube of 4 m at 5 to 60 m, where the view is
    /// nearly parallel, and those of the rest anywhere in the image at 1 to 10 m.
    fn random(k: u64) -> Self {
        let mut random = Random(k);
        let camera = Camera::new(800.0, 810.0, 320.0, 240.0).unwrap();
        let r = random.rotation();
        if k.is_multiple_of(2) {
            let pixels: [[f64; 2]; 3] = [(); 3].map(|()| [random.between(0.0, 640.0), random.between(0.0, 480.0)]);
            let t = camera.ray([320.0, 240.0]) * 5.0;
            let points = pixels.map(|p| (r.transpose() * (camera.ray(p) * random.between(1.0, 10.0) - t)).into());
            return Self { camera, points, pixels, truth: Pose { r, t } };
        }
        let distance = random.between(5.0, 60.0);
        let t = Vector3::new(random.between(-0.4, 0.4), random.between(-0.3, 0.3), 1.0) * distance;
        let truth = Pose { r, t };
        let points = [(); 3].map(|()| random.point([[-2.0; 3], [2.0; 3]]));
        let pixels = points.map(|x| camera.project(&truth.transform(x)).expect("at least 5 m - 2 sqrt(3) m away"));
        Self { camera, points, pixels, truth }
    }

    fn solve(&self) -> Vec<Pose> {
        let model = ShapeModel::rigid(&self.points, [[-2.0; 3], [2.0; 3]]).unwrap();
        let observation = Observation::new(&self.pixels, &model).unwrap();
        let mut poses = vec![];
        P3p::new(&self.camera, &observation).solve([0, 1, 2], &mut |pose| poses.push(pose));
        poses
    }

    /// Largest reprojection error of the three points, pixels.
    fn worst_residual(&self, pose: &Pose) -> f64 {
        let residual = |k: usize| {
            let [u, v] = self.camera.project(&pose.transform(self.points[k])).unwrap_or([f64::INFINITY; 2]);
            (u - self.pixels[k][0]).hypot(v - self.pixels[k][1])
        };
        (0..3).map(residual).fold(0.0, f64::max)
    }

    /// Number of solutions by brute force: of each of the four ways to walk along the first ray and to close two
    /// sides of the triangle, how often the third side changes from too short to too long or back.
    fn count_by_scanning(&self) -> usize {
        const STEPS: u32 = 20_000;
        let ray = self.pixels.map(|p| self.camera.ray(p).normalize());
        let square =
            |i: usize, j: usize| (Vector3::from(self.points[i]) - Vector3::from(self.points[j])).norm_squared();
        // d_j with |d_j m_j - d m_0| = |X_j - X_0|
        let other = |d: f64, j: usize, sign: f64| {
            let along = d * ray[0].dot(&ray[j]);
            along + sign * (along * along - d * d + square(0, j)).sqrt()
        };
        let sine = |j: usize| ray[0].cross(&ray[j]).norm();
        let farthest = (1..3).map(|j| square(0, j).sqrt() / sine(j)).fold(f64::INFINITY, f64::min);
        let branch = |s1: f64, s2: f64| {
            let error = |step: u32| {
                // Cosine spacing: steps are short where a branch turns back.
                let d = farthest * (core::f64::consts::FRAC_PI_2 * f64::from(step) / f64::from(STEPS)).sin();
                let (d1, d2) = (other(d, 1, s1), other(d, 2, s2));
                if d1 > 0.0 && d2 > 0.0 { (ray[1] * d1 - ray[2] * d2).norm_squared() - square(1, 2) } else { f64::NAN }
            };
            (1..STEPS).filter(|&step| error(step - 1) * error(step) < 0.0).count()
        };
        [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].into_iter().map(|(s1, s2)| branch(s1, s2)).sum()
    }
}

#[test]
fn p3p_recovers_the_truth_and_returns_solutions_only() {
    const SAMPLES: u64 = 10_000;
    let (mut failures, mut invalid, mut duplicates) = (0, 0, 0);
    let mut counts = [0_u32; 5];
    for k in 0..SAMPLES {
        let triangle = Triangle::random(k);
        let poses = triangle.solve();
        counts[poses.len()] += 1;
        failures += u32::from(!(nearest(&poses, &triangle.truth) < 1e-3));
        invalid += poses.iter().filter(|p| !(triangle.worst_residual(p) < 1e-6)).count();
        let same = |a: &Pose, b: &Pose| angle_deg(&a.r, &b.r) < 1e-6 && (a.t - b.t).norm() < 1e-9 * a.t.norm();
        duplicates += (0..poses.len()).map(|i| poses[..i].iter().filter(|p| same(p, &poses[i])).count()).sum::<usize>();
    }
    let total: u32 = counts.iter().zip(0..).map(|(count, solutions)| count * solutions).sum();
    println!(
        "{SAMPLES} samples: truth missed in {failures}, {invalid} false and {duplicates} double solutions; \
         {:.3} solutions on average, samples with 0 to 4: {counts:?}",
        f64::from(total) / SAMPLES as f64
    );
    assert!(failures <= 1, "{failures}");
    assert_eq!((invalid, duplicates), (0, 0));
}

#[test]
fn p3p_finds_as_many_solutions_as_there_are() {
    const SAMPLES: u64 = 400;
    let (mut more, mut fewer) = (0, 0);
    for k in 0..SAMPLES {
        let triangle = Triangle::random(k);
        let (found, counted) = (triangle.solve().len(), triangle.count_by_scanning());
        more += u32::from(found > counted);
        fewer += u32::from(found < counted);
    }
    println!("of {SAMPLES} samples {fewer} with fewer, {more} with more solutions than counted by brute force");
    // The scan steps over pairs of solutions that nearly coincide.
    assert!(fewer == 0 && more <= SAMPLES as u32 / 50, "{fewer} fewer, {more} more");
}
