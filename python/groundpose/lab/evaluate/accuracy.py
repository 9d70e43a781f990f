"""Rows about accuracy on synthetic scenes: E1, E3, E4 of the paper and V1, against an oracle."""

from __future__ import annotations

from typing import Any

import numpy as np

from groundpose.lab.evaluate import methods, oracle
from groundpose.lab.evaluate.methods import HRE_CUBE, HRE_VEHICLE, Method, errors
from groundpose.lab.evaluate.rivals import RIVALS, Rival
from groundpose.lab.evaluate.rows import Check, Context, Detail, Result
from groundpose.lab.evaluate.scenes import Scenes, generate
from groundpose.lab.metrics import Summary, rotation_error_deg, summarise, translation_error_percent

OUTLIER_KINDS = ("image", "box")
TILT_ERRORS_DEG = (-5.0, -3.0, -1.5, 0.0, 1.5, 3.0, 5.0)
FORGETS_ITS_START = (
    "The stages of HRE have wide kernels: where every start leads it to the same minimum, lines with HRE "
    "agree to all digits whatever the search, and a flat curve shows that the start is forgotten, not that "
    "the search is robust. The unrefined lines tell what the searches themselves are worth."
)
BOX_ERRORS_PX = (-5.0, -2.0, 0.0, 2.0, 5.0)


def oracle_errors(scenes: Scenes, degrees_of_freedom: int) -> Summary:
    """Errors of least squares on the true inliers, 6 or 4 degrees of freedom."""
    c = scenes.camera
    problem = oracle.Problem(
        scenes.keypoints_2d, scenes.keypoints_3d, scenes.inlier_truth, (c.fx, c.fy, c.cx, c.cy)
    )
    if degrees_of_freedom == 6:
        return errors(scenes, *oracle.solve_6dof(problem, scenes.R, scenes.t))
    tilt = scenes.view.R_camera_from_ground
    return errors(scenes, *oracle.solve_4dof(problem, scenes.R, scenes.t, tilt))


def rival_errors(scenes: Scenes, rival: Rival) -> Summary:
    """Errors of another library, one call an object."""
    e_r, e_t = np.full(len(scenes), np.nan), np.full(len(scenes), np.nan)
    for k, scene in enumerate(scenes.singles):
        answer = rival.solve(scene)
        if answer.R is not None and answer.t is not None:
            e_r[k] = rotation_error_deg(scene.R, answer.R)
            e_t[k] = translation_error_percent(scene.t, answer.t)
    return summarise(e_r, e_t)


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


def e1(context: Context, percents: tuple[int, ...], method: Method, dof: int, limit: float) -> Result:
    """E1 at outlier shares in percent, both outlier models: mean e_r against the oracle with `dof`."""
    details: list[Detail] = []
    checks: list[Check] = []
    for kind in OUTLIER_KINDS:
        for percent in percents:
            context.advance(f"E1 {percent} % {kind}")
            scenes = generate(
                "cube", context.trials, seed=context.seed, outlier_ratio=percent / 100, outliers=kind
            )
            floor, ours = oracle_errors(scenes, dof), errors(scenes, *method(scenes))
            setting = {"outliers": f"{percent} % {kind}"}
            ratio = ours.mean_e_r_deg / floor.mean_e_r_deg
            details.append(detail(setting, f"oracle {dof}-DoF", floor) | {"ratio": 1.0})
            details.append(detail(setting, method.name, ours) | {"ratio": ratio})
            checks.append(Check(f"E1 {percent} % {kind}, mean e_r / oracle", ratio, limit))
    worst = max(checks, key=lambda check: check.value)
    return Result([worst], details)


def e1_moderate(context: Context) -> Result:
    """10 to 70 % outliers, default without prior."""
    return e1(context, (10, 20, 30, 40, 50, 60, 70), methods.NO_PRIOR, 6, 1.05)


def e1_hard(context: Context) -> Result:
    """90 % outliers, default without prior: near the oracle, and no failure."""
    result = e1(context, (90,), methods.NO_PRIOR, 6, 1.2)
    failures = [d["failures %"] for d in result.details if d["method"] == methods.NO_PRIOR.name]
    worst = max(failures) * context.trials / 100
    return Result([*result.checks, Check("failures, worst outlier model", round(worst), 0)], result.details)


def e1_tilt_prior(context: Context) -> Result:
    """A tilt that is known to 0.1 deg, against the oracle that knows it exactly."""
    parts = [e1(context, percents, methods.TIGHT_PRIOR, 4, 1.1) for percents in ((10, 30, 50, 70), (90,))]
    return Result([c for p in parts for c in p.checks], [d for p in parts for d in p.details])


def v1(context: Context) -> Result:
    """Vehicle-like scenes with a tilt that is told wrongly by 1.5 deg (sd)."""
    scenes = generate("vehicle", context.trials, seed=context.seed)
    details = [detail({}, f"oracle {dof}-DoF", oracle_errors(scenes, dof)) for dof in (6, 4)]
    ours = errors(scenes, *methods.PRIOR(scenes))
    default = errors(scenes, *methods.DEFAULT(scenes))
    details += [detail({}, methods.DEFAULT.name, default), detail({}, methods.PRIOR.name, ours)]
    paper = [methods.paper(solver, HRE_VEHICLE) for solver in ("p1p", "p3p")]
    raw = [methods.unrefined(solver) for solver in ("p1p", "p3p")]
    for method in (methods.NO_PRIOR, methods.UP2P, methods.P3P, *paper, *raw):
        context.advance(f"V1 {method.name}")
        details.append(detail({}, method.name, errors(scenes, *method(scenes))))
    for rival in RIVALS:
        context.advance(f"V1 {rival.name}")
        if reason := rival.missing():
            details.append({"method": f"{rival.name}: {reason}"})
        else:
            details.append(detail({}, rival.name, rival_errors(scenes, rival)))
    checks = [
        Check(f"{name}, {what}", value, limit, unit=unit)
        for name, summary in ((methods.DEFAULT.name, default), (methods.PRIOR.name, ours))
        for what, value, limit, unit in (
            ("mean e_r", summary.mean_e_r_deg, 2.2, " deg"),
            ("failures", 100 * summary.failures, 1.2, " %"),
        )
    ]
    return Result(checks, details, note=FORGETS_ITS_START)


def _flat(
    context: Context, name: str, settings: list[dict[str, Any]], method: Method, limit: float
) -> Result:
    """Mean e_r under an error of the input, relative to none; the first setting is the one without error."""
    details: list[Detail] = []
    for setting in settings:
        label = " ".join(str(value) for value in setting.values())
        context.advance(f"{name} {label}")
        scenes = generate("cube", context.trials, seed=context.seed, **setting)
        ours = errors(scenes, *method(scenes))
        details.append(detail({"error": label}, method.name, ours))
    at_zero = details[0]["mean e_r deg"]
    for line in details:
        line["ratio"] = line["mean e_r deg"] / at_zero
    worst = max(details, key=lambda line: float(line["ratio"]))
    what = f"{name}, {method.name}: mean e_r at {worst['error']} / at zero"
    return Result([Check(what, worst["ratio"], limit)], details)


def e3(context: Context, method: Method, limit: float) -> Result:
    """Tilt told wrongly by up to 5 deg."""
    errors_deg = sorted(TILT_ERRORS_DEG, key=abs)
    return _flat(context, "E3", [{"pitch_error_deg": e} for e in errors_deg], method, limit)


def e4(context: Context, method: Method, limit: float) -> Result:
    """Box sides off by up to 5 px: both outward (negative: inward) or both shifted."""
    kinds = [
        {"bbox_error": e, "bbox_error_kind": kind}
        for kind in ("outward", "shift")
        for e in sorted(BOX_ERRORS_PX, key=abs)
        if not (kind == "shift" and e == 0.0)
    ]
    return _flat(context, "E4", kinds, method, limit)


def flatness(context: Context) -> Result:
    """E3 and E4 with the paper's refinement and with the default without prior."""
    parts = [
        experiment(context, method, 1.1)
        for experiment in (e3, e4)
        for method in (methods.hre(HRE_CUBE), methods.NO_PRIOR)
    ]
    raw = [experiment(context, methods.unrefined("p1p"), 1.1) for experiment in (e3, e4)]
    details = [d for p in (*parts, *raw) for d in p.details]
    return Result([c for p in parts for c in p.checks], details, note=FORGETS_ITS_START)


def flatness_with_prior(context: Context) -> Result:
    """E3 with the default and its priors; E4 beside it, without a bar."""
    tilt, box = e3(context, methods.DEFAULT, 1.25), e4(context, methods.DEFAULT, 1.25)
    return Result(tilt.checks, [*tilt.details, *box.details])
