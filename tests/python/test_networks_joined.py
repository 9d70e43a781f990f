"""Networks that answer together."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from groundpose import InputError  # noqa: E402
from groundpose.lab.training.configs import NETWORKS  # noqa: E402
from groundpose.lab.training.networks import KeypointNetwork, Raw, folded, joined  # noqa: E402
from groundpose.lab.training.trained import detector  # noqa: E402

CROPS = np.random.default_rng(0).integers(0, 256, (3, 96, 128, 3)).astype(np.uint8)


def network(name: str, seed: int) -> KeypointNetwork:
    torch.manual_seed(seed)
    return folded(KeypointNetwork(NETWORKS[name]))


def raw(one: KeypointNetwork) -> Raw:
    with torch.no_grad():
        return one(torch.from_numpy(CROPS).float().permute(0, 3, 1, 2))


def test_together_they_say_the_mean() -> None:
    first, second = network("lite24", 0), network("lite32", 1)
    mean = Raw(*(0.5 * (a + b) for a, b in zip(raw(first), raw(second), strict=True)))
    with torch.no_grad():
        wanted = first.decode(mean)
    found = detector(joined(first, [second]))(CROPS)
    np.testing.assert_allclose(found.keypoints, wanted.keypoints.numpy(), atol=1e-3)
    np.testing.assert_allclose(found.vehicle, wanted.vehicle.numpy(), atol=1e-5)
    np.testing.assert_allclose(found.viewing_angle, wanted.viewing_angle.numpy(), atol=1e-5)


def test_a_network_and_itself_is_the_network() -> None:
    alone = detector(network("lite24", 0), mirrored=True)(CROPS)
    twice = detector(joined(network("lite24", 0), [network("lite24", 0)]), mirrored=True)(CROPS)
    np.testing.assert_allclose(alone.keypoints, twice.keypoints, atol=1e-4)
    np.testing.assert_allclose(alone.class_probabilities, twice.class_probabilities, atol=1e-6)


def test_networks_with_other_crops_do_not_go_together() -> None:
    with pytest.raises(InputError, match="--with"):
        joined(network("lite24", 0), [network("lite48-256x192", 0)])
