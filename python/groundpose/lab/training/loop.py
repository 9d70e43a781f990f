"""The training loop: steps, checkpoints, metrics.

Every random number comes from (seed, step) or (seed, epoch), so a resumed run takes the same steps as one
that was not interrupted.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose.keypoints.codec import ByteArray, Codec
from groundpose.keypoints.decode import Detections
from groundpose.lab.training.batches import Batch, Batcher
from groundpose.lab.training.configs import NETWORKS, AugmentConfig, TrainConfig
from groundpose.lab.training.crops import Crops
from groundpose.lab.training.evaluate import Answers, answers
from groundpose.lab.training.log import MetricsLog, Progress
from groundpose.lab.training.losses import Loss, Losses
from groundpose.lab.training.networks import KeypointNetwork, folded

CHECKPOINT = "checkpoint.pt"
_ORDER, _STEP = 1, 2  # streams of random numbers
_COSTS = {"steps": "step", "seconds": "seconds"}
_NOTHING_BEFORE = {"steps": 0, "seconds": 0.0}


@dataclass(frozen=True)
class Limits:
    """Limits of a call; they do not affect what is learned.

    Args:
        minutes: stop and save after this time; a later call continues. None: train to the end.
        save_minutes: time between checkpoints.
        evaluations: number of evaluations of the validation crops in a whole run.
        validation: number of validation crops.
    """

    minutes: float | None = None
    save_minutes: float = 5.0
    evaluations: int = 20
    validation: int = 2000


_NO_LIMITS = Limits()


class Trainer:
    """A training run in a folder: its network, optimizer and step."""

    def __init__(
        self,
        config: TrainConfig,
        data: Path,
        folder: Path,
        *,
        workers: int = 0,
        initial: Path | None = None,
    ) -> None:
        """Start a run, or resume it from the folder's checkpoint.

        Args:
            config: what to train.
            data: folder of crops with splits train and validation.
            folder: of the run; made if missing.
            workers: threads that prepare batches during training (0: none); they do not change the batches.
            initial: folder of a run of the same network whose weights to start from; None: random weights.

        Raises:
            InputError: the folder holds a run of another configuration; the data are not crops; the initial
                run is of another network.
        """
        self.config, self.folder, self._workers = config, folder, workers
        network = NETWORKS[config.network]
        self.codec = Codec(network.width, network.height)
        self.crops = Crops(data, "train")
        self._data = data
        torch.manual_seed(config.seed)
        self.network = KeypointNetwork(network).to(memory_format=torch.channels_last)
        self._loss = Loss(self.network, self.codec, config)
        self._batcher = Batcher(self.codec, self.crops.codec, config.augment)
        self.optimizer = _optimizer(self.network, config)
        self.steps = max(1, math.ceil(config.epochs * len(self.crops) / config.batch))
        self.step, self.seconds = 0, 0.0
        self.before: dict[str, float] = dict(_NOTHING_BEFORE)
        self._orders: dict[int, NDArray[np.intp]] = {}
        self._bf16 = config.bf16 and has_bf16()
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / CHECKPOINT).exists():
            self._load()
        elif initial is not None:
            self._begin_with(initial)

    def run(
        self, limits: Limits = _NO_LIMITS, tell: Callable[[Progress], None] = lambda progress: None
    ) -> bool:
        """Train to the end or to a limit; returns whether the end is reached. Ctrl-C saves, then raises."""
        start = saved = before = time.monotonic()
        every = max(1, self.steps // max(limits.evaluations, 1))
        try:
            with MetricsLog(self.folder, self.step) as log, self._batches() as batches:
                for batch in batches:
                    losses = self._train(batch)
                    now = time.monotonic()
                    self.seconds += now - before
                    rate = len(batch.labels) / (now - before)
                    judged = self.step == self.steps or self.step % every == 0
                    metrics = self.validate(limits.validation).metrics() if judged else {}
                    parts = {name: float(value.detach()) for name, value in losses._asdict().items()}
                    progress = Progress(self.step, self.steps, parts, rate, metrics)
                    log.write(progress)
                    tell(progress)
                    before = time.monotonic()
                    if before - saved > 60.0 * limits.save_minutes:
                        self.save()
                        saved = before
                    if limits.minutes is not None and before - start > 60.0 * limits.minutes:
                        break
        finally:
            self.save()
        return self.step == self.steps

    def validate(self, limit: int | None = None, split: str = "validation") -> Answers:
        """The current network's answers on (the first `limit`) held-out crops."""
        return answers(detector(self.network), Crops(self._data, split, limit), self.codec)

    def save(self) -> None:
        """Write the checkpoint under a temporary name and rename it when it is complete."""
        content = {
            "config": asdict(self.config),
            "data": self.crops.index,
            "step": self.step,
            "steps": self.steps,
            "seconds": self.seconds,
            "before": self.before,
            "network": self.network.state_dict(),
            "optimizer": self.optimizer.state_dict(),
        }
        temporary = self.folder / f"{CHECKPOINT}.tmp{os.getpid()}"
        torch.save(content, temporary)
        temporary.replace(self.folder / CHECKPOINT)

    def _load(self) -> None:
        content = load_checkpoint(self.folder)
        if content["config"] != asdict(self.config) or content["steps"] != self.steps:
            raise input_error(
                str(self.folder), "an empty folder or a run of this configuration and data", "another"
            )
        self.step, self.seconds = content["step"], content["seconds"]
        self.before = content["before"]
        self.network.load_state_dict(content["network"])
        self.optimizer.load_state_dict(content["optimizer"])

    def _begin_with(self, initial: Path) -> None:
        """Take the weights of another run and add its cost to the count."""
        content = load_checkpoint(initial)
        if content["config"]["network"] != self.config.network:
            raise input_error(
                str(initial), f"a run of {self.config.network}", repr(content["config"]["network"])
            )
        self.network.load_state_dict(content["network"])
        self.before = {name: content["before"][name] + content[now] for name, now in _COSTS.items()}

    def _train(self, batch: Batch) -> Losses:
        """Take one training step."""
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(self.config, self.step, self.steps)
        self.network.train()
        crops = batch.crops.contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=self._bf16):
            raw = self.network(crops)
        losses = self._loss(raw, batch)
        self.optimizer.zero_grad(set_to_none=True)
        losses.total.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.step += 1
        return losses

    def _make(self, step: int) -> Batch:
        """The batch of a step."""
        images, labels = self.crops.take(self._indices(step))
        return self._batcher(images, labels, np.random.default_rng([self.config.seed, _STEP, step]))

    def _indices(self, step: int) -> NDArray[np.intp]:
        """The crops `step * batch` and following in the sequence of shuffled epochs."""
        count, batch = len(self.crops), self.config.batch
        places = range(step * batch, (step + 1) * batch)
        return np.array([self._order(place // count)[place % count] for place in places], dtype=np.intp)

    def _order(self, epoch: int) -> NDArray[np.intp]:
        """The crops in the order of an epoch."""
        if epoch not in self._orders:
            rng = np.random.default_rng([self.config.seed, _ORDER, epoch])
            # two, because a batch at the end of an epoch also holds crops of the next
            self._orders = {e: o for e, o in self._orders.items() if e == epoch - 1}
            self._orders[epoch] = rng.permutation(len(self.crops))
        return self._orders[epoch]

    @contextlib.contextmanager
    def _batches(self) -> Iterator[Iterator[Batch]]:
        """The batches from the next step to the last, prepared in advance by the workers."""
        steps = iter(range(self.step, self.steps))
        if self._workers == 0:
            yield map(self._make, steps)
            return
        with ThreadPoolExecutor(self._workers) as pool:
            waiting = [pool.submit(self._make, step) for step in itertools.islice(steps, 2 * self._workers)]

            def ready() -> Iterator[Batch]:
                while waiting:
                    yield waiting.pop(0).result()
                    waiting.extend(pool.submit(self._make, step) for step in itertools.islice(steps, 1))

            try:
                yield ready()
            finally:
                pool.shutdown(cancel_futures=True)


def load_checkpoint(folder: Path) -> dict[str, Any]:
    """The checkpoint of a run. Raises InputError when there is none."""
    path = folder / CHECKPOINT
    if not path.exists():
        raise input_error(str(folder), f"a training run ({CHECKPOINT})", "none")
    content: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
    # older checkpoints lack this entry
    return {"before": dict(_NOTHING_BEFORE)} | content


def config_of(content: dict[str, Any]) -> TrainConfig:
    """The configuration with which a checkpoint was trained."""
    return TrainConfig(**{**content["config"], "augment": AugmentConfig(**content["config"]["augment"])})


def trained(folder: Path) -> tuple[KeypointNetwork, TrainConfig, dict[str, Any]]:
    """Network for inference, configuration and checkpoint of a run."""
    content = load_checkpoint(folder)
    config = config_of(content)
    network = KeypointNetwork(NETWORKS[config.network])
    network.load_state_dict(content["network"])
    return folded(network), config, content


def detector(network: KeypointNetwork, mirrored: bool = False) -> Callable[[ByteArray], Detections]:
    """Function that applies the current network as an exported one is applied."""

    def detect(crops: ByteArray) -> Detections:
        network.eval()
        with torch.no_grad():
            decoded = network.detect(torch.from_numpy(crops), mirrored)
        return Detections.of(*(value.double().numpy() for value in decoded))

    return detect


def learning_rate(config: TrainConfig, step: int, steps: int) -> float:
    """Learning rate of a step: divided by 10 at 60/90 and 80/90 of the run, or a cosine after a warm-up."""
    fraction = step / steps
    if config.schedule == "steps":
        return config.learning_rate * 0.1 ** ((fraction >= 60 / 90) + (fraction >= 80 / 90))
    warm = min(1.0, (step + 1) / max(1.0, 0.02 * steps))
    return config.learning_rate * warm * 0.5 * (1.0 + math.cos(math.pi * fraction))


def has_bf16() -> bool:
    """Whether this processor multiplies bfloat16; emulation would be slower than float32."""
    try:
        return "avx512_bf16" in Path("/proc/cpuinfo").read_text()
    except OSError:
        return False


def _optimizer(network: KeypointNetwork, config: TrainConfig) -> torch.optim.Optimizer:
    kinds: dict[str, Callable[..., torch.optim.Optimizer]] = {
        "adam": torch.optim.Adam,
        "adamw": torch.optim.AdamW,
    }
    if config.optimizer not in kinds:
        raise input_error("optimizer", "adam or adamw", repr(config.optimizer))
    return kinds[config.optimizer](
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay, fused=True
    )
