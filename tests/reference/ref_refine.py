"""Reference refinement: Tukey, MAD scale, RE (eq. 9), HRE (Algorithm 1), GN, MSAC, covariance.

Unknowns: rotation (left perturbation R <- exp(w) R), translation, shape coefficients. Slow and run to
convergence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ref_geometry import Array, Mask, RefCamera, exp_so3, hat, project

TUKEY = 4.685  # sec. 3.3, below eq. (10)
MAD_TO_SIGMA = 0.6745


@dataclass(frozen=True)
class State:
    """camera_from_object and shape coefficients (M,)."""

    R: Array
    t: Array
    shape: Array

    def moved(self, step: Array) -> State:
        shape = self.shape.copy()
        shape[: len(step) - 6] += step[6:]
        return State(exp_so3(step[:3]) @ self.R, self.t + step[3:6], shape)


@dataclass(frozen=True)
class Problem:
    """Pixels (n, 2), mean shape (n, 3), basis (M, n, 3); `weights` (n,) multiply squared residuals."""

    camera: RefCamera
    pixels: Array
    mean: Array
    basis: Array
    weights: Array

    @staticmethod
    def of(camera: RefCamera, pixels: Array, mean: Array, basis: Array | None = None) -> Problem:
        seen = np.isfinite(pixels).all(axis=1)
        basis = np.zeros((0, len(mean), 3)) if basis is None else basis
        return Problem(camera, pixels[seen], mean[seen], basis[:, seen], np.ones(int(seen.sum())))

    def subset(self, mask: Mask) -> Problem:
        return Problem(
            self.camera, self.pixels[mask], self.mean[mask], self.basis[:, mask], self.weights[mask]
        )

    def points(self, state: State) -> Array:
        points: Array = self.mean + np.einsum("m,mpk->pk", state.shape, self.basis)
        return points

    def errors(self, state: State) -> Array:
        """(n, 2) signed reprojection errors in pixels."""
        return project(self.camera, self.points(state) @ state.R.T + state.t) - self.pixels

    def residuals(self, state: State) -> Array:
        """(n,) residual r_i of eq. (9)."""
        r: Array = np.linalg.norm(self.errors(state), axis=1)
        return r

    def jacobian(self, state: State, with_shape: bool) -> Array:
        """(n, 2, 6 or 6 + M) derivative of `errors` by [rotation, translation, shape]."""
        rotated = self.points(state) @ state.R.T
        x, y, z = (rotated + state.t).T
        D = np.zeros((len(x), 2, 3))
        D[:, 0, 0], D[:, 0, 2] = self.camera.fx / z, -self.camera.fx * x / z**2
        D[:, 1, 1], D[:, 1, 2] = self.camera.fy / z, -self.camera.fy * y / z**2
        blocks = [-np.array([hat(p) for p in rotated]), np.broadcast_to(np.eye(3), (len(x), 3, 3))]
        if with_shape:
            blocks.append(np.einsum("ij,mnj->nim", state.R, self.basis))
        J: Array = D @ np.concatenate(blocks, axis=2)
        return J


def numerical_jacobian(problem: Problem, state: State, with_shape: bool, h: float = 1e-6) -> Array:
    """Central differences of `errors`, shaped as `Problem.jacobian`."""
    size = 6 + (len(state.shape) if with_shape else 0)
    steps = np.eye(size) * h
    columns = [(problem.errors(state.moved(d)) - problem.errors(state.moved(-d))) / (2.0 * h) for d in steps]
    return np.stack(columns, axis=2)


def tukey_rho(r: Array, c: float) -> Array:
    """Eq. (10)."""
    q = np.minimum(1.0, (np.asarray(r) / c) ** 2)
    return c * c / 6.0 * (1.0 - (1.0 - q) ** 3)


def tukey_weight(r: Array, c: float) -> Array:
    """rho'(r) / r: the weight of iteratively reweighted least squares."""
    q = np.minimum(1.0, (np.asarray(r) / c) ** 2)
    return (1.0 - q) ** 2


def mad_scale(r: Array) -> float:
    """s = MAD / 0.6745 with the median absolute deviation about the median."""
    return float(np.median(np.abs(r - np.median(r)))) / MAD_TO_SIGMA


def robust_cost(problem: Problem, state: State, c: float | None) -> float:
    """Sum of rho(r_i); half the sum of squares for c None (rho near zero is r^2 / 2)."""
    r = problem.residuals(state)
    if not np.all(np.isfinite(r)):
        return float("inf")
    rho = 0.5 * r * r if c is None else tukey_rho(r, c)
    return float(problem.weights @ rho)


def minimise(
    problem: Problem, state: State, c: float | None, with_shape: bool = False, rounds: int = 2000
) -> State:
    """Damped IRLS run until it stands still; a step is kept when the true robust cost does not grow."""
    damping, cost = 1e-6, robust_cost(problem, state, c)
    for _ in range(rounds):
        e, J = problem.errors(state), problem.jacobian(state, with_shape)
        r = np.linalg.norm(e, axis=1)
        w = problem.weights * (1.0 if c is None else tukey_weight(r, c))
        H = np.einsum("n,nij,nik->jk", w, J, J)
        g = np.einsum("n,nij,ni->j", w, J, e)
        step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
        candidate = state.moved(step)
        new = robust_cost(problem, candidate, c)
        if new <= cost * (1.0 + 1e-15):
            state, cost, damping = candidate, new, max(damping / 10.0, 1e-16)
            if np.abs(step).max() < 1e-14:
                break
        else:
            damping *= 10.0
            if damping > 1e12:
                break
    return state


def clamped_c(problem: Problem, state: State, low: float, high: float) -> float:
    """c = 4.685 gamma(s | low, high) of Algorithm 1."""
    return TUKEY * max(low, min(mad_scale(problem.residuals(state)), high))


def m_estimate(
    problem: Problem, state: State, low: float, high: float, with_shape: bool, update_scale: bool
) -> State:
    """One M-estimation stage with s clamped to [low, high].

    The paper does not say whether s is taken once at the start or from the current residuals in every round:
    `update_scale` chooses. Where the clamp is active at one end throughout, both are the same problem.
    """
    c = clamped_c(problem, state, low, high)
    state = minimise(problem, state, c, with_shape)
    if not update_scale:
        return state
    for _ in range(200):
        new_c = clamped_c(problem, state, low, high)
        if abs(new_c - c) < 1e-12 * c:
            break
        c = np.sqrt(c * new_c)  # the plain iteration c = new_c can go round in a cycle
        state = minimise(problem, state, c, with_shape)
    return state


def gn(problem: Problem, state: State, inliers: Mask, with_shape: bool = False) -> State:
    """Least squares on the inliers."""
    return minimise(problem.subset(inliers), state, None, with_shape)


def re(problem: Problem, state: State, with_shape: bool = False, update_scale: bool = False) -> State:
    """Eq. (9): one M-estimation with the scale of the residuals, not clamped."""
    return m_estimate(problem, state, 0.0, np.inf, with_shape, update_scale)


def hre(
    problem: Problem,
    state: State,
    taus: tuple[float, float, float],
    with_shape: bool,
    update_scale: bool = False,
) -> tuple[State, State, State]:
    """Algorithm 1; the states after its three stages. A known model keeps its shape in all of them."""
    tau1, tau2, tau3 = taus
    one = m_estimate(problem, state, tau2, tau3, False, update_scale)
    two = m_estimate(problem, one, tau1, tau2, with_shape, update_scale)
    three = gn(problem, two, problem.residuals(two) < tau1, with_shape)
    return one, two, three


def msac(residuals: Array, threshold: float) -> float:
    """Truncated squared error, sum over the seen points of min(r^2, threshold^2)."""
    r = residuals[np.isfinite(residuals)]
    return float(np.minimum(r * r, threshold**2).sum())


def covariance(problem: Problem, state: State, sigma: float, with_shape: bool = False) -> Array:
    """sigma^2 (J^T J)^-1 by central differences; order [rotation vector, translation, shape]."""
    J = numerical_jacobian(problem, state, with_shape)
    J = J.reshape(-1, J.shape[-1])
    return np.asarray(sigma**2 * np.linalg.inv(J.T @ J), dtype=np.float64)
