"""The same rows from the engines of clusters, as far as they are installed; each needs seconds to start."""

import sys

import pytest

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
from fleet_frames import all_rows, keypoint_frame, same_rows, write_frames
from groundpose.fleet import EstimateFrames
from groundpose.fleet.on_ray import on_ray
from groundpose.fleet.pool import in_this_process
from groundpose.fleet.run import run
from groundpose.formats.arrow_frames import frames_table

pytestmark = pytest.mark.filterwarnings("ignore")  # theirs


@pytest.fixture
def table():
    return frames_table([keypoint_frame(k, 2) for k in range(6)])


def test_ray_writes_the_same_parts(tmp_path):
    pytest.importorskip("ray", reason="ray is not installed")
    source = tmp_path / "frames"
    write_frames(source, files=2, groups=2, frames=2, objects=2)
    for name, engine in (("alone", in_this_process), ("ray", on_ray(local=True))):
        report = run(EstimateFrames(), source, tmp_path / name, engine, 2)
        assert (report.failed, report.counts["objects"]) == ([], 16)
    alone, made = all_rows(tmp_path / "alone"), all_rows(tmp_path / "ray")
    assert list(alone) == list(made)
    assert all(same_rows(alone[name], made[name]) for name in alone)


def test_ray_data_maps_it(table):
    ray = pytest.importorskip("ray", reason="ray is not installed")
    pytest.importorskip("ray.data")
    import pyarrow as pa

    ray.init(address="local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    try:
        frames = ray.data.from_arrow([table.slice(0, 3), table.slice(3, 3)])
        poses = frames.map_batches(EstimateFrames, batch_format="pyarrow", batch_size=2, concurrency=1)
        made = pa.concat_tables(ray.get(poses.to_arrow_refs()))
    finally:
        ray.shutdown()
    made = made.select(EstimateFrames.schema().names).cast(EstimateFrames.schema())
    assert same_rows(made.sort_by([("frame", "ascending"), ("object", "ascending")]), EstimateFrames()(table))


def test_spark_maps_it(table, monkeypatch):
    pytest.importorskip("pyspark", reason="pyspark is not installed")
    import pyarrow as pa
    from pyspark.sql import SparkSession
    from pyspark.sql.pandas.types import from_arrow_schema

    monkeypatch.setenv("PYSPARK_PYTHON", sys.executable)
    spark = SparkSession.builder.master("local[2]").config("spark.ui.enabled", "false").getOrCreate()
    try:
        frames = spark.createDataFrame(table)
        poses = frames.mapInArrow(EstimateFrames().batches, from_arrow_schema(EstimateFrames.schema()))
        made = poses.toArrow()
    finally:
        spark.stop()
    made = pa.table({name: made.column(name) for name in EstimateFrames.schema().names})
    made = made.cast(EstimateFrames.schema()).sort_by([("frame", "ascending"), ("object", "ascending")])
    assert same_rows(made, EstimateFrames()(table))


def test_daft_maps_it(table):
    daft = pytest.importorskip("daft", reason="daft is not installed")
    import pyarrow as pa

    estimate = EstimateFrames()
    rows = pa.list_(pa.struct([f for f in EstimateFrames.schema() if f.name != "frame"]))

    @daft.func.batch(return_dtype=daft.DataType.from_arrow_type(rows))
    def poses(*columns):
        names = table.schema.names
        given = pa.table(
            {
                name: c.to_arrow().cast(table.schema.field(name).type)
                for name, c in zip(names, columns, strict=True)
            }
        )
        return daft.Series.from_arrow(estimate.nested(given))

    frames = daft.from_arrow(table)
    made = frames.select(
        frames["frame"], poses(*[frames[name] for name in table.schema.names]).alias("poses")
    )
    found = made.explode("poses").to_arrow()
    expected = estimate(table)
    assert found.column("frame").to_pylist() == expected.column("frame").to_pylist()
    plain = expected.drop_columns(["frame"]).to_pylist()
    assert repr(found.column("poses").to_pylist()) == repr(plain)
