"""PnP methods of the paper's figures that no kept library has, from their papers' equations.

Written to be right and readable, not fast. Every method is a function of object points `X` (n, 3) and
normalised image points `x` (n, 2) = K^-1 u, and answers with a pose (R, t), `Y = R X + t` in the camera, or
None. A file imports `geometry` (and its neighbours `quaternion`, `control_points`) only.
"""

from groundpose.lab.contenders.baselines.aspnp import aspnp
from groundpose.lab.contenders.baselines.eppnp import eppnp
from groundpose.lab.contenders.baselines.gauss_newton import gauss_newton
from groundpose.lab.contenders.baselines.opnp import opnp
from groundpose.lab.contenders.baselines.reppnp import reppnp
from groundpose.lab.contenders.baselines.rpnp import rpnp

__all__ = ["aspnp", "eppnp", "gauss_newton", "opnp", "reppnp", "rpnp"]
