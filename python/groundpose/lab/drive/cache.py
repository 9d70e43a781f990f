"""Arrays kept on disk between runs, in a folder of the user that may be deleted at any time.

One `.npz` per entry, renamed into place when it is complete, so that several processes share the
folder. A file that cannot be read is made anew; a folder that cannot be written is not used.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import sys
import time
import zipfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from groundpose._writing import whole_file

Arrays = dict[str, NDArray[Any]]

VARIABLE = "GROUNDPOSE_CACHE"
"""Environment variable that names another folder."""
UNUSED_DAYS = 30.0
"""Entries of other versions are removed when they were not used for this long."""
_UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


def folder() -> Path:
    """The cache of this user: `GROUNDPOSE_CACHE`, else where the platform keeps caches."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return Path(chosen).expanduser()
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
        return Path(local) / "groundpose" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "groundpose"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "groundpose"


def fingerprint(sources: Iterable[Path]) -> str:
    """16 hex digits that change with the contents of these files and folders."""
    digest = hashlib.sha256()
    for source in sources:
        files = sorted(f for f in source.rglob("*") if f.is_file()) if source.is_dir() else [source]
        for file in files:
            if file.suffix != ".pyc":
                digest.update(file.relative_to(source.parent).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def version_folder(kind: str, version: str) -> str:
    """Name of the folder of a version of a kind of entries, which begins to be used; removes unused ones."""
    name = f"{kind}-{version}"
    with contextlib.suppress(OSError):
        os.utime(folder() / name)
    with contextlib.suppress(OSError):
        for other in folder().glob(f"{kind}-*"):
            if other.name != name and time.time() - other.stat().st_mtime > 86400.0 * UNUSED_DAYS:
                _remove(other)
    return name


def _remove(path: Path) -> None:
    # Renamed first: another process then finds the whole folder or none. What a stopped process leaves
    # keeps its age and its kind, so the next one removes it.
    gone = path.with_name(f"{path.name}.removed{os.getpid()}")
    with contextlib.suppress(OSError):
        path.rename(gone)
        shutil.rmtree(gone, ignore_errors=True)


def arrays(name: str, keys: frozenset[str], make: Callable[[], Arrays]) -> Arrays:
    """The arrays `keys` of the entry `name` (a relative path without suffix), made if they are missing."""
    path = folder() / f"{name}.npz"
    with contextlib.suppress(*_UNREADABLE), path.open("rb") as file:
        kept = np.load(file, allow_pickle=False)
        if isinstance(kept, np.lib.npyio.NpzFile) and keys == set(kept.files):
            return {key: kept[key] for key in kept.files}
    made = make()
    with contextlib.suppress(OSError):
        _write(path, made)
    return made


def _write(path: Path, made: Arrays) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path, "wb", sync=False) as file:
        _write_npz(file, made)


def _write_npz(file: IO[bytes], made: Arrays) -> None:
    """`numpy.savez_compressed` at the fastest level, because writing should cost little."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for key, array in made.items():
            with archive.open(f"{key}.npy", "w") as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
