"""Who takes part: every family, and which methods belong to which experiment."""

from __future__ import annotations

from groundpose.lab.evaluate.experiments.contenders import Family, Oracles, Ours, Ransac, Reppnp
from groundpose.lab.evaluate.experiments.libraries import EVERY_RIVAL, Library

FAMILIES: tuple[Family, ...] = (
    Oracles(),
    Ours(),
    Ransac("p1p"),
    Ransac("p3p"),
    Reppnp(),
    *(Library(rival) for rival in EVERY_RIVAL),
)
OWN = ("oracle 6-DoF", "oracle 4-DoF", "ours, default", "ours, no priors")
HRE = (*OWN, "RNSC-P1P", "RNSC-P1P+GN", "RNSC-P1P+HRE")
SEARCHES = ("RNSC-P3P", "REPPnP", "REPPnP+OPnP+N")
QUICK = (*HRE, *SEARCHES)
LIMITED = {"HRE": HRE, "quick": QUICK}


def family(name: str) -> Family:
    """KeyError for an unknown name."""
    return {f.name: f for f in FAMILIES}[name]


def methods_of(experiment: str) -> dict[str, str]:
    """{method: note} of all that can run here and belong to the experiment."""
    names = {name: note for f in FAMILIES for name, note in f.methods().items()}
    wanted = LIMITED.get(experiment, tuple(names))
    return {name: note for name, note in names.items() if name in wanted}
