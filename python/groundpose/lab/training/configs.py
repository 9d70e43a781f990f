"""Tables of networks and training configurations."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

from groundpose._checks import input_error


@dataclass(frozen=True)
class NetworkConfig:
    """A network: stem, residual stages at strides 4 to 32, one head for heat maps and one for the class.

    Args:
        width, height: pixels of a crop.
        stem: "imagenet" (7 x 7 at stride 2, max pooling) or "lite" (two 3 x 3 at stride 2).
        widths: channels of the four stages (before a bottleneck's factor 4).
        blocks: residual blocks of the four stages.
        bottleneck: whether blocks are 1 x 1, 3 x 3, 1 x 1 (ResNet-50) or two 3 x 3.
        head: "deconv" (4 x 4 transposed convolutions at stride 2) or "fpn".
        head_widths: channels of each transposed convolution; of the pyramid's levels for "fpn".
        reach: radius around a map's highest cell within which it is read, as a fraction of the crop's width.
        gmac: billions of multiply-adds stated by the paper; None: not one of the paper's networks.
    """

    width: int = 128
    height: int = 96
    stem: str = "lite"
    widths: tuple[int, int, int, int] = (32, 64, 128, 256)
    blocks: tuple[int, int, int, int] = (1, 1, 1, 1)
    bottleneck: bool = False
    head: str = "fpn"
    head_widths: tuple[int, ...] = (64,)
    reach: float = 0.1
    gmac: float | None = None


_RES10 = NetworkConfig(stem="imagenet", widths=(64, 128, 256, 512), head="deconv")
_RES50 = replace(_RES10, blocks=(3, 4, 6, 3), bottleneck=True, head_widths=(256, 256, 256))

NETWORKS: dict[str, NetworkConfig] = {
    # the paper's four (sec. 4.2.2, table 1); the widths of the deconvolutions are chosen to match its GMAC
    "res50-256x192": replace(_RES50, width=256, height=192, gmac=5.45),
    "res10-256x192": replace(_RES10, width=256, height=192, head_widths=(512, 256, 128, 64), gmac=2.32),
    "res50-128x96": replace(_RES50, gmac=1.36),
    "res10-128x96": replace(_RES10, head_widths=(256, 256, 128, 64), gmac=0.50),
    # ours
    "lite24": NetworkConfig(widths=(24, 48, 96, 192), head_widths=(48,)),
    "lite32": NetworkConfig(),
    "lite32-deep": NetworkConfig(blocks=(1, 1, 2, 2)),
    "lite48": NetworkConfig(widths=(48, 96, 192, 384)),
    "lite48-256x192": NetworkConfig(width=256, height=192, widths=(48, 96, 192, 384)),
    "res10-fpn": replace(_RES10, head="fpn"),
    # after a few hundred steps the means of whole maps are right, their peaks not yet
    "toy": NetworkConfig(widths=(12, 24, 32, 48), head_widths=(24,), reach=1.0),
}
"""By name."""


@dataclass(frozen=True)
class AugmentConfig:
    """Random changes to a crop. Fractions refer to the box, probabilities to the crops.

    Args:
        box_noise: standard deviation of each side of the box, as a fraction of the box's sides.
        box_noise_heavy, heavy_chance: the same for crops with a large box error, and their probability.
        rotation_deg: standard deviation of a rotation about the crop's middle.
        flip: probability of a mirror image, with left and right keypoints exchanged.
        tone: strength of gamma, darkening, contrast, veil, colour; 1 is the strong recipe, 0 none.
        resolution: probability of reducing a crop to the resolution of a distant vehicle and enlarging it.
        coarsest: smallest scale factor of that reduction.
        sharpen: probability of sharpening with halos.
        noise: probability of sensor noise.
        shade: probability of uneven light over the crop (shadows of trees, glare).
        cover: probability of a plain thing in front of a part of the crop.
    """

    box_noise: float = 0.03
    box_noise_heavy: float = 0.10
    heavy_chance: float = 0.15
    rotation_deg: float = 1.5
    flip: float = 0.5
    tone: float = 1.0
    resolution: float = 0.5
    coarsest: float = 0.22
    sharpen: float = 0.3
    noise: float = 0.6
    shade: float = 0.4
    cover: float = 0.2


PLAIN = AugmentConfig(
    box_noise=0.02,
    heavy_chance=0.0,
    rotation_deg=0.0,
    tone=0.3,
    resolution=0.0,
    sharpen=0.0,
    noise=0.0,
    shade=0.0,
    cover=0.0,
)
"""Mirror images, small shifts and small changes of colour; the paper mentions no others."""


@dataclass(frozen=True)
class TrainConfig:
    """A training run; `network` is a name in `NETWORKS`.

    Args:
        epochs: passes over the training crops.
        batch: crops per step.
        optimizer: "adam" (weight decay in the gradient, as the paper's) or "adamw".
        schedule: "cosine" (after a 2 % linear warm-up) or "steps" (divided by 10 at 2/3 and 8/9 of the run).
        learning_rate, weight_decay: of the optimizer.
        clip: largest norm of the gradient; None: any.
        average: weight of the past in the moving average of the weights, which is the network that is
            evaluated and exported; 0: the weights themselves.
        sigma_cells: standard deviation of the target Gaussian of heat maps, cells.
        cross_entropy, distance, places, classes, vehicle, viewing_angle, size, style: weights of the losses,
            see `groundpose.lab.training.losses.Loss`.
        hidden_weight: weight of a keypoint hidden by the vehicle itself or by another; visible ones have 1.
        bf16: bfloat16 arithmetic on a GPU, or where the CPU has avx512_bf16.
        seed: of weights, order and changes of crops.
    """

    network: str
    epochs: float = 30
    batch: int = 64
    optimizer: str = "adamw"
    schedule: str = "cosine"
    learning_rate: float = 2e-3
    weight_decay: float = 0.02
    clip: float | None = 5.0
    average: float = 0.9995
    sigma_cells: float = 1.0
    cross_entropy: float = 0.1
    distance: float = 4.0
    places: float = 0.02
    classes: float = 0.1
    vehicle: float = 0.1
    viewing_angle: float = 0.05
    size: float = 0.02
    style: float = 0.02
    hidden_weight: float = 0.5
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    bf16: bool = True
    seed: int = 0


def _paper(network: str) -> TrainConfig:
    """Sec. 4.2.2: Adam 1e-3, 90 epochs, divided by 10 at 60 and 80, weight decay 1e-4."""
    return TrainConfig(
        network,
        epochs=90,
        optimizer="adam",
        schedule="steps",
        learning_rate=1e-3,
        weight_decay=1e-4,
        clip=None,
        average=0.0,
        augment=PLAIN,
        bf16=False,
    )


CONFIGS: dict[str, TrainConfig] = {
    **{f"{name}-paper": _paper(name) for name, network in NETWORKS.items() if network.gmac is not None},
    **{name: TrainConfig(name) for name in NETWORKS if name != "toy"},
    "smoke": TrainConfig(
        "toy", epochs=15, batch=16, learning_rate=5e-3, average=0.0, augment=PLAIN, bf16=False
    ),
}
"""By name: the networks with our recipe, the paper's four with its recipe, and a tiny one for tests."""


def train_config(name: str) -> TrainConfig:
    """The row `name` of `CONFIGS`. Raises InputError that lists the rows."""
    if name not in CONFIGS:
        raise input_error("config", f"one of {', '.join(CONFIGS)}", repr(name))
    return CONFIGS[name]


def changed(config: TrainConfig, **changes: object) -> TrainConfig:
    """The row with other values; names of `AugmentConfig` change its `augment`."""
    inner = {
        name: value for name, value in changes.items() if name in {f.name for f in fields(AugmentConfig)}
    }
    outer = {name: value for name, value in changes.items() if name not in inner}
    unknown = set(outer) - {f.name for f in fields(TrainConfig)}
    if unknown:
        raise input_error("config", "names of TrainConfig or AugmentConfig", ", ".join(sorted(unknown)))
    return replace(config, augment=replace(config.augment, **inner), **outer)  # type: ignore[arg-type]
