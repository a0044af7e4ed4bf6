"""One engagement of the coupling: its beginning where the axes stand, its end, what is dropped."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.controller.inertia import start_inertia
from tautwave.controller.pair import engage_pair, start_pair
from tautwave.controller.records import PIPE, TAG
from tautwave.controller.run import ramp_share
from tautwave.runtime.carrying.side import SideLoad
from tautwave.runtime.control import CoupledControl


def begin_session(
    control: CoupledControl, slot: int, loads: Sequence[SideLoad], *, keep_offset: bool
) -> None:
    """Begin with new states and an empty line; with `keep_offset` at the offset there is now."""
    table, law = control.table, control.law
    rig = control.pairs
    if keep_offset:
        control.pairs = [q._replace(at_engage=True) for q in rig]
    for pair in control.view.views:
        q = pair.q
        places = law.rings * q.samples
        table[q.line : q.line + places] = [0.0] * places
        pair.c.link = law.link()
        start_pair(pair, control.samples[q.master], control.samples[q.slave], control.steps)
    if keep_offset:
        control.pairs = rig
    control.state.armed_at = slot
    rise = ramp_share(control.run, control.state, slot)
    for pair in control.view.views:
        engage_pair(pair, rise, control.steps)
    offsets = {n: c.offset for n, c in zip(control.pair_names, control.states, strict=True)}
    for load in loads:
        load.engage(offsets)


def end_session(control: CoupledControl, loads: Sequence[SideLoad] = ()) -> None:
    """Reset the coupling's state; offsets stay."""
    for load in loads:
        load.disengage()
    law = control.law
    for state in control.states:
        state.link = law.link()
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
    """Discard commands on their way: the devices were without torque, and none of them acted."""
    for s, p in zip(control.axes, control.params, strict=True):
        control.table[p.pipe : p.pipe + PIPE * p.delay] = [0.0] * (PIPE * p.delay)
        s.missing = 0
