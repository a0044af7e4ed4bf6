"""Many steps of a network in one call, for compiled code; the same steps as `live`, to the bit."""

from __future__ import annotations

from tautwave.scene.compiling import Arrays, Numbers
from tautwave.scene.schemes.gradient import step_gradient
from tautwave.scene.schemes.stepping import move_ports, pull_links, step_symplectic
from tautwave.scene.schemes.tension import jump_ports

SYMPLECTIC = 0
GRADIENT = 1


def advance_many(
    s: Arrays,
    scheme: int,
    period: float,
    ports: Numbers,
    forced: Numbers,
    pushes: Numbers,
    efforts: Numbers,
) -> int:
    """Advance a network as often as `ports` has rows.

    Parameters
    ----------
    s : Arrays
        The network; `pull_links` was called once if the scheme is symplectic.
    scheme : int
        SYMPLECTIC or GRADIENT.
    period : float
        T [s].
    ports : (steps, p)
        Positions of the ports [m].
    forced : (f,) ints
        Masses with an external force.
    pushes : (steps, f)
        External forces [N].
    efforts : (steps, p)
        Filled with the resisting efforts [N].

    Returns
    -------
    int
        Greatest number of iterations of a step.
    """
    most = 0
    first = s.count[0]
    for step in range(len(ports)):
        for at in range(len(forced)):
            s.pushed[forced[at]] = pushes[step, at]
        if scheme == SYMPLECTIC:
            for port in range(s.count[1]):
                move_ports(s, port, ports[step, port], period)
            pull_links(s)
            for port in range(s.count[1]):
                efforts[step, port] = -s.force[first + port]
            step_symplectic(s, period)
        else:
            for port in range(s.count[1]):
                jump_ports(s, port, ports[step, port], period)
            tries = step_gradient(s, period)
            if tries > most:
                most = tries
            for port in range(s.count[1]):
                efforts[step, port] = -s.force[first + port]
    return most
