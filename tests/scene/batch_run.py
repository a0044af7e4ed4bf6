"""A network under given motions of its ports, many steps in one call, as Python or compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError
from tautwave.scene import batch
from tautwave.scene.compiling import Arrays, as_arrays, compile_network
from tautwave.scene.network import Network
from tautwave.scene.schemes.stepping import pull_links
from tautwave.simulation.scene.networks import compiled_batch

Floats = npt.NDArray[np.float64]

SCHEMES = {"symplectic": batch.SYMPLECTIC, "discrete_gradient": batch.GRADIENT}


def run_network(
    network: Network,
    scheme: str,
    period: float,
    ports: Floats,
    pushes: Floats | None = None,
    *,
    engine: str = "numba",
) -> tuple[Floats, Arrays]:
    """Run a network under given motions of its ports.

    Parameters
    ----------
    network : Network
        Without problems and without strings.
    scheme : str
        `symplectic` or `discrete_gradient`.
    period : float
        T [s].
    ports : (steps, p)
        Positions of the ports [m].
    pushes : (steps, f)
        External forces on `network.forced` [N]; none if not given.
    engine : str
        `numba`, or `python` for the same numbers some hundred times slower.

    Returns
    -------
    efforts : (steps, p)
        Resisting efforts [N].
    arrays : Arrays
        The network after the last step, with its books.

    Raises
    ------
    ConfigError
        The scheme is not one of these, or the network has strings.
    """
    if scheme not in SCHEMES or network.strings:
        raise ConfigError(
            f"scheme {scheme}: run_network supports {' and '.join(SCHEMES)}, without strings"
        )
    start = np.ascontiguousarray(ports, np.float64)
    made = compile_network(network, start[0].tolist() if len(start) else ())
    forced: Any = [made.masses.index(name) for name in network.forced]
    if pushes is None:
        pushes = np.zeros((len(start), len(forced)))
    arrays = made.arrays
    if scheme == "symplectic":
        pull_links(arrays)
    efforts = np.zeros_like(start)
    advance: Callable[..., int] = batch.advance_many
    if engine == "numba":
        arrays = as_arrays(arrays)
        forced = np.array(forced, np.int64)
        advance = compiled_batch()
    advance(arrays, SCHEMES[scheme], period, start, forced, pushes, efforts)
    if scheme == "symplectic":
        pull_links(arrays)  # its account is a step behind
    return efforts, arrays
