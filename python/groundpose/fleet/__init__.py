"""Frames in tables to poses in tables: in one process, in several, and on the engines of clusters.

`EstimateFrames` is the function that Ray Data, Spark and Daft map over tables. `groundpose fleet estimate`
does the same for folders of Parquet files, with Ray or with processes of its own.
"""

from groundpose.fleet.worker import EstimateFrames

__all__ = ["EstimateFrames"]
