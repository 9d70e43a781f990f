"""Files are written whole or not at all, and by one run at a time.

A file gets a temporary name in its own folder and is renamed when it is complete: whatever ends the program,
signals and a full disk included, leaves the file of before or the new one.
"""

from __future__ import annotations

import itertools
import os
import stat
import sys
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import IO, Any, Literal

from groundpose._checks import input_error

LOCK = ".groundpose.lock"
"""In a folder that a run writes to; only a lock that a living process holds counts."""
_PART = ".groundpose-{}-{}.part"
_numbers = itertools.count()

_TEXT = {"encoding": "utf-8", "errors": "backslashreplace", "newline": "\n"}

AnyPath = str | PathLike[str]


@contextmanager
def whole_file(path: AnyPath, mode: Literal["w", "wb"] = "w", *, sync: bool = True) -> Iterator[IO[Any]]:
    """A stream whose file replaces `path` when the block ends without an error.

    A link stays a link, a file keeps its permissions, and a pipe or a device is written to as it is.

    Args:
        path: the file.
        mode: "w" for text in UTF-8, "wb" for bytes.
        sync: whether the file also survives a power cut right after, which takes some milliseconds.

    Raises:
        OSError: naming `path`.
    """
    coding: dict[str, Any] = {} if mode == "wb" else _TEXT
    if not replaceable(path):
        with naming(path), Path(path).open(mode, **coding) as stream:
            yield stream
        return
    with whole_path(path) as part, part.open(mode, **coding) as stream:
        yield stream
        if sync:
            stream.flush()
            os.fsync(stream.fileno())


@contextmanager
def whole_path(path: AnyPath) -> Iterator[Path]:
    """As `whole_file`, for a library that wants the name of a file to write. Raises OSError naming `path`."""
    target = Path(os.path.realpath(path))
    part = target.with_name(_PART.format(_short(target), f"{os.getpid()}-{next(_numbers)}"))
    try:
        with naming(path, part):
            yield part
            with suppress(FileNotFoundError):
                part.chmod(stat.S_IMODE(target.stat().st_mode))
            part.replace(target)
    finally:
        with suppress(OSError):  # it is gone when all went well
            part.unlink()


def _short(path: Path) -> str:
    """A name for its name, which may itself be as long as the system allows."""
    return f"{zlib.crc32(os.fsencode(path.name)):08x}"


def write_text(path: AnyPath, text: str, *, sync: bool = True) -> None:
    """A whole text file; see `whole_file`."""
    with whole_file(path, sync=sync) as stream:
        stream.write(text)


def replaceable(path: AnyPath) -> bool:
    """Whether it is a file or may become one: renaming would put an end to a pipe or a device."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except FileNotFoundError:
        return True
    except OSError:
        return True  # what is wrong is said where the file is made


@contextmanager
def naming(path: AnyPath, part: Path | None = None) -> Iterator[None]:
    """An error of the system names the file that was to be written."""
    try:
        yield
    except OSError as error:
        if error.filename is None or (part is not None and str(error.filename) == str(part)):
            error.filename, error.filename2 = str(path), None
        raise


@contextmanager
def only_writer(path: AnyPath) -> Iterator[None]:
    """Hold the lock of a folder, or of a file that is to be written, during the block.

    The lock of a process that has ended counts no more. A file system without locks is written to without.

    Raises:
        InputError: another run writes there. OSError: naming `path`.
    """
    target = Path(os.path.realpath(path))
    name = target / LOCK if target.is_dir() else target.with_name(f".{target.name}.lock")
    with naming(path, name):
        held = _hold(name, path)
    # Of a run that was killed: the lock is ours now, and so is all below the folder.
    left = "**/" + _PART.format("*", "*") if target.is_dir() else _PART.format(_short(target), "*")
    for part in name.parent.glob(left):
        part.unlink(missing_ok=True)
    try:
        yield
    finally:
        _release(name, held)


def _hold(name: Path, path: AnyPath) -> int:
    while True:
        descriptor = os.open(name, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _locked(descriptor):
                who = os.read(descriptor, 20).decode("ascii", "replace").strip()
                raise input_error(str(path), "no other run that writes there", f"one, process {who or '?'}")
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(descriptor), os.stat(name)):  # else its holder has just ended
                    os.ftruncate(descriptor, 0)
                    os.write(descriptor, b"%d\n" % os.getpid())
                    return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _release(name: Path, descriptor: int) -> None:
    if sys.platform == "win32":  # where an open file cannot be removed
        os.close(descriptor)
        with suppress(OSError):
            name.unlink()
        return
    with suppress(OSError):
        name.unlink()
    os.close(descriptor)


def _locked(descriptor: int) -> bool:
    """Take the lock of an open file; False: another has it."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(descriptor, 1 << 30, os.SEEK_SET)  # far behind the text, which others read
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(descriptor, 0, os.SEEK_SET)
        return True
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # no locks here
    return True
