//! Every number that was chosen rather than derived, step by step, with its reason and what it was chosen on.
//!
//! "Paper" is Lee et al., "1-Point RANSAC-Based Method for Ground Object Pose Estimation", CVPR Workshops 2021. Where no
//! data set is named, the number was chosen by hand and then kept by the tests and by the published results
//! (`make results`). Constants of mathematics and guards of rounding stay where they are used.

use core::f64::consts::PI;

// The inlier threshold, from which most lengths in pixels follow.

/// Inlier threshold relative to the longer side of the 2D box (paper, sec. 4.2.4).
pub(crate) const RELATIVE_THRESHOLD: f64 = 0.0375;
/// `tau_1, tau_2, tau_3` of HRE in inlier thresholds (paper, sec. 4.1.5: 4, 6, 12 px at a threshold of 4 px).
pub(crate) const HRE_THRESHOLDS: [f64; 3] = [1.0, 1.5, 3.0];
/// Without a box, the extent of the keypoints stands for it: one in so many is left out at either end, so that a few
/// wrong keypoints do not stretch it. Chosen by hand.
pub(crate) const EXTENT_LEAVES_OUT: usize = 10;
/// Keypoints all as near to one of them as this fraction of the longer side of the 2D box say nothing of a pose: of V1's
/// objects none has its keypoints within a third. Chosen by hand.
pub(crate) const COLLAPSED: f64 = 0.1;
/// Sides of a 2D box this close to the image border, pixels, are cut by it. Chosen by hand.
pub(crate) const BORDER_PX: f64 = 1.5;

// Wide lenses.

/// Directions further than 80 degrees from the middle of their object (cosine) count as not seen: a pinhole that faces the
/// object draws them out of all proportion. Chosen by hand.
pub(crate) const NARROWEST_RAY: f64 = 0.17;
/// The sides of a 2D box are as good as they get when the pose moves none of them by more than this, in standard deviations
/// of a side or inlier thresholds, whichever are smaller. Chosen by hand.
pub(crate) const SIDES_SETTLED: f64 = 0.1;

// The search.

/// Corners of the 3D box may lie outside the planes of the box sides by this fraction of the keypoint's distance: 3 %
/// served well with noise of 2 px.
pub(crate) const FEASIBILITY_TOLERANCE: f64 = 0.03;
/// The same in the default refinement, in inlier thresholds: 3 % of the distance is as wide as a car at 60 m. On KITTI's
/// cars, whose boxes hold what is visible, room of one threshold loses right answers, of three loses none, and four are
/// as good as six there and on the virtual drive (`groundpose evaluate kitti`; docs/performance.md, "Tried and dropped").
pub(crate) const BBOX_ROOM: f64 = 4.0;
/// Poses whose forward axes differ by more than 30 degrees face another way (cosine): two hypotheses that do not are
/// one, two answers that do are ambiguous. Chosen by hand.
pub(crate) const OTHER_WAY: f64 = 0.866;
/// Candidates that the default refinement refines. Chosen by hand.
pub(crate) const CANDIDATES: usize = 2;
/// A second candidate costs at most so many times the first. Chosen by hand.
pub(crate) const WORST_CANDIDATE: f64 = 1.3;
/// Draws of one keypoint in any case: a drawn inlier may still be a noisy one. Chosen by hand.
pub(crate) const MIN_DRAWS: usize = 8;

// The noise of the keypoints.

/// Guess of the standard deviation of a coordinate, in inlier thresholds. Chosen by hand.
pub(crate) const NOISE_PER_THRESHOLD: f64 = 0.5;
/// Keypoints' worth of the guess. Chosen by hand.
pub(crate) const NOISE_GUESS_WEIGHT: f64 = 3.0;
/// Smallest and largest noise, in guesses. Chosen by hand.
pub(crate) const NOISE_LIMITS: [f64; 2] = [0.04, 4.0];
/// Keypoints' worth of freedom that the pose was fitted with, and the fewest that are left. Chosen by hand.
pub(crate) const NOISE_FITTED: f64 = 2.0;
pub(crate) const NOISE_FEWEST: f64 = 0.5;
/// Rounds of expectation and maximisation, from this fraction of inliers on: the estimate has two digits after that.
pub(crate) const NOISE_ROUNDS: usize = 5;
pub(crate) const NOISE_START_FRACTION: f64 = 0.5;
/// The fraction of inliers stays away from certainty. Chosen by hand.
pub(crate) const INLIER_FRACTIONS: [f64; 2] = [0.02, 0.98];
/// Tukey's `c` in units of the residual at which inlier and outlier are as likely: the weight there is 0.24, the best
/// compromise between few outliers (wider is better) and many (narrower).
pub(crate) const TUKEY_PER_EVEN: f64 = 1.4;
/// Narrowest and widest Tukey scale, in standard deviations of the noise. Chosen by hand.
pub(crate) const TUKEY_LIMITS: [f64; 2] = [3.5, 9.0];

// The default refinement. Its first stage only has to tell candidates apart; the second ends where it is as exact as the
// keypoints. Iterations and tolerances were chosen by hand.

/// Scale of the wide stage, in inlier thresholds.
pub(crate) const WIDE_SCALE: f64 = 5.0;
pub(crate) const WIDE_ITERATIONS: usize = 6;
pub(crate) const WIDE_TOLERANCE: f64 = 1e-2;
pub(crate) const POLISH_ITERATIONS: usize = 25;
pub(crate) const POLISH_TOLERANCE: f64 = 1e-5;

// The paper's refinements run until nothing changes.

pub(crate) const PAPER_TOLERANCE: f64 = 1e-8;
pub(crate) const GN_ITERATIONS: usize = 20;
pub(crate) const RE_ITERATIONS: usize = 50;
pub(crate) const HRE_ITERATIONS: [usize; 3] = [30, 30, 20];

// Steps of the least squares. Chosen by hand.

/// Damping of the first step, and its limits.
pub(crate) const DAMPING_START: f64 = 1e-6;
pub(crate) const DAMPING_LIMITS: [f64; 2] = [1e-10, 1e8];
/// What damping is multiplied by after a step that lowers the cost, one that does not, and one that does not exist.
pub(crate) const DAMPING_ACCEPTED: f64 = 0.1;
pub(crate) const DAMPING_REJECTED: f64 = 10.0;
pub(crate) const DAMPING_SINGULAR: f64 = 100.0;
/// Rejected steps in a row before giving up.
pub(crate) const MAX_REJECTIONS: usize = 6;
/// A step that the linear model expects to lower the cost by less than this fraction of the tolerance is the last one:
/// robust kernels give more than the model expects, but not so much more.
pub(crate) const LAST_STEP: f64 = 0.5;

// Priors of the default refinement.

/// Standard deviation, radians, of an object's up axis about the ground's normal: 1.5 degrees, as the
/// true pitch varies in the synthetic vehicle scenes.
pub(crate) const OBJECT_TILT_SIGMA: f64 = 1.5 * (PI / 180.0);
/// Degrees of freedom of the tilt prior: nearly Gaussian inside, forgiving for a tilt that is wrong for the whole frame.
/// Chosen by hand.
pub(crate) const TILT_DOF: f64 = 8.0;
/// A tilt prior of zero width is the upright pose: as narrow as keeps the equations well conditioned, radians.
pub(crate) const NARROWEST_TILT: f64 = 1e-5;
/// Standard deviation of the sides of the 2D box, in inlier thresholds. Chosen by hand.
pub(crate) const RELATIVE_BBOX_SIGMA: f64 = 2.0;
/// Standard deviations at which a side of the box loses its say: detectors' boxes have heavy tails, and the box of a
/// hidden object ends anywhere. Chosen by hand.
pub(crate) const BBOX_CUT: f64 = 4.0;

// The comparison of refined candidates.

/// Poses whose forward axes differ by less than 3 degrees (cosine) after the first stage end in the same place: of two
/// candidates more than half do.
pub(crate) const SAME_WAY: f64 = 0.9986;
/// A candidate that costs so many times the best one after the first stage does not win: of cars whose second
/// candidate ended elsewhere it did so in 2 of 415 cases.
pub(crate) const HOPELESS: f64 = 2.0;
/// Residuals beyond so many standard deviations of the noise count the same. Chosen by hand.
pub(crate) const JUDGING_CUT: f64 = 3.0;
/// Least noise, in inlier thresholds, by which two poses are compared for their ambiguity. Chosen by hand.
pub(crate) const AMBIGUITY_NOISE: f64 = 0.25;

// The test against chance.

/// Noise, in guesses of it, at which a pose is tested, and its part of the test: fixed, so that chance cannot choose it.
pub(crate) const TESTED_NOISE: [(f64, f64); 3] = [(0.7, 0.15), (1.4, 0.6), (2.8, 0.25)];
/// Part of the test that goes to believing the scores as they are; the rest to finding the fraction of inliers. Chosen
/// by hand.
pub(crate) const BELIEF_IN_SCORES: f64 = 0.9;
/// An answer has at most ten false alarms (log10). Chosen by hand.
pub(crate) const MAX_LOG10_NFA: f64 = 1.0;

// The probability that an answer is right. What a number is measured against only moves the bias; limits keep one number
// from deciding alone. Chosen by hand.

/// Misfit of the box and noise of the keypoints of a good answer, as fractions of the longer side.
pub(crate) const TYPICAL_MISFIT: f64 = 0.02;
pub(crate) const TYPICAL_NOISE: f64 = 0.01;
/// Sides that agree better than this say no more.
pub(crate) const LEAST_MISFIT: f64 = 0.002;
/// Limits of mean score, ambiguity, log10 of false alarms, logit of a vehicle.
pub(crate) const SCORE_LIMITS: [f64; 2] = [0.001, 0.999];
pub(crate) const AMBIGUITY_LIMITS: [f64; 2] = [0.001, 0.999];
/// The same of what viewing angles say, wider: a line through the logits needs them.
pub(crate) const NETWORK_AMBIGUITY_LIMITS: [f64; 2] = [0.0001, 0.9999];
pub(crate) const FALSE_ALARM_LIMITS: [f64; 2] = [-40.0, 10.0];
pub(crate) const VEHICLE_LOGIT_LIMIT: f64 = 7.0;
/// For keypoints of the caller, without scores and with them: bias, score level, misfit, noise, false alarms, vehicle (of
/// which nothing is known), ambiguity. Fitted on a mixture of synthetic objects of every quality; there the probabilities
/// are right within 2 % (`python -m groundpose.lab.evaluate.honesty.callers`).
pub(crate) const PROBABILITY_WITHOUT_SCORES: [f64; 7] = [1.42, 0.25, -1.01, -1.55, -1.33, 0.0, -0.15];
pub(crate) const PROBABILITY_WITH_SCORES: [f64; 7] = [5.01, 2.73, -0.23, -0.18, -0.35, 0.0, -0.26];
/// Least probability of an answer to keypoints of the caller: of the mixture's right answers 99.8 % stay, of those to
/// keypoints labelled by hand 98 %, of V1 and E1 all.
pub(crate) const MIN_PROBABILITY: f64 = 0.15;
/// Probability from which another reading is told.
pub(crate) const LEAST_ALTERNATIVE: f64 = 0.02;

// The second try.

/// A pose with more false alarms than this (log10) is doubtful: where the solver is ours to choose, the search is done
/// again without the box, a side of which may be wrong. With it the simulated detector's targets are met
/// (`groundpose experiment G1`, `G2`).
pub(crate) const DOUBTFUL: f64 = -6.0;
/// What a second try has to be better by (log10 of false alarms): chance has 1.2 tries in all.
pub(crate) const SECOND_TRY: f64 = 0.7;
/// An object looks at least so large, as a fraction of its 2D box. Chosen by hand.
pub(crate) const SMALLEST_LOOK: f64 = 0.5;

// The last try, without the ground. Chosen on the scenes of `groundpose evaluate silent`, whose nominal tilt is wrong.

/// More false alarms (log10) do not convince: 1 % of V1's answers have more than -5.
pub(crate) const UNCONVINCING: f64 = -3.0;
/// Nor does a larger misfit of the 2D box (root mean square of the sides, as a fraction of the longer one): 1 % of V1's
/// answers have more, and 90 % of those that the ground misled.
pub(crate) const MISFIT_UNCONVINCING: f64 = 0.035;
/// The largest misfit of a pose that the ground does not hold: with the model of another class it bends to any keypoints,
/// but not to the box.
pub(crate) const MISFIT_WITHOUT_GROUND: f64 = 0.05;
/// What the third keypoint of a sample says without meaning it (log10 of false alarms): it fits whatever it is.
pub(crate) const THIRD_KEYPOINT: f64 = 2.0;
/// What a last try has to be better by (log10 of false alarms): the third keypoint, and the price of another try. The box
/// may make up for the first, not for the second: it may be that of the visible part alone.
pub(crate) const LAST_TRY: f64 = THIRD_KEYPOINT + SECOND_TRY;
/// Most draws: of one keypoint in four that is right, three at once come up with probability 0.99.
pub(crate) const LAST_DRAWS: usize = 50;
/// Standard deviation of a side when poses with and without the ground are compared, as a fraction of the longer side,
/// and most standard deviations that count.
pub(crate) const MISFIT_SIGMA: f64 = 0.02;
pub(crate) const MISFIT_CUT: f64 = 4.0;

// The tilt of a frame.

/// Degrees of freedom of objects about the frame's tilt: wrong poses, ramps. Chosen by hand.
pub(crate) const FRAME_DOF: f64 = 4.0;
/// The weights settle in a few steps; more change nothing that matters.
pub(crate) const FRAME_ITERATIONS: usize = 20;

// The frame as a whole (method, "how far"). Standard deviations are those that make the labels of KITTI's roads likeliest.

/// Of a frame's pitch and roll about the nominal ones, radians: what braking, load and the road's camber do to a camera
/// on a car, and how well its mounting is known.
pub(crate) const FRAME_PITCH_SIGMA: f64 = 0.7 * (PI / 180.0);
pub(crate) const FRAME_ROLL_SIGMA: f64 = 1.4 * (PI / 180.0);
/// Of a nominal height, as a fraction: 5 cm of a camera on a car.
pub(crate) const HEIGHT_SIGMA: f64 = 0.03;
/// Of the logarithm of an unknown height about the median of what the objects say: no opinion.
pub(crate) const UNKNOWN_HEIGHT_SIGMA: f64 = 1.0;
/// Heights that a camera may have, metres.
pub(crate) const HEIGHTS: [f64; 2] = [0.1, 300.0];
/// Of the road under a vehicle about the plane through all: metres, and radians over its distance.
pub(crate) const ROAD_ROUGHNESS: f64 = 0.041;
pub(crate) const ROAD_SLOPE: f64 = 0.12 * (PI / 180.0);
/// How roads bend up and down, 1 / m. With the constants of a camera's frames below chosen on KITTI's sequences 0 to 4
/// and on drives of the validation split.
pub(crate) const ROAD_CURVATURE: f64 = 2.5e-4;
/// Of the mean size of a class where the region is not known, and of a vehicle about it, as fractions.
pub(crate) const CLASS_SIZE_SIGMA: f64 = 0.08;
pub(crate) const OWN_SIZE_SIGMA: f64 = 0.05;
/// Of a frame's pitch, roll (radians) and log height about the mean of its drive: motion, and roads that fall to the side
/// for a while.
pub(crate) const PITCH_OF_FRAMES: f64 = 0.5 * (PI / 180.0);
pub(crate) const ROLL_OF_FRAMES: f64 = 1.2 * (PI / 180.0);
pub(crate) const HEIGHT_OF_FRAMES: f64 = 0.02;
/// Part of a frame's information that a camera's state takes: frames of a drive show the same vehicles.
pub(crate) const CARRIED_INFORMATION: f64 = 0.03;
/// Most of what is told of a frame's variance that differs from frame to frame; the rest belongs to the drive.
pub(crate) const MOST_OF_FRAMES: f64 = 0.5;
/// Degrees of freedom of contacts about the road: wrong poses, ramps. Chosen by hand.
pub(crate) const CONTACT_DOF: f64 = 4.0;
/// A bottom centre above this fraction of the camera's height counts as there: above the horizon there is no logarithm.
/// Chosen by hand.
pub(crate) const LOWEST_CONTACT: f64 = 0.15;
/// Steps of the frame solve; it ends earlier when no unknown changes by more than the smallest step, and none is longer
/// than the largest. Chosen by hand.
pub(crate) const SOLVE_ITERATIONS: usize = 12;
pub(crate) const SMALLEST_FRAME_STEP: f64 = 1e-6;
pub(crate) const LARGEST_FRAME_STEP: f64 = 0.3;
/// Largest pitch of a solved frame, radians: at the nadir there is no roll. Chosen by hand.
pub(crate) const STEEPEST_PITCH: f64 = 1.5;
