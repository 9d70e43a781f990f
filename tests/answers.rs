//! Hashes of the bits of ten thousand answers, to detect changes of any number.
//!
//! The same bits are promised for every vector unit and platform, so the constants hold everywhere. A change that is
//! meant to change numbers says so and replaces the constants by those that the failing test prints.

mod common;

use common::{Case, Random, reason};
use groundpose::synthetic::{BboxError, Kind, Outliers, Protocol};
use groundpose::{Estimate, Estimator, GrowingWorkspace, NoPose, Options, Refinement, Solver, Tilt, View, Workspace};

/// Objects of one sort, estimated with the same options.
struct Group {
    name: &'static str,
    objects: u64,
    object: fn(u64, &mut Random) -> Case,
    options: Options,
    /// Of every number of every answer.
    hash: u64,
}

fn groups() -> [Group; 19] {
    let ours = Options::default();
    let group = |name, objects, object, options, hash| Group { name, objects, object, options, hash };
    let solver = |solver| Options { solver, max_iterations: 200, ..ours };
    let refinement = |refinement| Options { refinement, ..ours };
    [
        group("cubes", 700, cube, ours, 0xF1BE_8A05_667B_C175),
        group("vehicles", 2000, vehicle, ours, 0xA9AA_27DD_81BE_0B11),
        group("scores", 1000, scored, ours, 0x19AB_22B7_9F3F_43FE),
        group("shape modes", 1500, shaped, ours, 0xBFD3_D17B_7983_B1F8),
        group("boxes that follow the shape", 400, shaped_box, ours, 0xBCA5_6BDF_148F_4D90),
        group("cut boxes", 800, cut, ours, 0xE395_A8A5_818C_D124),
        group("no boxes", 400, boxless, ours, 0x600C_CD94_2B86_C21E),
        group("tilted cameras", 600, tilted, ours, 0xA7BA_515D_3698_2D0D),
        group("lenses", 400, behind_a_lens, ours, 0xE25D_C52A_F636_AED6),
        group("camera heights", 400, of_known_height, ours, 0xDFE3_93C5_DF77_F885),
        group("p1p", 200, vehicle, solver(Solver::P1p), 0x78A8_A84A_FFEB_9975),
        group("p3p", 200, vehicle, solver(Solver::P3p), 0x609F_D9B5_9726_047B),
        group("up2p", 200, vehicle, solver(Solver::Up2p), 0x98C2_B478_81BE_698E),
        group("p1p_height", 200, of_known_height, solver(Solver::P1pHeight), 0x32DC_2E83_689C_D553),
        group("no refinement", 200, shaped, refinement(Refinement::None), 0x0BD5_B395_C1B6_EEB4),
        group("gn", 200, shaped, refinement(Refinement::Gn), 0x44D6_C2A6_82E5_E0BD),
        group("re", 200, shaped, refinement(Refinement::Re), 0x6C0A_CCBE_3CF0_018E),
        group("hre", 200, shaped, refinement(Refinement::Hre), 0x5407_9120_0A4C_68D9),
        group("free tilt", 200, tilted, ours.without_tilt(), 0xCBA3_7989_FD3F_3BB9),
    ]
}

fn scene(protocol: &Protocol, trial: u64) -> Case {
    Case::of(protocol, &protocol.scene(1, trial))
}

/// The paper's protocol with all its sources of error.
fn cube(trial: u64, random: &mut Random) -> Case {
    let protocol = Protocol {
        n_points: 4 + random.next() as usize % 300,
        outlier_ratio: random.between(0.0, 0.9),
        outliers: if trial.is_multiple_of(2) { Outliers::Image } else { Outliers::Box },
        pitch_error: random.between(-0.03, 0.03),
        bbox_error: random.between(-4.0, 4.0),
        bbox_error_kind: if trial.is_multiple_of(3) { BboxError::Shift } else { BboxError::Outward },
        ..Protocol::default()
    };
    scene(&protocol, trial)
}

/// Some of its keypoints are missing.
fn vehicle(trial: u64, random: &mut Random) -> Case {
    let mut case = scene(&Protocol { kind: Kind::Vehicle, ..Protocol::default() }, trial);
    for pixel in &mut case.keypoints_2d {
        if random.between(0.0, 1.0) < 0.1 {
            *pixel = [f64::NAN; 2];
        }
    }
    case
}

fn scored(trial: u64, random: &mut Random) -> Case {
    let mut case = vehicle(trial, random);
    case.scores = Some(case.keypoints_2d.iter().map(|_| random.between(0.0, 1.0)).collect());
    case
}

/// The true shape is one to ten modes away from the mean of the model.
fn shaped(trial: u64, random: &mut Random) -> Case {
    let mut case = if trial.is_multiple_of(3) { scored(trial, random) } else { vehicle(trial, random) };
    let count = case.keypoints_3d.len();
    case.eigenvalues = (0..1 + trial % 10).map(|_| random.between(0.2, 2.0)).collect();
    for _ in 0..case.eigenvalues.len() {
        let coefficient = random.between(-1.0, 1.0);
        for point in 0..count {
            let moved = random.point([[-0.08; 3], [0.08; 3]]);
            for axis in 0..3 {
                case.keypoints_3d[point][axis] -= coefficient * moved[axis];
            }
            case.basis.push(moved);
        }
    }
    case
}

fn shaped_box(trial: u64, random: &mut Random) -> Case {
    let mut case = shaped(trial, random);
    case.bbox_basis =
        case.eigenvalues.iter().map(|_| [[-0.1; 3], [0.0; 3]].map(|low| random.point([low, [0.1; 3]]))).collect();
    case.footprint = Some(vec![[-0.6, 2.2], [0.6, 2.2], [0.9, 1.6], [0.9, -2.2], [-0.9, -2.2], [-0.9, 1.6]]);
    case
}

/// One or two sides of the box are unknown.
fn cut(trial: u64, random: &mut Random) -> Case {
    let mut case = vehicle(trial, random);
    for _ in 0..1 + trial % 2 {
        case.bbox.as_mut().expect("a box")[random.next() as usize % 4] = f64::NAN;
    }
    case
}

fn boxless(trial: u64, random: &mut Random) -> Case {
    Case { bbox: None, ..vehicle(trial, random) }
}

/// A car before a camera that looks up or down, with noise and wrong keypoints; the threshold is our own.
fn tilted(_: u64, random: &mut Random) -> Case {
    let keypoints = 6 + random.next() as usize % 40;
    let mut case = random.exact_car(keypoints);
    for pixel in &mut case.keypoints_2d {
        let error = if random.between(0.0, 1.0) < 0.25 { 60.0 } else { 2.0 };
        *pixel = pixel.map(|x| x + random.between(-error, error));
    }
    case
}

/// Keypoints and box seen through a lens with distortion.
fn behind_a_lens(trial: u64, random: &mut Random) -> Case {
    let mut case = tilted(trial, random);
    let coefficients = [-0.1, 0.02, 1e-3, -1e-3, -2e-3].map(|k| k * random.between(0.0, 1.0));
    let camera = case.view.camera.with_distortion(coefficients).expect("a lens");
    case.view = View::new(camera, case.view.tilt).expect("a view");
    for pixel in &mut case.keypoints_2d {
        *pixel = camera.distort(*pixel);
    }
    let [left, top, right, bottom] = case.bbox.expect("a box");
    let ([left, top], [right, bottom]) = (camera.distort([left, top]), camera.distort([right, bottom]));
    case.bbox = Some([left, top, right, bottom]);
    case
}

/// The camera's height is known with a small error, and one side of the box is unknown.
fn of_known_height(trial: u64, random: &mut Random) -> Case {
    let mut case = vehicle(trial, random);
    let tilt = Tilt { pitch: random.between(-0.02, 0.02), roll: random.between(-0.02, 0.02) };
    let view = View::new(case.view.camera, tilt).expect("a view");
    case.view = view.with_height(random.between(1.4, 1.6)).expect("a height");
    case.bbox.as_mut().expect("a box")[2 * (trial % 2) as usize] = f64::NAN;
    case
}

/// FNV-1a, 64 bits.
struct Hash(u64);

impl Hash {
    fn bytes(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        }
    }

    /// Platforms differ only in the bits of NaN.
    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f64>) {
        for x in numbers {
            let bits = if x.is_nan() { u64::MAX } else { x.to_bits() };
            self.bytes(&bits.to_le_bytes());
        }
    }

    fn estimate(&mut self, e: &Estimate, residuals: &[f64]) {
        self.numbers(e.pose.r.iter().chain(&e.pose.t));
        self.numbers(&e.shape_coefficients);
        self.numbers(e.covariance.iter().flat_map(|c| c.iter()));
        self.numbers(e.shape_covariance.iter().flat_map(|c| c.iter()));
        self.numbers(&[e.yaw, e.inlier_threshold, e.inlier_count as f64, e.reprojection_rmse, e.score]);
        self.numbers(&[e.noise_sigma, e.log10_nfa, e.ambiguity]);
        self.numbers(residuals);
    }
}

/// The hash of a group's answers, and how many of its objects have a pose.
fn answers(group: &Group) -> (u64, u64) {
    let estimator = Estimator::new(group.options).expect("options");
    let mut workspace = GrowingWorkspace::new();
    let (mut hash, mut poses) = (Hash(0xCBF2_9CE4_8422_2325), 0);
    for trial in 0..group.objects {
        let case = (group.object)(trial, &mut Random(trial));
        let answer =
            case.with_observation(|o| estimator.estimate_indexed(&case.view, o, &mut workspace, trial)).map_err(reason);
        hash.bytes(answer.as_ref().map_or_else(|reason| reason.name(), |_| NoPose::NAMES[0]).as_bytes());
        if let Ok(estimate) = answer {
            hash.estimate(&estimate, workspace.residuals());
            poses += 1;
        }
    }
    (hash.0, poses)
}

#[test]
fn ten_thousand_answers_have_the_bits_they_had() {
    let groups = groups();
    assert_eq!(groups.iter().map(|group| group.objects).sum::<u64>(), 10_000);
    let mut changed = vec![];
    for group in groups {
        let (hash, poses) = answers(&group);
        println!("{:>28}: {poses} of {} answered, hash 0x{hash:016X}", group.name, group.objects);
        assert!(2 * poses > group.objects, "{}: {poses} of {} answered", group.name, group.objects);
        if hash != group.hash {
            changed.push(format!("{}: 0x{hash:016X}, was 0x{:016X}", group.name, group.hash));
        }
    }
    assert_eq!(changed, [""; 0], "groups whose answers changed");
}
