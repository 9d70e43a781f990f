"""Packages that come with an extra of this one, imported when they are first used."""

from __future__ import annotations

import importlib
from types import ModuleType

from groundpose._checks import input_error


def extra_package(name: str, distribution: str, extra: str) -> ModuleType:
    """The package or module `name`. Raises InputError saying what to install when it is not there."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        wanted = f"{distribution} (pip install 'groundpose[{extra}]')"
        raise input_error(name.partition(".")[0], wanted, f"no package {error.name}") from None
