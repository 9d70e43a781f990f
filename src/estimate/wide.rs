//! An object seen through a wide lens: estimated in a pinhole view that faces it, and turned back.
//!
//! Keypoints are rays, and so points of that view: nothing of them is approximated. A side of the 2D box is a line of pixels
//! and so a cone of rays, of which the view has one plane: the column or row through a point of that line. The object
//! touches the side somewhere, but where is known only with its pose. At first the point is the middle of the side. Then
//! the sides are moved by as much as the 3D box of the pose found ends elsewhere in that view than through the lens, and
//! the pose is found again: there the planes are those that touch the object.

use nalgebra::{Matrix6, Vector3};

use crate::error::NoPose;
use crate::estimate::describe::Estimate;
use crate::estimate::options::Options;
use crate::estimate::outline::Outline;
use crate::estimate::pipeline::estimate_ideal;
use crate::estimate::workspace::Buffers;
use crate::geometry::bbox::Bbox;
use crate::geometry::camera::Camera;
use crate::geometry::local_view::LocalView;
use crate::geometry::view::View;
use crate::model::observation::Observation;
use crate::refine::covariance::PoseCovariance;
use crate::tuning::SIDES_SETTLED;

/// The pose of what is seen through a wide lens. A call of its own: its variables are no part of the stack of others.
///
/// # Errors
/// The data has no answer.
#[inline(never)]
pub(crate) fn estimate_wide(
    view: &View,
    observation: &Observation,
    options: &Options,
    index: u64,
    mut buffers: Buffers,
) -> Result<Estimate, NoPose> {
    let pixels = core::mem::take(&mut buffers.pixels);
    let Some(local) = facing(view, observation) else {
        buffers.residuals.fill(f64::NAN);
        return Err(NoPose::TooFewKeypoints);
    };
    let camera = &view.camera;
    for (pixel, &distorted) in pixels.iter_mut().zip(observation.keypoints_2d()) {
        *pixel = local.pixel(camera, distorted).unwrap_or([f64::NAN; 2]);
    }
    let given = observation.bbox().map(|bbox| view.uncut_bbox(bbox));
    let mut pass = |bbox: Option<Bbox>| {
        estimate_ideal(&local.view, &observation.seen_ideally(pixels, bbox), options, index, buffers.lend())
    };
    let sides = given.map(|given| local.bbox(camera, given));
    let mut estimate = pass(sides)?;
    let touching = given.and_then(|given| touching_sides(camera, &local, observation, &estimate, given));
    let worth = options.effective_bbox_sigma(estimate.inlier_threshold).min(estimate.inlier_threshold);
    if farthest_move(sides, touching) > SIDES_SETTLED * worth {
        // What the first sides found is still an answer; then it is found once more for its residuals.
        estimate = pass(touching).or_else(|_| pass(sides))?;
    }
    turn_to_camera(&mut estimate, &local);
    Ok(estimate)
}

/// The view that faces the middle of the 2D box; of the keypoints, where sides are unknown or the lens shows nothing there.
fn facing(view: &View, observation: &Observation) -> Option<LocalView> {
    let middle = observation.bbox().map_or([f64::NAN; 2], |bbox| bbox.middle());
    LocalView::facing(view, middle).or_else(|| {
        let of_keypoints = middle_of_keypoints(&view.camera, observation);
        let known = |axis: usize| if middle[axis].is_nan() { of_keypoints[axis] } else { middle[axis] };
        LocalView::facing(view, [known(0), known(1)]).or_else(|| LocalView::facing(view, of_keypoints))
    })
}

/// Mean of the keypoints that the lens shows; not numbers without any.
fn middle_of_keypoints(camera: &Camera, observation: &Observation) -> [f64; 2] {
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for (i, &[u, v]) in observation.keypoints_2d().iter().enumerate() {
        if observation.is_visible(i) && camera.direction_of([u, v]).is_some() {
            sum = [sum[0] + u, sum[1] + v];
            count += 1.0;
        }
    }
    sum.map(|x| x / count)
}

/// Sides of a box in a local view such that the 3D box of a pose touches them there where it touches the given sides
/// through the lens: moved by as much as it ends elsewhere. `None` where a part of it is not shown.
fn touching_sides(
    camera: &Camera,
    local: &LocalView,
    observation: &Observation,
    estimate: &Estimate,
    given: Bbox,
) -> Option<Bbox> {
    let outline = Outline::of(observation.model(), &estimate.shape_coefficients);
    let point = |x: &Vector3<f64>| estimate.pose.r * x + estimate.pose.t;
    let here = outline.extent_of_corners(|x| local.view.camera.project(&point(x)))?;
    let seen = outline.extent_of_edges(|x| camera.image_of(&local.to_camera(&point(x))))?;
    let [left, top, right, bottom] = core::array::from_fn(|side| here[side] - seen[side]);
    Some(Bbox {
        left: given.left + left,
        top: given.top + top,
        right: given.right + right,
        bottom: given.bottom + bottom,
    })
}

/// Pixels; unknown sides do not move.
fn farthest_move(from: Option<Bbox>, to: Option<Bbox>) -> f64 {
    let (Some(from), Some(to)) = (from, to) else { return 0.0 };
    let moves = [to.left - from.left, to.top - from.top, to.right - from.right, to.bottom - from.bottom];
    moves.iter().fold(0.0, |most, x| x.abs().max(most))
}

/// Pose, covariances and the other reading from a local view to the camera's frame. The yaw is about the ground and the
/// same.
fn turn_to_camera(estimate: &mut Estimate, local: &LocalView) {
    let mut turn = Matrix6::zeros();
    for block in [0, 3] {
        turn.fixed_view_mut::<3, 3>(block, block).copy_from(&local.rotation_to_camera());
    }
    let turned = |covariance: &PoseCovariance| {
        let product = turn * covariance * turn.transpose();
        (product + product.transpose()) * 0.5
    };
    estimate.pose = local.pose_to_camera(&estimate.pose).orthonormalized();
    estimate.covariance = estimate.covariance.as_ref().map(turned);
    estimate.shape_pose_covariance = estimate.shape_pose_covariance.as_ref().map(|between| between * turn.transpose());
    if let Some(other) = &mut estimate.alternative {
        other.pose = local.pose_to_camera(&other.pose).orthonormalized();
        other.covariance = other.covariance.as_ref().map(turned);
    }
}
