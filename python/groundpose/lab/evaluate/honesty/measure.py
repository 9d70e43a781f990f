"""`groundpose evaluate honesty NAME=FILE.onnx --crops FOLDER [--fit FOLDER]`: docs/honesty.md.

What a network says of crops is kept in `FOLDER/evaluated/honesty`, so a second run takes seconds and a run
that was stopped goes on. Poses are solved anew each time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._checks import input_error
from groundpose.keypoints.network import Network
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.honesty import callers, numbers, sources, synthetic
from groundpose.lab.evaluate.honesty.answers import Answers, Mask, solve
from groundpose.lab.evaluate.honesty.coverage import covered
from groundpose.lab.evaluate.honesty.fit import ambiguity_coefficients, fit
from groundpose.lab.evaluate.honesty.page import RESULTS, write_page
from groundpose.lab.evaluate.honesty.seen import Source, kept
from groundpose.lab.evaluate.honesty.store import store
from groundpose.lab.evaluate.honesty.truth import folder_of

Tell = Callable[[str], None]
TRIALS = 1500
"""Synthetic scenes of each setting."""


@dataclass(frozen=True, eq=False)
class Judge:
    """One network and its answers to sources."""

    network: Network
    tell: Tell
    ambiguity: tuple[float, float] | None = None
    """`Options.ambiguity_coefficients`."""

    def answers(self, folder: Path, name: str, source: Source) -> Answers:
        """Of a source that `name` tells from others; what the network says is kept in a folder of crops."""
        return solve(kept(folder_of(folder), name, self.network, source, self.tell), self.ambiguity)

    def is_vehicle(self, answers: Answers) -> Mask:
        """(N,): what the network takes for a vehicle."""
        return np.asarray(answers.seen["vehicle"] >= self.network.vehicle_threshold)


def measure(root: Path, networks: list[str], crops: Path, fit_on: Path | None, tell: Tell) -> Path:
    """Measure networks and the solver alone, write results and page; where the results are.

    Args:
        networks: NAME=FILE. Numbers of others stay.
        crops: folder with a test split, and of what is kept.
        fit_on: folder with a validation split; each file's certainty is fitted on it and stored first.

    Raises:
        InputError: a file without certainty that is not fitted now; a folder without the split.
    """
    out = root / RESULTS
    found = report.read_json(out) | {"command": _command(networks), "versions": report.versions()}
    tell("synthetic scenes")
    found["callers"], found["callers_probability"] = coverage_of_callers(), callers.judged(data_folder())
    for name, _, path in (one.partition("=") for one in networks):
        if fit_on is not None:
            tell(f"{name}: fit on the validation split")
            fit_file(Path(path), fit_on, tell)
        network = Network(path, 1)
        judge = Judge(network, tell, network.certainty.ambiguity_coefficients)
        found.setdefault("trained", {})[name] = judged(judge, crops)
        report.write_json(out, found)
    report.write_json(out, found)
    write_page(root, found)
    return out


def _command(networks: list[str]) -> str:
    named = [f"{one.partition('=')[0]}=FILE.onnx" for one in networks]
    return " ".join(["groundpose evaluate honesty", *named, *(["--crops FOLDER"] if networks else [])])


def fit_file(path: Path, crops: Path, tell: Tell) -> None:
    """Fit a network's certainty on the validation split of a folder and store it in the network's file."""
    network = Network(path, 1)
    line = ambiguity_coefficients(_for_fit(Judge(network, tell), crops))
    judge = Judge(network, tell, line)
    answers = _for_fit(judge, crops)
    certainty = replace(fit(answers, judge.is_vehicle(answers)), ambiguity_coefficients=line)
    store(path, certainty)
    tell(f"{path.name}: {certainty}")


def _for_fit(judge: Judge, crops: Path) -> Answers:
    return Answers.joined([judge.answers(crops, *one) for one in sources.for_fit(crops).items()])


def judged(judge: Judge, crops: Path) -> dict[str, Any]:
    """All numbers of a network; its file must have a certainty."""
    certainty = judge.network.certainty
    if certainty.probability_coefficients is None:
        raise input_error(str(judge.network.path), "a network with certainty (--fit)", "none")
    found: dict[str, Any] = {"certainty": certainty.numbers(), "vehicles": {}, "background": {}}
    found["vehicle_threshold"] = judge.network.vehicle_threshold
    seen = {
        name: judge.answers(crops, name, source)
        for name, source in sources.for_test(crops, data_folder()).items()
    }
    seen[sources.ALL_RENDERS] = Answers.joined([seen[name] for name in sources.RENDERS])
    for name, answers in seen.items():
        if name in sources.BACKGROUND:
            found["background"][name] = numbers.background(answers, certainty, judge.is_vehicle(answers))
        else:
            real = name in (sources.STREETS, sources.MANY_LOOKS)
            found["vehicles"][name] = numbers.vehicles(answers, certainty, judge.is_vehicle(answers), real)
    return found


def coverage_of_callers() -> dict[str, Any]:
    """Coverage for keypoints of the caller: synthetic scenes, and ApolloCar3D if the data folder has it."""
    return {
        name: covered(stated, float("inf"))
        for name, stated in synthetic.settings(TRIALS, data_folder()).items()
        if len(stated.t) >= numbers.FEWEST
    }
