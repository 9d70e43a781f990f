"""Keypoints of the caller: how probable it is that an answer to them is right.

`python -m groundpose.lab.evaluate.honesty.callers` fits the coefficients that stand in `tuning.rs`, for
keypoints with scores and without, and writes them with what they are worth to results/callers.json. Seeds
of fit and test are apart; real keypoints are a test alone.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundpose import _core
from groundpose._checks import FloatArray
from groundpose.keypoints.decode import logistic_regression
from groundpose.lab.contenders.objects import Mask, Objects
from groundpose.lab.contenders.own import Own
from groundpose.lab.data import data_folder
from groundpose.lab.evaluate import report
from groundpose.lab.evaluate.honesty.answers import right
from groundpose.lab.evaluate.honesty.mixture import WITH_SCORES, WITHOUT_SCORES
from groundpose.lab.evaluate.honesty.probability import auc, reliability
from groundpose.lab.evaluate.misled import Case
from groundpose.lab.evaluate.real_data import apollo, kitti

RESULTS = Path("results/callers.json")
FIT_SEED, TEST_SEED = 100, 200
TRIALS, TESTED = 1000, 500
"""Objects of each part of the mixture: of a fit, and of a test."""
MIXTURES: dict[str, tuple[Case, ...]] = {"without scores": WITHOUT_SCORES, "with scores": WITH_SCORES}
NEVER_REFUSES = Own("", options={"min_probability": 0.0})
_USED = [0, 1, 2, 3, 5]
"""Numbers of the evidence: a vehicle's probability nobody says."""
_PLACES = 2


@dataclass(frozen=True)
class Judged:
    """Answers and whether they are right; none is refused for its probability."""

    ok: Mask
    right: Mask
    evidence: FloatArray
    probability: FloatArray
    """As the solver states it."""

    @classmethod
    def of(cls, objects: list[Objects], has_truth: bool = True) -> Judged:
        """The default on groups of objects."""
        groups = [(seen, NEVER_REFUSES.poses(seen)) for seen in objects]
        good = [right(seen.R, seen.t, poses.R, poses.t) & poses.ok & has_truth for seen, poses in groups]
        rows = [(poses.ok, poses.evidence, poses.probability) for _, poses in groups]
        ok, evidence, probability = (np.concatenate(column) for column in zip(*rows, strict=True))
        return cls(ok, np.concatenate(good), evidence, probability)


def answers(mixture: tuple[Case, ...], trials: int, seed: int) -> dict[str, Judged]:
    """By part of the mixture."""
    return {case.id: Judged.of(case.scenes(trials, seed), case.has_truth) for case in mixture}


def fit(parts: dict[str, Judged]) -> list[float]:
    """Bias and the coefficients of the six numbers of the evidence, as they stand in `tuning.rs`."""
    evidence = np.concatenate([part.evidence[part.ok] for part in parts.values()])[:, _USED]
    good = np.concatenate([part.right[part.ok] for part in parts.values()])
    bias, *fitted = logistic_regression(np.concatenate([np.ones((len(good), 1)), evidence], axis=1), good)
    coefficients = np.zeros(1 + _core.EVIDENCE)
    coefficients[0], coefficients[1 + np.array(_USED)] = bias, fitted
    return [round(float(c), _PLACES) for c in coefficients]


def stated(judged: Judged, coefficients: list[float]) -> FloatArray:
    """(N,) probabilities by other coefficients; NaN without an answer."""
    logit = coefficients[0] + judged.evidence @ np.array(coefficients[1:])
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * logit)))


def kept(judged: Judged, probability: FloatArray, least: float) -> dict[str, Any]:
    """Percentages of all objects: right and wrong answers, and those above a least probability."""
    above = judged.ok & (probability >= least)
    wrong = judged.ok & ~judged.right
    percent = {
        "right, %": judged.right,
        "right kept, %": judged.right & above,
        "wrong, %": wrong,
        "wrong kept, %": wrong & above,
    }
    return {name: 100.0 * float(mask.mean()) for name, mask in percent.items()}


def real(folder: Path) -> dict[str, Judged]:
    """Real keypoints, where the folder of real data has them."""
    found = {}
    if (folder / "kitti_cnn_keypoints14_dev.npz").exists():
        found["KITTI, a CNN's keypoints with scores"] = Judged.of([kitti(folder)])
        found["KITTI, a CNN's keypoints of 0.3 or more"] = Judged.of([kitti(folder).cut(0.3)])
        found["KITTI, a CNN's keypoints"] = Judged.of([kitti(folder).without_scores()])
    if (folder / "apollo_cars_dev.npz").exists():
        found["ApolloCar3D, labelled by hand, known models"] = Judged.of([apollo(folder, known_model=True)])
        found["ApolloCar3D, labelled by hand, class model"] = Judged.of([apollo(folder, known_model=False)])
    return found


def judged(folder: Path, trials: int = TESTED) -> dict[str, Any]:
    """`reliability` of the probabilities stated, by kind of keypoints; real ones from a folder."""
    found = {f"mixture, {name}": _joined(answers(mix, trials, TEST_SEED)) for name, mix in MIXTURES.items()}
    return {name: _reliability(one, one.probability) for name, one in {**found, **real(folder)}.items()}


def _joined(parts: dict[str, Judged]) -> Judged:
    columns = zip(*((p.ok, p.right, p.evidence, p.probability) for p in parts.values()), strict=True)
    return Judged(*(np.concatenate(column) for column in columns))


def _reliability(one: Judged, probability: FloatArray) -> dict[str, Any]:
    ok = one.ok
    share = {"objects": len(ok), "right": float(100 * one.right[ok].mean())}
    return share | reliability(probability[ok], one.right[ok])


def measure(trials: int, least: float, folder: Path) -> dict[str, Any]:
    """Fit and test: what stands in results/callers.json."""
    found: dict[str, Any] = {
        "command": f"python -m groundpose.lab.evaluate.honesty.callers {trials} {least:g}",
        "versions": report.versions(),
        "least probability": least,
        "fits": {},
    }
    fits = {}
    for name, mixture in MIXTURES.items():
        fits[name] = fit(answers(mixture, trials, FIT_SEED))
        parts = answers(mixture, trials, TEST_SEED)
        found["fits"][name] = _tested(parts, fits[name], least)
    found["real"] = {}
    for name, one in real(folder).items():
        probability = stated(one, fits["with scores" if name.endswith("with scores") else "without scores"])
        found["real"][name] = _reliability(one, probability) | kept(one, probability, least)
    return found


def _tested(parts: dict[str, Judged], coefficients: list[float], least: float) -> dict[str, Any]:
    whole = _joined(parts)
    probability = stated(whole, coefficients)
    quantiles = np.quantile(probability[whole.right], [0.003, 0.01, 0.03])
    return {
        "coefficients": coefficients,
        **_reliability(whole, probability),
        "right at 0.3, 1, 3 %": quantiles.tolist(),
        "parts": {
            name: kept(part, stated(part, coefficients), least)
            | {"AUC": auc(stated(part, coefficients)[part.ok], part.right[part.ok])}
            for name, part in {"all": whole, **parts}.items()
        },
    }


if __name__ == "__main__":
    _, _trials, _least = sys.argv
    report.write_json(RESULTS, measure(int(_trials), float(_least), data_folder()))
