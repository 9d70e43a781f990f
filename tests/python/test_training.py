"""Networks, crops, batches, losses, resuming, export: on painted crops, without a renderer."""

import csv
import json

import groundpose as gp
import numpy as np
import pytest
from groundpose.keypoints.codec import FILL, Codec, cut
from groundpose.keypoints.network import Network
from groundpose.lab.drive import HIDDEN, OUTSIDE, VISIBLE
from groundpose.vehicles.classes import CLASSES
from groundpose.vehicles.keypoints import KEYPOINTS, flip_indices, keypoint_indices

torch = pytest.importorskip("torch", reason="torch is not installed (extra [train])")
pytest.importorskip("onnxscript", reason="onnxscript is not installed (extra [train])")
onnx = pytest.importorskip("onnx", reason="onnx is not installed (extra [train])")

from groundpose.lab.bodies import STYLE_NAMES  # noqa: E402
from groundpose.lab.training import (  # noqa: E402
    batches,
    configs,
    crops,
    device,
    heat_maps,
    in_time,
    loop,
    networks,
    optimise,
    release,
    sizes,
    trained,
    weights,
)
from groundpose.lab.training.batches import Batcher  # noqa: E402
from groundpose.lab.training.evaluate import answers  # noqa: E402
from groundpose.lab.training.log import METRICS  # noqa: E402
from groundpose.lab.training.losses import Loss  # noqa: E402
from groundpose.lab.training.toy import IMAGE_SIZE, toy_frame, toy_samples  # noqa: E402

K = len(KEYPOINTS)
ADDED_LINEAR = ("whole.0", "vehicle", "viewing_angle", "size", "style", "cells.3", "place")
"""What our networks have beside those of the paper."""
SMALL = configs.changed(configs.train_config("smoke"), epochs=1, batch=8)


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crops")
    for split, count in {"train": 48, "validation": 16}.items():
        crops.write_crops(folder, toy_samples, split, count, frames_per_shard=32)
    return folder


@pytest.mark.parametrize("name", [name for name, c in configs.NETWORKS.items() if c.gmac is not None])
def test_multiply_adds_of_the_papers_networks(name):
    config = configs.NETWORKS[name]
    with torch.device("meta"):
        network = networks.KeypointNetwork(config)
        ours = sum(network.get_parameter(f"extras.{name}.weight").numel() for name in ADDED_LINEAR)
        ours += network.extras.cells[0].weight.numel() * (config.width // 32) * (config.height // 32)
        assert (networks.multiply_adds(network) - ours) / 1e9 == pytest.approx(config.gmac, rel=0.01)


@pytest.mark.parametrize("name", configs.NETWORKS)
def test_shapes(name):
    config = configs.NETWORKS[name]
    with torch.device("meta"):
        network = networks.KeypointNetwork(config)
        raw = network(torch.zeros(2, 3, config.height, config.width))
        decoded = network.decode(raw)
    assert raw.maps.shape == (2, K, config.height / network.stride, config.width / network.stride)
    assert decoded.keypoints.shape == (2, K, 2)
    assert decoded.spread.shape == decoded.peak.shape == (2, K)
    assert decoded.class_probabilities.shape == (2, len(CLASSES))


def raw_of(network, maps, classes=None, **others):
    """An output with these maps, and keypoints stated in the crop's middle."""
    n = len(maps)
    sizes = (("vehicle", ()), ("viewing_angle", (16,)), ("size", (6,)), ("style", (len(STYLE_NAMES),)))
    fields = {name: torch.zeros(n, *size) for name, size in sizes}
    fields |= {"place": torch.zeros(n, K, 2), "place_scale": torch.full((n, K), -3.0)}
    return networks.Raw(maps, torch.zeros(n, len(CLASSES)) if classes is None else classes, **fields | others)


def test_softargmax():
    network = networks.KeypointNetwork(configs.NETWORKS["toy"])
    maps = torch.full((1, K, 24, 32), -1e4)
    maps[..., 3, 5] = 0.0  # one cell: centre of 4 x 4 pixels from (20, 12)
    maps[:, 1, 3, 6] = 0.0  # two cells side by side
    found = network.decode(raw_of(network, maps))
    np.testing.assert_allclose(found.keypoints[0, 0], [21.5, 13.5])
    np.testing.assert_allclose(found.keypoints[0, 1], [23.5, 13.5])
    np.testing.assert_allclose(found.spread[0, :2], [0.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(found.peak[0, :2], [1.0, 0.5])


def test_of_two_hills_the_higher_is_the_place_and_the_spread_tells_both():
    network = networks.KeypointNetwork(configs.NETWORKS["lite24"])
    maps = torch.full((1, K, 24, 32), -1e4)
    maps[..., 3, 5] = np.log(0.6)
    maps[..., 3, 25] = np.log(0.4)
    found = network.decode(raw_of(network, maps))
    np.testing.assert_allclose(found.keypoints[0, 0], [21.5, 13.5])
    np.testing.assert_allclose(found.spread[0, 0], 80.0 * np.sqrt(0.6 * 0.4), rtol=1e-5)


def test_folding_changes_nothing():
    torch.manual_seed(0)
    for name in ("toy", "res10-128x96"):
        network = networks.KeypointNetwork(configs.NETWORKS[name])
        pictures = 255 * torch.rand(4, 3, 96, 128)
        for _ in range(3):
            network(pictures)  # running means that are not the first ones
        network.eval()
        with torch.no_grad():
            before = network(pictures)
            after = networks.folded(network)(pictures)
        assert not any(isinstance(m, torch.nn.BatchNorm2d) for m in network.modules())
        for a, b in zip(before, after, strict=True):
            np.testing.assert_allclose(a, b, atol=2e-4)


def test_crops_are_resumed_and_the_same_for_any_jobs(tmp_path, data):
    told = []
    written = crops.write_crops(tmp_path, toy_samples, "train", 48, frames_per_shard=32)
    assert written == 2
    (tmp_path / "train-00000-labels.npy").unlink()  # as if stopped between the two files
    again = crops.write_crops(
        tmp_path, toy_samples, "train", 48, frames_per_shard=32, advance=lambda *now: told.append(now)
    )
    assert again == 1
    assert told == [(1, 2), (2, 2)]
    one, two = crops.Crops(tmp_path, "train"), crops.Crops(data, "train")
    for a, b in zip(one.take(np.arange(48)), two.take(np.arange(48)), strict=True):
        assert a.tobytes() == b.tobytes()
    assert len(one) == 48
    assert len(crops.Crops(data, "train", limit=20)) == 20
    with pytest.raises(gp.InputError, match="expected crops made with the same source, seed"):
        crops.write_crops(tmp_path, toy_samples, "train", 48, seed=1, frames_per_shard=32)
    with pytest.raises(gp.InputError, match="expected finished shards of split 'test'"):
        crops.Crops(data, "test")
    with pytest.raises(gp.InputError, match=r"expected a folder of crops \(index.json\), got none"):
        crops.Crops(tmp_path / "none", "train")


def test_batches_show_what_inference_cuts(data):
    """A stored crop cut again is the crop of the image, up to the resampling, and so are its keypoints."""
    stored, codec = crops.Crops(data, "train"), Codec()
    images, labels = stored.take(np.arange(16))
    batch = Batcher(codec, stored.codec)(images, labels, np.random.default_rng(0))
    for i in range(16):
        image, _, class_name, points, state = toy_frame(0, "train", i)
        window = codec.windows(labels["box"][i : i + 1].astype(float))
        wanted = cut(image, window[0], 128, 96)
        assert np.abs(batch.crops[i].permute(1, 2, 0).numpy() - wanted).mean() < 6.0
        rows = keypoint_indices(class_name)
        places = codec.crop_from_image(points[None], window)[0]
        np.testing.assert_allclose(batch.keypoints[i, rows], places, atol=0.02)
        assert batch.state[i, rows].tolist() == state.tolist()
        assert int(torch.isfinite(batch.keypoints[i]).all(dim=1).sum()) == len(rows)


def test_mirrored_and_turned_crops_keep_their_keypoints(data):
    """The dots that the toy paints are found at the keypoints of changed crops, in their colours."""
    stored, codec = crops.Crops(data, "train"), Codec()
    images, labels = stored.take(np.arange(48))
    changes = configs.AugmentConfig(
        box_noise=0.05,
        flip=1.0,
        rotation_deg=6.0,
        tone=0.0,
        resolution=0.0,
        sharpen=0.0,
        noise=0.0,
        shade=0.0,
    )
    plain = Batcher(codec, stored.codec)(images, labels, np.random.default_rng(0))
    batch = Batcher(codec, stored.codec, changes)(images, labels, np.random.default_rng(0))
    flip = flip_indices()
    errors = []
    for i in range(48):
        for k in range(K):
            a, b = plain.keypoints[i, k].round().long(), batch.keypoints[i, k].round().long()
            seen = plain.state[i, k] != OUTSIDE and bool(torch.isfinite(plain.keypoints[i, k]).all())
            if not seen or not (5 < b[0] < 122 and 5 < b[1] < 90):
                continue
            there = batch.crops[i, :, b[1], b[0]] - plain.crops[i, :, a[1], a[0]]
            errors.append(float(there.abs().mean()))
            assert batch.state[i, flip[k]] == plain.state[i, k]
    assert len(errors) > 500
    # partners have one colour; dots that others cover differ
    assert np.median(errors) < 8.0


def test_looks_change_and_the_border_does_not(data):
    stored, codec = crops.Crops(data, "train"), Codec()
    images, labels = stored.take(np.arange(48))
    augment = configs.AugmentConfig(rotation_deg=0.0, flip=0.0)
    make = Batcher(codec, stored.codec, augment)
    one, same = (make(images, labels, np.random.default_rng(5)) for _ in range(2))
    assert one.crops.numpy().tobytes() == same.crops.numpy().tobytes()
    plain = Batcher(codec, stored.codec)(images, labels, np.random.default_rng(0))
    assert (one.crops - plain.crops).abs().mean() > 20.0
    assert float(one.crops.min()) >= 0.0
    assert float(one.crops.max()) <= 255.0
    whole = one.windows
    beyond = np.flatnonzero(whole[:, 0] < -0.5 - 0.05 * (whole[:, 2] - whole[:, 0]))
    assert len(beyond) > 2
    for i in beyond:
        np.testing.assert_array_equal(one.crops[i, :, 40, 0], FILL)
    assert tuple(labels["image_size"][0]) == IMAGE_SIZE


def test_loss_is_least_at_the_truth_and_deaf_to_other_classes(data):
    stored, codec = crops.Crops(data, "train"), Codec()
    batch = Batcher(codec, stored.codec)(*stored.take(np.arange(8)), np.random.default_rng(0))
    network = networks.KeypointNetwork(configs.NETWORKS["toy"])
    loss = Loss(network, codec, SMALL)
    y, x = torch.meshgrid(network.cell_y, network.cell_x, indexing="ij")

    def maps(shift):
        place = torch.nan_to_num(batch.keypoints)[:, :, None, None] + shift
        return -0.5 * (((x - place[..., 0]) / 4) ** 2 + ((y - place[..., 1]) / 4) ** 2)

    logits = 20.0 * torch.nn.functional.one_hot(batch.class_index, 4).float()
    truth, off = (loss(raw_of(network, maps(shift), logits), batch) for shift in (0.0, 3.0))
    assert float(truth.total) < float(off.total)
    assert float(truth.distance) < 0.01 < 0.03 < float(off.distance)
    assert float(truth.classes) < 1e-6
    other = torch.isnan(batch.keypoints).any(dim=2)[..., None, None]
    changed = loss(raw_of(network, torch.where(other, torch.randn_like(maps(0.0)), maps(0.0)), logits), batch)
    assert float(changed.total) == pytest.approx(float(truth.total), abs=1e-6)
    assert {OUTSIDE, HIDDEN, VISIBLE} >= set(batch.state.unique().tolist())


def test_losses_of_the_other_heads(data):
    """Each is least at the truth, and what is unknown has none."""
    stored, codec = crops.Crops(data, "train"), Codec()
    images, labels = stored.take(np.arange(8))
    labels["alpha"], labels["size"], labels["style"] = 0.5 * np.pi, (4.0, 1.5, 1.7), 2
    labels[4:] = crops.record_of(box=labels["box"][0], window=labels["window"][0], image_size=IMAGE_SIZE)
    batch = Batcher(codec, stored.codec)(images, labels, np.random.default_rng(0))
    network = networks.KeypointNetwork(configs.NETWORKS["toy"])
    loss = Loss(network, codec, SMALL)
    flat = torch.zeros(8, K, 24, 32)
    own = torch.isfinite(batch.keypoints).all(dim=2)
    place = (torch.nan_to_num(batch.keypoints) + 0.5) / network.sides - 0.5
    true = {
        "vehicle": torch.where(batch.vehicle, 10.0, -10.0),
        "viewing_angle": 30.0 * torch.nn.functional.one_hot(torch.full((8,), 4), 16).float(),
        "size": torch.tensor([np.log(4.0), np.log(1.5), np.log(1.7), -3.0, -3.0, -3.0]).float().repeat(8, 1),
        "style": 30.0 * torch.nn.functional.one_hot(torch.full((8,), 2), len(STYLE_NAMES)).float(),
        "place": place,
    }
    names = ("vehicle", "viewing_angle", "size", "style", "places")
    best = loss(raw_of(network, flat, **true), batch)
    for name, wrong in true.items():
        moved = loss(raw_of(network, flat, **true | {name: wrong.roll(1, dims=-1)}), batch)
        part = "places" if name == "place" else name
        assert float(getattr(moved, part)) > float(getattr(best, part)) + 0.1
        same = [n for n in names if n != part]
        assert [float(getattr(moved, n)) for n in same] == [float(getattr(best, n)) for n in same]
    # rows without a vehicle have a loss of vehicle and maps alone
    for name in ("viewing_angle", "size", "style", "place"):
        other = true[name].clone()
        other[4:] += 3.0
        assert float(loss(raw_of(network, flat, **true | {name: other}), batch).total) == float(best.total)
    peaked = flat.clone()
    peaked[4:, :, 3, 3] = 9.0
    assert float(loss(raw_of(network, peaked, **true), batch).cross_entropy) > float(best.cross_entropy) + 0.1
    assert not own[4:].any()


def test_keypoints_outside_the_crop_are_the_stated_ones():
    network = networks.KeypointNetwork(configs.NETWORKS["toy"])
    maps = torch.full((1, K, 24, 32), -1e4)
    maps[..., 3, 5] = 0.0
    place = torch.zeros(1, K, 2)
    place[0, 1] = torch.tensor([-0.75, 0.0])  # a quarter of the width to the left of the crop
    found = network.decode(raw_of(network, maps, place=place))
    np.testing.assert_allclose(found.keypoints[0, 0], [21.5, 13.5])
    np.testing.assert_allclose(found.keypoints[0, 1], [-0.25 * 128 - 0.5, 47.5])
    np.testing.assert_allclose(found.spread[0, 1], np.exp(-3.0) * np.sqrt(2.0) * 160.0, rtol=1e-5)
    assert float(found.spread[0, 0]) < 1e-3


def test_weights_are_kept_in_small_files(tmp_path, data, monkeypatch):
    trainer = loop.Trainer(SMALL, data, tmp_path / "run")
    assert trainer.run(loop.Limits(evaluations=1, validation=8))
    monkeypatch.setattr(weights, "_LARGEST", 200_000)
    content = weights.read_weights(tmp_path / "run")
    paths = weights.write_weights(tmp_path, content)
    assert len(paths) > 2
    assert max(path.stat().st_size for path in paths) < 230_000
    kept = weights.read_weights(tmp_path)
    assert kept["config"] == content["config"]
    for name, value in content["network"].items():
        np.testing.assert_allclose(kept["network"][name], value, rtol=1e-3, atol=1e-6)
    begun = loop.Trainer(SMALL, data, tmp_path / "b", initial=tmp_path)
    assert begun.before["steps"] == trainer.steps
    old = {name: value for name, value in content["network"].items() if not name.startswith("extras.")}
    weights.load_into(begun.network, old)  # weights from before the additional heads
    with pytest.raises(gp.InputError, match="none for stem"):
        weights.load_into(begun.network, {})


def test_weights_of_a_release_are_found_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(weights, "RELEASED", "kept")
    with pytest.raises(gp.InputError, match="expected the release's weights in kept/default of the current"):
        weights.initial_folder("default")
    (tmp_path / "kept" / "default").mkdir(parents=True)
    assert weights.initial_folder("default").resolve() == tmp_path / "kept" / "default"
    assert weights.initial_folder("runs/a").name == "a"


def test_a_run_may_be_fitted_into_a_time(tmp_path, data):
    config = configs.changed(SMALL, epochs=1e6)
    trainer = loop.Trainer(config, data, tmp_path / "run", fit_minutes=0.15)
    assert trainer.run(loop.Limits(evaluations=1, validation=8))
    assert 50 < trainer.steps < 100_000
    assert trainer.seconds < 14.0
    assert trainer.optimizer.param_groups[0]["lr"] < 0.2 * config.learning_rate


def test_devices(monkeypatch):
    assert device.device("cpu").type == "cpu"
    assert device.device("auto").type in ("cpu", "cuda")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(gp.InputError, match=r"device: expected a GPU that PyTorch can use .*got none"):
        device.device("cuda")
    with pytest.raises(gp.InputError, match=r"device: expected one of auto, cpu, cuda, got 'gpu'"):
        device.device("gpu")


def test_pictures_and_batches_do_not_depend_on_where_they_are_made(data):
    """All of a batch at a time, as on a GPU, and in parts, as on a CPU."""
    stored, codec = crops.Crops(data, "train"), Codec()
    images, labels = stored.take(np.arange(24))
    for augment in (None, configs.AugmentConfig()):
        make = Batcher(codec, stored.codec, augment)
        one = make(images, labels, np.random.default_rng(3))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(batches, "_CHUNK", {})
            other = make(images, labels, np.random.default_rng(3))
        assert torch.equal(one.keypoints.nan_to_num(), other.keypoints.nan_to_num())
        difference = (one.crops - other.crops).abs()
        # a value at a half may be rounded either way
        assert float(difference.max()) <= (1.0 if augment else 0.0)
        assert float((difference > 0).float().mean()) < 1e-3


def run(config, data, folder, stop_at=None, workers=0):
    """Losses of all steps of a run that is interrupted and gone on with after `stop_at`."""
    losses = {}

    def tell(now):
        losses[now.step] = now.losses
        if now.step == stop_at and len(losses) == stop_at:
            raise KeyboardInterrupt

    for _ in range(1 if stop_at is None else 2):
        trainer = loop.Trainer(config, data, folder, workers=workers)
        try:
            trainer.run(loop.Limits(evaluations=1, validation=8), tell)
        except KeyboardInterrupt:
            continue
    return losses, trainer


def metrics(folder):
    with (folder / METRICS).open(newline="") as file:
        return [row for row in csv.reader(file) if row[1] != "crops_per_second"]


def test_a_stopped_run_goes_on_as_if_it_had_not_been(tmp_path, data):
    straight, first = run(SMALL, data, tmp_path / "a")
    stopped, second = run(SMALL, data, tmp_path / "b", stop_at=3)
    assert sorted(straight) == sorted(stopped) == list(range(1, 7))
    assert straight == stopped  # bit for bit
    for a, b in zip(first.network.parameters(), second.network.parameters(), strict=True):
        assert torch.equal(a, b)
    ahead, _ = run(SMALL, data, tmp_path / "c", workers=1)
    assert ahead == straight
    rows = [metrics(tmp_path / name) for name in "ab"]
    assert rows[0] == rows[1]
    assert rows[0][0] == ["step", "name", "value"]
    assert any(row[1] == "class_accuracy" for row in rows[0])
    with pytest.raises(gp.InputError, match="run of this configuration"):
        loop.Trainer(configs.changed(SMALL, seed=1), data, tmp_path / "a")
    with pytest.raises(
        gp.InputError, match=r"expected a training run \(checkpoint.pt\) or weights .*got none"
    ):
        trained.trained(tmp_path / "none")


def test_a_run_may_begin_with_the_weights_of_another(tmp_path, data):
    _, first = run(SMALL, data, tmp_path / "a")
    begun = loop.Trainer(SMALL, data, tmp_path / "b", initial=tmp_path / "a")
    for a, b in zip(first.network.parameters(), begun.network.parameters(), strict=True):
        assert torch.equal(a, b)
    assert begun.step == 0
    assert begun.before["steps"] == first.step == 6
    begun.save()
    again = loop.Trainer(SMALL, data, tmp_path / "b", initial=tmp_path / "none")  # it has its own by now
    assert again.before == begun.before
    other = configs.changed(configs.train_config("lite24"), epochs=1)
    with pytest.raises(gp.InputError, match="expected a run of lite24, got 'toy'"):
        loop.Trainer(other, data, tmp_path / "c", initial=tmp_path / "a")


def test_heat_map_losses_are_those_of_single_operations(monkeypatch):
    rng = np.random.default_rng(0)
    monkeypatch.setattr(heat_maps, "_CELLS", 300)  # several parts
    maps = torch.tensor(rng.normal(size=(3, 5, 6, 8)), requires_grad=True)
    x, y = (torch.tensor(rng.normal(size=(3, 5, n))).softmax(dim=2) for n in (8, 6))
    cells = [4.0 * torch.arange(n, dtype=torch.float64) + 1.5 for n in (8, 6)]
    entropy, means = heat_maps.heat_map_losses(maps, x, y, *cells)
    share = maps.flatten(2).softmax(dim=2).unflatten(2, maps.shape[2:])
    gaussian = y[..., None] * x[..., None, :]
    torch.testing.assert_close(entropy, -(gaussian * share.log()).sum(dim=(2, 3)))
    torch.testing.assert_close(means[..., 0], share.sum(dim=2) @ cells[0])
    torch.testing.assert_close(means[..., 1], share.sum(dim=3) @ cells[1])
    assert torch.autograd.gradcheck(lambda m: heat_maps.heat_map_losses(m, x, y, *cells), maps)


def test_schedules():
    paper, ours = configs.train_config("res10-128x96-paper"), configs.train_config("lite32")
    rates = [optimise.learning_rate(paper, step, 90) for step in (0, 59, 60, 79, 80, 89)]
    np.testing.assert_allclose(rates, [1e-3, 1e-3, 1e-4, 1e-4, 1e-5, 1e-5])
    assert (paper.optimizer, paper.weight_decay, paper.epochs) == ("adam", 1e-4, 90)
    curve = [optimise.learning_rate(ours, step, 1000) for step in range(1000)]
    assert int(np.argmax(curve)) in (18, 19, 20)
    assert curve[-1] < 1e-4 * max(curve)


def test_configurations():
    assert set(configs.NETWORKS) >= {c.network for c in configs.CONFIGS.values()}
    assert configs.changed(SMALL, epochs=3, flip=0.25).augment.flip == 0.25
    with pytest.raises(gp.InputError, match=r"config: expected one of .*lite32.*got 'lite33'"):
        configs.train_config("lite33")
    with pytest.raises(gp.InputError, match="names of TrainConfig or AugmentConfig, got epoch"):
        configs.changed(SMALL, epoch=3)


SMOKE_WITHIN, SMOKE_CLASSES = 0.85, 0.98


def test_smoke_trains_exports_and_is_good(tmp_path):
    """The whole way in half a minute: painted crops, training, fp16 and int8 files, accuracy of each."""
    folder = tmp_path / "crops"
    for split, count in {"train": 320, "validation": 64, "test": 64}.items():
        crops.write_crops(folder, toy_samples, split, count)
    trainer = loop.Trainer(configs.train_config("smoke"), folder, tmp_path / "run")
    assert trainer.run(loop.Limits(evaluations=1, validation=16))
    done = release.release(
        tmp_path / "run",
        folder,
        tmp_path / "smoke.onnx",
        int8=tmp_path / "int8.onnx",
        command="groundpose train smoke",
    )
    assert done.metrics["within_visible"] > SMOKE_WITHIN
    assert done.metrics["class_accuracy"] >= SMOKE_CLASSES
    assert done.int8_metrics["within_visible"] > done.metrics["within_visible"] - 0.02
    assert done.int8_metrics["class_accuracy"] >= SMOKE_CLASSES
    assert done.metrics["score_auc"] > 0.6
    _check_files(tmp_path, folder)


def _check_files(folder, data):
    """Parity of torch, onnxruntime and int8, sizes, and what the file says of itself."""
    stored = crops.Crops(data, "test", 24)
    network, config, _ = trained.trained(folder / "run")
    codec = Codec(network.config.width, network.config.height)
    truth = answers(trained.detector(network), stored, codec).detections
    found = {name: Network(folder / name, threads=1) for name in ("smoke.onnx", "int8.onnx")}
    half, int8 = (answers(n.detect, stored, codec).detections for n in found.values())
    assert np.abs(half.keypoints - truth.keypoints).max() < 0.2  # weights rounded to float16
    assert np.abs(half.spread - truth.spread).max() < 0.2
    assert np.abs(half.class_probabilities - truth.class_probabilities).max() < 2e-3
    assert np.abs(int8.keypoints - truth.keypoints).mean() < 0.5
    sizes = [(folder / name).stat().st_size for name in found]
    parameters = sum(p.numel() for p in network.parameters())
    assert sizes[0] < 2 * parameters + 60_000
    whole = sum(m.weight.numel() for m in network.modules() if isinstance(m, torch.nn.Linear))  # float16
    assert sizes[1] < parameters + whole + 120_000
    graph = onnx.load(folder / "int8.onnx").graph
    assert "Resize" not in {node.op_type for node in graph.node}  # see test_enlarged.py
    constants = [onnx.numpy_helper.to_array(w) for w in graph.initializer]
    weights = [w for w in constants if w.dtype == np.int8 and w.ndim == 4]
    assert 60 < max(np.abs(w.astype(int)).max() for w in weights) <= 64  # 7 bits: sums of pairs fit 16 bits
    said = found["int8.onnx"].metadata
    assert said["command"] == "groundpose train smoke"
    assert json.loads(said["data"]) == {
        "source": "groundpose.lab.training.toy.toy_samples",
        "seed": 0,
        "version": 2,
    }
    assert json.loads(said["config"])["network"] == config.network
    assert json.loads(said["metrics"])["class_accuracy"] >= SMOKE_CLASSES
    assert (said["width"], said["height"], said["margin"], said["weights"]) == ("128", "96", "0.1", "int8")


@pytest.mark.parametrize("mirrored", [False, True])
def test_float32_export_is_the_network_to_the_bit_almost(tmp_path, mirrored):
    from groundpose.keypoints.decode import Calibration
    from groundpose.lab.training.export import export, metadata

    torch.manual_seed(0)
    network = networks.folded(networks.KeypointNetwork(configs.NETWORKS["toy"]))
    index = {"source": "none", "seed": 0, "version": 1}
    said = metadata(Codec(), Calibration(), "", index, {}, {})
    export(network, tmp_path / "n.onnx", said, stored="float32", mirrored=mirrored)
    pictures = np.random.default_rng(0).integers(0, 256, (3, 96, 128, 3), dtype=np.uint8)
    ours = trained.detector(network, mirrored)(pictures)
    theirs = Network(tmp_path / "n.onnx", threads=1).detect(pictures)
    np.testing.assert_allclose(theirs.keypoints, ours.keypoints, atol=3e-4)
    np.testing.assert_allclose(theirs.spread, ours.spread, atol=3e-4)
    np.testing.assert_allclose(theirs.class_probabilities, ours.class_probabilities, atol=1e-5)
    np.testing.assert_allclose(theirs.vehicle, ours.vehicle, atol=1e-5)
    np.testing.assert_allclose(theirs.viewing_angle, ours.viewing_angle, atol=1e-5)
    sizes = {"float32": (tmp_path / "n.onnx").stat().st_size}
    for stored, far in (("float16", 0.1), ("int8", 1.0)):
        path = tmp_path / f"{stored}.onnx"
        export(network, path, said, stored=stored, mirrored=mirrored)
        sizes[stored] = path.stat().st_size
        found = Network(path, threads=1).detect(pictures)
        assert np.abs(found.keypoints - ours.keypoints).mean() < far
        np.testing.assert_allclose(found.class_probabilities, ours.class_probabilities, atol=0.02)
    assert sizes["int8"] < 0.7 * sizes["float16"] < 0.5 * sizes["float32"]


def test_with_mirror_images_a_mirrored_crop_has_the_mirrored_answer():
    torch.manual_seed(0)
    detect = trained.detector(
        networks.folded(networks.KeypointNetwork(configs.NETWORKS["toy"])), mirrored=True
    )
    pictures = np.random.default_rng(0).integers(0, 256, (3, 96, 128, 3), dtype=np.uint8)
    there, back = detect(pictures), detect(np.ascontiguousarray(pictures[:, :, ::-1]))
    expected = (there.keypoints * [-1.0, 1.0] + [127.0, 0.0])[:, flip_indices()]
    np.testing.assert_allclose(back.keypoints, expected, atol=1e-3)
    np.testing.assert_allclose(back.spread, there.spread[:, flip_indices()], atol=1e-3)
    np.testing.assert_allclose(back.class_probabilities, there.class_probabilities, atol=1e-5)


def test_rendering_and_training_end_in_time(tmp_path):
    """The times are counted over calls, so a stopped call is resumed."""
    told = []
    plan = in_time.Plan(tmp_path, toy_samples, 0.2, 1)
    left = in_time.render(plan, lambda split, shards: told.append((split, shards)))
    assert 0.05 < left <= 0.5 * 0.2 + 0.01
    assert [split for split in dict.fromkeys(split for split, _ in told)] == list(in_time.FRACTIONS)
    assert len(crops.Crops(tmp_path, "train")) > len(crops.Crops(tmp_path, "validation")) > 0
    shards = len(list(tmp_path.glob("*-labels.npy")))
    assert in_time.render(plan) == pytest.approx(left, abs=0.02)
    assert len(list(tmp_path.glob("*-labels.npy"))) == shards


def test_sizes_are_compared_with_the_prior_of_the_class():
    rng = np.random.default_rng(0)
    truth = rng.normal([1.4, 0.4, 0.5], 0.1, (200, 3))
    mean, sigma = np.tile([1.5, 0.4, 0.5], (200, 1)), np.full((200, 3), 0.05)
    told = sizes.compared(truth + rng.normal(0.0, 0.05, truth.shape), sigma, mean, truth)
    assert told["length: stated, rms %"] == pytest.approx(5.0, rel=0.15)
    assert told["length: class, bias %"] == pytest.approx(10.0, abs=2.0)
    assert told["height: class, rms %"] == pytest.approx(10.0, rel=0.15)
    assert told["width: correlation"] > 0.8
