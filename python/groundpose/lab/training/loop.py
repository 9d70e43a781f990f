"""The training loop: steps, checkpoints, metrics.

Every random number comes from (seed, step) or (seed, epoch), so a resumed run takes the same steps as one
that was not interrupted.
"""

from __future__ import annotations

import contextlib
import copy
import itertools
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from groundpose._checks import input_error
from groundpose._writing import only_writer, whole_file
from groundpose.keypoints.codec import Codec
from groundpose.lab.training.batches import Batch, Batcher
from groundpose.lab.training.configs import NETWORKS, TrainConfig
from groundpose.lab.training.crops import Crops
from groundpose.lab.training.device import finish, has_bf16, pictures_on
from groundpose.lab.training.evaluate import Answers, answers
from groundpose.lab.training.log import MetricsLog, Progress
from groundpose.lab.training.losses import Loss, Losses
from groundpose.lab.training.networks import KeypointNetwork
from groundpose.lab.training.optimise import learning_rate, optimizer
from groundpose.lab.training.trained import detector
from groundpose.lab.training.weights import CHECKPOINT, load_into, read_weights, write_weights

_ORDER, _STEP = 1, 2  # streams of random numbers
_COSTS = {"steps": "step", "seconds": "seconds"}
_AVERAGED_EVERY = 4  # steps
_REPORTS = 1000  # of a run
_FITTED_EVERY = 50  # steps after which a run that has to end in time counts its steps anew
_CPU = torch.device("cpu")


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
    """A training run in a folder: its network, optimizer and step.

    Attributes:
        network: as it is trained. averaged: the moving average of its weights, which is evaluated and kept;
            the same network without an average.
        step, steps: done, and in all. seconds: spent.
    """

    def __init__(
        self,
        config: TrainConfig,
        data: Path,
        folder: Path,
        *,
        workers: int = 0,
        initial: Path | None = None,
        device: torch.device = _CPU,
        fit_minutes: float | None = None,
    ) -> None:
        """Start a run, or resume it from the folder's checkpoint.

        Args:
            config: what to train.
            data: folder of crops with splits train and validation.
            folder: of the run; made if missing.
            workers: threads that prepare batches during training (0: none); they do not change the batches.
            initial: folder of a run of the same network, or of kept weights, to start from; None: random
                weights.
            device: where to train. A checkpoint can be resumed on another one.
            fit_minutes: the number of steps is chosen so that the whole run takes this time, counting earlier
                calls, whatever the configuration's epochs; None: by epochs.

        Raises:
            InputError: the folder holds a run of another configuration; the data are not crops; the initial
                run is of another network.
        """
        self.config, self.folder, self.device = config, folder, device
        self._workers, self._fit_seconds = workers, None if fit_minutes is None else 60.0 * fit_minutes
        network = NETWORKS[config.network]
        self.codec = Codec(network.width, network.height)
        self.crops = Crops(data, "train")
        self._pictures = pictures_on(device, self.crops)
        self._data = data
        torch.manual_seed(config.seed)
        self.network = KeypointNetwork(network).to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.averaged = copy.deepcopy(self.network) if config.average > 0.0 else self.network
        self._loss = Loss(self.network, self.codec, config)
        self._batcher = Batcher(self.codec, self.crops.codec, config.augment, device)
        self.optimizer = optimizer(self.network, config)
        self.steps = max(1, math.ceil(config.epochs * len(self.crops) / config.batch))
        self.step, self.seconds = 0, 0.0
        self.before: dict[str, float] = {name: 0 for name in _COSTS}
        self._spent = 0.0  # seconds of earlier calls
        self._orders: dict[int, NDArray[np.intp]] = {}
        self._bf16 = config.bf16 and has_bf16(device)
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / CHECKPOINT).exists():
            self._load()
        elif initial is not None:
            self._begin_with(initial)

    def run(
        self, limits: Limits = _NO_LIMITS, tell: Callable[[Progress], None] = lambda progress: None
    ) -> bool:
        """Train to the end or to a limit; returns whether the end is reached. Ctrl-C saves, then raises.

        Raises:
            InputError: another run writes into the folder.
        """
        with only_writer(self.folder):
            return self._run(limits, tell)

    def _run(self, limits: Limits, tell: Callable[[Progress], None]) -> bool:
        """In a folder that is ours alone."""
        start = saved = before = reported = time.monotonic()
        first = last = self.step
        try:
            with MetricsLog(self.folder, self.step) as log, self._batches() as batches:
                for batch in batches:
                    losses = self._train(batch)
                    judged = self._due(limits.evaluations)
                    if told := judged or self._due(_REPORTS):
                        finish(self.device)
                    now = time.monotonic()
                    self.seconds += now - before
                    if told:
                        rate = (self.step - last) * self.config.batch / (now - reported)
                        metrics = self.validate(limits.validation).metrics() if judged else {}
                        parts = {name: float(value.detach()) for name, value in losses._asdict().items()}
                        progress = Progress(self.step, self.steps, parts, rate, metrics)
                        log.write(progress)
                        tell(progress)
                        reported, last = time.monotonic(), self.step
                    before = time.monotonic()
                    if before - saved > 60.0 * limits.save_minutes:
                        self.save()
                        saved = before
                    if limits.minutes is not None and before - start > 60.0 * limits.minutes:
                        break
                    self._fit_steps(self.step - first, before - start)
        finally:
            self.save()
        return self.step == self.steps

    def _due(self, times: int) -> bool:
        """Whether this is one of `times` steps of the run, or the last."""
        return self.step == self.steps or self.step % max(1, self.steps // max(times, 1)) == 0

    def _fit_steps(self, done: int, seconds: float) -> None:
        """Choose the number of steps for the time left, from the steps done in this call and their time."""
        if self._fit_seconds is None or done % _FITTED_EVERY != 0:
            return
        left = self._fit_seconds - self._spent - seconds
        self.steps = self.step + max(0, int(left * done / seconds))

    def validate(self, limit: int | None = None, split: str = "validation") -> Answers:
        """The current network's answers on (the first `limit`) held-out crops."""
        return answers(detector(self.averaged), Crops(self._data, split, limit), self.codec)

    def save(self) -> None:
        """Write the checkpoint under a temporary name and rename it when it is complete; at the end of the
        run also the weights alone."""
        content = {
            "config": asdict(self.config),
            "data": self.crops.index,
            "step": self.step,
            "steps": self.steps,
            "seconds": self.seconds,
            "before": self.before,
            "network": self.averaged.state_dict(),
            "trained": self.network.state_dict() if self.averaged is not self.network else {},
            "optimizer": self.optimizer.state_dict(),
        }
        with whole_file(self.folder / CHECKPOINT, "wb") as file:
            torch.save(content, file)
        if self.step == self.steps:
            write_weights(self.folder, content)

    def _load(self) -> None:
        content = read_weights(self.folder)
        fitted = self._fit_seconds is not None
        if content["config"] != asdict(self.config) or not (fitted or content["steps"] == self.steps):
            raise input_error(
                str(self.folder), "an empty folder or a run of this configuration and data", "another"
            )
        self.step, self.steps, self.seconds = content["step"], content["steps"], content["seconds"]
        self.before = content["before"]
        self.averaged.load_state_dict(content["network"])
        self.network.load_state_dict(content["trained"] or content["network"])
        self.optimizer.load_state_dict(content["optimizer"])
        self._spent = self.seconds

    def _begin_with(self, initial: Path) -> None:
        """Take the weights of another run and add its cost to the count."""
        content = read_weights(initial)
        if content["config"]["network"] != self.config.network:
            raise input_error(
                str(initial), f"a run of {self.config.network}", repr(content["config"]["network"])
            )
        for network in (self.network, self.averaged):
            load_into(network, content["network"])
        self.before = {name: content["before"][name] + content[now] for name, now in _COSTS.items()}

    def _train(self, batch: Batch) -> Losses:
        """Take one training step."""
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(self.config, self.step, self.steps)
        self.network.train()
        crops = batch.crops.contiguous(memory_format=torch.channels_last)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self._bf16):
            raw = self.network(crops)
        losses = self._loss(raw, batch)
        self.optimizer.zero_grad(set_to_none=True)
        losses.total.backward()  # type: ignore[no-untyped-call]
        if self.config.clip is not None:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip)
        self.optimizer.step()
        self.step += 1
        if self.averaged is not self.network and self.step % _AVERAGED_EVERY == 0:
            self._average()
        return losses

    def _average(self) -> None:
        """Move the averaged weights towards the trained ones; faster in the beginning, when all is new."""
        kept = min(self.config.average, (1 + self.step) / (10 + self.step)) ** _AVERAGED_EVERY
        new = self.network.state_dict()
        with torch.no_grad():
            for name, value in self.averaged.state_dict().items():
                if value.dtype.is_floating_point:
                    value.lerp_(new[name], 1.0 - kept)
                else:
                    value.copy_(new[name])

    def _make(self, step: int) -> Batch:
        """The batch of a step."""
        indices = self._indices(step)
        images, labels = self._pictures(indices), self.crops.labels[indices]
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
        steps = itertools.count(self.step)
        if self._workers == 0:
            yield (self._make(step) for step in itertools.takewhile(lambda _: self.step < self.steps, steps))
            return
        with ThreadPoolExecutor(self._workers) as pool:
            waiting = [pool.submit(self._make, step) for step in itertools.islice(steps, 2 * self._workers)]

            def ready() -> Iterator[Batch]:
                while self.step < self.steps:
                    yield waiting.pop(0).result()
                    waiting.extend(pool.submit(self._make, step) for step in itertools.islice(steps, 1))

            try:
                yield ready()
            finally:
                pool.shutdown(cancel_futures=True)
