"""Poses and frames as Arrow tables: bit for bit, with schemas that stay."""

import copy
import pickle

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, make_batch
from groundpose.demo.street import example
from groundpose.formats import arrow_schema
from groundpose.formats.arrow_poses import Answer, poses_table
from groundpose.vehicles import CLASSES, shape_model

pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
parquet = pytest.importorskip("pyarrow.parquet")


def assert_equal(a, b, without=()):
    assert type(a) is type(b)
    for name, value in vars(a).items():
        if name in without:
            continue
        other = getattr(b, name)
        if isinstance(value, np.ndarray):
            assert value.dtype.kind == other.dtype.kind, name
            np.testing.assert_array_equal(value, other, err_msg=name)
        elif name == "models":
            assert [m.name for m in value] == [m.name for m in other]
            for one, two in zip(value, other, strict=True):
                for array in ("keypoints_3d", "bbox_3d", "basis", "eigenvalues", "footprint", "bbox_basis"):
                    np.testing.assert_array_equal(getattr(one, array), getattr(two, array))
        else:
            assert type(value) is type(other)
            assert repr(value) == repr(other), name  # in which every bit shows, and NaN is NaN


def mixed(frame=None, n=9):
    """Objects of two classes of unlike numbers of keypoints and modes, one without an answer."""
    models = [shape_model("car"), shape_model("box_truck"), MODEL]
    parts = [make_batch(n // 3, seed=k, model=model) for k, model in enumerate(models)]
    each = [models[k % 3] for k in range(n)]
    keypoints = [parts[k % 3].keypoints_2d[k // 3] for k in range(n)]
    keypoints[4] = np.full_like(keypoints[4], np.nan)
    boxes = np.array([parts[k % 3].bboxes[k // 3] for k in range(n)])
    return gp.estimate_poses(parts[0].view, keypoints, boxes, each, frame=frame)


@pytest.fixture(scope="module")
def vehicles():
    given = example()
    return gp.Pipeline(network="int8", threads=1)(given.image, given.bboxes, given.view)


@pytest.mark.parametrize("frame", [None, gp.FramePriors()], ids=["alone", "on one road"])
def test_a_batch_comes_back_bit_for_bit(frame, tmp_path):
    poses = mixed(frame)
    assert_equal(gp.PoseBatch.from_arrow(poses.to_arrow()), poses)
    assert_equal(gp.PoseBatch.from_arrow(poses.to_records()), poses)
    parquet.write_table(poses.to_arrow("7"), tmp_path / "poses.parquet")
    again = parquet.read_table(tmp_path / "poses.parquet")
    assert again.column("frame").unique().to_pylist() == ["7"]
    assert_equal(gp.PoseBatch.from_arrow(again), poses)


def test_what_a_network_says_comes_back_too(vehicles):
    again = gp.VehiclePoses.from_arrow(vehicles.to_arrow())
    assert_equal(again, vehicles, without=("seconds", "ids"))
    assert again.ids.tolist() == [str(label) for label in vehicles.ids]
    assert set(vehicles.to_arrow().column("model").to_pylist()) <= {f"bundled:{c}" for c in CLASSES}


def test_a_batch_without_objects_comes_back():
    poses = gp.estimate_poses(make_batch(1).view, [], None, MODEL)
    table = poses.to_arrow()
    assert table.num_rows == 0
    again = gp.PoseBatch.from_arrow(table)
    assert len(again) == 0
    assert again.view == poses.view
    with pytest.raises(gp.InputError, match="a row, or the metadata"):
        gp.PoseBatch.from_arrow(table.replace_schema_metadata(None))
