"""Rows about accuracy on synthetic scenes: E1, E3, E4 of the paper and V1, against an oracle."""

from __future__ import annotations

from typing import Any

from groundpose.lab.contenders import own
from groundpose.lab.contenders.contender import Contender, errors
from groundpose.lab.contenders.objects import Objects
from groundpose.lab.contenders.oracle import Oracle
from groundpose.lab.contenders.registry import contenders
from groundpose.lab.evaluate.rows import Context, Detail, Result
from groundpose.lab.evaluate.scenes import generate
from groundpose.lab.metrics import Summary
from groundpose.lab.targets import TARGETS, Check
from groundpose.lab.timing import Clock

OUTLIER_KINDS = ("image", "box")
TILT_ERRORS_DEG = (-5.0, -3.0, -1.5, 0.0, 1.5, 3.0, 5.0)
FORGETS_ITS_START = (
    "The stages of HRE have wide kernels: where every start leads it to the same minimum, lines with HRE "
    "agree to all digits whatever the search, and a flat curve shows that the start is forgotten, not that "
    "the search is robust. The unrefined lines tell what the searches themselves are worth."
)
BOX_ERRORS_PX = (-5.0, -2.0, 0.0, 2.0, 5.0)


def errors_of(contender: Contender, scenes: Objects) -> Summary:
    """Errors of all scenes."""
    return errors(scenes, contender.solve(scenes, Clock()))


def detail(setting: Detail, name: str, summary: Summary) -> Detail:
    """One line of a detail table."""
    return {
        **setting,
        "method": name,
        "mean e_r deg": summary.mean_e_r_deg,
        "median e_r deg": summary.median_e_r_deg,
        "mean e_t %": summary.mean_e_t_percent,
        "failures %": 100 * summary.failures,
    }


def e1(context: Context, percents: tuple[int, ...], contender: Contender, dof: int, target: str) -> Result:
    """E1 at percentages of outliers, both outlier models: mean e_r against the oracle with `dof`."""
    details: list[Detail] = []
    checks: list[Check] = []
    oracle = Oracle(dof)
    for kind in OUTLIER_KINDS:
        for percent in percents:
            context.advance(f"E1 {percent} % {kind}")
            scenes = generate(
                "cube", context.trials, seed=context.seed, outlier_ratio=percent / 100, outliers=kind
            )
            floor, ours = errors_of(oracle, scenes), errors_of(contender, scenes)
            setting = {"outliers": f"{percent} % {kind}"}
            ratio = ours.mean_e_r_deg / floor.mean_e_r_deg
            details.append(detail(setting, oracle.name, floor) | {"ratio": 1.0})
            details.append(detail(setting, contender.name, ours) | {"ratio": ratio})
            checks.append(TARGETS[target].check(ratio, f"E1 {percent} % {kind}, mean e_r / oracle"))
    worst = max(checks, key=lambda check: check.value)
    return Result([worst], details)


def e1_moderate(context: Context) -> Result:
    """10 to 70 % outliers, default without prior."""
    return e1(context, (10, 20, 30, 40, 50, 60, 70), own.NO_PRIOR, 6, "e1")


def e1_hard(context: Context) -> Result:
    """90 % outliers, default without prior: near the oracle, and no failure."""
    result = e1(context, (90,), own.NO_PRIOR, 6, "e1-90")
    failures = [d["failures %"] for d in result.details if d["method"] == own.NO_PRIOR.name]
    worst = round(max(failures) * context.trials / 100)
    return Result([*result.checks, TARGETS["e1-90 failures"].check(worst)], result.details)


def e1_tilt_prior(context: Context) -> Result:
    """A tilt that is known to 0.1 deg, against the oracle that knows it exactly."""
    parts = [e1(context, some, own.TIGHT_PRIOR, 4, "e1-tilt") for some in ((10, 30, 50, 70), (90,))]
    return Result([c for p in parts for c in p.checks], [d for p in parts for d in p.details])


def v1(context: Context) -> Result:
    """Vehicle-like scenes with a nominal tilt that is wrong by 1.5 deg (sd)."""
    scenes = generate("vehicle", context.trials, seed=context.seed)
    details: list[Detail] = []
    found: dict[str, Summary] = {}
    for contender in contenders("V1"):
        context.advance(f"V1 {contender.name}")
        if reason := contender.missing():
            details.append({"method": f"{contender.name}: {reason}"})
        else:
            found[contender.name] = errors_of(contender, scenes)
            details.append(detail({}, contender.name, found[contender.name]))
    checks = [
        check
        for name in (own.DEFAULT.name, own.PRIOR.name)
        for check in (
            TARGETS["v1 e_r"].check(found[name].mean_e_r_deg, f"{name}, mean e_r"),
            TARGETS["v1 failures"].check(100 * found[name].failures, f"{name}, failures"),
        )
    ]
    return Result(checks, details, note=FORGETS_ITS_START)


def _flat(
    context: Context, name: str, settings: list[dict[str, Any]], contender: Contender, target: str
) -> Result:
    """Mean e_r under an error of the input, relative to none; the first setting is the one without error."""
    details: list[Detail] = []
    for setting in settings:
        label = " ".join(str(value) for value in setting.values())
        context.advance(f"{name} {label}")
        scenes = generate("cube", context.trials, seed=context.seed, **setting)
        details.append(detail({"error": label}, contender.name, errors_of(contender, scenes)))
    at_zero = details[0]["mean e_r deg"]
    for line in details:
        line["ratio"] = line["mean e_r deg"] / at_zero
    worst = max(details, key=lambda line: float(line["ratio"]))
    what = f"{name}, {contender.name}: mean e_r at {worst['error']} / at zero"
    return Result([TARGETS[target].check(worst["ratio"], what)], details)


def e3(context: Context, contender: Contender, target: str) -> Result:
    """Nominal tilt wrong by up to 5 deg."""
    errors_deg = sorted(TILT_ERRORS_DEG, key=abs)
    return _flat(context, "E3", [{"pitch_error_deg": e} for e in errors_deg], contender, target)


def e4(context: Context, contender: Contender, target: str) -> Result:
    """Box sides off by up to 5 px: both outward (negative: inward) or both shifted."""
    kinds = [
        {"bbox_error": e, "bbox_error_kind": kind}
        for kind in ("outward", "shift")
        for e in sorted(BOX_ERRORS_PX, key=abs)
        if not (kind == "shift" and e == 0.0)
    ]
    return _flat(context, "E4", kinds, contender, target)


def flatness(context: Context) -> Result:
    """E3 and E4 with the paper's refinement and with the default without prior."""
    parts = [
        experiment(context, contender, "flat")
        for experiment in (e3, e4)
        for contender in (own.HRE, own.NO_PRIOR)
    ]
    raw = [experiment(context, own.unrefined("p1p"), "flat") for experiment in (e3, e4)]
    details = [d for p in (*parts, *raw) for d in p.details]
    return Result([c for p in parts for c in p.checks], details, note=FORGETS_ITS_START)


def flatness_with_prior(context: Context) -> Result:
    """E3 with the default and its priors; E4 beside it, without a target."""
    tilt, box = (experiment(context, own.DEFAULT, "flat-prior") for experiment in (e3, e4))
    return Result(tilt.checks, [*tilt.details, *box.details])
