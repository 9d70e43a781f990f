//! One frame as a detector gives it: a camera, its tilt, and of every vehicle a class, a 2D box, keypoints and scores.

use crate::classes::{CAR, Class, PICKUP};

/// A keypoint that is not seen.
const HIDDEN: [f64; 2] = [f64::NAN; 2];

/// A detector's result for one vehicle.
pub struct Detection {
    /// The class.
    pub class: &'static Class,
    /// Left, top, right, bottom, pixels.
    pub bbox: [f64; 4],
    /// Pixels, one per keypoint of the class; NaN = not seen.
    pub keypoints_2d: &'static [[f64; 2]],
    /// One score per keypoint.
    pub scores: &'static [f64],
}

/// `fx, fy, cx, cy`, pixels.
pub const CAMERA: [f64; 4] = [1200.0, 1200.0, 960.0, 540.0];
/// Radians; the camera looks down a little.
pub const PITCH: f64 = -0.03;

/// The vehicles. Each has two wrong keypoints; the last one, a detector's mistake, has only wrong ones.
pub const FRAME: [Detection; 5] = [
    Detection { class: &CAR, bbox: [673.8, 513.7, 902.2, 667.4], keypoints_2d: &KEYPOINTS_0, scores: &SCORES_0 },
    Detection { class: &CAR, bbox: [1072.9, 507.2, 1233.0, 602.3], keypoints_2d: &KEYPOINTS_1, scores: &SCORES_1 },
    Detection { class: &PICKUP, bbox: [988.1, 493.4, 1096.2, 569.8], keypoints_2d: &KEYPOINTS_2, scores: &SCORES_2 },
    Detection { class: &CAR, bbox: [906.3, 505.4, 1040.2, 555.6], keypoints_2d: &KEYPOINTS_3, scores: &SCORES_3 },
    Detection { class: &CAR, bbox: [397.9, 506.4, 698.9, 627.2], keypoints_2d: &KEYPOINTS_4, scores: &SCORES_4 },
];

/// The truth of the first four: yaw in radians, then the origin in the camera frame in metres.
pub const TRUTH: [[f64; 4]; 4] = [
    [0.050, -1.800, 1.179, 14.042],
    [3.050, 3.400, 0.939, 22.038],
    [-0.100, 2.000, 0.669, 31.034],
    [1.500, 0.400, 0.399, 40.030],
];

#[rustfmt::skip]
const KEYPOINTS_0: [[f64; 2]; 28] = [
    HIDDEN, HIDDEN, [707.8, 624.2], [865.8, 624.9], HIDDEN, HIDDEN,
    [831.9, 633.7], [850.8, 571.3], HIDDEN, [894.7, 548.2], [761.2, 523.5], [855.4, 525.8],
    HIDDEN, HIDDEN, HIDDEN, HIDDEN, [693.6, 636.3], [844.0, 639.0],
    [715.0, 559.5], [841.2, 560.6], [733.7, 533.1], [835.1, 531.7], [739.4, 560.3], [873.4, 559.9],
    [798.4, 615.3], [857.5, 563.5], HIDDEN, [764.2, 598.4],
];
#[rustfmt::skip]
const SCORES_0: [f64; 28] = [
    0.00, 0.00, 0.84, 0.69, 0.00, 0.00, 0.60, 0.74, 0.00, 0.87, 0.78, 0.88, 0.00, 0.00,
    0.00, 0.00, 0.86, 0.79, 0.68, 0.95, 0.65, 0.87, 0.96, 0.61, 0.45, 0.64, 0.00, 0.98,
];

#[rustfmt::skip]
const KEYPOINTS_1: [[f64; 2]; 28] = [
    [1214.3, 577.7], [1115.6, 576.7], [1171.4, 570.9], [1084.9, 567.9], [1223.1, 553.9], [1125.2, 553.7],
    HIDDEN, HIDDEN, [1209.2, 531.5], [1098.0, 531.5], [1180.8, 514.3], [1117.5, 516.2],
    [1196.8, 539.7], [1118.1, 539.2], [1083.0, 560.0], [1137.4, 587.2], HIDDEN, HIDDEN,
    HIDDEN, HIDDEN, HIDDEN, [1098.6, 516.4], [1186.8, 535.6], [1099.0, 536.1],
    HIDDEN, HIDDEN, [1203.3, 574.3], HIDDEN,
];
#[rustfmt::skip]
const SCORES_1: [f64; 28] = [
    0.99, 0.70, 0.85, 0.85, 0.87, 0.87, 0.00, 0.00, 0.62, 0.78, 0.71, 0.82, 0.74, 0.87,
    0.45, 0.84, 0.00, 0.00, 0.00, 0.00, 0.00, 0.85, 0.80, 0.87, 0.00, 0.00, 0.60, 0.00,
];

#[rustfmt::skip]
const KEYPOINTS_2: [[f64; 2]; 26] = [
    HIDDEN, HIDDEN, [1001.8, 495.9], [1083.0, 553.8], HIDDEN, HIDDEN,
    [1016.6, 534.1], [1093.5, 534.0], [988.4, 517.4], [1072.1, 519.7], [1007.3, 501.4], [1058.3, 501.5],
    HIDDEN, HIDDEN, HIDDEN, HIDDEN, [1013.7, 499.5], [1072.6, 498.8],
    [1030.4, 538.0], [1078.5, 522.5], [1018.7, 523.1], [1093.6, 523.9], [1018.1, 551.2], [1092.4, 552.0],
    HIDDEN, [1057.5, 523.1],
];
#[rustfmt::skip]
const SCORES_2: [f64; 26] = [
    0.00, 0.00, 0.45, 0.93, 0.00, 0.00, 0.99, 0.90, 0.73, 0.87, 0.95, 0.84, 0.00, 0.00,
    0.00, 0.00, 0.80, 0.66, 0.60, 0.84, 0.66, 0.87, 0.75, 0.57, 0.00, 0.83,
];

#[rustfmt::skip]
const KEYPOINTS_3: [[f64; 2]; 28] = [
    HIDDEN, [1014.5, 542.7], HIDDEN, [934.9, 541.7], HIDDEN, [1025.6, 530.0],
    HIDDEN, [915.1, 525.6], HIDDEN, [992.1, 520.0], [977.5, 508.7], [945.9, 524.3],
    HIDDEN, [998.1, 523.5], HIDDEN, [1034.4, 546.3], HIDDEN, [1002.0, 545.1],
    [920.1, 523.9], [922.7, 518.6], [929.4, 511.3], [931.6, 512.3], HIDDEN, [968.7, 523.0],
    HIDDEN, [931.2, 522.6], [1037.1, 539.0], [907.3, 530.8],
];
#[rustfmt::skip]
const SCORES_3: [f64; 28] = [
    0.00, 0.73, 0.00, 0.46, 0.00, 0.87, 0.00, 0.93, 0.00, 0.84, 0.50, 0.45, 0.00, 0.99,
    0.00, 0.97, 0.00, 0.60, 0.87, 0.80, 0.92, 0.78, 0.00, 0.62, 0.00, 0.75, 0.84, 0.86,
];

#[rustfmt::skip]
const KEYPOINTS_4: [[f64; 2]; 28] = [
    HIDDEN, HIDDEN, [415.1, 610.9], [588.7, 594.3], HIDDEN, HIDDEN,
    [554.1, 588.6], [637.9, 536.4], HIDDEN, [484.5, 624.9], [670.4, 576.7], [634.7, 615.3],
    HIDDEN, HIDDEN, HIDDEN, HIDDEN, [410.3, 583.6], [675.3, 587.3],
    [691.5, 568.2], [641.8, 523.3], [667.5, 559.1], [661.8, 545.1], [585.8, 608.6], [612.0, 581.3],
    [690.1, 517.0], [428.6, 573.0], HIDDEN, [491.1, 519.4],
];
#[rustfmt::skip]
const SCORES_4: [f64; 28] = [
    0.00, 0.00, 0.62, 0.76, 0.00, 0.00, 0.75, 0.82, 0.00, 0.96, 0.45, 0.60, 0.00, 0.00,
    0.00, 0.00, 0.99, 0.83, 0.78, 0.87, 0.57, 0.80, 0.67, 0.99, 0.89, 0.82, 0.00, 0.50,
];
