"""Reference minimal solvers: P1P (general and the paper's own formula), P1P with camera height, UP2P, P3P.

Each returns a list of `Hypothesis`, unsorted and unscored.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ref_geometry import Array, RefCamera, RefView, box_corners, rays_ground, rot_y, side_planes

# (left, right) corners of the paper's four cases; 0..3 = front left, front right, rear right, rear left
PAPER_CASES = ((3, 1), (2, 0), (0, 2), (1, 3))
TOLERANCE = 0.03  # corners may lie outside the planes by this share of l_C (method.md sec. 2)


@dataclass(frozen=True)
class Hypothesis:
    """camera_from_object (R, t); `margin` = smallest signed distance of a corner to a side plane over l_C."""

    R: Array
    t: Array
    yaw: float = float("nan")
    margin: float = float("inf")
    corners: tuple[int, int] = (-1, -1)


def unit_circle_roots(a: float, b: float, e: float) -> list[tuple[float, float]]:
    """All (cos, sin) with a cos + b sin = e; none when |e| > hypot(a, b)."""
    h = np.hypot(a, b)
    if h == 0.0 or abs(e) > h:
        return []
    base, delta = np.arctan2(b, a), np.arccos(e / h)
    return [(np.cos(base + s * delta), np.sin(base + s * delta)) for s in (1.0, -1.0)]


def _hypothesis(
    view: RefView,
    ray: Array,
    X: Array,
    l_C: float,
    cs: tuple[float, float],
    planes: Array,
    prism: Array,
    pair: tuple[int, int],
) -> Hypothesis:
    yaw = float(np.arctan2(cs[1], cs[0]))
    t_ground = l_C * ray - rot_y(yaw) @ X
    corners = prism @ rot_y(yaw).T + t_ground
    margin = float((corners @ planes.T).min() / l_C)
    return Hypothesis(view.R_cg @ rot_y(yaw), view.R_cg @ t_ground, yaw, margin, pair)


def _plane_row(n: Array, ray: Array, offset: Array) -> tuple[float, float, float, float]:
    """(p, a, b, q) with n . (l ray + R_y(yaw) offset) = p l + a cos(yaw) + b sin(yaw) + q."""
    a = n[0] * offset[0] + n[2] * offset[2]
    b = n[0] * offset[2] - n[2] * offset[0]
    return float(n @ ray), float(a), float(b), float(n[1] * offset[1])


def _touching_corners(n: Array, prism: Array) -> Array:
    """The layer of the prism that can touch a plane with inward normal n: top (small y) when n_y > 0."""
    half = len(prism) // 2
    return prism[:half] if n[1] > 0.0 else prism[half:]


def p1p(
    view: RefView,
    X: Array,
    pixel: Array,
    left: float,
    right: float,
    bbox_3d: Array,
    footprint: Array | None = None,
    pairs: tuple[tuple[int, int], ...] | None = None,
    tolerance: float = TOLERANCE,
) -> list[Hypothesis]:
    """P1P exact under any tilt: keypoint X (3,) seen at pixel (2,), box columns, ordered corner pairs.

    For corner i on the left and j on the right plane two equations p l + a cos + b sin + q = 0 hold.
    Eliminating l leaves one linear equation in (cos, sin), which the unit circle cuts in at most two points.
    """
    ray = rays_ground(view, pixel[None])[0]
    planes = side_planes(view, left, right)
    prism = box_corners(bbox_3d, footprint)
    count = len(prism) // 2
    if pairs is None:
        pairs = tuple((i, j) for i in range(count) for j in range(count) if i != j)
    out = []
    for i, j in pairs:
        pL, aL, bL, qL = _plane_row(planes[0], ray, _touching_corners(planes[0], prism)[i] - X)
        pR, aR, bR, qR = _plane_row(planes[1], ray, _touching_corners(planes[1], prism)[j] - X)
        for c, s in unit_circle_roots(pR * aL - pL * aR, pR * bL - pL * bR, pL * qR - pR * qL):
            l_C = _depth([(pL, aL, bL, qL), (pR, aR, bR, qR)], c, s)
            if l_C > 0.0:
                h = _hypothesis(view, ray, X, l_C, (c, s), planes, prism, (i, j))
                if h.margin >= -tolerance:
                    out.append(h)
    return out


def _depth(rows: list[tuple[float, float, float, float]], c: float, s: float) -> float:
    """l_C from the row whose coefficient of l_C is largest."""
    p, a, b, q = max(rows, key=lambda row: abs(row[0]))
    return -(a * c + b * s + q) / p if p != 0.0 else -1.0


def p1p_paper(
    view: RefView,
    X: Array,
    pixel: Array,
    left: float,
    right: float,
    bbox_3d: Array,
    tolerance: float = TOLERANCE,
) -> list[Hypothesis]:
    """P1P by eq. (1) and (2) of the paper: four cases, vertical side planes, exact at zero tilt only.

    Errata: phi_y is an atan2 (Appendix B prints the arcsine of a dot product); theta and psi are signed
    angles (an arccosine loses the sign that a keypoint outside the box needs); Table 1 gives way to the
    feasibility of all corners; the arctangent leaves yaw open by pi, which l_C > 0 decides.
    """
    rays = rays_ground(view, np.array([[pixel[0], pixel[1]], [left, pixel[1]], [right, pixel[1]]]))
    angle_K, angle_L, angle_R = np.arctan2(rays[:, 0], rays[:, 2])  # phi_y is angle_K
    theta_L, theta_R = angle_K - angle_L, angle_R - angle_K
    prism, planes = box_corners(bbox_3d), side_planes(view, left, right)
    offsets = (prism[:4] - X)[:, [0, 2]]
    length, psi = np.hypot(offsets[:, 0], offsets[:, 1]), np.arctan2(offsets[:, 0], offsets[:, 1])
    out = []
    for i, j in PAPER_CASES:
        l_L, l_R, w_L, w_R = length[i], length[j], psi[i] + theta_L, psi[j] - theta_R
        f_L, f_R = l_L / np.sin(theta_L), l_R / np.sin(theta_R)
        numerator = -f_R * np.sin(w_R) - f_L * np.sin(w_L)
        denominator = f_R * np.cos(w_R) + f_L * np.cos(w_L)
        first = np.arctan(numerator / denominator)
        for theta_y in (first, first + np.pi):
            l_C = f_R * np.sin(theta_y + w_R)
            if l_C > 0.0:
                yaw = angle_K + theta_y
                cs = (float(np.cos(yaw)), float(np.sin(yaw)))
                h = _hypothesis(view, rays[0], X, float(l_C), cs, planes, prism, (i, j))
                if h.margin >= -tolerance:
                    out.append(h)
    return out


def p1p_height(
    view: RefView,
    X: Array,
    pixel: Array,
    left: float | None,
    right: float | None,
    bbox_3d: Array,
    footprint: Array | None = None,
    tolerance: float = TOLERANCE,
) -> list[Hypothesis]:
    """P1P from camera height and known box sides: the bottom of the 3D box (largest y) is on the ground.

    The ground plane y = height fixes l_C; a corner on one side plane is then one linear equation in (cos,
    sin). With two sides every solution of either is returned that is feasible for both.
    """
    assert view.height is not None
    ray = rays_ground(view, pixel[None])[0]
    if ray[1] == 0.0:
        return []
    l_C = (view.height - (bbox_3d[1, 1] - X[1])) / ray[1]
    if not l_C > 0.0:
        return []
    both = side_planes(view, 0.0 if left is None else left, 0.0 if right is None else right)
    planes = both[[side is not None for side in (left, right)]]
    prism = box_corners(bbox_3d, footprint)
    out = []
    for n in planes:
        for i, corner in enumerate(_touching_corners(n, prism)):
            p, a, b, q = _plane_row(n, ray, corner - X)
            for cs in unit_circle_roots(a, b, -q - p * l_C):
                h = _hypothesis(view, ray, X, float(l_C), cs, planes, prism, (i, i))
                if h.margin >= -tolerance:
                    out.append(h)
    return out


def up2p(view: RefView, points: Array, pixels: Array) -> list[Hypothesis]:
    """Known tilt, two points (2, 3) and pixels (2, 2): linear in (cos, sin, t) up to one null direction.

    Four projection equations for five unknowns leave a line; cos^2 + sin^2 = 1 cuts it in at most two points.
    """
    rays = rays_ground(view, pixels)
    A, rhs = np.zeros((4, 5)), np.zeros(4)
    for k, (ray, X) in enumerate(zip(rays, points, strict=True)):
        # R_y X = cos [x, 0, z] + sin [z, 0, -x] + [0, y, 0]; the two rows below are the cross product with
        # the ray
        columns = np.column_stack([[X[0], 0.0, X[2]], [X[2], 0.0, -X[0]], *np.eye(3)])
        M = np.array([[ray[2], 0.0, -ray[0]], [-ray[1] * ray[0], 1.0, -ray[1] * ray[2]]])
        A[2 * k : 2 * k + 2] = M @ columns
        rhs[2 * k : 2 * k + 2] = -M @ np.array([0.0, X[1], 0.0])
    particular = np.linalg.lstsq(A, rhs, rcond=None)[0]
    null = np.linalg.svd(A)[2][-1]
    u, v = particular[:2], null[:2]
    quadratic = [v @ v, 2.0 * u @ v, u @ u - 1.0]
    out = []
    for s in np.roots(quadratic):
        if abs(s.imag) > 0.0:
            continue
        x = particular + s.real * null
        yaw = float(np.arctan2(x[1], x[0]))
        R, t = view.R_cg @ rot_y(yaw), view.R_cg @ x[2:]
        # the two rows allow points behind the camera
        if np.all((points @ R.T + t)[:, 2] > 0.0):
            out.append(Hypothesis(R, t, yaw))
    return out


def p3p(camera: RefCamera, points: Array, pixels: Array) -> list[Hypothesis]:
    """P3P after Grunert (Haralick et al. 1994, eq. 9): a quartic in s3/s1, then Newton on the three
    distances.

    The quartic is solved for each of the three cyclic orders of the points and the answers are united: a
    root that one order loses to cancellation is well conditioned in another.
    """
    f = np.column_stack([pixels, np.ones(3)]) @ np.linalg.inv(camera.K).T
    f /= np.linalg.norm(f, axis=1)[:, None]
    out: list[Hypothesis] = []
    for k in range(3):
        order = np.roll(np.arange(3), k)
        for distances in _grunert_distances(points[order], f[order]):
            R, t = _align(points[order], f[order] * distances[:, None])
            if not any(np.abs(R - h.R).max() < 1e-7 and np.abs(t - h.t).max() < 1e-6 for h in out):
                out.append(Hypothesis(R, t))
    return out


def _grunert_distances(points: Array, f: Array) -> list[Array]:
    """Distances (3,) of the points along the unit rays f (3, 3)."""
    a2, b2, c2 = (float(np.sum((points[i] - points[j]) ** 2)) for i, j in ((1, 2), (0, 2), (0, 1)))
    ca, cb, cg = float(f[1] @ f[2]), float(f[0] @ f[2]), float(f[0] @ f[1])
    q, p = (a2 - c2) / b2, (a2 + c2) / b2
    A4 = (q - 1.0) ** 2 - 4.0 * c2 / b2 * ca**2
    A3 = 4.0 * (q * (1.0 - q) * cb - (1.0 - p) * ca * cg + 2.0 * c2 / b2 * ca**2 * cb)
    A2 = 2.0 * (
        q**2
        - 1.0
        + 2.0 * q**2 * cb**2
        + 2.0 * (b2 - c2) / b2 * ca**2
        - 4.0 * p * ca * cb * cg
        + 2.0 * (b2 - a2) / b2 * cg**2
    )
    A1 = 4.0 * (-q * (1.0 + q) * cb + 2.0 * a2 / b2 * cg**2 * cb - (1.0 - p) * ca * cg)
    A0 = (1.0 + q) ** 2 - 4.0 * a2 / b2 * cg**2
    out = []
    for root in np.roots([A4, A3, A2, A1, A0]):
        # a small object far away has its roots all near 1 and a few digits only; Newton below tells roots
        # from none
        if abs(root.imag) > 0.1 or root.real <= 0.0 or cg == root.real * ca:
            continue
        v = root.real
        u = ((q - 1.0) * v * v - 2.0 * q * cb * v + 1.0 + q) / (2.0 * (cg - v * ca))
        s1 = np.sqrt(b2 / (1.0 + v * v - 2.0 * v * cb))
        distances = _polish_distances(np.array([s1, u * s1, v * s1]), (a2, b2, c2), (ca, cb, cg))
        if distances is not None and np.all(distances > 0.0):
            out.append(distances)
    return out


def _polish_distances(s: Array, squares: tuple[float, ...], cosines: tuple[float, ...]) -> Array | None:
    """Newton on |s_i f_i - s_j f_j|^2 = d^2; None when it does not end on a root."""
    sides = ((1, 2), (0, 2), (0, 1))
    for _ in range(50):
        F, J = np.zeros(3), np.zeros((3, 3))
        for k, (i, j) in enumerate(sides):
            F[k] = s[i] ** 2 + s[j] ** 2 - 2.0 * s[i] * s[j] * cosines[k] - squares[k]
            J[k, i], J[k, j] = 2.0 * (s[i] - s[j] * cosines[k]), 2.0 * (s[j] - s[i] * cosines[k])
        step = np.linalg.lstsq(J, -F, rcond=None)[0]
        s = s + step
        if np.abs(step).max() < 1e-14 * np.abs(s).max():
            break
    return s if np.abs(F).max() < 1e-9 * max(squares) else None


def _align(source: Array, target: Array) -> tuple[Array, Array]:
    """R, t with target = R source + t (Kabsch; three points suffice because the rotation is proper)."""
    ms, mt = source.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((target - mt).T @ (source - ms))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return R, mt - R @ ms
