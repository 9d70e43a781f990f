//! Vehicles all round a lens of 190 degrees: estimated as well as by a pinhole that faces them, box sides without a bias.

use groundpose::geometry::lens::double_sphere::DoubleSphere;
use groundpose::geometry::lens::equidistant::Equidistant;
use groundpose::geometry::lens::omnidirectional::Omnidirectional;
use groundpose::{
    Bbox, Camera, Estimate, Estimator, FixedWorkspace, Footprint, Lens, Observation, Options, Pose, ShapeModel, Solver,
    Tilt, View,
};
use nalgebra::Vector3;

/// A car: wheels, lights, corners of the roof and of the windows.
const KEYPOINTS: [[f64; 3]; 16] = [
    [-0.8, -0.3, 1.35], [0.8, -0.3, 1.35], [0.8, -0.3, -1.35], [-0.8, -0.3, -1.35],
    [-0.65, -0.7, 2.1], [0.65, -0.7, 2.1], [0.7, -0.9, -2.15], [-0.7, -0.9, -2.15],
    [-0.55, -1.45, 0.3], [0.55, -1.45, 0.3], [0.55, -1.4, -1.3], [-0.55, -1.4, -1.3],
    [-0.75, -0.95, 1.0], [0.75, -0.95, 1.0], [0.75, -0.95, -1.7], [-0.75, -0.95, -1.7],
];
const BBOX_3D: [[f64; 3]; 2] = [[-0.9, -1.5, -2.2], [0.9, 0.0, 2.2]];
const OUTLINE: [[f64; 2]; 8] =
    [[-0.5, 2.2], [0.5, 2.2], [0.9, 1.6], [0.9, -1.8], [0.6, -2.2], [-0.6, -2.2], [-0.9, -1.8], [-0.9, 1.6]];
const FOCAL: f64 = 400.0;
const TILT: Tilt = Tilt { pitch: -0.12, roll: 0.03 };

fn model() -> ShapeModel<'static> {
    let model = ShapeModel::rigid(&KEYPOINTS, BBOX_3D).expect("a model");
    model.with_footprint(Footprint::new(&OUTLINE).expect("an outline"))
}

fn view(lens: Option<Lens>) -> View {
    let camera = Camera::new(FOCAL, FOCAL, 960.0, 700.0).expect("a camera");
    View::new(lens.map_or(camera, |lens| camera.with_lens(lens).expect("a lens")), TILT).expect("a view")
}

fn lenses() -> [Lens; 3] {
    [
        Lens::Equidistant(Equidistant::new([0.01, -0.004, 0.001, -0.0002])),
        Lens::DoubleSphere(DoubleSphere::new([-0.18, 0.59])),
        Lens::Omnidirectional(Omnidirectional::new([1.4, -0.1, 0.02, 1e-3, -5e-4])),
    ]
}

/// Numbers 0 to 1 that follow each other as at random.
struct Draws(u64);

impl Draws {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Where a vehicle is: angle from straight ahead and distance over the ground, heading against the line of sight.
#[derive(Clone, Copy)]
struct Place {
    bearing: f64,
    distance: f64,
    heading: f64,
}

impl Place {
    fn pose(&self, view: &View) -> Pose {
        let (sine, cosine) = self.bearing.sin_cos();
        Pose::upright(view, self.heading + self.bearing, Vector3::new(sine, 0.0, cosine) * self.distance + Vector3::y() * 1.6)
    }
}

/// Vehicles over 190 degrees.
fn places(count: usize, seed: u64) -> Vec<Place> {
    let mut draws = Draws(seed);
    (0..count)
        .map(|k| Place {
            bearing: (190.0 * (k as f64 + 0.5) / count as f64 - 95.0).to_radians(),
            distance: 5.0 + 25.0 * draws.uniform(),
            heading: std::f64::consts::TAU * draws.uniform(),
        })
        .collect()
}

/// Extent of the edges of the prism through a camera, point by point.
fn bbox(view: &View, pose: &Pose) -> Option<Bbox> {
    let [min, max] = BBOX_3D;
    let corner = |k: usize, y: f64| [OUTLINE[k % 8][0], y, OUTLINE[k % 8][1]];
    let edges = (0..8).flat_map(|k| {
        [
            [corner(k, min[1]), corner(k + 1, min[1])],
            [corner(k, max[1]), corner(k + 1, max[1])],
            [corner(k, min[1]), corner(k, max[1])],
        ]
    });
    let mut sides = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for [from, to] in edges {
        for step in 0..=200 {
            let along = f64::from(step) / 200.0;
            let point = [0, 1, 2].map(|axis| from[axis] + along * (to[axis] - from[axis]));
            let [u, v] = view.camera.image_of(&pose.transform(point))?;
            sides = [sides[0].min(u), sides[1].min(v), sides[2].max(u), sides[3].max(v)];
        }
    }
    Some(Bbox::new(sides).expect("a box"))
}

/// Errors of an answer: yaw in degrees, distance relative.
fn errors(estimate: &Estimate, truth: &Pose, view: &View) -> [f64; 2] {
    let turn = (estimate.yaw - truth.yaw(view) + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
    [(turn - std::f64::consts::PI).abs().to_degrees(), (estimate.pose.t.norm() / truth.t.norm() - 1.0).abs()]
}

/// What a camera sees of a place; `noise` in fractions of the longer side of the box, for keypoints and for its sides.
fn seen(view: &View, pose: &Pose, noise: [f64; 2], draws: &mut Draws) -> Option<([[f64; 2]; 16], Bbox)> {
    let exact = bbox(view, pose)?;
    let longer = exact.longer_side().expect("known sides");
    let mut pixels = [[0.0; 2]; 16];
    for (pixel, &point) in pixels.iter_mut().zip(&KEYPOINTS) {
        *pixel = view.camera.image_of(&pose.transform(point))?.map(|x| x + noise[0] * longer * draws.normal());
    }
    let mut moved = || noise[1] * longer * draws.normal();
    let sides = [exact.left + moved(), exact.top + moved(), exact.right + moved(), exact.bottom + moved()];
    Some((pixels, Bbox::new(sides).expect("a box")))
}

fn estimate(view: &View, pixels: &[[f64; 2]], bbox: Bbox, options: Options) -> Option<Estimate> {
    let model = model();
    let observation = Observation::new(pixels, &model).expect("keypoints").with_bbox(bbox);
    Estimator::new(options).expect("options").estimate(view, &observation, &mut FixedWorkspace::<16>::new()).ok()
}

/// Sorted errors of the answers of many places, and how many places had none.
fn all_errors(view: &View, places: &[Place], noise: [f64; 2], options: Options) -> ([Vec<f64>; 2], usize) {
    let (mut found, mut none, mut draws) = ([vec![], vec![]], 0, Draws(17));
    for place in places {
        let truth = place.pose(view);
        let Some((pixels, bbox)) = seen(view, &truth, noise, &mut draws) else { panic!("not in the picture") };
        match estimate(view, &pixels, bbox, options) {
            None => none += 1,
            Some(estimate) => {
                let [yaw, distance] = errors(&estimate, &truth, view);
                found[0].push(yaw);
                found[1].push(distance);
            }
        }
    }
    found.iter_mut().for_each(|errors| errors.sort_by(f64::total_cmp));
    (found, none)
}

#[test]
fn explore() {
    let places = places(2000, 5);
    let ahead: Vec<Place> = places.iter().map(|place| Place { bearing: 0.0, ..*place }).collect();
    let q = |(e, none): &([Vec<f64>; 2], usize)| format!("{:?} none {}", e.each_ref().map(|e| [0.5, 0.9, 0.99, 1.0].map(|q| e[((e.len() as f64 * q) as usize).min(e.len()-1)])), none);
    for noise in [[0.0, 0.0], [0.01, 0.01], [0.02, 0.02]] {
        println!("noise {noise:?}");
        println!("pinhole {}", q(&all_errors(&view(None), &ahead, noise, Options::default())));
        for lens in lenses() {
            println!("{} {}", lens.name(), q(&all_errors(&view(Some(lens)), &places, noise, Options::default())));
        }
    }
}
