"""Poses and frames as Arrow tables: bit for bit, with schemas that stay."""

import copy
import pickle
from dataclasses import fields
from pathlib import Path

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, VIEW, make_batch
from groundpose.demo.street import example
from groundpose.formats import arrow_schema
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


def test_a_batch_comes_back_from_pandas(vehicles):
    pytest.importorskip("pandas", reason="pandas is not installed")
    for poses in (mixed(), mixed(gp.FramePriors())):
        assert_equal(gp.PoseBatch.from_arrow(poses.to_pandas()), poses)
    nothing = gp.estimate_poses(VIEW, [], None, MODEL)
    assert len(gp.PoseBatch.from_arrow(nothing.to_pandas())) == 0
    frame = vehicles.to_pandas("street")
    assert frame["frame"].tolist() == ["street"] * len(vehicles)
    assert_equal(gp.VehiclePoses.from_arrow(frame), vehicles, without=("seconds", "ids"))


def test_what_is_no_table_of_poses():
    poses = gp.estimate_poses(VIEW, np.full((3, 24, 2), np.nan), None, MODEL)
    table = poses.to_arrow("a")
    for given, expected in (
        (table.drop_columns(["view", "R"]), "expected the columns R, view of poses"),
        (pa.concat_tables([table, poses.to_arrow("b")]), "the rows of one frame, got those of 2"),
        (table.replace_schema_metadata({arrow_schema.VERSION_KEY: b"2"}), "version 1, got version 2"),
        (table.set_column(8, "model", pa.array(["{}"] * 3)), "a shape model as JSON"),
        (table.set_column(9, "ok", pa.array([None] * 3, pa.bool_())), "column ok: expected no nulls, got 3"),
        (table.set_column(10, "R", pa.array([[[1.0]]] * 3)), "column R: expected lists of 3, got one of 1"),
        ([{"frame": 3}], "the columns of `PoseBatch.to_arrow`"),
    ):
        with pytest.raises(gp.InputError, match=expected):
            gp.PoseBatch.from_arrow(given)
    with pytest.raises(TypeError, match="a pyarrow Table, a pandas DataFrame or records, got str"):
        gp.PoseBatch.from_arrow("poses.parquet")


def test_every_number_says_its_unit_and_shape():
    schema = arrow_schema.schema_of(arrow_schema.POSES)
    assert schema.metadata == {b"groundpose.schema": b"poses", b"groundpose.version": b"1"}
    assert schema.field("covariance").metadata[b"unit"] == b"rad, m"
    assert schema.field("covariance").metadata[b"shape"] == b"6, 6"
    assert {f.name for f in fields(gp.PoseBatch)} - set(schema.names) == {"bboxes", "models"}


def test_the_page_has_every_column():
    page = (Path(__file__).parents[2] / "docs" / "fleets.md").read_text(encoding="utf-8")
    listed = (*arrow_schema.FRAME_COLUMNS, *arrow_schema.OBJECT_MEMBERS, *arrow_schema.POSE_COLUMNS)
    for c in listed:
        shape = f"({', '.join(map(str, c.shape))})" if c.shape else ""
        assert f"| `{c.name}` | {c.type} | {shape} | {c.unit} | {c.text or 'as in `PoseBatch`'} |" in page


def test_all_that_a_worker_is_given_is_copied_and_pickled(vehicles):
    given = example()
    pipeline = gp.Pipeline(network="int8", threads=1)
    poses = mixed(gp.FramePriors())
    for copied in (copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))):
        again = copied(pipeline)
        assert again.network is not pipeline.network
        assert_equal(again(given.image, given.bboxes, given.view), vehicles, without=("seconds",))
        assert copied(pipeline.network).path == pipeline.network.path
        for value in (gp.Options(seed=3), given.view, given.view.camera):
            assert copied(value) == value
        assert_equal(copied(poses), poses)
        np.testing.assert_array_equal(copied(MODEL).keypoints_3d, MODEL.keypoints_3d)
        assert repr(copied(poses.view)) == repr(poses.view)
