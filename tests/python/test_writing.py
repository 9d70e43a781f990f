"""Files are whole or not there, and one run at a time writes into a place."""

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from groundpose import InputError
from groundpose._writing import LOCK, only_writer, whole_file, whole_path, write_text


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_file_is_replaced_when_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("before")
    path.chmod(0o640)
    with whole_file(path) as file:
        file.write("after")
        assert path.read_text() == "before"
    assert path.read_text() == "after"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert names(tmp_path) == {"a.txt"}


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, OSError(28, "No space left on device")])
def test_what_ends_early_leaves_the_file_of_before(tmp_path, error):
    path = tmp_path / "a.bin"
    path.write_bytes(b"before")
    with pytest.raises(BaseException) as raised, whole_file(path, "wb") as file:  # noqa: PT011, PT012
        file.write(b"half")
        raise error
    assert path.read_bytes() == b"before"
    assert names(tmp_path) == {"a.bin"}
    assert not isinstance(raised.value, OSError) or raised.value.filename == str(path)


def test_errors_name_the_file_that_was_to_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "none" / "a", tmp_path / "file" / "a", tmp_path / "folder"):
        with pytest.raises(OSError, match=re.escape(repr(str(path)))):
            write_text(path, "x")
        with pytest.raises(OSError, match=re.escape(repr(str(path)))), whole_path(path) as part:
            part.write_text("x")
    assert names(tmp_path) == {"file", "folder"}


def test_a_name_may_be_as_long_as_the_system_allows(tmp_path):
    path = tmp_path / ("a" * 255)
    write_text(path, "x")
    assert path.read_text() == "x"


def test_a_link_stays_and_its_file_is_written(tmp_path):
    (tmp_path / "b").mkdir()
    link, file = tmp_path / "link", tmp_path / "b" / "file"
    link.symlink_to(file)
    write_text(link, "x")
    assert link.is_symlink()
    assert file.read_text() == "x"


@pytest.mark.skipif(sys.platform == "win32", reason="no devices there")
def test_a_device_stays_one():
    write_text("/dev/null", "x")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_a_second_writer_is_refused_and_the_place_is_free_again(tmp_path):
    file = tmp_path / "poses.csv"
    for path, lock in ((tmp_path, LOCK), (file, ".poses.csv.lock")):
        with only_writer(path):
            assert lock in names(tmp_path)
            with pytest.raises(InputError, match=f"got one, process {os.getpid()}"), only_writer(path):
                pass
        with only_writer(path):
            pass
        assert names(tmp_path) == set()


def test_the_lock_and_the_half_files_of_a_killed_run_are_no_hindrance(tmp_path):
    code = (
        "import os, sys; from groundpose._writing import only_writer, whole_file\n"
        "with only_writer(sys.argv[1]), whole_file(sys.argv[1] + '/a') as file:\n"
        "    os.kill(os.getpid(), 9)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(tmp_path)], timeout=60)
    assert ended.returncode != 0
    left = names(tmp_path)
    assert LOCK in left
    assert len(left) == 2
    (tmp_path / "below").mkdir()
    half = next(path for path in tmp_path.iterdir() if path.name.endswith(".part"))
    half.rename(tmp_path / "below" / half.name)
    with only_writer(tmp_path):
        assert names(tmp_path) == {LOCK, "below"}
    assert names(tmp_path) == {"below"}
    assert names(tmp_path / "below") == set()


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_named(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError, match=re.escape(str(tmp_path))), only_writer(tmp_path):
        pass
