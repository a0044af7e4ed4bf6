"""One step of a network per call: compiled code for the live loop, bit-identical to live.

All fields of `Arrays` are contiguous in two blocks of memory, floats and ints: a call passes three
arrays instead of forty, and allocates nothing.
"""

from __future__ import annotations

from typing import Any

from tautwave_scenes.networks.compiling import Arrays
from tautwave_scenes.networks.ledger import tally
from tautwave_scenes.networks.schemes.gradient import step_gradient
from tautwave_scenes.networks.schemes.kutta import aim_ports, step_kutta
from tautwave_scenes.networks.schemes.stepping import move_ports, pull_links, step_symplectic
from tautwave_scenes.networks.schemes.tension import jump_ports
from tautwave_scenes.simulation.steps import EXACT, KUTTA, SYMPLECTIC, Flows, step_flows


def tick_network(f: Any, w: Any, at: Any, scheme: int, period: float) -> int:
    """Advance a network without strings by one step; efforts and ledger as in `networks.live`.

    Parameters
    ----------
    f, w : floats, ints
        The fields of `Arrays` in order, then those of `Flows`, then the positions of the ports [m],
        the external forces [N], the resisting efforts [N] and the ledger [J], which are filled, and
        in `w` the forced masses.
    at : (2 * fields,) ints
        Start and end of each field in its block.
    scheme : int
        SYMPLECTIC, GRADIENT, EXACT or KUTTA of `network_steps`.
    period : float
        T [s].

    Returns
    -------
    int
        Iterations of the step.
    """
    s = Arrays(
        w[at[0] : at[1]],
        f[at[2] : at[3]],
        f[at[4] : at[5]],
        f[at[6] : at[7]],
        f[at[8] : at[9]],
        w[at[10] : at[11]],
        w[at[12] : at[13]],
        w[at[14] : at[15]],
        f[at[16] : at[17]],
        f[at[18] : at[19]],
        f[at[20] : at[21]],
        f[at[22] : at[23]],
        f[at[24] : at[25]],
        f[at[26] : at[27]],
        f[at[28] : at[29]],
        w[at[30] : at[31]],
        w[at[32] : at[33]],
        w[at[34] : at[35]],
        w[at[36] : at[37]],
        w[at[38] : at[39]],
        f[at[40] : at[41]],
        f[at[42] : at[43]],
        f[at[44] : at[45]],
        f[at[46] : at[47]],
        f[at[48] : at[49]],
        f[at[50] : at[51]],
        f[at[52] : at[53]],
        f[at[54] : at[55]],
        f[at[56] : at[57]],
        f[at[58] : at[59]],
        f[at[60] : at[61]],
        f[at[62] : at[63]],
        f[at[64] : at[65]],
        f[at[66] : at[67]],
        f[at[68] : at[69]],
        f[at[70] : at[71]],
        f[at[72] : at[73]],
    )
    flows = Flows(
        w[at[74] : at[75]],
        w[at[76] : at[77]],
        f[at[78] : at[79]],
        f[at[80] : at[81]],
        f[at[82] : at[83]],
    )
    ports = f[at[84] : at[85]]
    pushes = f[at[86] : at[87]]
    efforts = f[at[88] : at[89]]
    ledger = f[at[90] : at[91]]
    forced = w[at[92] : at[93]]
    tries = 0
    first = s.count[0]
    for j in range(len(forced)):
        s.pushed[forced[j]] = pushes[j]
    if scheme == SYMPLECTIC:
        for port in range(s.count[1]):
            move_ports(s, port, ports[port], period)
        pull_links(s)
    elif scheme == KUTTA:
        for port in range(s.count[1]):
            aim_ports(s, port, ports[port], period)
        step_kutta(s, period)
    else:
        for port in range(s.count[1]):
            jump_ports(s, port, ports[port], period)
        if scheme == EXACT:
            step_flows(s, flows, period)
        else:
            tries = step_gradient(s, period)
    for port in range(s.count[1]):
        efforts[port] = -s.force[first + port]
    balance = tally(s)
    ledger[0], ledger[1], ledger[2], ledger[3] = balance[0], balance[1], balance[2], balance[3]
    ledger[4], ledger[5], ledger[6], ledger[7] = balance[4], balance[5], balance[6], balance[7]
    if scheme == SYMPLECTIC:
        step_symplectic(s, period)
    return tries
