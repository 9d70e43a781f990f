"""Coordinates of crops: there and back to 1e-9, the half-pixel convention, boxes beyond the image."""

import groundpose as gp
import numpy as np
import pytest
from groundpose.keypoints.codec import FILL, MARGIN, Codec, cell_from_crop, crop_from_cell, cut, usable
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

CODEC = Codec()
places = st.floats(-3000.0, 3000.0, allow_nan=False)
sides = st.floats(1.0, 3000.0, allow_nan=False)
boxes = st.tuples(places, places, sides, sides).map(
    lambda b: np.array([b[0], b[1], b[0] + b[2], b[1] + b[3]])
)
codecs = st.builds(Codec, st.integers(1, 400), st.integers(1, 400), st.floats(0.0, 1.0))


def ramp(width=200, height=150):
    """An image whose red and green are the coordinates of the pixel."""
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    return np.stack([x, y, np.zeros_like(x)], axis=2).astype(np.uint8)


@given(codecs, boxes, st.lists(st.tuples(places, places), min_size=1, max_size=5))
def test_image_to_crop_and_back(codec, box, points):
    windows = codec.windows(box[None])
    given_ = np.array([points])
    back = codec.image_from_crop(codec.crop_from_image(given_, windows), windows)
    np.testing.assert_allclose(back, given_, rtol=0.0, atol=1e-9)
    crop = codec.crop_from_image(codec.image_from_crop(given_, windows), windows)
    np.testing.assert_allclose(crop, given_, rtol=0.0, atol=1e-7)  # magnified by up to 400 * 3000


@given(st.floats(-100.0, 500.0), st.sampled_from([1.0, 2.0, 4.0, 8.0]))
def test_cell_to_crop_and_back(cell, stride):
    assert cell_from_crop(crop_from_cell(cell, stride), stride) == pytest.approx(cell, abs=1e-9)


def test_half_pixels():
    # four pixels a cell: the first cell's centre lies between pixels 1 and 2
    assert crop_from_cell(0, 4.0) == 1.5
    # a window from -0.5 to W - 0.5 is the image itself
    codec = Codec(200, 150, margin=0.0)
    windows = codec.windows(np.array([[-0.5, -0.5, 199.5, 149.5]]))
    points = np.array([[[0.0, 0.0], [199.0, 149.0], [3.25, 7.5]]])
    np.testing.assert_allclose(codec.crop_from_image(points, windows), points, atol=1e-12)


@given(codecs, boxes)
def test_window_holds_the_box_with_the_aspect_of_the_crop(codec, box):
    left, top, right, bottom = codec.windows(box[None])[0]
    width, height = box[2] - box[0], box[3] - box[1]
    assert (right - left) / codec.width == pytest.approx((bottom - top) / codec.height)
    slack = 1e-9 * (right - left + bottom - top)
    assert right - left >= width * (1 + 2 * codec.margin) - slack
    assert bottom - top >= height * (1 + 2 * codec.margin) - slack
    assert left + right == pytest.approx(box[0] + box[2], abs=1e-6)
    tight = min((right - left) / width, (bottom - top) / height) / (1 + 2 * codec.margin)
    assert tight == pytest.approx(1.0)


@settings(max_examples=60)
@given(st.floats(-40.0, 180.0), st.floats(-40.0, 130.0), st.floats(8.0, 700.0), st.integers(16, 64))
def test_crop_shows_what_its_coordinates_say(left, top, width, out):
    """On a ramp, a linear filter reads the coordinate of the crop pixel's centre back."""
    codec = Codec(out, out * 3 // 4, margin=0.1)
    box = np.array([left, top, left + width, top + 0.75 * width])
    crop = codec.crop(ramp(), box)
    x, y = np.meshgrid(np.arange(codec.width), np.arange(codec.height))
    windows = codec.windows(box[None])
    seen = codec.image_from_crop(np.stack([x, y], axis=2).reshape(1, -1, 2).astype(float), windows)[0]
    pixel = (windows[0, 2] - windows[0, 0]) / codec.width
    reach = pixel + 2.0  # of the filter: beyond it the border has no part
    inside = np.all((seen > reach) & (seen < np.array([199, 149]) - reach), axis=1)
    error = crop.reshape(-1, 3)[inside, :2] - seen[inside]
    # bytes, twice rounded; a tenth of a crop pixel for a triangle of few taps
    assert np.all(np.abs(error) <= 1.01 + 0.1 * pixel)


def test_outside_the_image_is_filled():
    crop = CODEC.crop(ramp(), np.array([-500.0, -500.0, -100.0, -100.0]))
    np.testing.assert_array_equal(crop, np.broadcast_to(FILL, crop.shape))
    half = CODEC.crop(np.zeros((150, 200, 3), np.uint8), np.array([-50.0, 20.0, 50.0, 95.0]))
    assert tuple(half[48, 10]) == FILL
    assert tuple(half[48, 118]) == (0, 0, 0)


@pytest.mark.parametrize("step", [1.6, 3.3, 7.9])
def test_large_objects_are_in_place_at_the_border_too(step):
    """Every second (third, ...) pixel is read when shrinking: the places do not move for it."""
    image = np.full((400, 600, 3), 255, np.uint8)
    window = np.array([-64.0 * step, -48.0 * step, 64.0 * step, 48.0 * step]) - 0.5
    crop = cut(image, window, 128, 96)
    share = (crop[..., 0].astype(float) - FILL[0]) / (255 - FILL[0])
    assert share[60:].sum(axis=1) == pytest.approx(64.0, abs=0.5)  # the border is in the middle
    assert share[:, 80:].sum(axis=0) == pytest.approx(48.0, abs=0.5)


def test_shrinking_averages():
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (300, 400, 3), dtype=np.uint8)
    crop = cut(noise, np.array([-0.5, -0.5, 399.5, 299.5]), 200, 150)
    assert crop[2:-2, 2:-2].std() < 0.5 * noise.std()


@pytest.mark.parametrize(
    ("box", "good"),
    [
        ([10, 10, 20, 20], True),
        ([-30, -30, 0, 0], True),
        ([-30, -30, -0.5, 5], False),
        ([199.5, 0, 300, 20], False),
        ([20, 10, 20, 30], False),
        ([30, 10, 20, 30], False),
        ([np.nan, 10, 20, 30], False),
        ([0, 0, np.inf, 30], False),
    ],
)
def test_usable(box, good):
    assert usable(np.array([box], dtype=float), 200, 150).tolist() == [good]


def test_wrong_sizes():
    with pytest.raises(gp.InputError, match="width: expected 1 pixel or more, got 0"):
        Codec(0, 10)
    with pytest.raises(gp.InputError, match="margin: expected 0 or more"):
        Codec(margin=-0.1)
    assert Codec().margin == MARGIN


def by_pillow(image, window, width, height):
    """The crop by Pillow's resampling, from a copy of the part that the window shows."""
    low, high = window[:2] + 0.5, window[2:] + 0.5  # outer corners at integers, as Pillow counts
    step = max(1, int(((high - low) / (width, height)).min() / 1.5))
    first, last = np.floor(low).astype(int) - step, np.ceil(high).astype(int) + step
    columns, rows = (np.arange(begin, end, step) for begin, end in zip(first, last, strict=True))
    part = np.empty((len(rows), len(columns), 3), np.uint8)
    part[:] = FILL
    inside = [(at >= 0) & (at < size) for at, size in zip((rows, columns), image.shape, strict=False)]
    part[np.ix_(*inside)] = image[np.ix_(rows[inside[0]], columns[inside[1]])]
    box = np.concatenate([low - first - 0.5, high - first - 0.5]) / step + 0.5
    made = Image.fromarray(part).resize((width, height), Image.Resampling.BILINEAR, box=tuple(box.tolist()))
    return np.asarray(made)


LAYOUTS = {
    "rows": lambda image: image,
    "BGR": lambda image: image[..., ::-1].copy()[..., ::-1],
    "a part": lambda image: np.pad(image, ((1, 2), (3, 1), (0, 0)))[1:-2, 3:-1],
    "turned": lambda image: np.rot90(np.rot90(image).copy(), -1),
    "planes": lambda image: np.ascontiguousarray(image.transpose(2, 0, 1)).transpose(1, 2, 0),
}


@settings(max_examples=300, deadline=None)
@given(
    st.tuples(st.integers(1, 90), st.integers(1, 90)),
    st.tuples(st.floats(-0.5, 1.5), st.floats(-0.5, 1.5)),
    st.floats(-3.0, 3.0),
    st.floats(-1.0, 1.0),
    st.tuples(st.integers(1, 80), st.integers(1, 80)),
    st.sampled_from(list(LAYOUTS)),
    st.integers(0, 2**32 - 1),
)
def test_pixels_are_those_of_pillow(size, centre, scale, aspect, out, layout, seed):
    """Boxes of a thousandth of a pixel to a thousand of the image's, wide, narrow, beyond it."""
    width, height = size
    image = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    half = 0.5 * np.array(out) * 10.0**scale * (10.0**aspect, 1.0)
    middle = np.array(centre) * size
    window = np.concatenate([middle - half, middle + half])
    crop = cut(LAYOUTS[layout](image), window, *out)
    np.testing.assert_allclose(crop.astype(int), by_pillow(image, window, *out).astype(int), atol=1.0)


@settings(max_examples=100, deadline=None)
@given(st.floats(-60.0, 260.0), st.floats(-60.0, 200.0), st.floats(-1.0, 2.8), st.integers(0, 2**32 - 1))
def test_crops_of_boxes_are_the_very_bytes_of_pillow(x, y, size, seed):
    """With the sides of the crop both passes shrink alike, and Pillow makes them in the same order."""
    image = np.random.default_rng(seed).integers(0, 256, (150, 200, 3), dtype=np.uint8)
    half = 0.5 * 10.0**size * np.array([4.0, 3.0])
    window = np.array([x - half[0], y - half[1], x + half[0], y + half[1]])
    # some compilers join products and sums, which moves a weight by a unit in 2^22
    differ = cut(image, window, 128, 96) != by_pillow(image, window, 128, 96)
    assert differ.mean() < 1e-3


@pytest.mark.parametrize("threads", [0, 1, 2])
def test_all_crops_at_once_are_those_one_by_one(threads):
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (300, 400, 3), dtype=np.uint8)
    corner, sides = rng.uniform(-50, 350, (40, 2)), rng.uniform(1, 200, (40, 2))
    bboxes = np.concatenate([corner, corner + sides], axis=1)
    found = CODEC.crops(image, bboxes, threads)
    np.testing.assert_array_equal(found, np.stack([CODEC.crop(image, bbox) for bbox in bboxes]))
    assert CODEC.crops(image, bboxes[:0], threads).shape == (0, 96, 128, 3)


def test_windows_of_any_layout():
    records = np.zeros(2, dtype=[("odd", "u1"), ("window", "<f8", 4)])  # at odd addresses
    records["window"] = [10.0, 10.0, 74.0, 58.0]
    wanted = cut(ramp(), np.array([10.0, 10.0, 74.0, 58.0]), 64, 48)
    for window in (records["window"][0], np.array([10, 10, 74, 58]), np.repeat(records["window"][0], 2)[::2]):
        np.testing.assert_array_equal(cut(ramp(), window, 64, 48), wanted)


def test_an_image_is_only_read():
    image = ramp()
    image.flags.writeable = False
    assert CODEC.crop(image, np.array([0.0, 0.0, 40.0, 30.0])).shape == (96, 128, 3)


@pytest.mark.parametrize(
    ("window", "got"), [([3, 0, 2, 9], "3.0, 0.0, 2.0"), ([0, 0, np.nan, 9], "NaN"), ([0, -1e10, 1, 1], "-1")]
)
def test_windows_that_cannot_be(window, got):
    with pytest.raises(gp.InputError, match=f"windows: expected left, top, right, bottom.*{got}"):
        cut(ramp(), np.array(window, dtype=float), 8, 6)


def test_images_that_cannot_be():
    for shape in ((5, 5, 4), (0, 5, 3)):
        with pytest.raises(gp.InputError, match="image: expected shape"):
            cut(np.zeros(shape, np.uint8), np.array([0.0, 0.0, 4.0, 3.0]), 8, 6)
