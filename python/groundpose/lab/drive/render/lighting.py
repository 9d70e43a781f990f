"""Values for the shaders computed from a scene's `Light`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundpose.lab.drive.assets import environments
from groundpose.lab.drive.scene import Light

Floats = NDArray[np.float64]
Range = tuple[float, float]
Generator = np.random.Generator


@dataclass(frozen=True)
class LightKind:
    """Ranges of a kind of light; drawn by `surroundings.light` (first five) and from the light's seed.

    fraction: of all drives; elevation: of the sun, degrees; strength: of the sun (white level ground under it
    has this radiance); sky: of the sky, level ground likewise; exposure of the camera; warm: 0 white
    to 1 orange sun; seen: brightness of the sky in the picture; clear: fraction of a painted blue sky;
    shade: fraction of the street shaded by things not drawn; haze: per kilometre; lamps: of streets
    and vehicles; skies: usable environments, empty = all of the day; wet: how often the road is.
    """

    fraction: float
    elevation: Range
    strength: Range
    exposure: Range
    sky: Range
    warm: Range = (0.0, 0.15)
    seen: Range = (1.0, 2.0)
    clear: Range = (0.0, 1.0)
    shade: Range = (0.0, 0.35)
    haze: Range = (0.2, 1.8)
    lamps: float = 0.0
    skies: tuple[str, ...] = ()
    wet: float = 0.0


DAY = ("bl_city", "bl_courtyard", "bl_forest", "bl_sunrise", "bl_sunset", "pm_park", "pm_sky", "pm_venice",
       "pm_city", "pm_forest", "pm_sunset")  # fmt: skip
GREY = ("bl_city", "bl_forest", "pm_venice", "pm_city", "pm_forest")
LOW = ("bl_sunset", "bl_sunrise", "pm_venice", "pm_dawn", "pm_sunset")
NIGHT = ("bl_night", "pm_night")
# Panoramas whose sky can be shown; the others only give light and reflections.
OPEN = ("bl_sunrise", "bl_night", "pm_park", "pm_sky", "pm_dawn", "pm_night")

KINDS: dict[str, LightKind] = {
    "sun": LightKind(0.42, (22, 62), (2.6, 4.0), (0.6, 1.15), (0.28, 0.6), seen=(1.2, 4.0)),
    "glare": LightKind(
        0.12, (8, 25), (3.0, 4.5), (0.45, 1.0), (0.25, 0.5), warm=(0.1, 0.5), seen=(2.0, 5.0),
        haze=(0.3, 2.5),
    ),
    "shade": LightKind(
        0.16, (25, 55), (2.8, 4.0), (0.5, 1.3), (0.25, 0.5), seen=(1.5, 5.0), shade=(0.6, 0.95),
    ),
    "overcast": LightKind(
        0.18, (30, 70), (0.0, 0.4), (0.7, 1.4), (0.7, 1.3), seen=(1.2, 2.8), haze=(0.3, 3.0), skies=GREY,
        wet=0.35,
    ),
    "dusk": LightKind(
        0.08, (3, 10), (0.25, 1.2), (0.9, 1.8), (0.2, 0.45), warm=(0.4, 0.9), clear=(0.0, 0.5),
        haze=(0.3, 2.0), lamps=0.35, skies=LOW, wet=0.25,
    ),
    "night": LightKind(
        0.04, (65, 85), (0.25, 0.6), (1.1, 2.0), (0.05, 0.12), warm=(0.6, 0.95), seen=(0.1, 0.3),
        clear=(0.0, 0.0), shade=(0.3, 0.7), lamps=1.0, skies=NIGHT, wet=0.4,
    ),
}  # fmt: skip


def illumination(light: Light) -> dict[str, Any]:
    """Uniforms of light.glsl, sky.frag and ground.frag that depend on the light alone."""
    kind, rng = KINDS[light.kind], np.random.default_rng([83, light.seed])
    environment = environments()[light.sky]
    sun = np.asarray(light.sun_direction, dtype=float)
    turn = environment.azimuth - np.arctan2(sun[0], sun[2])
    strength, warm, shade = rng.uniform(*kind.sky), rng.uniform(*kind.warm), rng.uniform(*kind.shade)
    sun_colour = light.sun_strength * np.array([1.0, 1.0 - 0.3 * warm, 1.0 - 0.65 * warm])
    # The camera's white balance removes part of the blue of the sky.
    grey = environment.harmonics.mean(axis=1, keepdims=True)
    mean = float(environment.mean.mean())
    # The light on the open road decides how bright road and house fronts look in a mirror.
    level = sun_colour * max(-sun[1], 0.0) * (1.0 - shade) + strength
    return {
        "sun_direction": tuple(sun),
        "sun_colour": tuple(sun_colour),
        "sky_harmonics": (strength * (0.6 * environment.harmonics + 0.4 * grey)).astype("f4"),
        "sky_turn": (np.cos(turn), np.sin(turn)),
        "sky_gain": tuple(strength / mean * (environment.mean / mean) ** -0.25),
        "ground_colour": tuple(level * rng.uniform(0.09, 0.16)),
        "gobo": (
            rng.uniform(0.006, 0.02),
            0.76 - 0.45 * shade,
            rng.uniform(0.01, 0.05),
            rng.uniform(0.85, 1.0),
        ),
        "headlight": (*(kind.lamps * 0.5 * np.array([1.0, 0.95, 0.8])), np.cos(rng.uniform(0.35, 0.5))),
        "shadow_blur": rng.uniform(0.6, 2.5),
        "lamps": kind.lamps,
        **_seen_sky(rng, kind, strength, environment.name in OPEN, light.sun_strength > 0.6),
        **_street(rng, kind, strength, level),
    }


def _seen_sky(rng: Generator, kind: LightKind, strength: float, free: bool, blue: bool) -> dict[str, Any]:
    """The painted sky (`blue` or grey) and its fraction: all of it where the panorama is not `free`."""
    zenith = np.array([0.28, 0.5, 1.0] if blue else [0.75, 0.82, 0.9]) * rng.uniform(0.6, 1.6)
    horizon = np.array([0.9, 1.0, 1.1]) * rng.uniform(0.8, 1.8)
    fraction = rng.uniform(*kind.clear) if free else 1.0
    return {
        "sky_zenith": (*(strength * zenith), fraction),
        "sky_horizon": (*(strength * horizon), rng.choice([0.0, 0.5, 1.0])),
        "sky_seen": rng.uniform(*kind.seen),
    }


def _street(rng: Generator, kind: LightKind, strength: float, level: Floats) -> dict[str, Any]:
    """Reflected surroundings, background at the end of the view, haze, and age of the road."""
    tone = np.array([1.0, 1.0, 1.0] if rng.random() < 0.5 else [0.8, 1.0, 0.6])
    beside = (0.3 * level + 0.3 * strength) * rng.uniform(0.05, 0.25) * tone
    air = strength * rng.uniform(0.8, 1.3) * np.array([0.85, 0.95, 1.05])
    wood = strength * rng.uniform(0.04, 0.14) * np.array([0.7, 0.9, 0.6])
    wet = rng.uniform(0.5, 1.0) if rng.random() < kind.wet else 0.0
    return {
        "street": (*beside, rng.uniform(0.1, 0.55)),
        "haze": (*air, rng.uniform(*kind.haze) * 1e-3),
        "far_line": (*wood, rng.uniform(0.01, 0.05)),
        "wear": (*rng.uniform(0.0, 1.0, 3), wet),
        "road_tint": tuple(rng.uniform(0.55, 1.25) * rng.normal(1.0, 0.03, 3)),
    }
