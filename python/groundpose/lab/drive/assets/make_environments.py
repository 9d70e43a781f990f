"""Make the bundled environments: `python -m groundpose.lab.drive.assets.make_environments HDRI.npz`.

The file holds `names`, `ldr` (N, 512, 1024, 3) tone-mapped panoramas and `env` (N, 32, 64, 3) light.
Only the upper half and a strip below the horizon are kept, because the renderer draws the ground.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from groundpose.lab.drive.assets import FOLDER, KEPT_ROWS, SKIES

FloatArray = NDArray[np.float64]


def main(source: str) -> None:
    """Write one JPEG per outdoor environment and `environments.npz`."""
    with np.load(source, allow_pickle=False) as file:
        names, panoramas, light = file["names"].tolist(), file["ldr"], file["env"].astype(np.float64)
    wanted = [name for split in SKIES.values() for name in split]
    harmonics, azimuths, means = [], [], []
    for name in wanted:
        index = names.index(name)
        picture = without_marks(panoramas[index])[:KEPT_ROWS]
        Image.fromarray(picture).save(FOLDER / f"{name}.jpg", quality=78, optimize=True)
        linear = (picture / 255.0) ** 2.2
        azimuths.append(brightest_azimuth(linear))
        weight = np.sin((np.arange(256) + 0.5) / 512 * np.pi)[:, None, None]
        means.append((linear[:256] * weight).mean(axis=(0, 1)) / weight.mean())
        harmonics.append(sky_harmonics(light[index]))
    np.savez_compressed(
        FOLDER / "environments.npz",
        names=np.array(wanted),
        harmonics=np.array(harmonics, dtype=np.float32),
        azimuths=np.array(azimuths, dtype=np.float32),
        means=np.array(means, dtype=np.float32),
    )


def without_marks(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture without the blue square at the sun, an overflow of the tone mapping in two panoramas."""
    out: NDArray[np.uint8] = picture.copy()
    values = picture.astype(int)
    out[(values[..., 2] > 120) & (values[..., 0] < 30) & (values[..., 1] < 30)] = 255
    return out


def brightest_azimuth(linear: FloatArray) -> float:
    """Radians of the brightest column of the sky, 0 at the left edge."""
    columns = (linear[:256].sum(axis=2) ** 4).mean(axis=0)
    angle = (np.arange(len(columns)) + 0.5) / len(columns) * 2.0 * np.pi
    return float(np.arctan2(columns @ np.sin(angle), columns @ np.cos(angle)) % (2.0 * np.pi))


def sky_harmonics(light: FloatArray) -> FloatArray:
    """Irradiance coefficients (9, 3) of the upper half, scaled so that level ground receives 1 (green).

    Ramamoorthi and Hanrahan, 2001: An efficient representation for irradiance environment maps; the
    cosine lobe and the 1/pi of a diffuse surface are folded in. Axes: x, up, z with azimuth from z to x.
    """
    rows, columns = light.shape[:2]
    polar = ((np.arange(rows) + 0.5) / rows * np.pi)[:, None]
    azimuth = ((np.arange(columns) + 0.5) / columns * 2.0 * np.pi)[None]
    x, up = np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth
    z = np.sin(polar) * np.cos(azimuth)
    basis = harmonic_basis(x, up, z)
    solid = np.sin(polar) * (np.pi / rows) * (2.0 * np.pi / columns) * (up > 0.0)
    lobe = np.array([1.0, 2 / 3, 2 / 3, 2 / 3, 0.25, 0.25, 0.25, 0.25, 0.25])
    coefficients: FloatArray = np.einsum("krc,rc,rcj->kj", basis, solid, light) * lobe[:, None]
    level = harmonic_basis(np.zeros(1), np.ones(1), np.zeros(1))[:, 0] @ coefficients
    return np.asarray(coefficients / level[1])


def harmonic_basis(x: FloatArray, up: FloatArray, z: FloatArray) -> FloatArray:
    """The nine real spherical harmonics of degree 0 to 2, (9, ...)."""
    one = np.ones_like(up)
    return np.stack(
        [
            0.282095 * one,
            0.488603 * up,
            0.488603 * z,
            0.488603 * x,
            1.092548 * x * up,
            1.092548 * up * z,
            0.315392 * (3 * z * z - 1),
            1.092548 * x * z,
            0.546274 * (x * x - up * up),
        ]
    )


if __name__ == "__main__":
    main(str(Path(sys.argv[1])))
