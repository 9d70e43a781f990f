"""The measures of `groundpose evaluate tracks`."""

import numpy as np
from groundpose.lab.evaluate.tracks.errors import PASSAGE, Said, passages
from groundpose.lab.evaluate.tracks.sequence import Truth


def said(speeds):
    n = len(speeds)
    unknown = np.zeros((n, 3))
    return Said(
        frame=np.arange(n),
        index=np.zeros(n, int),
        place=unknown[:, :2],
        place_covariance=np.tile(np.eye(2), (n, 1, 1)),
        heading=unknown[:, 0],
        heading_sigma=unknown[:, 0],
        speed=np.array(speeds, dtype=float),
        speed_sigma=unknown[:, 0],
        size=unknown,
        size_sigma=unknown,
        dof=unknown[:, 0],
        id=np.zeros(n, int),
    )


def truth(vehicles, speeds):
    n = len(speeds)
    unknown = np.zeros((n, 4))
    return Truth(
        id=np.array(vehicles),
        place=unknown[:, :2],
        heading=unknown[:, 0],
        size=unknown[:, :3],
        bbox=unknown,
        speed=np.array(speeds, dtype=float),
    )


def test_a_passage_is_the_mean_of_a_vehicle_that_drives_and_is_seen_often():
    long, short = [1] * PASSAGE, [2] * (PASSAGE - 1)
    slow, lost = [3] * PASSAGE, [4] * PASSAGE
    vehicles = [*long, *short, *slow, *lost]
    true = [10.0] * len(vehicles)
    given = [9.0 if k % 2 else 13.0 for k in range(len(vehicles))]
    for k, vehicle in enumerate(vehicles):
        if vehicle == 3:
            true[k] = 1.0
        if vehicle == 4:
            given[k] = np.nan
    found = passages(said(given), truth(vehicles, true))
    np.testing.assert_allclose(found, [3.6 * 1.0])
