"""What is read as it comes: cameras, addresses, pipes."""

from __future__ import annotations

import re
import stat
from pathlib import Path

ADDRESS = re.compile(r"(rtsps?|rtmps?|https?|udp|tcp|srt):/+(?=.)")
CAMERA = re.compile(r"camera:(\d+)")


def is_live(path: Path) -> bool:
    """Whether it is a camera (`camera:0`, a device), an address (`rtsp://...`) or a pipe."""
    if is_address(path):
        return True
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)


def is_address(path: Path) -> bool:
    """Whether it is one of the network, or the number of a camera."""
    name = name_of(path)
    return bool(ADDRESS.match(name) or CAMERA.fullmatch(name))


def name_of(path: Path) -> str:
    """As it was given: a path has one slash where an address has two."""
    return ADDRESS.sub(r"\1://", path.as_posix(), count=1)
