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

/// The pose of what is seen through a wide lens. Calls of their own, this and its steps: of their variables as little as can
/// be is on the stack under the search.
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
    for (pixel, &distorted) in pixels.iter_mut().zip(observation.keypoints_2d()) {
        *pixel = local.pixel(&view.camera, distorted).unwrap_or([f64::NAN; 2]);
    }
    let usable = observation.bbox().map(|bbox| view.uncut_bbox(bbox));
    let mut pass = |sides: Option<Bbox>| {
        estimate_ideal(&local.view, &observation.seen_ideally(pixels, sides), options, index, buffers.lend())
    };
    let middles = usable.map(|usable| local.bbox(&view.camera, usable));
    // A side whose middle the lens does not show is cut by the end of the picture.
    let given = usable.zip(middles).map(|(usable, middles)| usable.known_where(&middles));
    let mut answer = pass(middles);
    let found = answer.as_ref().ok().zip(given);
    let touching = found.and_then(|(found, given)| touching_sides(&view.camera, &local, observation, found, given));
    if answer.as_ref().is_ok_and(|found| is_elsewhere(middles, touching, found, options)) {
        answer = pass(touching);
        if answer.is_err() {
            // What the first sides found is still an answer.
            answer = pass(middles);
        }
    }
    if let Ok(estimate) = &mut answer {
        turn_to_camera(estimate, &local);
    }
    answer
}

/// The view that faces the middle of the 2D box; of the keypoints, where sides are unknown or the lens shows nothing there.
#[inline(never)]
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
#[inline(never)]
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

/// Whether a side moved by more than does not matter; an unknown one does not move.
fn is_elsewhere(from: Option<Bbox>, to: Option<Bbox>, estimate: &Estimate, options: &Options) -> bool {
    let (Some(from), Some(to)) = (from, to) else { return false };
    let moves = [to.left - from.left, to.top - from.top, to.right - from.right, to.bottom - from.bottom];
    let worth = options.effective_bbox_sigma(estimate.inlier_threshold).min(estimate.inlier_threshold);
    moves.iter().any(|x| x.abs() > SIDES_SETTLED * worth)
}

/// Pose, covariances and the other reading from a local view to the camera's frame. The yaw is about the ground and the
/// same.
#[inline(never)]
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
