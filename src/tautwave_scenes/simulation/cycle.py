"""One cycle of a scene and the axes at its ports, as one call from the live loop.

What `runtime.axes` does once the scene is engaged, in the same order: equal to the bit. What
crosses is in arrays: `inputs`, position, effort and validity of each axis; `outputs`, a command an
axis and then the slot after the last; a row.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass
from typing import Any

from tautwave.controller.axis import pass_slot, render_axis, take_sample
from tautwave.controller.braking import miss_axis
from tautwave.controller.records import AxisParams, AxisState, RunParams, RunState, Sample
from tautwave.controller.rows import fill_axis
from tautwave.controller.run import ramp_share, stop_on_guard
from tautwave.controller.steps import Steps
from tautwave.laws.limit import OVERDRAWN, RUNAWAY
from tautwave_scenes.networks.compiling import Arrays
from tautwave_scenes.runtime.hold import Debt, Held, absorbed, book_hold
from tautwave_scenes.simulation.tick import tick_network

X = 2 * Arrays._fields.index("x")
PORTS, PUSHES, EFFORTS, LEDGER = 84, 86, 88, 90
"""Where `tick_network` has the beginning of what goes in and comes out."""

INPUTS = 3


@dataclass(slots=True)
class SceneState:
    """What is constant of a scene and its place in the run.

    `scheme` and `period` of the network, `nodes` that are recorded, forces on `forced` masses in
    the first `pushed` numbers; whether held efforts are `guarded`; the present `slot`, and the
    guard's code by which it `ended`.
    """

    scheme: int = 0
    period: float = 0.0
    nodes: int = 0
    forced: int = 0
    pushed: int = 0
    guarded: bool = False
    slot: int = 0
    ended: int = 0


@dataclass(slots=True)
class ScenePort:
    """How an axis moves its port: scale * position + offset; what its effort must not pass."""

    scale: float = 0.0
    offset: float = 0.0
    most: float = 0.0
    place: float = 0.0
    effort: float = 0.0
    asked: float = 0.0


def advance_scene(
    c: SceneState,
    ends: Sequence[ScenePort],
    f: Any,
    w: Any,
    at: Sequence[int],
    forces: Sequence[float],
    skipped: int,
) -> int:
    """Step the network over the elapsed slots and this one; return 0, or RUNAWAY."""
    count = len(ends)
    for _ in range(skipped + 1):
        first = min(c.forced * c.slot, c.pushed)
        c.slot += 1
        for j in range(c.forced):
            f[at[PUSHES] + j] = forces[first + j]
        for port in range(count):
            f[at[PORTS] + port] = ends[port].place
        tick_network(f, w, at, c.scheme, c.period)
    for port in range(count):
        e = ends[port]
        e.asked = e.scale * f[at[EFFORTS] + port]
        if not -e.most <= e.asked <= e.most:
            return RUNAWAY  # NaN as well
    return 0


def step_scene(
    runs: Sequence[RunParams],
    outcomes: Sequence[RunState],
    params: Sequence[AxisParams],
    axes: Sequence[AxisState],
    samples: Sequence[Sample],
    scenes: Sequence[SceneState],
    ends: Sequence[ScenePort],
    helds: Sequence[Held],
    debts: Sequence[Debt],
    table: MutableSequence[float],
    pipe: MutableSequence[float],
    f: MutableSequence[float],
    w: MutableSequence[int],
    at: Sequence[int],
    ports: Sequence[int],
    forces: Sequence[float],
    efforts: MutableSequence[float],
    start: Sequence[float],
    inputs: MutableSequence[float],
    outputs: MutableSequence[float],
    row: MutableSequence[float],
    slot: int,
    skipped: int,
    steps: Steps,
) -> None:
    """Run one cycle of an engaged scene on what was read."""
    r = runs[0]
    o = outcomes[0]
    c = scenes[0]
    count = len(ports)
    for port in range(count):
        which = ports[port]
        s = axes[which]
        p = params[which]
        m = samples[which]
        m.position = inputs[INPUTS * which]
        m.effort = inputs[INPUTS * which + 1]
        m.valid = inputs[INPUTS * which + 2] != 0.0
        if m.valid:
            s.missing = 0
        for _ in range(skipped + 1):
            pass_slot(s, p, table, steps)
        take_sample(s, p, m, steps)
        if s.valid:
            ends[port].place = ends[port].scale * s.position + ends[port].offset
    ledger = f[at[LEDGER] : at[LEDGER + 1]]
    if c.ended == 0:
        for port in range(count):
            efforts[port] = ends[port].effort
        c.ended = advance_scene(c, ends, f, w, at, forces, skipped)
        if (
            c.ended == 0
            and c.guarded
            and book_hold(debts[0], helds, pipe, axes, ports, efforts, skipped + 1, ledger)
        ):
            c.ended = OVERDRAWN
        if c.ended == 0:
            for port in range(count):
                ends[port].effort = ends[port].asked
    ramp = ramp_share(r, o, slot)
    for port in range(count):
        s = axes[ports[port]]
        p = params[ports[port]]
        ceiling = ramp * p.ceiling
        ends_now = c.ended != 0 and not s.stopping
        s.stopping = s.stopping or c.ended != 0
        if s.valid:
            s.guard = render_axis(s, p, ends[port].effort, ceiling)
        else:
            s.guard = miss_axis(s, p, ceiling)
        if ends_now:
            s.guard = c.ended
    for port in range(count):
        stop_on_guard(r, o, axes, slot, ports[port])
    fill_scene(c, params, axes, ends, f, at, ports, start, row, steps)
    for i in range(r.axes):
        outputs[i] = axes[i].command
    outputs[r.axes] = float(o.end)


def fill_scene(
    c: SceneState,
    params: Sequence[AxisParams],
    axes: Sequence[AxisState],
    ends: Sequence[ScenePort],
    f: Sequence[float],
    at: Sequence[int],
    ports: Sequence[int],
    start: Sequence[float],
    row: MutableSequence[float],
    steps: Steps,
) -> None:
    """Write all columns of the scene: axes, energies, efforts, where its nodes are."""
    to = 0
    for port in range(len(ports)):
        which = ports[port]
        to = fill_axis(row, to, axes[which], params[which], 1.0, steps)
    b = f[at[LEDGER] : at[LEDGER + 1]]
    for part in range(8):
        row[to + part] = b[part]
    came = b[6] + b[7] + b[4] + b[5] - b[3]
    came -= start[6] + start[7] + start[4] + start[5] - start[3]
    row[to + 8] = came - (b[0] + b[1] + b[2] - (start[0] + start[1] + start[2]))
    row[to + 9] = absorbed(axes, ports) - (b[6] - start[6])
    to = to + 10
    for port in range(len(ports)):
        row[to + port] = ends[port].effort
    to = to + len(ports)
    for node in range(c.nodes):
        row[to + node] = f[at[X] + node]
