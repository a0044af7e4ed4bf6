"""One engagement of the coupling: its beginning where the axes stand, its end, what is dropped."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.controller.inertia import start_inertia
from tautwave.controller.pair import engage_pair, start_pair
from tautwave.controller.records import PIPE, TAG, PairState
from tautwave.controller.run import ramp_share
from tautwave.runtime.carrying.side import SideLoad
from tautwave.runtime.control import CoupledControl


def begin_session(
    control: CoupledControl, slot: int, loads: Sequence[SideLoad], *, keep_offset: bool
) -> None:
    """Begin with new states and an empty line; with `keep_offset` at the offset there is now."""
    table, params, law = control.table, control.params, control.law
    for k, q in enumerate(control.pairs):
        places = law.rings * q.samples
        table[q.line : q.line + places] = [0.0] * places
        control.states[k] = c = PairState(link=law.link())
        one, two = control.axes[q.master], control.axes[q.slave]
        p1, p2 = params[q.master], params[q.slave]
        present = q._replace(at_engage=q.at_engage or keep_offset)
        master, slave = control.samples[q.master], control.samples[q.slave]
        start_pair(c, present, one, two, p1, p2, master, slave, table, law.steps)
    control.state.armed_at = slot
    rise = ramp_share(control.run, control.state, slot)
    for k, q in enumerate(control.pairs):
        one, two = control.axes[q.master], control.axes[q.slave]
        p1, p2 = params[q.master], params[q.slave]
        engage_pair(control.states[k], q, one, two, p1, p2, table, rise, law.steps)
    offsets = {n: c.offset for n, c in zip(control.pair_names, control.states, strict=True)}
    for load in loads:
        load.engage(offsets)


def end_session(control: CoupledControl, loads: Sequence[SideLoad] = ()) -> None:
    """Forget everything that the coupling stored; offsets stay."""
    for load in loads:
        load.disengage()
    law = control.law
    for k, state in enumerate(control.states):
        control.states[k] = PairState(state.offset, law.link())
    for s, p in zip(control.axes, control.params, strict=True):
        # What the coupling put beside commands that still wait was banked as its own.
        for at in range(p.pipe, p.pipe + PIPE * p.delay, PIPE):
            control.table[at + TAG] = 0.0
        s.end = law.end()
        s.tag = 0.0
        s.alarm = 0
        s.wall_effort = 0.0
        s.depth = 0.0
        s.wall_stored_at_start = 0.0
        s.wall_absorbed = s.wall_dissipated = s.wall_contact_energy = 0.0
        s.wall_owes = False
        s.help_absorbed = 0.0
        start_inertia(s, p)


def drop_commands(control: CoupledControl) -> None:
    """Forget commands on their way: the devices were without torque, and none of them acted."""
    for s, p in zip(control.axes, control.params, strict=True):
        control.table[p.pipe : p.pipe + PIPE * p.delay] = [0.0] * (PIPE * p.delay)
        s.missing = 0
