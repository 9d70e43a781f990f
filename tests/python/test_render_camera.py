"""Effects of the camera, each alone; no OpenGL needed."""

import numpy as np
import pytest
from groundpose.lab.drive.render import compression, lens, sensor
from groundpose.lab.drive.render.shot import Shot
from groundpose.lab.drive.render.view import Window


def shot(left=16, top=16, width=64, height=48, scale=1.0, seed=3, gain=1.0):
    edges = (left - 0.5, top - 0.5, left + width / scale - 0.5, top + height / scale - 0.5)
    return Shot(0.8, Window(*edges, width, height), (1920, 1080), scale, np.random.default_rng(seed), gain)


def noise(height=128, width=160, seed=0):
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, size=(height, width, 3), dtype=np.uint8)


@pytest.mark.parametrize(("left", "top"), [(0, 0), (6, 10), (22, 38)])
def test_blocks_lie_on_the_grid_of_the_frame(left, top):
    """A window of a frame is compressed as the frame is; its last blocks are cut elsewhere."""
    frame = noise()
    whole = compression._jpeg(frame, shot(0, 0, 160, 128), 30, 2)
    cut = frame[top:, left:]
    # Up to the first whole block the window has other neighbours than the frame.
    first = 16 - np.array([top % 16, left % 16])
    window = compression._jpeg(cut, shot(left, top, cut.shape[1], cut.shape[0]), 30, 2)
    assert window.shape == cut.shape
    inner = np.s_[first[0] + 2 : -2, first[1] + 2 : -2]
    difference = np.abs(window.astype(int) - whole[top:, left:])[inner]
    assert (difference <= 2).all()


def test_less_than_the_frames_pixels_is_compressed_less():
    picture = noise(48, 64)

    def loss(scale):
        return np.abs(compression._jpeg(picture, shot(scale=scale), 25, 2).astype(int) - picture).mean()

    assert loss(0.4) < loss(1.0) == loss(2.0)


@pytest.mark.parametrize("kind", [kind for _, kind in compression.COMPRESSIONS])
@pytest.mark.parametrize("size", [(48, 64), (9, 11)])
def test_compression_keeps_size_and_mean(kind, size):
    flat = np.full((*size, 3), (90, 120, 150), dtype=np.uint8)
    out = kind(flat, shot(22, 38, size[1], size[0]))
    assert out.shape == flat.shape
    assert out.dtype == np.uint8
    assert (
        np.abs(out.reshape(-1, 3).mean(axis=0) - (90, 120, 150)).max() <= 5.0
    )  # the coarsest step of a block's mean is 10


def test_a_decoder_of_video_smooths_the_edges_of_blocks():
    steps = np.repeat(np.repeat(np.arange(0, 96, 12, dtype=np.uint8), 8)[None, :, None], 48, axis=0)
    picture = np.repeat(steps, 3, axis=2)
    smooth = compression._deblocked(picture, shot()).astype(int)
    assert np.abs(np.diff(smooth[..., 0], axis=1)).max() < np.abs(np.diff(picture.astype(int)[..., 0])).max()
    inside = np.s_[:, 3:5]
    np.testing.assert_array_equal(smooth[inside], picture[inside])


def test_a_mosaic_leaves_plain_areas_and_colours_edges():
    flat = np.full((48, 64, 3), 0.4, dtype=np.float32)
    np.testing.assert_allclose(sensor.mosaic(flat, shot()), flat, atol=1e-6)
    bars = flat * (np.arange(64) // 2 % 2)[None, :, None].astype(np.float32)
    out = sensor.mosaic(bars, shot())
    assert np.ptp(out, axis=2).max() > 0.05
    assert np.ptp(bars, axis=2).max() == 0.0


def test_a_mosaic_finer_than_what_is_drawn_leaves_the_picture():
    picture = noise(48, 64).astype(np.float32) / 255
    assert sensor.mosaic(picture, shot(scale=0.5)) is picture


def test_night_is_noisier_than_day():
    flat = np.full((48, 64, 3), 0.1, dtype=np.float32)
    day, night = (sensor.noise(flat, shot(gain=gain)).std() for gain in (1.0, 3.5))
    assert night == pytest.approx(3.5 * day, rel=0.01)


def test_some_exposures_blow_out_white_and_some_drown_black():
    white, gains = np.full((2, 2, 3), 0.6, dtype=np.float32), []
    for seed in range(300):
        gains.append(float(sensor.expose(white, shot(seed=seed)).mean()) / (0.6 * 0.8))
    assert 0.1 < np.mean(np.array(gains) > 1.7) < 0.3
    assert 0.02 < np.mean(np.array(gains) < 0.6) < 0.15


@pytest.mark.parametrize("stage", [lens.fog, lens.rain, lens.wet_glass])
def test_weather_leaves_black_black(stage):
    black = np.zeros((48, 64, 3), dtype=np.float32)
    np.testing.assert_array_equal(stage(black, shot()), black)


def test_fog_takes_contrast_away():
    picture = noise(48, 64).astype(np.float32) / 255
    assert lens.fog(picture, shot()).std() < 0.95 * picture.std()


def test_rain_falls_in_upright_streaks():
    flat = np.full((96, 128, 3), 0.4, dtype=np.float32)
    added = (lens.rain(flat, shot(width=128, height=96)) - flat)[..., 0]
    assert 0.0 < (added > 0.0).mean() < 0.2
    assert np.abs(np.diff(added, axis=0)).sum() < 0.5 * np.abs(np.diff(added, axis=1)).sum()
