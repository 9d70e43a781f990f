"""A search followed by a PnP method on the keypoints that it kept, as in the paper's figures."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from groundpose.lab.contenders.baselines import aspnp, eppnp, gauss_newton, opnp, reppnp, rpnp
from groundpose.lab.contenders.baselines.geometry import Array, Pose, normalised
from groundpose.lab.contenders.baselines.reppnp import DELTA_FACTOR
from groundpose.lab.contenders.contender import Answers, Contender, inlier_mask, nothing
from groundpose.lab.contenders.objects import Mask, Objects
from groundpose.lab.timing import Clock

Fit = Callable[[Array, Array, Pose], Pose | None]
"""Kept points X (n, 3), x (n, 2) normalised, and the pose of the search, to a pose."""


@dataclass(frozen=True)
class Polish:
    """One method; `name` is appended to that of the search."""

    name: str
    note: str
    fit: Fit = field(repr=False)
    package: str | None = None

    def missing(self) -> str | None:
        """Why it cannot run, or None when it can."""
        absent = self.package is not None and importlib.util.find_spec(self.package) is None
        return f"{self.package} is not installed" if absent else None


def _epnp_gn(X: Array, x: Array, start: Pose) -> Pose | None:
    cv2 = importlib.import_module("cv2")
    try:
        found, r, t = cv2.solvePnP(X, x, np.eye(3), None, flags=cv2.SOLVEPNP_EPNP)
    except cv2.error:  # too few or degenerate points
        return None
    if not found or not (np.isfinite(r).all() and np.isfinite(t).all()):
        return None
    return gauss_newton(X, x, (np.asarray(cv2.Rodrigues(r)[0]), np.asarray(t).ravel()))


GN = Polish("GN", "Gauss-Newton from the pose of the search", gauss_newton)
PNPS = (
    Polish("EPnP+GN", "EPnP of OpenCV, then Gauss-Newton", _epnp_gn, "cv2"),
    Polish("RPnP", "Li et al. 2012, NumPy", lambda X, x, start: rpnp(X, x)),
    Polish("ASPnP", "Zheng et al., IEICE 2013, NumPy", lambda X, x, start: aspnp(X, x)),
    Polish("OPnP+N", "Zheng et al., ICCV 2013, NumPy", lambda X, x, start: opnp(X, x)),
    Polish("EPPnP", "Ferraz et al. 2014, NumPy", lambda X, x, start: eppnp(X, x)),
)
LEAST_POINTS = 6
"""Points a PnP needs (EPnP and EPPnP: twelve equations); with fewer there is no answer."""


@dataclass(frozen=True)
class Reppnp:
    """REPPnP, which finds its inliers itself; delta_max = 1.4 t_in / f."""

    name: str = "REPPnP"
    note: str = "Ferraz et al. 2014, NumPy"
    weighs_scores: bool = False
    slow_with_outliers: bool = False

    def missing(self) -> str | None:
        """It is always there."""
        return None

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """See `Contender`."""
        R, t = nothing(len(objects))
        seconds, kept = np.zeros(len(objects)), np.zeros(objects.keypoints_2d.shape[:2], bool)
        for k in range(len(objects)):
            delta = DELTA_FACTOR * float(objects.inlier_threshold[k]) / objects.camera.fx
            before = clock.seconds
            seen = np.isfinite(objects.keypoints_2d[k, :, 0])
            pose, kept[k, seen] = clock(self._fit, objects, k, seen, delta)
            seconds[k] = clock.seconds - before
            if pose is not None:
                R[k], t[k] = pose
        return Answers(R, t, seconds, kept=kept)

    def _fit(self, objects: Objects, k: int, seen: Mask, delta: float) -> tuple[Pose | None, Mask]:
        x = normalised(objects.keypoints_2d[k, seen], objects.camera)
        pose, used, _ = reppnp(objects.keypoints_3d[k, seen], x, delta)
        return pose, used


@dataclass(frozen=True)
class Polished:
    """A search and a PnP method after it; the times of both count."""

    search: Contender
    polish: Polish
    weighs_scores: bool = False
    slow_with_outliers: bool = False

    @property
    def name(self) -> str:
        """Of both."""
        return f"{self.search.name}+{self.polish.name}"

    @property
    def note(self) -> str:
        """Of the PnP method."""
        return self.polish.note

    def missing(self) -> str | None:
        """What is missing of either."""
        return self.search.missing() or self.polish.missing()

    def solve(self, objects: Objects, clock: Clock) -> Answers:
        """See `Contender`."""
        return self.after(self.search.solve(objects, clock), objects, clock)

    def after(self, search: Answers, objects: Objects, clock: Clock) -> Answers:
        """The PnP on what the search kept, which is done."""
        R, t = nothing(len(objects))
        seconds = search.seconds.copy()
        kept = inlier_mask(objects, search.R, search.t) if search.kept is None else search.kept
        for k in np.flatnonzero(np.isfinite(search.t[:, 0]) & (kept.sum(axis=1) >= LEAST_POINTS)):
            before = clock.seconds
            X, pixels = objects.keypoints_3d[k][kept[k]], objects.keypoints_2d[k][kept[k]]
            pose = clock(self._fit, X, normalised(pixels, objects.camera), (search.R[k], search.t[k]))
            seconds[k] += clock.seconds - before
            if pose is not None and np.isfinite(pose[0]).all() and np.isfinite(pose[1]).all():
                R[k], t[k] = pose
        return Answers(R, t, seconds, search.iterations)

    def _fit(self, X: Array, x: Array, start: Pose) -> Pose | None:
        try:
            return self.polish.fit(X, x, start)
        except np.linalg.LinAlgError:
            return None


def solve_all(contenders: Sequence[Contender], objects: Objects, clock: Clock) -> dict[str, Answers]:
    """Answers of several, {name: answers}; a search that some of them share runs once."""
    searches: dict[str, Answers] = {}
    found = {}
    for contender in contenders:
        search = contender.search if isinstance(contender, Polished) else contender
        if search.name not in searches:
            searches[search.name] = search.solve(objects, clock)
        done = searches[search.name]
        found[contender.name] = (
            contender.after(done, objects, clock) if isinstance(contender, Polished) else done
        )
    return found
