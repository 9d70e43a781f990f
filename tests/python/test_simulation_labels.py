"""Labels of the virtual drive against slow and obvious ways to find the same."""

import dataclasses
import math

import groundpose as gp
import numpy as np
import pytest
from groundpose.lab.drive import HIDDEN, OUTSIDE, VISIBLE, labels, props, scene, scene_seed
from groundpose.lab.drive.body_cache import body
from groundpose.lab.drive.labels import own_body_hides
from groundpose.lab.drive.road import STEP
from groundpose.lab.drive.scene import Prop
from groundpose.lab.drive.silhouette import NEAR, Region, outline
from groundpose.lab.drive.solids import solid
from groundpose.lab.drive.visibility import look
from groundpose.vehicles import CLASSES
from PIL import Image, ImageDraw

SEED = scene_seed(9, "validation")
FRAMES = (0, 7, 19)
BODY = {"car": 200_001, "van_bus": 200_002, "pickup": 200_003, "box_truck": 200_004}


@pytest.fixture(scope="module")
def frames():
    scenes = [scene(SEED, number) for number in FRAMES]
    return [(s, labels(s)) for s in scenes]


@pytest.fixture(scope="module")
def stage():
    """A scene of the drive that tests put vehicles on."""
    return scene(SEED, 0)


def parked(stage, class_name, x, z, yaw_deg):
    """A vehicle at a place of the camera's frame, upright there."""
    ahead = stage.view.R_camera_from_ground
    a = math.radians(yaw_deg)
    R = ahead @ np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    t = ahead @ [x, stage.height, z]
    world = stage.R_camera_from_world.T
    return dataclasses.replace(
        stage.vehicles[0],
        class_name=class_name,
        seed=BODY[class_name],
        R_world=world @ R,
        t_world=world @ (t - stage.t_camera_from_world),
    )


def with_vehicles(stage, *vehicles):
    return dataclasses.replace(stage, vehicles=vehicles, props=())


def brute_force_box(frame, vehicle):
    """Extent of all vertices, by the definition of the pose and of the camera."""
    points = []
    for v in body(vehicle.class_name, vehicle.seed).vertices:
        x, y, z = (
            frame.R_camera_from_world @ (vehicle.R_world @ v + vehicle.t_world) + frame.t_camera_from_world
        )
        if z < NEAR:
            return None
        points.append((frame.camera.fx * x / z + frame.camera.cx, frame.camera.fy * y / z + frame.camera.cy))
    return np.concatenate([np.min(points, axis=0), np.max(points, axis=0)])


def test_boxes_are_the_extent_of_all_vertices(frames):
    checked = 0
    for frame, found in frames[:2]:
        for label in found[:4]:
            box = brute_force_box(frame, frame.vehicles[label.index])
            if box is None:
                continue
            np.testing.assert_allclose(label.bbox_full, box, atol=1e-7)
            np.testing.assert_allclose(label.bbox, np.clip(box, 0, [1913, 1079, 1913, 1079]), atol=1e-7)
            checked += 1
    assert checked >= 4


def test_box_of_a_vehicle_beside_the_camera_is_cut(stage):
    [label] = labels(with_vehicles(stage, parked(stage, "car", 2.2, 2.0, 0.0)))
    assert np.isfinite(label.bbox_full).all()
    assert label.bbox_full[2] > 1913 > label.bbox[0]
    assert label.bbox[2] == 1913
    inside = np.prod(label.bbox[2:] - label.bbox[:2]) / np.prod(label.bbox_full[2:] - label.bbox_full[:2])
    assert label.truncation == pytest.approx(1.0 - inside)
    assert label.truncation > 0.5
    assert labels(with_vehicles(stage, parked(stage, "car", 0.0, -8.0, 0.0))) == []


@pytest.mark.parametrize(("fence", "hidden"), [("planks", 1.0), ("railing", 0.3), ("wire", 0.2)])
def test_a_car_behind_a_fence_is_hidden_as_far_as_its_bars_reach(stage, fence, hidden):
    car = parked(stage, "car", 0.0, 14.0, 90.0)
    before = parked(stage, "car", 0.0, 9.0, 0.0)
    size = np.array([0.05, 4.0, 30.0])
    yaw = math.atan2(stage.R_camera_from_world[0, 0], stage.R_camera_from_world[0, 2])
    prop = Prop("fence", props.FENCES.index(fence), before.t_world, yaw, size)
    found = labels(dataclasses.replace(stage, vehicles=(car,), props=(prop,)))
    if hidden == 1.0:
        assert found == []
        return
    [label] = found
    assert label.occluded_share == pytest.approx(hidden, abs=0.1)
    assert label.occluded_share == pytest.approx(props.cover("fence", prop.seed), abs=0.02)
    [free] = labels(dataclasses.replace(stage, vehicles=(car,), props=()))
    np.testing.assert_array_equal(label.keypoint_states, free.keypoint_states)


def test_keypoints_lie_in_the_unclipped_box_and_states_in_the_image(frames):
    seen = np.zeros(3, dtype=int)
    for frame, found in frames:
        for label in found:
            before = np.isfinite(label.keypoints_2d).all(axis=1)
            points = label.keypoints_2d[before]
            assert (points >= label.bbox_full[:2] - 0.2).all()
            assert (points <= label.bbox_full[2:] + 0.2).all()
            width, height = frame.camera.image_size
            inside = before.copy()
            inside[before] = ((points >= -0.5) & (points < [width - 0.5, height - 0.5])).all(axis=1)
            np.testing.assert_array_equal(label.keypoint_states == OUTSIDE, ~inside)
            seen += np.bincount(label.keypoint_states, minlength=3)
    assert (seen[[HIDDEN, VISIBLE]] > 50).all()


def ray_hits(vertices, faces, origin, directions):
    """(N,) whether rays of length one meet a triangle, by the formula of Möller and Trumbore."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    e1, e2 = b - a, c - a
    hit = np.zeros(len(directions), dtype=bool)
    for n, (o, d) in enumerate(zip(origin, directions, strict=True)):
        p = np.cross(d, e2)
        det = np.sum(e1 * p, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / det
            s = o - a
            u = np.sum(s * p, axis=1) * inverse
            q = np.cross(s, e1)
            v = np.sum(d * q, axis=1) * inverse
            distance = np.sum(e2 * q, axis=1) * inverse
            hit[n] = np.any((u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0) & (distance < 1))
    return hit


@pytest.mark.parametrize("class_name", CLASSES)
def test_own_body_hides_what_rays_do_not_reach(stage, class_name):
    agree = total = 0
    for x, z, yaw in ((-2.0, 9.0, 20.0), (3.0, 14.0, 160.0), (0.5, 25.0, 275.0)):
        frame = with_vehicles(stage, parked(stage, class_name, x, z, yaw))
        sight = look(frame, 0, frame.vehicles[0])
        target, made = sight.target, body(class_name, BODY[class_name])
        points = made.keypoints_3d @ target.R.T + target.t
        pixels = points[:, :2] / points[:, 2:] * frame.camera.fx + [frame.camera.cx, frame.camera.cy]
        hidden = own_body_hides(target, pixels, points[:, 2])
        eye = -target.R.T @ target.t
        toward = eye - made.keypoints_3d
        start = made.keypoints_3d + 0.03 * toward / np.linalg.norm(toward, axis=1, keepdims=True)
        rays = ray_hits(made.vertices, made.faces, start, eye - start)
        agree, total = agree + np.count_nonzero(hidden == rays), total + len(rays)
        assert hidden.any()
        assert not hidden.all()
    assert agree / total > 0.97


def mesh_mask(region, sight):
    """What the whole mesh covers of a region."""
    canvas = Image.new("L", (region.width, region.height))
    draw = ImageDraw.Draw(canvas)
    for face in sight.target.front_faces[0]:
        corners = (sight.target.pixels[face] - (region.left, region.top)) * region.scale - 0.5
        draw.polygon(corners.ravel().tolist(), fill=1)
    return np.asarray(canvas, dtype=bool)


@pytest.mark.parametrize("class_name", CLASSES)
def test_outline_covers_what_the_mesh_covers(stage, class_name):
    for x, z, yaw in ((-2.0, 12.0, 30.0), (0.0, 20.0, 90.0)):
        frame = with_vehicles(stage, parked(stage, class_name, x, z, yaw))
        sight = look(frame, 0, frame.vehicles[0])
        region = Region.around(sight.box)
        mesh, ours = mesh_mask(region, sight), region.mask(sight.polygons)
        assert np.count_nonzero(mesh & ours) / np.count_nonzero(mesh | ours) > 0.88


def test_outline_of_a_slab_cut_by_the_near_plane_ends_there(stage):
    known = solid("car", BODY["car"])
    points = known.slabs + np.array([1.5, 0.5, 1.0])  # its front half is before the camera
    polygons = outline(stage.camera, points)
    assert len(polygons)
    assert np.isfinite(polygons).all()
    assert outline(stage.camera, points - np.array([0.0, 0.0, 20.0])).shape[0] == 0


def test_occlusion_of_a_pair(stage):
    near, far = parked(stage, "car", 0.9, 12.0, 0.0), parked(stage, "car", 0.0, 18.0, 20.0)
    first, second = labels(with_vehicles(stage, near, far))
    assert (first.occlusion, first.occluded_share) == (0, 0.0)
    alone = labels(with_vehicles(stage, far))[0]
    assert alone.occluded_share == 0.0
    assert (alone.keypoint_states == VISIBLE).sum() > (second.keypoint_states == VISIBLE).sum()
    sights = [look(stage, 0, v) for v in (near, far)]
    region = Region.around(sights[1].box)
    covered, own = (mesh_mask(region, sight) for sight in sights)
    share = np.count_nonzero(covered & own) / np.count_nonzero(own)
    assert second.occluded_share == pytest.approx(share, abs=0.06)
    assert second.occlusion == 1
    # keypoints well inside the near one's box are hidden, those beside it are not hidden by it
    behind = (second.keypoints_2d > [first.bbox[0] + 5, first.bbox[1::2].mean()]).all(axis=1)
    assert (behind & (alone.keypoint_states == VISIBLE)).any()
    assert (second.keypoint_states[behind] == HIDDEN).all()
    beside = second.keypoints_2d[:, 0] < first.bbox[0]
    np.testing.assert_array_equal(second.keypoint_states[beside], alone.keypoint_states[beside])


def test_a_vehicle_behind_a_truck_has_no_label(stage):
    truck, car = parked(stage, "box_truck", 0.0, 14.0, 0.0), parked(stage, "car", 0.0, 30.0, 0.0)
    assert [label.index for label in labels(with_vehicles(stage, truck, car))] == [0]
    assert [label.index for label in labels(with_vehicles(stage, car, truck))] == [1]


def test_things_beside_the_road_hide_vehicles(stage):
    from groundpose.lab.drive import Prop

    car = parked(stage, "car", 0.0, 25.0, 90.0)
    middle = car.t_world - 3.0 * stage.R_camera_from_world.T @ [0.0, 0.0, 1.0]
    thing = Prop("bin", 0, middle, 0.0, np.array([2.0, 3.0, 0.3]))
    frame = dataclasses.replace(with_vehicles(stage, car), props=(thing,))
    [label] = labels(frame)
    assert label.occluded_share == pytest.approx(2.0 * 25 / 22 / label.size[0], abs=0.12)
    assert label.occlusion in (1, 2)


def test_poses_are_found_again_from_the_visible_keypoints(frames):
    """Exact keypoints, the body's own shape, no priors: the solver must return the label's pose."""
    options = gp.Options(tilt_sigma=math.inf, bbox_sigma=math.inf, relative_threshold=0.1)
    tested = 0
    for frame, found in frames:
        usable = [label for label in found if np.count_nonzero(label.keypoint_states == VISIBLE) >= 8]
        models = [gp.ShapeModel(label.keypoints_3d, label.bbox_3d, name=label.class_name) for label in usable]
        points = [np.where((a.keypoint_states == VISIBLE)[:, None], a.keypoints_2d, np.nan) for a in usable]
        view = gp.View(frame.camera)
        poses = gp.estimate_poses(view, points, [a.bbox for a in usable], models, options=options)
        for label, pose in zip(usable, poses, strict=True):
            assert pose.ok
            np.testing.assert_allclose(pose.R, label.R, atol=1e-6)
            np.testing.assert_allclose(pose.t, label.t, rtol=1e-6, atol=1e-6)
            tested += 1
    assert tested >= 5


def test_angles_of_kitti_and_of_the_planes_agree_with_the_pose(frames):
    for frame, found in frames:
        for label in found:
            forward = label.R[:, 2]
            assert math.cos(label.rotation_y + math.pi / 2) == pytest.approx(
                forward[2] / math.hypot(*forward[[0, 2]])
            )
            seen_from = label.rotation_y - math.atan2(label.location[0], label.location[2])
            assert math.cos(label.alpha - seen_from) == pytest.approx(1.0)
            view = gp.View(frame.camera, label.plane_pitch, label.plane_roll)
            np.testing.assert_allclose(view.R_camera_from_ground[:, 1], label.R[:, 1], atol=1e-9)
            length, height, width = label.size
            assert 2.5 < length < 19.0
            assert 1.0 < height < 4.5
            assert 1.3 < width < 2.7


@pytest.mark.parametrize(("crest", "least", "most"), [(0.0, 0.0, 0.0), (1.2, 0.2, 0.8), (3.0, None, None)])
def test_a_crest_hides_what_is_beyond(stage, crest, least, most):
    s = STEP * np.arange(300)
    flat = np.zeros(len(s))
    road = dataclasses.replace(
        stage.road,
        start=0.0,
        centre=np.stack([flat, s], axis=1),
        heading=flat,
        curvature=flat,
        height=crest * np.exp(-(((s - 22.0) / 5.0) ** 2)),
        bank=flat,
        crown=flat,
        junction=None,
    )
    beyond = dataclasses.replace(
        parked(stage, "car", 0, 9, 0), R_world=np.eye(3), t_world=np.array([0, 0, 45.0])
    )
    frame = dataclasses.replace(
        with_vehicles(stage, beyond),
        road=road,
        R_camera_from_world=np.eye(3),
        t_camera_from_world=np.array([0.0, 1.5, 0.0]),
    )
    shares = [label.occluded_share for label in labels(frame)]
    if least is None:
        assert shares == []
    else:
        assert least <= shares[0] <= most
