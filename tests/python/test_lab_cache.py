"""The cache on disk gives back what was made, whatever lies there; the drawing device is chosen by name."""

import os
import time

import numpy as np
import pytest
from groundpose.lab.drive import body_cache, cache, solids
from groundpose.lab.drive.render import device, levels

KEYS = frozenset(("a",))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    return tmp_path


def entry(value: float, name: str = "x/one") -> float:
    return float(cache.arrays(name, KEYS, lambda: {"a": np.array([value])})["a"][0])


def test_an_entry_is_made_once():
    assert entry(1.0) == 1.0
    assert entry(2.0) == 1.0


@pytest.mark.parametrize("content", [b"", b"nonsense", b"PK\x03\x04" + 40 * b"\0"])
def test_a_file_that_cannot_be_read_is_made_anew(folder, content):
    entry(1.0)
    (folder / "x/one.npz").write_bytes(content)
    assert [entry(2.0), entry(3.0)] == [2.0, 2.0]


def test_damaged_bytes_are_noticed(folder):
    entry(1.0)
    file = folder / "x/one.npz"
    data = bytearray(file.read_bytes())
    data[60] ^= 1
    file.write_bytes(data)
    assert entry(2.0) == 2.0


def test_an_entry_with_other_arrays_is_made_anew(folder):
    cache.arrays("x/one", frozenset("b"), lambda: {"b": np.zeros(3)})
    assert entry(2.0) == 2.0


def test_a_folder_that_cannot_be_written_is_not_used(folder):
    (folder / "x").write_text("a file where the folder should be")
    assert [entry(1.0), entry(2.0)] == [1.0, 2.0]


def test_versions_that_were_not_used_for_a_month_are_removed(folder):
    def kept() -> set[str]:
        return {place.name for place in folder.iterdir()}

    def versions(**days: float) -> None:
        for name, unused in days.items():
            (folder / f"x-{name}" / "inside").mkdir(parents=True, exist_ok=True)
            os.utime(folder / f"x-{name}", 2 * (time.time() - 86400 * unused,))

    versions(now=100, recent=29, old=31, older=400)
    (folder / "x-old.removed17").mkdir()  # left by a process that was stopped
    os.utime(folder / "x-old.removed17", 2 * (time.time() - 86400 * 31,))
    (folder / "y-old").mkdir()
    os.utime(folder / "y-old", (0, 0))
    cache.version_folder.cache_clear()
    assert cache.version_folder("x", "now") == "x-now"
    assert kept() == {"x-now", "x-recent", "y-old"}
    assert time.time() - (folder / "x-now").stat().st_mtime < 60.0
    cache.version_folder.cache_clear()


def test_several_processes_remove_the_same_version(folder):
    places = [folder / "x-old", folder / "x-old"]
    places[0].mkdir()
    for place in places:  # the second finds it gone
        cache._remove(place)
    assert not any(folder.iterdir())


def test_no_temporary_file_stays(folder):
    entry(1.0)
    assert [file.name for file in folder.rglob("*") if file.is_file()] == ["one.npz"]


def test_the_fingerprint_follows_the_sources(tmp_path):
    source = tmp_path / "made"
    source.mkdir()
    (source / "a.py").write_text("1")
    first = cache.fingerprint([source])
    assert cache.fingerprint([source]) == first
    (source / "a.py").write_text("2")
    assert cache.fingerprint([source]) != first


def test_a_body_from_the_disk_is_the_body_made(folder):
    def known():
        for kept in (body_cache.body, body_cache.measures, body_cache.length_and_width, solids.solid):
            kept.cache_clear()
        drawn = body_cache.of_body(
            "levels", "car", 7, levels.keys(levels.COARSE) | {"box"}, lambda: levels.coarse_levels(made)
        )
        solid = solids.solid("car", 7)
        flat = [vars(solid.body), {k: v for k, v in vars(solid).items() if k != "body"}, drawn]
        return flat, body_cache.length_and_width("car", 7)

    made = body_cache.body("car", 7)
    (first, outline), (second, again) = known(), known()
    assert outline == again
    for a, b in zip(first, second, strict=True):
        assert a.keys() == b.keys()
        for key in a:
            np.testing.assert_array_equal(a[key], b[key])
            assert np.asarray(a[key]).dtype == np.asarray(b[key]).dtype
    size = sum(file.stat().st_size for file in folder.rglob("*.npz"))
    assert size < 1.5e6


def test_kept_levels_are_those_of_the_mesh():
    made = body_cache.body("pickup", 3)
    kept = levels.unpacked(levels.coarse_levels(made), levels.COARSE)
    for some, level in zip(kept, levels.vehicle_levels(made)[1:], strict=True):
        for a, b in zip(some, level, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_device_is_chosen_by_name(monkeypatch):
    monkeypatch.setenv(device.VARIABLE, "auto")
    device.choose("cpu")
    assert device.chosen() == "cpu"
    with pytest.raises(ValueError, match="auto, cpu, cuda"):
        device.choose("tpu")


def test_cuda_without_a_card_says_what_to_install(monkeypatch):
    monkeypatch.setenv(device.VARIABLE, "cuda")
    monkeypatch.setattr(device, "_nvidia_vendor", lambda: None)
    with pytest.raises(RuntimeError, match="libEGL_nvidia"):
        device.prepare()
    with pytest.raises(RuntimeError, match="llvmpipe"):
        device.check("llvmpipe (LLVM 15.0.6, 256 bits)")
    device.check("NVIDIA H100/PCIe/SSE2")


@pytest.mark.parametrize(
    ("name", "nvidia", "mesa", "now", "expected"),
    [
        ("auto", None, "m.json", {}, {}),
        ("auto", "n.json", "m.json", {}, {device._VENDORS: "n.json"}),
        ("auto", "n.json", "m.json", {device._VENDORS: "own.json"}, {}),
        ("cuda", "n.json", "m.json", {}, {device._VENDORS: "n.json"}),
        ("cpu", None, "m.json", {}, {device._VENDORS: "m.json", "LIBGL_ALWAYS_SOFTWARE": "1"}),
        ("cpu", None, None, {}, {"LIBGL_ALWAYS_SOFTWARE": "1"}),
    ],
)
def test_the_environment_of_each_device(name, nvidia, mesa, now, expected):
    assert device._settings(name, nvidia, mesa, now) == expected
