"""Faces that a window cannot see are left out: the picture stays the same to the bit."""

import numpy as np
import pytest
from groundpose.lab.drive.drive import scene
from groundpose.lab.drive.labels import labels
from groundpose.lab.drive.render import Renderer
from groundpose.lab.drive.render.faces import Aim, FaceTable
from groundpose.lab.drive.render.staged import Staged
from groundpose.lab.drive.rigs import RIGS
from groundpose.lab.drive.splits import scene_seed

_SIZE = (160, 120)


@pytest.fixture(scope="module")
def renderer():
    return Renderer()


def _windows(frame):
    """Around each labelled vehicle, and a part of it, which cuts it at all sides."""
    for label in labels(frame):
        middle, half = 0.5 * (label.bbox[:2] + label.bbox[2:]), 0.5 * (label.bbox[2:] - label.bbox[:2])
        for scale in (1.3, 0.4):
            yield np.concatenate([middle - scale * half, middle + scale * half])


@pytest.mark.parametrize(("drive", "number"), [(0, 0), (0, 30), (1, 10)])
def test_pictures_do_not_depend_on_it(renderer, monkeypatch, drive, number):
    counts = []
    seen = FaceTable.seen

    def counted(table, aim):
        found = seen(table, aim)
        counts.append((len(found), len(table._faces)))
        return found

    monkeypatch.setattr(FaceTable, "seen", counted)
    frame = scene(scene_seed(drive), number, rigs=RIGS["mixed"])
    boxes = list(_windows(frame))[:12]
    fewer = [renderer.window(frame, box, _SIZE, None) for box in boxes]
    with monkeypatch.context() as without:
        without.setattr(Staged, "aim", lambda *_: None)
        every = [renderer.window(frame, box, _SIZE, None) for box in boxes]
    assert np.array_equal(fewer, every)
    drawn, had = np.sum(counts, axis=0)
    assert drawn < 0.7 * had


def test_moving_faces_are_always_drawn():
    """A wheel that steers is not where the mesh has it."""
    positions = np.array([(0, 0, 0), (0, 1, 0), (1, 0, 0)], np.float32)
    faces = np.array([(0, 1, 2), (0, 2, 1)], np.int32)
    eye = np.array([0.2, 0.2, -5.0])
    clip = np.eye(4)[[0, 1, 2, 2]]
    clip[:, 3] = 5.0
    aim = Aim(clip, eye, 1e-6)
    still = FaceTable(positions, faces, np.zeros(3, bool)).seen(aim)
    assert still.tolist() == [[0, 1, 2]]
    assert len(FaceTable(positions, faces, np.ones(3, bool)).seen(aim)) == 2
