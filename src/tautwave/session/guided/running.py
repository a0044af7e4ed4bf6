"""Run a guided procedure on the devices of a rig, and record it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import MonotonicClock
from tautwave.config import Rig, resolved_yaml
from tautwave.controller.records import PIPE
from tautwave.errors import BusBudgetError, ConfigError, TautwaveError, WritingError
from tautwave.files import write_text
from tautwave.rig import (
    Assembly,
    Simulate,
    Way,
    as_taken,
    axis_names,
    bare_site,
    build_rig,
    bus_ways,
    controlled_axis,
)
from tautwave.rig.calibrated import identities
from tautwave.runtime.interrupts import Interrupted, interrupts
from tautwave.runtime.loop import TIMING_COLUMNS, Loop
from tautwave.runtime.machine import quiet_collector
from tautwave.runtime.recorder import Recorder
from tautwave.runtime.unwatched import refuse_enabled, warning
from tautwave.session.checking import bus_budgets, over_budget, require_drivers
from tautwave.session.devices import devices
from tautwave.session.guided.answers import Answers, Declined, Misread, confirmed
from tautwave.session.guided.control import Guide, GuidedControl
from tautwave.session.keeping import run_directory
from tautwave.session.metadata import metadata_of
from tautwave.session.running import loop_conditions

LONGEST_S = 3600.0
PATIENCE_S = 2.0
"""[s] A device without torque may be unheard."""

LOOK_NS = 20_000_000
SIMULATED_S = 600.0
"""A simulated hand is laid out for the whole run."""


class Conversation(NamedTuple):
    """Where answers come from, and where sentences and numbers go.

    `pauses`: somebody is there, who may be asked between two procedures.
    """

    answers: Answers
    say: Callable[[str], None]
    show: Callable[[str], None]
    pauses: bool = False


class Ways(NamedTuple):
    """How devices are reached: as for `session.run`."""

    clock: str = "real"
    simulate: Simulate = ()
    attach: bool = False
    allow_unwatched: bool = False
    configure: bool = False


class Guided(NamedTuple):
    """A procedure that came to its end: its result, and what the devices said of themselves.

    `unwatched` are axes whose devices no watchdog stops.
    """

    result: Any
    identities: Mapping[str, Mapping[str, str]]
    notes: list[str]
    unwatched: Sequence[str] = ()


def ask_without_devices(
    talk: Conversation, question: str, read: Callable[[str], str] = confirmed
) -> str:
    """Ask while no device is open until there is an answer that can be read; return it.

    Raises
    ------
    Declined
        The person said no.
    """
    clock, said = MonotonicClock(), question
    while True:
        talk.say(said)
        talk.answers.ask(clock.now_ns())
        while (answer := talk.answers.take(clock.now_ns())) is None:
            clock.sleep_until(clock.now_ns() + LOOK_NS)
        try:
            return read(answer)
        except Misread as err:
            said = f"{answer!r}: {err}. {question}"
        except Declined as err:
            raise Declined(f"{err} to: {question}") from None


def run_guided(
    rig: Rig,
    guide: Guide,
    talk: Conversation,
    *,
    out: Path,
    torque: bool,
    guarded: bool,
    ways: Ways,
) -> Guided:
    """Lead a person through a procedure; without `torque` no device is enabled.

    Parameters
    ----------
    out : Path
        Directory for rig.yaml and recording.mcap.
    guarded : bool
        Stop at the limits of the rig.

    Raises
    ------
    TautwaveError
        The rig is refused, a device or the procedure failed, or nobody answers.
    """
    require_drivers(rig)
    taken = bus_ways(rig, clock=ways.clock, simulate=ways.simulate, attach=ways.attach)
    rig = as_taken(rig, taken)
    problems = over_budget(rig, bus_budgets(rig))
    if problems:
        raise BusBudgetError("\n".join(problems))
    # Devices simulated in this process are held until they are enabled.
    torque = torque or any(way.way is Way.MEMORY for way in taken.values())
    here = any(way.way in (Way.MEMORY, Way.SERVED) for way in taken.values())
    longest_s = SIMULATED_S if here else LONGEST_S
    with run_directory(out) as keep, devices(rig, taken) as taken:
        assembly = build_rig(
            rig,
            clock=ways.clock,
            duration_s=longest_s,
            ways=taken,
            allow_unwatched=ways.allow_unwatched,
            configure=ways.configure,
        )
        assembly = _guided(rig, assembly, guide, talk, torque=torque, guarded=guarded)
        text = resolved_yaml(rig)
        write_text(out / "rig.yaml", text)
        recorder = Recorder(
            out / "recording.mcap",
            assembly.columns,
            metadata=metadata_of(rig, ways.clock, assembly.columns),
            attachments={"rig.yaml": text.encode()},
            rows=rig.loop.ring_rows,
            lossless=ways.clock == "fake",
            rate_hz=rig.rate_hz,
        )
        loop = Loop(
            assembly.clock, assembly.buses, assembly.control, assembly.sources, recorder,
            torque=torque, begun=recorder.begin, opened=warning(assembly.buses, talk.say),
        )  # fmt: skip
        with interrupts() as heard, heard.calling(loop.stop):
            recorder.start()
            with loop_conditions(rig, ways.clock), quiet_collector():
                result = loop.run()
            for simulator in assembly.simulators:
                simulator.close()
            stats = recorder.close()
        if result.opened:
            keep()
    refuse_enabled(assembly.buses, result.error)
    if result.interrupted or isinstance(result.error, KeyboardInterrupt):
        raise Interrupted(heard.number)
    if isinstance(result.error, TautwaveError):
        raise result.error
    if result.error is not None:
        raise TautwaveError(
            f"{type(result.error).__name__}: {result.error}; all axes stopped safely"
        ) from result.error
    if stats.error:
        raise WritingError(stats.error)
    control = assembly.control
    assert isinstance(control, GuidedControl)
    if not control.over:
        raise ConfigError(f"the procedure did not finish within {longest_s:g} s")
    reported = {k: v for bus in assembly.buses for k, v in identities(bus.driver).items()}
    notes = [note for bus in assembly.buses for note in getattr(bus.driver, "notes", ())]
    unwatched = [name for bus in assembly.buses for name in bus.driver.unwatched]
    return Guided(control.result, reported, notes, unwatched)


def _witness(assembly: Assembly) -> Callable[[str], tuple[float, float]]:
    """Return what the devices say of velocity and motor effort beside their samples."""
    by_axis = {
        name: witness
        for bus in assembly.buses
        if (witness := getattr(bus.driver, "witness", None)) is not None
        for name in bus.axes
    }

    def tell(name: str) -> tuple[float, float]:
        told: tuple[float, float] = by_axis[name](name) if name in by_axis else (math.nan, math.nan)
        return told

    return tell


def _guided(
    rig: Rig,
    assembly: Assembly,
    guide: Guide,
    talk: Conversation,
    *,
    torque: bool,
    guarded: bool,
) -> Assembly:
    """Return the assembly with a guide in place of its controller."""
    run = assembly.control.run
    if not torque:  # nothing can happen while a sample is missing
        patience = round(PATIENCE_S * rig.rate_hz)
        run = run._replace(missing_limit=patience, overrun_limit=patience)
    delays = {name: bus.driver.command_delay for bus in assembly.buses for name in bus.axes}
    params = []
    at = 0
    for name, delay in delays.items():
        params.append(controlled_axis(rig, name, delay, bare_site(rig, name, delay), at, end=None))
        at += PIPE * delay.periods
    control = GuidedControl(
        run, axis_names(rig, tuple(delays)), params, [0.0] * at, guide,
        talk.answers, talk.say, talk.show, guarded=guarded,
    )  # fmt: skip
    control.witness = _witness(assembly)
    control.watchdogs = lambda: {
        name: bus.driver.watchdog_s.get(name) for bus in assembly.buses for name in bus.axes
    }
    clock = assembly.clock
    control.silence = lambda seconds: clock.sleep_until(clock.now_ns() + round(1e9 * seconds))
    sources = [control, *assembly.sources[1:]]
    columns = [*TIMING_COLUMNS, *(name for source in sources for name in source.columns)]
    return assembly._replace(control=control, sources=sources, columns=columns)
