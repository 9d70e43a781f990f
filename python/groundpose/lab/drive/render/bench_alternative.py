"""Time VTK beside the renderer: `python -m groundpose.lab.drive.render.bench_alternative OUT.json`.

Needs `pip install pyvista`, which groundpose itself does not need. The scene is one car on a plane:
physically based paint, light and reflections of a panorama, a sun with a shadow map, four samples per pixel;
crops of 128 x 96 and whole frames; the camera moves a little between pictures. Our own picture of one car on
a road, with sky and twice the width and height, is timed beside it. The figures are added to those of
`bench.py` in OUT.json.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from groundpose._writing import write_text
from groundpose.lab.bodies import MATERIALS, body
from groundpose.lab.drive.assets import environments

_SIZES = {"crop": (128, 96), "frame": (1914, 1080)}
_REPEATS = 7


def main(path: str) -> None:
    """Measure what is installed; figures already in the file stay."""
    file = Path(path)
    figures = json.loads(file.read_text("utf-8")) if file.exists() else {}
    kept = figures.setdefault("alternatives", {"what": "one car, CPU ms a picture, one core"})
    for name, measure in (("pyvista", pyvista_ms), ("groundpose", own_ms)):
        try:
            kept[name] = measure()
        except (ImportError, RuntimeError) as error:
            print(f"{name} left out: {error}")
    write_text(file, json.dumps(figures, indent=1) + "\n")


def pyvista_ms() -> dict[str, Any]:
    """Median CPU ms of a picture by size."""
    pyvista: Any = importlib.import_module("pyvista")
    made = body("car", 0)
    colours = np.random.default_rng(0).uniform(0.02, 0.6, size=(len(MATERIALS), 3))
    out: dict[str, Any] = {"version": pyvista.__version__}
    for name, size in _SIZES.items():
        plotter = pyvista.Plotter(off_screen=True, window_size=size, lighting="none")
        for material in np.unique(made.materials):
            faces = made.faces[made.materials == material]
            cells = np.hstack([np.full((len(faces), 1), 3), faces]).ravel()
            mesh = pyvista.PolyData(made.vertices, cells)
            plotter.add_mesh(mesh, pbr=True, metallic=0.5, roughness=0.3, color=colours[material])
        plane = pyvista.Plane(center=(0, 0.01, 0), direction=(0, -1, 0), i_size=60, j_size=60)
        plotter.add_mesh(plane, pbr=True, roughness=0.9, color="gray")
        plotter.add_light(pyvista.Light(position=(5, -9, -4), light_type="scene light"))
        sky = np.zeros((512, 1024, 3), np.uint8)
        sky[: len(environments()[0].panorama)] = environments()[0].panorama
        plotter.set_environment_texture(pyvista.Texture(sky), is_srgb=True)
        plotter.enable_shadows()
        plotter.enable_anti_aliasing("msaa", multi_samples=4)
        plotter.camera_position = [(4, -1.5, -8), (0, -0.7, 0), (0, -1, 0)]
        plotter.show(auto_close=False)

        def picture(k: int, plotter: Any = plotter) -> None:
            plotter.camera.position = (4 + 0.1 * k, -1.5, -8)
            plotter.render()
            plotter.screenshot(return_img=True)

        out[f"{name}_ms"] = _median_ms(picture)
        plotter.close()
    return out


def own_ms() -> dict[str, Any]:
    """The same of a scene with one car and no props, without the effects of the camera."""
    from groundpose.lab.drive.drive import scene
    from groundpose.lab.drive.render import Renderer

    renderer, made = Renderer(), scene(5, 0)
    car = made.vehicles[0]
    s = made.road.locate(*made.camera_position[[0, 2]])[0][0] + 8.0
    car = dataclasses.replace(
        car, class_name="car", seed=0, R_world=made.road.frame(s, 0.5)[0], t_world=made.road.world(s, 0.5)[0]
    )
    light = dataclasses.replace(made.light, sun_strength=3.0)
    one = dataclasses.replace(made, vehicles=(car,), props=(), light=light)
    crop = (757.0, 380.0, 1157.0, 680.0)
    return {
        "crop_ms": _median_ms(
            lambda _: renderer.crop(dataclasses.replace(one), 0, crop, (128, 96), effects=False)
        ),
        "frame_ms": _median_ms(lambda _: renderer.frame(dataclasses.replace(one), effects=False)),
        "note": "staged anew for every picture, so that shadows are cast every time",
    }


def _median_ms(picture: Callable[[int], object]) -> float:
    times = []
    for k in range(_REPEATS + 2):
        start = time.process_time()
        picture(k)
        times.append(time.process_time() - start)
    return round(1e3 * float(np.median(times[2:])), 1)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "results/renderer.json")
