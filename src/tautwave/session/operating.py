"""An operated rig in a session: its controller, where commands come from, and its record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tautwave.config import Rig
from tautwave.config.keys.key_codes import CODES
from tautwave.config.keys.rig import CLAIMED_S, UNTIL_STOPPED_S
from tautwave.errors import ConfigError
from tautwave.rig import Assembly, BusWay
from tautwave.rig.operated.leading import led_masters, with_hands
from tautwave.rig.operated.operation import LOOK_HZ, operation_of
from tautwave.rig.ways import Way
from tautwave.runtime.carrying.side import SideLoad
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.loop import TIMING_COLUMNS
from tautwave.runtime.operate.commands import DeadMan, Source, Watcher
from tautwave.runtime.operate.inbox import Inbox, People
from tautwave.runtime.operate.journal import Journalled
from tautwave.runtime.operate.key_device import KeyDevice
from tautwave.runtime.operate.lead import Lead, Leading, Leads
from tautwave.runtime.operate.mailbox import Kept
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.runtime.operate.plan import EpisodePlan
from tautwave.runtime.operate.trigger import TriggerLine
from tautwave.summary import checked
from tautwave.summary.model import Operation

OFTENER = 4
"""Looks at the live sources where a policy drives, for one where people do."""


def refuse_endless(rig: Rig, ways: Sequence[BusWay]) -> None:
    """Refuse to simulate devices without an end.

    Raises
    ------
    ConfigError
        The rig has no duration or one of a day or more, and devices that are simulated here.
    """
    simulated = any(way.way in (Way.MEMORY, Way.SERVED) for way in ways)
    if rig.duration_s >= UNTIL_STOPPED_S and simulated:
        stated = f"is {rig.duration_s:g} s" if rig.duration_s > UNTIL_STOPPED_S else "is missing"
        raise ConfigError(
            f"duration_s {stated}: simulated devices run for less than a day; give --duration"
        )


def people_of(
    rig: Rig, assembly: Assembly, scripts: Sequence[Source], live: Sequence[Source]
) -> People | None:
    """Return what people give an operated rig; None for a rig that is not operated.

    Raises
    ------
    ConfigError
        There are commands or a dead-man, but the rig is not operated.
    DriverError
        A key device cannot be opened.
    """
    given = (getattr(bus.driver, "dead_man", None) for bus in assembly.buses)
    inputs: list[DeadMan] = [one for one in given if one is not None]
    if rig.operate is None:
        if inputs or scripts:
            what = "enable_input" if inputs else "--commands"
            raise ConfigError(f"{what}: the rig has no `operate` block; write `operate: {{}}`")
        return None
    keys = [
        KeyDevice(
            one.device,
            {CODES[key]: word for key, word in one.keys.items()},
            None if one.dead_man is None else CODES[one.dead_man],
        )
        for one in rig.operate.key_devices
    ]
    port = rig.operate.trigger
    lines = [] if port is None else [TriggerLine(port.port, port.command or "")]
    look = max(1, round(rig.rate_hz / LOOK_HZ))
    sent: list[DeadMan] = [one for one in live if isinstance(one, Kept)]
    led = None
    if rig.operate.policy is not None:
        led = led_masters(
            rig, assembly.delays, [name for bus in assembly.buses for name in bus.axes]
        )
    leads = led or _leads(assembly)
    if leads is not None:
        scripts, live = ([Leading(one, leads) for one in some] for some in (scripts, live))
        sent.append(leads)
        look = max(1, look // OFTENER)
    dead_men = [*keys, *sent, *inputs]
    inbox = Inbox(rig.period_ns, look, scripts, [*live, *keys, *lines], dead_men)
    task = " ".join(rig.operate.task.split())
    return People(inbox, lines, rig.operate.start == "engaged", task, led)


def with_operation(
    rig: Rig,
    assembly: Assembly,
    scripts: Sequence[Source],
    live: Sequence[Source],
    link: Any = None,
) -> Assembly:
    """Return the assembly behind a table of states if the rig is operated.

    `link`: a `Joined` of one of two sites; its controller becomes that, operated or not. Errors are
    those of `people_of`.
    """
    scripts = [*scripts, *_plans(rig)]
    people = people_of(rig, assembly, scripts, live)
    if link is not None:
        from tautwave.session.sites.joining import with_site

        assembly = with_site(rig, assembly, link, people)
    elif people is not None:
        assembly = _with_table(rig, assembly, people)
    for source in scripts:
        if isinstance(source, Watcher):
            source.sees(assembly.control)
    return assembly


def _plans(rig: Rig) -> list[EpisodePlan]:
    """Return the plan of episodes, if any; of two sites the master's follows it."""
    keys = None if rig.operate is None else rig.operate.episodes
    if keys is None or rig.site == "slave":
        return []
    return [EpisodePlan(keys.count, keys.episode_s, keys.reset_s, keys.name)]


def _with_table(rig: Rig, assembly: Assembly, people: People) -> Assembly:
    plain = assembly.control
    assert isinstance(plain, CoupledControl)
    control = OperatedControl(plain, operation_of(rig, plain, assembly.delays), people)
    control.loads = [one for one in assembly.sources if isinstance(one, SideLoad)]
    sources = [control, *assembly.sources[1:]]
    if people.led is not None:
        sources.append(people.led)
        assembly = assembly._replace(buses=list(with_hands(assembly.buses, people.led)))
    columns = [*TIMING_COLUMNS, *(name for source in sources for name in source.columns)]
    return assembly._replace(control=control, sources=sources, columns=columns)


def _leads(assembly: Assembly) -> Leads | None:
    """Return the virtual hands that a policy leads, None without any."""
    axes = [axis for world in assembly.simulators for axis in getattr(world, "axes", ())]
    leads = {
        axis.name.partition(".")[2]: axis.lead
        for axis in axes
        if type(getattr(axis, "lead", None)) is Lead
    }
    return Leads(leads) if leads else None


def operation_done(assembly: Assembly, duration_s: float) -> Operation | None:
    """Let go of key devices; return the summary's `operation` of an operated rig, else None."""
    control = assembly.control
    if not isinstance(control, Journalled):
        return None
    for one in (*control.inbox.dead_men, *control.lamps):
        if isinstance(one, KeyDevice | TriggerLine):
            one.close()
    return checked(Operation, control.journal.summary(duration_s))


def claimed_span(rig: Rig, cycles: int) -> float:
    """Return for how long ports claim [s]: the rig's duration, or begun hours of one without."""
    hours = max(1, math.ceil(cycles * rig.period_s / CLAIMED_S))
    return CLAIMED_S * hours if rig.duration_s == UNTIL_STOPPED_S else rig.duration_s


def engagements(assembly: Assembly) -> int:
    """Return how often the pairs engaged; each time the ports began with their reserve."""
    control = assembly.control
    return control.journal.engagements if isinstance(control, OperatedControl) else 1
