"""Pictures of every kind become (H, W, 3) uint8 as a viewer shows them, or an error that says what is
wrong."""

import io
import os

import groundpose as gp
import numpy as np
import pytest
from groundpose.keypoints import image
from groundpose.keypoints.image import as_rgb, endings
from PIL import Image

SHOWN = np.random.default_rng(0).integers(0, 255, (6, 8, 3), dtype=np.uint8)
TURNS = {
    3: Image.Transpose.ROTATE_180,
    6: Image.Transpose.ROTATE_90,
    8: Image.Transpose.ROTATE_270,
    2: Image.Transpose.FLIP_LEFT_RIGHT,
}


def stored(orientation: int) -> bytes:
    """The bytes of a picture that a viewer turns to SHOWN."""
    exif, made = Image.Exif(), io.BytesIO()
    exif[0x0112] = orientation
    Image.fromarray(SHOWN).transpose(TURNS[orientation]).save(made, "PNG", exif=exif.tobytes())
    return made.getvalue()


@pytest.mark.parametrize("orientation", TURNS)
def test_pictures_are_turned_as_viewers_turn_them(orientation, tmp_path):
    path = tmp_path / "turned.png"
    path.write_bytes(stored(orientation))
    with path.open("rb") as stream, Image.open(path) as picture:
        for given in (path, str(path), path.read_bytes(), io.BytesIO(path.read_bytes()), stream, picture):
            np.testing.assert_array_equal(as_rgb(given), SHOWN)
    as_stored = np.asarray(Image.fromarray(SHOWN).transpose(TURNS[orientation]))
    np.testing.assert_array_equal(as_rgb(path, exif=False), as_stored)


def test_broken_exif_asks_for_nothing(tmp_path):
    made = io.BytesIO()
    Image.fromarray(SHOWN).save(made, "PNG", exif=b"Exif\x00\x00nonsense")
    np.testing.assert_array_equal(as_rgb(made.getvalue()), SHOWN)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_grey_of_more_bits(bits, tmp_path):
    deep = (np.linspace(0.0, 1.0, 48).reshape(6, 8) * (2**bits - 1)).round().astype(np.uint16)
    Image.fromarray(deep).save(tmp_path / "deep.png")
    Image.fromarray(deep).save(tmp_path / "deep.tif")
    wanted = np.linspace(0.0, 255.0, 48).reshape(6, 8)
    for name in ("deep.png", "deep.tif"):
        found = as_rgb(tmp_path / name)
        assert found.shape == (6, 8, 3)
        np.testing.assert_allclose(found[..., 0], wanted, atol=0.75)


def test_other_colours(tmp_path):
    picture = Image.fromarray(SHOWN)
    picture.convert("CMYK").save(tmp_path / "cmyk.tif")
    np.testing.assert_array_equal(as_rgb(tmp_path / "cmyk.tif"), SHOWN)
    palette = picture.quantize(48)
    palette.save(tmp_path / "palette.png")
    palette.save(tmp_path / "palette.gif")
    for name in ("palette.png", "palette.gif"):
        np.testing.assert_array_equal(as_rgb(tmp_path / name), np.asarray(palette.convert("RGB")))
    with pytest.raises(gp.InputError, match="image: expected whole numbers, got mode F"):
        as_rgb(picture.convert("F"))


def test_what_is_no_file_does_not_hang(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "folder.png").mkdir()
    for name, what in (("pipe.png", "a pipe or a device"), ("folder.png", "a folder")):
        with pytest.raises(gp.InputError, match=rf"{name}: expected a file, got {what}"):
            as_rgb(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        as_rgb(tmp_path / "none.png")


def test_a_limit_on_pixels(tmp_path, monkeypatch):
    Image.fromarray(SHOWN).save(tmp_path / "large.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 47)
    with pytest.raises(gp.InputError, match=r"large\.png: expected at most 0 million pixels .*, got 8 x 6"):
        as_rgb(tmp_path / "large.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 20)
    with pytest.raises(gp.InputError, match=r"large\.png: expected at most"):
        as_rgb(tmp_path / "large.png")


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (b"", "image: expected a picture, got another kind of file"),
        (stored(3)[:-60], "image: expected a whole picture"),
        (
            io.BytesIO(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 6\n%%EndComments\n"),
            "image: expected a picture",
        ),
        (io.StringIO("text"), "image: expected a whole picture|image: expected a picture"),
    ],
)
def test_bytes_that_are_no_picture(given, text):
    with pytest.raises(gp.InputError, match=text):
        as_rgb(given)


def test_all_formats_of_pixels_that_pillow_reads(tmp_path):
    known = endings()
    assert {".png", ".jpg", ".tif", ".bmp", ".webp", ".gif", ".qoi", ".tga", ".ppm", ".jp2"} <= known
    assert not {".eps", ".ps", ".pdf", ".wmf", ".emf", ".h5", ".mpg", ".svg", ".txt", ".json"} & known
    for ending in (".bmp", ".ppm", ".tga", ".tif", ".pcx", ".sgi", ".webp", ".gif", ".jp2"):
        path = tmp_path / f"picture{ending}"
        Image.fromarray(SHOWN).save(path, **({"lossless": True} if ending == ".webp" else {}))
        found = as_rgb(path)
        assert found.shape == SHOWN.shape
        if ending not in (".gif", ".jp2"):
            np.testing.assert_array_equal(found, SHOWN)


def test_drawings_are_refused(tmp_path):
    path = tmp_path / "drawing.eps"
    Image.fromarray(SHOWN).save(path)
    with pytest.raises(gp.InputError, match=r"drawing\.eps: expected a picture of pixels, got EPS"):
        as_rgb(path)


def test_transparency_and_other_modes():
    picture = Image.fromarray(SHOWN)
    clear = picture.copy()
    clear.putalpha(0)
    np.testing.assert_array_equal(as_rgb(clear), SHOWN)
    grey = np.asarray(picture.convert("L"))
    for mode in ("L", "LA", "1"):
        found = as_rgb(picture.convert(mode))
        assert found.shape == SHOWN.shape
        if mode != "1":
            np.testing.assert_array_equal(found[..., 1], grey)
    np.testing.assert_allclose(as_rgb(picture.convert("YCbCr")).astype(int), SHOWN, atol=4)


def jpeg(mode="RGB", size=(61, 43), **saved):
    """The bytes of a JPEG file of a smooth picture with noise."""
    rng, made = np.random.default_rng(1), io.BytesIO()
    small = Image.fromarray(rng.integers(0, 256, (7, 9, 3), dtype=np.uint8)).resize(size)
    noise = rng.integers(-9, 10, (size[1], size[0], 3))
    pixels = np.clip(np.asarray(small).astype(int) + noise, 0, 255).astype(np.uint8)
    Image.fromarray(pixels).convert(mode).save(made, "JPEG", **saved)
    return made.getvalue()


TURNED = Image.Exif()
TURNED[0x0112] = 6
JPEGS = {
    **{f"sampling {k}": jpeg(subsampling=k) for k in (0, 1, 2)},
    **{f"quality {k}": jpeg(quality=k) for k in (5, 50, 100)},
    "progressive": jpeg(progressive=True),
    "grey": jpeg("L"),
    "CMYK": jpeg("CMYK"),
    "RGB as it is": jpeg(keep_rgb=True),
    "turned": jpeg(exif=TURNED.tobytes()),
    "a pixel": jpeg(size=(1, 1)),
    "narrow": jpeg(size=(3, 200)),
    "and more behind it": jpeg() + b"more",
}


def read_both_ways(data, monkeypatch):
    """What comes of bytes with simplejpeg and without it: arrays, or texts of errors."""
    found = []
    for has_it in (True, False):
        monkeypatch.setattr(image, "_has_simplejpeg", lambda has_it=has_it: has_it)
        try:
            found.append(as_rgb(data))
        except gp.InputError as error:
            found.append(str(error))
    return found


@pytest.mark.parametrize("name", JPEGS)
def test_the_fast_decoder_gives_the_same_pixels(name, monkeypatch):
    pytest.importorskip("simplejpeg", reason="simplejpeg is not installed (extra [jpeg])")
    ours, by_pillow = read_both_ways(JPEGS[name], monkeypatch)
    np.testing.assert_array_equal(ours, by_pillow)


def test_the_fast_decoder_takes_no_damage_that_pillow_names(monkeypatch):
    pytest.importorskip("simplejpeg", reason="simplejpeg is not installed (extra [jpeg])")
    whole, rng = jpeg(), np.random.default_rng(2)
    damaged = [whole[:cut] for cut in rng.integers(2, len(whole), 60)]
    for place, value in rng.integers(0, (len(whole), 256), (200, 2)):
        damaged.append(whole[:place] + bytes([value]) + whole[place + 1 :])
    errors = 0
    for data in damaged:
        ours, by_pillow = read_both_ways(data, monkeypatch)
        errors += isinstance(by_pillow, str)
        assert isinstance(ours, str) == isinstance(by_pillow, str)
        np.testing.assert_array_equal(ours, by_pillow)
    assert errors > 20


def test_files_are_read_alike_whatever_holds_them(tmp_path):
    path = tmp_path / "street.jpg"
    path.write_bytes(jpeg())
    wanted = np.asarray(Image.open(path).convert("RGB"))
    with path.open("rb") as stream, Image.open(path) as picture:
        for given in (path, path.read_bytes(), stream, picture):
            np.testing.assert_array_equal(as_rgb(given), wanted)
