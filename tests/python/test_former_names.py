"""Names of the first edition that still work."""

import groundpose as gp
import numpy as np
from groundpose.vehicles import CLASSES, KEYPOINTS, KINDS, body
from groundpose.vehicles import keypoints as table


def test_kinds_are_classes(tmp_path):
    assert KINDS is CLASSES
    assert table.KINDS is CLASSES
    assert KEYPOINTS[0].kinds is KEYPOINTS[0].classes
    assert body("car", 1).kind == "car"
    fields = dict.fromkeys(gp.VehiclePoses.__dataclass_fields__)
    poses = gp.VehiclePoses(**fields | {"classes": np.array(["car"]), "class_probabilities": np.eye(1, 4)})
    assert poses.kinds is poses.classes
    assert poses.kind_probabilities is poses.class_probabilities
    assert poses.kind_probability == poses.class_probability == 1.0
