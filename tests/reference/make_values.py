"""Write values.json, the committed reference values that the Rust and Python tests compare the core with.

Command: `python tests/reference/make_values.py` (needs numpy). Random numbers: PCG64, seed SEED below.

Schema. Rows of matrices are lists; a missing number is null; angles rad, lengths m, pixels px.

    camera    {fx, fy, cx, cy, distortion: null | [k1, k2, p1, p2, k3]}
    view      {camera, pitch, roll, height: null | number}
    pose      {R (3,3), t (3,)}  camera_from_object

    seed      number
    views     [{view, R_camera_from_ground (3,3), gravity (3,) pointing down in the camera frame,
                left, right (columns), side_planes (2,3) unit inward normals in the ground frame,
                horizon (3,) scaled to |(a, b)| = 1, its sign open}]
    lenses    [{camera, undistorted (n,2), distorted (n,2)}]
    p1p       [{view, bbox_3d (2,3), footprint null | (C,2) of (x, z), keypoint_3d (3,), keypoint_2d (2,),
                bbox (4,), truth pose | null for a noisy keypoint,
                solutions [{R, t, yaw, corners [left, right], margin, paper}]}]
              solutions: the feasible ones of all ordered pairs of different corners, sorted by yaw.
              corners: front left, front right, rear right, rear left, or as the footprint lists them.
              margin = smallest signed distance of a corner of the prism to a side plane, divided by l_C
              (the keypoint's distance in the bird's-eye view); feasible: margin >= -0.03. No candidate
              has a margin within 0.001 of that bound.
              paper = one of the paper's four cases (always false with a footprint).
    p1p_height [as p1p without footprint, view.height set, one side of bbox null or none, corners [i, i],
              paper false]  With two sides: the solutions of either side that are feasible for both; a
              solver may return more, feasible only for the side they come from.
    up2p      [{view, points_3d (2,3), pixels (2,2), truth null | pose,
                solutions [{R, t}] sorted by R[0][0], then R[0][2]}]
    p3p       [as up2p with three points; the tilt is not used]
    tukey     [{c, r (n,), rho (n,), weight (n,)}]  eq. (10), weight = rho'(r) / r
    mad       [{r (n,), scale}]  scale = median(|r - median(r)|) / 0.6745
    models    [{mean (P,3), basis (M,P,3), bbox_3d}]
    refine    [{model (index), shape_in_data (bool), view, keypoints_2d (P,2), [null, null] = not seen,
                truth pose, truth_shape (M,), inlier_truth (P,), start pose (coefficients zero),
                inlier_threshold, taus (3,), scale_start,
                msac_start = sum over the seen points of min(r^2, inlier_threshold^2),
                results: {name: {R, t, shape (M,), cost, c, noise_sigma}}, covariance (6,6)}]
              Each result is the converged minimiser, from start, of its own cost; weights 1, no priors:
                gn                        least squares on inlier_truth, pose only, shape zero
                gn_shape                  the same, pose and shape
                re_fixed                  eq. (9), pose only, s taken once at start
                re_updated                eq. (9), pose only, s of the current residuals
                hre1, hre2, hre3          Algorithm 1 after each stage, known model
                hre_shape1 to hre_shape3  the same with shape
              Pose-only names are present when shape_in_data is false, the others when it is true.
              cost = sum of rho (Tukey at c; r^2 / 2 for c null) over the points of the stage. In the hre
              stages s is clamped whichever way it is updated, and no residual lies within 0.05 px of
              tau1 after stage 2.
              noise_sigma (where c is null) = sqrt(sum r^2 / (2 n - parameters)).
              covariance: of gn or gn_shape, noise_sigma^2 (J^T J)^-1, order [rotation vector,
              translation] in the camera frame, R <- exp(w) R, t <- t + d; with shape the 6x6 pose block
              of the joint covariance.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import groundpose_reference as ref
import numpy as np

SEED = 20210617
PATH = Path(__file__).with_name("values.json")
BAND = 1e-3  # no candidate of a case may lie this near to the feasibility bound: roundoff must not decide


def plain(value: Any) -> Any:
    """NumPy values and NaN to what JSON holds."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def camera_dict(camera: ref.RefCamera) -> dict[str, Any]:
    return {
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "distortion": camera.distortion,
    }


def view_dict(view: ref.RefView) -> dict[str, Any]:
    return {"camera": camera_dict(view.camera), "pitch": view.pitch, "roll": view.roll, "height": view.height}


def pose_dict(R: ref.Array, t: ref.Array) -> dict[str, Any]:
    return {"R": R, "t": t}


def views(rng: np.random.Generator) -> list[dict[str, Any]]:
    out = []
    for _ in range(12):
        s = ref.random_scene(rng)
        line = ref.horizon(s.view)
        left, right = s.bbox[0], s.bbox[2]
        out.append({
            "view": view_dict(s.view), "R_camera_from_ground": s.view.R_cg, "gravity": s.view.R_cg[:, 1],
            "left": left, "right": right, "side_planes": ref.side_planes(s.view, left, right),
            "horizon": line / np.hypot(line[0], line[1]),
        })  # fmt: skip
    return out


def lenses(rng: np.random.Generator) -> list[dict[str, Any]]:
    coefficients = [
        (-0.3, 0.1, 1e-3, -2e-3, 0.02),
        (0.1, -0.05, 0.0, 0.0, 0.0),
        (-0.1, 0.0, -5e-4, 8e-4, 0.0),
    ]
    out = []
    for distortion in coefficients:
        camera = ref.RefCamera(900.0, 910.0, 640.0, 360.0, distortion)
        pixels = rng.uniform([40.0, 20.0], [1240.0, 700.0], (10, 2))
        out.append(
            {"camera": camera_dict(camera), "undistorted": pixels, "distorted": ref.distort(camera, pixels)}
        )
    return out


def solution_dicts(found: list[ref.Hypothesis], paper: bool) -> list[dict[str, Any]]:
    return [
        {"R": h.R, "t": h.t, "yaw": h.yaw, "corners": h.corners, "margin": h.margin,
         "paper": paper and h.corners in ref.PAPER_CASES}
        for h in sorted(found, key=lambda h: h.yaw)
    ]  # fmt: skip


def clear_of_bounds(candidates: list[ref.Hypothesis]) -> bool:
    """No candidate near the feasibility bound, no two near each other: double roots are ill-conditioned."""
    yaws = np.sort([h.yaw for h in candidates])
    gaps = np.diff(yaws)
    return all(abs(h.margin + ref.TOLERANCE) > BAND for h in candidates) and bool(np.all(gaps > 1e-3))


def rounded_footprint(bbox_3d: ref.Array) -> ref.Array:
    """Six corners: the box with its front corners cut."""
    (x0, _, z0), (x1, _, z1) = bbox_3d
    w, d = 0.25 * (x1 - x0), 0.15 * (z1 - z0)
    return np.array([[x0 + w, z1], [x1 - w, z1], [x1, z1 - d], [x1, z0], [x0, z0], [x0, z1 - d]])


def p1p_case(
    rng: np.random.Generator, tilt: tuple[float, float], noise: float, rounded: bool
) -> dict[str, Any]:
    roll = (-5.0, 5.0) if tilt != (0.0, 0.0) else (0.0, 0.0)
    while True:
        s = ref.random_scene(rng, pitch_deg=tilt, roll_deg=roll)
        footprint = rounded_footprint(s.bbox_3d) if rounded else None
        corners = ref.box_corners(s.bbox_3d, footprint)
        bbox = np.array(ref.box_columns(s.view, s.R, s.t, corners))
        pixel = s.pixels[0] + noise * rng.standard_normal(2)
        arguments = (s.view, s.keypoints_3d[0], pixel, bbox[0], bbox[2], s.bbox_3d, footprint)
        if clear_of_bounds(ref.p1p(*arguments, tolerance=np.inf)):
            break
    return {
        "view": view_dict(s.view),
        "bbox_3d": s.bbox_3d,
        "footprint": footprint,
        "keypoint_3d": s.keypoints_3d[0],
        "keypoint_2d": pixel,
        "bbox": bbox,
        "truth": None if noise else pose_dict(s.R, s.t),
        "solutions": solution_dicts(ref.p1p(*arguments), paper=not rounded),
    }


def p1p_cases(rng: np.random.Generator) -> list[dict[str, Any]]:
    level, steep = (0.0, 0.0), (-40.0, 10.0)
    plan = [(level, False, 10), (steep, False, 24), (steep, True, 6)]
    noises = (0.0, 2.0)
    return [p1p_case(rng, tilt, noises[k % 2], rounded) for tilt, rounded, n in plan for k in range(n)]


def height_case(rng: np.random.Generator, kind: int) -> dict[str, Any]:
    """kind 0: left side known; 1: right; 2: both."""
    while True:
        s = ref.random_scene(rng, pitch_deg=(-40.0, -5.0))
        height = float((s.view.R_cg.T @ s.t)[1] + s.bbox_3d[1, 1])
        view = replace(s.view, height=height)
        left = s.bbox[0] if kind != 1 else None
        right = s.bbox[2] if kind != 0 else None
        arguments = (view, s.keypoints_3d[0], s.pixels[0], left, right, s.bbox_3d)
        candidates = ref.p1p_height(*arguments, tolerance=np.inf)
        # with two sides the true pose is found from either, twice: the yaws are not apart
        apart = clear_of_bounds(candidates) if kind != 2 else True
        if height > 0.3 and apart and all(abs(h.margin + ref.TOLERANCE) > BAND for h in candidates):
            break
    return {
        "view": view_dict(view),
        "bbox_3d": s.bbox_3d,
        "keypoint_3d": s.keypoints_3d[0],
        "keypoint_2d": s.pixels[0],
        "bbox": [left, s.bbox[1], right, s.bbox[3]],
        "truth": pose_dict(s.R, s.t),
        "solutions": solution_dicts(ref.p1p_height(*arguments), paper=False),
    }


def point_cases(rng: np.random.Generator, points: int) -> list[dict[str, Any]]:
    """UP2P for two points, P3P for three."""
    out: list[dict[str, Any]] = []
    while len(out) < 14:
        noise = 2.0 * (len(out) % 2)
        s = ref.random_scene(rng, distance=(4.0, 40.0))
        pixels = s.pixels[:points] + noise * rng.standard_normal((points, 2))
        X = s.keypoints_3d[:points]
        found = ref.up2p(s.view, X, pixels) if points == 2 else ref.p3p(s.view.camera, X, pixels)
        found.sort(key=lambda h: (h.R[0, 0], h.R[0, 2]))
        near = [ref.rotation_angle(a.R, b.R) for k, a in enumerate(found) for b in found[:k]]
        # four solutions are rare: the last cases have them
        if min(near, default=1.0) < 1e-2 or (points == 3 and len(out) >= 11 and len(found) != 4):
            continue
        out.append(
            {
                "view": view_dict(s.view),
                "points_3d": X,
                "pixels": pixels,
                "truth": None if noise else pose_dict(s.R, s.t),
                "solutions": [pose_dict(h.R, h.t) for h in found],
            }
        )
    return out


def tables(rng: np.random.Generator) -> dict[str, Any]:
    r = np.array([0.0, 1e-6, 0.1, 1.0, 3.9, 4.0, 4.1, 12.0, 1e6])
    tukey = [
        {"c": c, "r": r, "rho": ref.tukey_rho(r, c), "weight": ref.tukey_weight(r, c)}
        for c in (0.5, 4.0, 18.74)
    ]
    samples = [rng.exponential(5.0, n) for n in (1, 2, 7, 28)]
    return {"tukey": tukey, "mad": [{"r": x, "scale": ref.mad_scale(x)} for x in samples]}


def solver_values(rng: np.random.Generator) -> dict[str, Any]:
    """Everything but the refinement, which alone is slow."""
    values: dict[str, Any] = {"seed": SEED, "views": views(rng), "lenses": lenses(rng), "p1p": p1p_cases(rng)}
    values["p1p_height"] = [height_case(rng, k % 3) for k in range(12)]
    return values | {"up2p": point_cases(rng, 2), "p3p": point_cases(rng, 3)} | tables(rng)


def main() -> None:
    from refine_values import refine_cases  # imports this file: a cycle at module level

    rng = np.random.Generator(np.random.PCG64(SEED))
    values = solver_values(rng) | refine_cases(rng)
    lines = [
        f"{json.dumps(key)}: {json.dumps(plain(value), allow_nan=False)}" for key, value in values.items()
    ]
    PATH.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    print(f"{PATH.name}: {PATH.stat().st_size} bytes")


if __name__ == "__main__":
    main()
