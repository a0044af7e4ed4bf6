"""Many steps of a network in one call, with any scheme, strings included; bit-identical to live.

The subset of Python that numba compiles, without allocations. `networks.live` runs the same laws
one step per call; what it keeps in objects (strings, exact islands) is here in arrays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from tautwave.laws.wave_filter import filter_step
from tautwave_scenes.networks.compiling import Arrays, Numbers
from tautwave_scenes.networks.schemes.gradient import step_gradient
from tautwave_scenes.networks.schemes.kutta import aim_ports, step_kutta
from tautwave_scenes.networks.schemes.stepping import move_ports, pull_links, step_symplectic
from tautwave_scenes.networks.schemes.tension import jump_ports

SYMPLECTIC = 0
GRADIENT = 1
EXACT = 2
KUTTA = 3


class Lines(NamedTuple):
    """The halves of all strings, two to a string, near before far.

    `node`, `root` by string; `size` (samples), `first` (in the rings), `at` (place), `returns`
    (reflection), `gain` (of the low-pass, 1: none) by half. State by half: `arriving`, `back`,
    `state`, `lost` [J]; the rings `out` (to the end) and `home` (to the point).
    """

    node: Numbers
    root: Numbers
    size: Numbers
    first: Numbers
    at: Numbers
    returns: Numbers
    gain: Numbers
    arriving: Numbers
    back: Numbers
    state: Numbers
    lost: Numbers
    out: Numbers
    home: Numbers


class Flows(NamedTuple):
    """The islands of the exact scheme, one after the other.

    `sizes` has 6 numbers per island: masses, ports, links, and where its `parts` (masses, ports,
    links), its `change` and its `loss` begin. `scratch` holds state, input and what moved.
    """

    sizes: Numbers
    parts: Numbers
    change: Numbers
    loss: Numbers
    scratch: Numbers


def push_strings(s: Arrays, lines: Lines) -> None:
    """Before a step: apply the arriving waves to the strings' nodes."""
    for at in range(len(lines.node)):
        arriving = lines.arriving[2 * at] + lines.arriving[2 * at + 1]
        s.pushed[lines.node[at]] = lines.root[at] * arriving


def carry_strings(s: Arrays, lines: Lines, period: float) -> None:
    """After a step: send the waves that result from the nodes' motion."""
    for at in range(len(lines.node)):
        motion = lines.root[at] * s.v[lines.node[at]]
        for half in range(2 * at, 2 * at + 2):
            send_wave(lines, half, motion - lines.arriving[half], period)


def send_wave(lines: Lines, half: int, wave: float, period: float) -> None:
    """Pass one sample of one half of a string."""
    place = lines.first[half] + lines.at[half]
    at_end = lines.out[place]
    lines.arriving[half] = lines.home[place]
    lines.out[place] = wave
    lines.home[place] = lines.back[half]
    lines.at[half] += 1
    if lines.at[half] == lines.size[half]:
        lines.at[half] = 0
    out = at_end
    if lines.gain[half] < 1.0:
        out, _, absorbed = filter_step(lines.gain[half], period, lines.state[half], at_end)
        lines.lost[half] += absorbed
        lines.state[half] = out
    lines.back[half] = -lines.returns[half] * out
    lines.lost[half] += 0.5 * period * (out * out - lines.back[half] * lines.back[half])


def step_flows(s: Arrays, flows: Flows, period: float) -> None:
    """Advance all masses by one exact step; ports were put in place before."""
    masses = s.count[0]
    for i in range(masses + s.count[1]):
        s.force[i] = 0.0
    for i in range(s.count[2]):
        one = s.a[i]
        two = s.b[i]
        pull = s.k[i] * (s.x[one] - s.x[two] - s.rest[i]) + s.z[i] * (s.v[one] - s.v[two])
        s.tension[i] = pull
        s.force[one] -= pull
        s.force[two] += pull
    for island in range(len(flows.sizes) // 6):
        step_flow(s, flows, 6 * island, period)


def step_flow(s: Arrays, flows: Flows, at: int, period: float) -> None:
    """Advance one island; see `networks.schemes.exact`."""
    n = flows.sizes[at]
    ports = flows.sizes[at + 1]
    links = flows.sizes[at + 2]
    parts = flows.sizes[at + 3]
    change = flows.sizes[at + 4]
    loss = flows.sizes[at + 5]
    state = flows.scratch
    size = 3 * n + 2 * ports + 1
    for j in range(n):
        m = flows.parts[parts + j]
        state[j] = s.x[m]
        state[n + j] = s.v[m]
        state[2 * n + 2 * ports + j] = s.pushed[m]
    for j in range(ports):
        port = flows.parts[parts + n + j]
        state[2 * n + j] = s.x[port]
        state[2 * n + ports + j] = s.v[port]
    state[size - 1] = 1.0
    lost = 0.0
    for row in range(size):
        total = 0.0
        for column in range(size):
            total += flows.loss[loss + row * size + column] * state[column]
        lost += state[row] * total
    for row in range(2 * n):
        total = 0.0
        for column in range(size):
            total += flows.change[change + row * size + column] * state[column]
        m = flows.parts[parts + row % n]
        if row < n:
            s.x[m] += total
            s.pumped[m] += s.pushed[m] * total
        else:
            s.v[m] += total
    s.dragged[flows.parts[parts]] += lost
    for j in range(links):
        i = flows.parts[parts + n + ports + j]
        one = s.a[i]
        two = s.b[i]
        if s.k[i] > 0.0:
            d = s.x[one] - s.x[two] - s.rest[i]
            s.stored[i] = 0.5 * s.k[i] * d * d
        if s.z[i] > 0.0:
            book_damper(s, flows, i, n, parts, period)


def book_damper(s: Arrays, flows: Flows, i: int, n: int, parts: int, period: float) -> None:
    """Book the work of ports at a damper: its mean tension times their displacement."""
    masses = s.count[0]
    ports = masses + s.count[1]
    one = s.a[i]
    two = s.b[i]
    swept = 0.0
    for j in range(n):
        if flows.parts[parts + j] == one:
            swept = s.x[one] - flows.scratch[j]
    less = 0.0
    for j in range(n):
        if flows.parts[parts + j] == two:
            less = s.x[two] - flows.scratch[j]
    swept = swept - less
    swept += period * (s.v[one] if one >= masses else 0.0)
    swept -= period * (s.v[two] if two >= masses else 0.0)
    if one >= masses and one < ports:
        s.port_work[one - masses] += s.z[i] * swept * s.v[one]
    if two >= masses and two < ports:
        s.port_work[two - masses] -= s.z[i] * swept * s.v[two]


def play_network(
    s: Arrays,
    lines: Lines,
    flows: Flows,
    scheme: int,
    period: float,
    ports: Any,
    forced: Any,
    pushes: Any,
    efforts: Any,
    places: Any,
    stride: int,
) -> int:
    """Advance a network as often as `ports` has rows.

    Parameters
    ----------
    s, lines, flows
        The network and its state; `pull_links` was called once if the scheme is symplectic.
    scheme : int
        SYMPLECTIC, GRADIENT, EXACT or KUTTA.
    period : float
        T [s].
    ports : (steps, p)
        Positions of the ports [m].
    forced : (f,) ints
        Masses with an external force.
    pushes : (steps, f)
        External forces [N].
    efforts : (steps / stride, p)
        Filled with the mean resisting efforts of `stride` steps each [N].
    places : (steps / stride, n)
        Filled with the positions of the masses after every `stride` steps [m].
    stride : int
        Divides the number of steps.

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
            step_symplectic(s, period)
        elif scheme == KUTTA:
            for port in range(s.count[1]):
                aim_ports(s, port, ports[step, port], period)
            step_kutta(s, period)
        else:
            for port in range(s.count[1]):
                jump_ports(s, port, ports[step, port], period)
            if scheme == EXACT:
                step_flows(s, flows, period)
            else:
                push_strings(s, lines)
                tries = step_gradient(s, period)
                if tries > most:
                    most = tries
                carry_strings(s, lines, period)
        row = step // stride
        for port in range(s.count[1]):
            efforts[row, port] -= s.force[first + port] / stride
        if (step + 1) % stride == 0:
            for m in range(first):
                places[row, m] = s.x[m]
    return most
