"""What the step of a drive's effort takes from a port's tank.

A drive truncates the effort that it is asked for, and the port adds what was taken to the next one:
the mean is exact, and what is left is a pulse of a step q now and then. A pulse of a period T gives
a free device of inertia m the energy (q T)**2 / 2m; some of it comes back as waves, some of it the
device's damping takes, which no tank sees. `DRAIN` is above what a search found (free, held and
moved devices of certified rigs, command delays of 0 to 2 periods, steps of 10 to 50 % of the
limit): 0.28, in units of q**2 T / m [W].
"""

from __future__ import annotations

DRAIN = 0.35

COARSEST = 0.5
"""Of b v, the port's effort at the velocity limit, the greatest step. A coarser one throws the
device to and fro faster than its limits: of 98 certified ends the first to fail had 1.15."""


def step_power(period: float, mass: float, quantum: float) -> float:
    """Return what truncation of the effort by `quantum` [N m or N] can take from a tank [W].

    Parameters
    ----------
    period, mass, quantum : float
        T [s], lower bound of the inertia [kg m**2 or kg], step of the effort [N m or N].
    """
    return DRAIN * quantum * quantum * period / mass
