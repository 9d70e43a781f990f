"""All contenders, and the comparisons in which each takes part. A new one is a row of `ROWS`."""

from __future__ import annotations

import re
from dataclasses import dataclass

from groundpose.lab.contenders import libraries as lib
from groundpose.lab.contenders import own
from groundpose.lab.contenders.contender import Contender
from groundpose.lab.contenders.oracle import Oracle
from groundpose.lab.contenders.polish import GN, PNPS, Polish, Polished, Reppnp
from groundpose.lab.contenders.use import at_threshold, with_cut

EXPERIMENTS = ("E1", "E2", "E3", "E4")
EVERYWHERE = ("bench", *EXPERIMENTS, "HRE", "quick", "today", "G1", "G2", "V1", "real", "kitti")
"""`groundpose bench`; the paper's experiments, and the figure of today's libraries (the other is "paper");
V1 and the time of `evaluate targets`; `evaluate real` and `apollo`; `evaluate kitti`."""


@dataclass(frozen=True)
class Row:
    """A contender and where it takes part."""

    contender: Contender
    where: tuple[str, ...] = EVERYWHERE
    option: str = ""
    """What it is called on a command line; "": its name in small letters and hyphens."""

    @property
    def key(self) -> str:
        """The option."""
        return self.option or re.sub(r"[^a-z0-9.+]+", "-", self.contender.name.lower()).strip("-")


def _row(contender: Contender, where: str, option: str = "") -> Row:
    """`where`: names with blanks between, E for E1 to E4."""
    names = tuple(name for word in where.split() for name in (EXPERIMENTS if word == "E" else (word,)))
    return Row(contender, names, option)


_P1P, _P3P, _REPPNP = own.paper("p1p"), own.paper("p3p"), Reppnp()


def _polished(search: Contender, *polishes: Polish) -> tuple[Row, ...]:
    """A search with PnP methods."""
    both = [Polished(search, polish) for polish in polishes]
    return tuple(_row(one, "E paper quick" if one.name == "REPPnP+OPnP+N" else "E paper") for one in both)


ROWS: tuple[Row, ...] = (
    _row(Oracle(6), "E HRE paper today quick V1"),
    _row(Oracle(4), "E HRE paper today quick V1"),
    _row(own.DEFAULT, " ".join((*EVERYWHERE, "paper")), "default"),
    _row(with_cut(own.DEFAULT), "kitti", "default-cut"),
    _row(own.NEVER_REFUSES, "G1 G2"),
    _row(own.UP2P_NEVER_REFUSES, "G1 G2"),
    _row(own.PRIOR, "V1"),
    _row(own.NO_PRIOR, "E HRE paper today quick V1"),
    _row(own.UP2P, "E today V1"),
    _row(own.P3P, "V1"),
    _row(_P1P, "E HRE paper quick"),
    _row(own.paper("p1p", "gn"), "E HRE paper quick G1"),
    _row(own.paper("p1p", "re"), "G2 kitti", "p1p+re"),
    _row(own.paper("p1p", "hre"), "bench E HRE quick today G1 G2 kitti", "p1p+hre"),
    *_polished(_P1P, *PNPS),
    _row(own.paper("up2p", "hre"), "bench"),
    _row(_P3P, "E paper quick"),
    _row(own.paper("p3p", "gn"), "E paper G1"),
    _row(own.paper("p3p", "re"), "G2 kitti", "p3p+re"),
    _row(own.paper("p3p", "hre"), "bench E G1 G2 kitti", "p3p+hre"),
    *_polished(_P3P, *PNPS),
    _row(own.refusing(own.paper("p1p", "hre")), "V1 real"),
    _row(own.refusing(own.paper("p3p", "hre")), "V1 real"),
    _row(own.unrefined("p1p"), "V1"),
    _row(own.unrefined("p3p"), "V1"),
    _row(_REPPNP, "E paper quick"),
    *_polished(_REPPNP, GN, *PNPS),
    _row(lib.POSELIB_TUNED, "bench E today G1 G2 V1 real kitti", "poselib"),
    _row(at_threshold(with_cut(lib.POSELIB_TUNED), 4.0), "kitti", "poselib-x4"),
    _row(lib.POSELIB, "bench E today G1 G2 V1 real", "poselib-plain"),
    _row(lib.OPENCV_EPNP, "E today V1 real"),
    _row(lib.OPENCV_P3P, "E today V1 real"),
    _row(lib.OPENCV_MAGSAC, "bench E today V1 real"),
    _row(lib.OPENCV_ACCURATE, "E today"),
    _row(lib.OPENCV_SQPNP, "bench E today"),
    _row(lib.PYCOLMAP, "bench E today"),
)
DEFAULT, TO_BEAT = own.DEFAULT.name, lib.POSELIB_TUNED.name
"""Ours, and the library that it has to beat."""


def rows(where: str) -> tuple[Row, ...]:
    """The rows of a comparison, in the order of the table."""
    return tuple(row for row in ROWS if where in row.where)


def contenders(where: str) -> tuple[Contender, ...]:
    """Everyone who takes part in a comparison, installed or not."""
    return tuple(row.contender for row in rows(where))


def installed(where: str) -> tuple[Contender, ...]:
    """Everyone who takes part and can run here."""
    return tuple(one for one in contenders(where) if one.missing() is None)


def by_option(where: str) -> dict[str, Contender]:
    """{option: contender} of a comparison."""
    return {row.key: row.contender for row in rows(where)}


def others(where: str) -> tuple[lib.Library, ...]:
    """The libraries of a comparison, the one to beat first."""
    return tuple(one for one in contenders(where) if isinstance(one, lib.Library))


def described(where: str) -> dict[str, str]:
    """What every library of a comparison is, or why it is missing, {name: text}: stored with results."""
    return {one.name: one.missing() or one.note for one in others(where)}
