"""Arrays of .npz files that others wrote: sizes are checked before anything is unpacked."""

from __future__ import annotations

import io
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from groundpose._checks import existing, input_error

if TYPE_CHECKING:
    from zipfile import ZipFile

MOST_BYTES = 2**28
"""Of the file and of all its arrays together: two thousand times the largest model."""
_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_arrays(path: str | PathLike[str], what: str) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz by name.

    Args:
        path: the file.
        what: what it should be, for the errors.

    Raises:
        OSError: no such file. InputError: another kind of file, a damaged one, arrays of Python objects,
            one that unpacks to more than 256 MB.
    """
    from zipfile import ZipFile  # here: half of what `import groundpose` takes beyond numpy

    place = existing(path)
    if place.stat().st_size > MOST_BYTES:
        raise input_error(str(path), what, f"a file of {place.stat().st_size} bytes")
    content = place.read_bytes()
    try:
        with ZipFile(io.BytesIO(content)) as archive:
            large = _bytes(archive)
            if large <= MOST_BYTES:
                with np.load(io.BytesIO(content), allow_pickle=False) as file:
                    return {name: file[name] for name in file.files}
    except Exception:  # zipfile and numpy have a dozen classes for damaged files
        raise input_error(str(path), what, "another kind of file") from None
    raise input_error(str(path), f"{what} of at most {MOST_BYTES} bytes", f"{large} in it")


def _bytes(archive: ZipFile) -> int:
    """What all arrays take together, as their headers say; ValueError where a member is not as large as its
    header says."""
    total = 0
    for member in archive.infolist():
        with archive.open(member) as stream:
            size = _data_bytes(stream) + stream.tell()
        if size != member.file_size:
            raise ValueError(member.filename)
        total += size
    return total


def _data_bytes(stream: IO[bytes]) -> int:
    """What follows the header of an array, which is read."""
    shape, _, dtype = _READ_HEADER[np.lib.format.read_magic(stream)](stream)
    if dtype.hasobject:
        raise ValueError(dtype)
    size = dtype.itemsize
    for length in shape:
        size *= int(length)
    return size
