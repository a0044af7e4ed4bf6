"""One step of a 3D network per call: compiled code for the live loop, bit-identical to live.

Memory is laid out as in `tick`: two blocks, floats and ints, with contiguous fields.
"""

from __future__ import annotations

from typing import Any

from tautwave_scenes.networks3d.arrays import Arrays3d
from tautwave_scenes.networks3d.elements import Elements
from tautwave_scenes.networks3d.ledger import tally3d
from tautwave_scenes.networks3d.solving import NEWTON, ONE, step_gradient3d
from tautwave_scenes.networks3d.stepping import (
    axis_effort,
    move_port3d,
    place_port,
    set_forces3d,
    step_network3d,
)
from tautwave_scenes.networks3d.tension import jump_links

SYMPLECTIC = 0
GRADIENT = 1
LINEARLY = 2


def tick_network3d(f: Any, w: Any, at: Any, scheme: int, period: float) -> int:
    """Advance a network by one step; outputs and ledger as in `networks3d.live`.

    Parameters
    ----------
    f, w : floats, ints
        The fields of `Arrays3d` and of its `elements` in order, then the positions of the axes
        [m], the external forces [N], their directions, the resisting efforts [N] and the ledger
        [J], which are filled, and in `w` the indices of the pushed masses' velocities.
    at : (2 * fields,) ints
        Start and end of each field in its block.
    scheme : int
        SYMPLECTIC, GRADIENT or LINEARLY.
    period : float
        T [s].

    Returns
    -------
    int
        Iterations of the step.
    """
    s = Arrays3d(
        w[at[0] : at[1]],
        f[at[2] : at[3]],
        f[at[4] : at[5]],
        f[at[6] : at[7]],
        f[at[8] : at[9]],
        w[at[10] : at[11]],
        w[at[12] : at[13]],
        w[at[14] : at[15]],
        w[at[16] : at[17]],
        f[at[18] : at[19]],
        f[at[20] : at[21]],
        f[at[22] : at[23]],
        f[at[24] : at[25]],
        f[at[26] : at[27]],
        f[at[28] : at[29]],
        f[at[30] : at[31]],
        f[at[32] : at[33]],
        w[at[34] : at[35]],
        w[at[36] : at[37]],
        w[at[38] : at[39]],
        w[at[40] : at[41]],
        w[at[42] : at[43]],
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
        f[at[74] : at[75]],
        f[at[76] : at[77]],
        f[at[78] : at[79]],
        f[at[80] : at[81]],
        f[at[82] : at[83]],
        f[at[84] : at[85]],
        f[at[86] : at[87]],
        f[at[88] : at[89]],
        w[at[90] : at[91]],
        w[at[92] : at[93]],
        f[at[94] : at[95]],
        f[at[96] : at[97]],
        w[at[98] : at[99]],
        Elements(
            w[at[100] : at[101]],
            w[at[102] : at[103]],
            w[at[104] : at[105]],
            w[at[106] : at[107]],
            w[at[108] : at[109]],
            w[at[110] : at[111]],
            f[at[112] : at[113]],
            f[at[114] : at[115]],
            f[at[116] : at[117]],
            f[at[118] : at[119]],
            f[at[120] : at[121]],
            f[at[122] : at[123]],
            f[at[124] : at[125]],
            f[at[126] : at[127]],
            f[at[128] : at[129]],
            f[at[130] : at[131]],
            f[at[132] : at[133]],
            f[at[134] : at[135]],
            f[at[136] : at[137]],
            f[at[138] : at[139]],
            f[at[140] : at[141]],
            f[at[142] : at[143]],
        ),
    )
    axes_at = f[at[144] : at[145]]
    pushes = f[at[146] : at[147]]
    ways = f[at[148] : at[149]]
    efforts = f[at[150] : at[151]]
    ledger = f[at[152] : at[153]]
    forced = w[at[154] : at[155]]
    tries = 0
    for j in range(len(forced)):
        for c in range(3):
            s.pushed[forced[j] + c] = 0.0
    for j in range(len(forced)):
        for c in range(3):
            s.pushed[forced[j] + c] += pushes[j] * ways[3 * j + c]
    if scheme == SYMPLECTIC:
        for port in range(s.count[1]):
            move_port3d(s, port, axes_at, period)
        set_forces3d(s)
    else:
        for port in range(s.count[1]):
            place_port(s, port, axes_at, period)
            jump_links(s, port)
        tries = step_gradient3d(s, period, ONE if scheme == LINEARLY else NEWTON)
    for axis in range(s.count[3]):
        efforts[axis] = axis_effort(s, axis)
    balance = tally3d(s)
    ledger[0], ledger[1], ledger[2], ledger[3] = balance[0], balance[1], balance[2], balance[3]
    ledger[4], ledger[5], ledger[6], ledger[7] = balance[4], balance[5], balance[6], balance[7]
    if scheme == SYMPLECTIC:
        step_network3d(s, period)
    return tries
