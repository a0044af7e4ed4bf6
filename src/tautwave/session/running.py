"""`run`: build, record, loop, and report, whatever happens."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import FakeClock, PacedClock
from tautwave.config import Rig, resolved_yaml
from tautwave.errors import ConfigError, TautwaveError
from tautwave.files import write_text
from tautwave.rig import Assembly, BusWay, Simulate, build_rig, real_buses
from tautwave.runtime.interrupts import Interrupted, interrupts
from tautwave.runtime.loop import Loop, LoopResult
from tautwave.runtime.machine import quiet_collector, realtime
from tautwave.runtime.operate.commands import Source
from tautwave.runtime.recorder import Recorder, RecorderStats
from tautwave.runtime.unwatched import warning
from tautwave.session.acceptance.accepted import comparing
from tautwave.session.admitting import admit
from tautwave.session.certified import (
    summary_block,
)
from tautwave.session.devices import devices
from tautwave.session.engine import compiled_devices, scene_devices, with_engine
from tautwave.session.facts import pair_facts, summary_claims
from tautwave.session.hooks import session_hooks
from tautwave.session.keeping import (
    VALUE_BYTES,
    backlog_warning,
    run_directory,
    warn_of_little_room,
    warn_of_slow_disk,
)
from tautwave.session.metadata import metadata_of
from tautwave.session.network import link_claims
from tautwave.session.operating import (
    claimed_span,
    engagements,
    operation_done,
    with_operation,
)
from tautwave.session.plan import left_out, rig_plan
from tautwave.session.reporting import outcome_of, recording_of, report_run
from tautwave.session.scales import scales_of
from tautwave.session.sites.agreed import with_sessions
from tautwave.session.viewing.cameras import cameras_of
from tautwave.session.viewing.facts import facts_of, mailbox_of, tell_end, tell_viewers
from tautwave.session.viewing.pointing import pointers_of
from tautwave.session.viewing.tuning import tuning_facts, tuning_of, with_tuning
from tautwave.summary import Summary, checked
from tautwave.summary.ending import last_line
from tautwave.summary.model import Axis, Bus, Camera, DeviceFault, Pair, Scene, Site, Spread, Tuned
from tautwave.summary.model import CommandDelay as CommandDelayOf
from tautwave.types import CommandDelay, Fault


class LoopOutcome(NamedTuple):
    """Result of a finished loop."""

    loop: Loop
    result: LoopResult
    stats: RecorderStats
    sentences: list[str]
    wall_time_s: float


class RunResult(NamedTuple):
    """A finished run, successful or not: its summary, its directory, and the exit code."""

    summary: Summary
    directory: Path
    exit_code: int

    @property
    def why(self) -> str:
        """How it ended, or why its exit code is not 0, as a clause."""
        sentence = last_line(self.summary.rig, self.summary, self.exit_code)
        return " ".join(sentence.splitlines()).rstrip(".")


@interrupts()
def run(
    rig: Rig,
    *,
    out: Path | str,
    clock: str = "real",
    duration_s: float | None = None,
    command: str = "",
    allow_uncertified: bool = False,
    allow_unwatched: bool = False,
    configure: bool = False,
    attach: bool = False,
    simulate: Simulate = (),
    allow_tuning: bool = False,
    scripts: Sequence[Source] = (),
    live: Sequence[Source] = (),
    progress: Callable[[float, str], None] | None = None,
    warn: Callable[[str], None] | None = None,
    accepting: bool = False,
    draw_later: bool = False,
) -> RunResult:
    """Run a rig and leave a run directory behind.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    out : Path
        Directory of the run; created if needed.
    clock : str
        `real`, or `fake` to run as fast as it computes.
    duration_s : float, optional
        Length [s], in place of the rig's own: that of its claims, and of the rig.yaml that is kept.
    command : str
        The command line of the run; kept in the summary.
    allow_uncertified : bool
        Move motors without a certificate.
    allow_unwatched, configure : bool
        Handed to drivers that have a watchdog or settings of their own.
    attach : bool
        Use simulated devices that are already served (`tautwave sim RIG`), instead of starting them
        with the run.
    simulate : bool or collection of str
        Buses to simulate although the rig names hardware; True: all. Otherwise a named serial port,
        TCP address or physical CAN channel is opened.
    allow_tuning : bool
        Let viewers change what the rig's parts declare to be tunable, each change certified.
    scripts, live : sequence of Source
        Where the commands of an operated rig come from: looked at in every cycle, and now and then.
    progress : callable, optional
        Called now and then with the fraction done and a short text.
    warn : callable, optional
        Called, before anything is enabled, with a sentence about each device that no watchdog of
        its own stops, and about real devices that were not accepted.
    accepting : bool
        This run is part of an acceptance, and not compared with an earlier one.
    draw_later : bool
        Return once the run is judged; report.html and its figures are drawn by a process that goes
        on after this one.

    Raises
    ------
    TautwaveError
        Nothing has moved: the rig is refused, or the run directory cannot be written. Later errors
        are in the result, not raised.
    """
    if duration_s is not None:
        if duration_s < rig.period_s:
            raise ConfigError(
                f"a duration of {duration_s:g} s is shorter than one cycle of {rig.period_s:g} s"
            )
        rig = rig.model_copy(update={"duration_s": duration_s})
    rig, ways, certificate = admit(
        rig, clock=clock, simulate=simulate, attach=attach, allow_uncertified=allow_uncertified
    )
    engine = None
    if rig.scene is not None:
        if progress is not None and clock == "real":
            progress(0.0, "measuring the scene")
        engine = session_hooks().choose_engine(rig, clock, ways)
        if progress is not None:
            for sentence in engine.warnings():
                progress(0.0, sentence)
    directory = Path(out)
    started = datetime.now(UTC)
    other = nullcontext() if rig.site is None else _other_site(rig, clock, progress)
    with (
        run_directory(directory) as keep,
        devices(rig, ways) as ways,
        other as link,
        mailbox_of(rig, clock) as mailbox,
    ):
        facts = facts_of(rig, certificate, mailbox)
        text = _kept_text(rig, directory)
        write_text(directory / "rig.yaml", text)
        assembly = build_rig(
            rig,
            clock=clock,
            ways=ways,
            allow_unwatched=allow_unwatched,
            configure=configure,
            devices=(
                compiled_devices(rig, progress)
                if engine is None
                else scene_devices(rig, engine.name)
            ),
        )
        posted = () if mailbox is None else (mailbox.source,)
        sources = [*live, *posted]
        assembly = with_operation(rig, with_engine(rig, assembly), scripts, sources, link)
        if engine is not None:
            assembly = session_hooks().use_engine(assembly, engine.name)
        with (
            tuning_of(rig, assembly, allow_tuning) as tuning,
            cameras_of(rig, clock, directory) as cameras,
            pointers_of(assembly) as pointed,
        ):
            assembly = with_tuning(assembly, tuning)
            facts["pointer"] = pointed
            facts["tuning"] = tuning_facts(rig, tuning, sorted(real_buses(ways)))
            real = [] if accepting else real_buses(ways)
            moved = _move(rig, clock, directory, text, assembly, progress, warn, keep, facts, real)
            if link is not None:
                link.leave(moved.result)
    if progress is not None:
        progress(1.0, "reporting")
    loop, result = moved.loop, moved.result
    outcome, exit_code = outcome_of(result, assembly)
    slots = result.cycles + result.missed_cycles
    pairs = _pairs(rig, assembly, slots)
    extra: dict[str, Any] = {}
    operation = operation_done(assembly, slots * rig.period_s)
    if operation is not None:
        extra["operation"] = operation
    if cameras:
        extra["cameras"] = {name: checked(Camera, one) for name, one in cameras.items()}
    if tuning is not None:
        extra["tuning"] = tuple(checked(Tuned, one) for one in tuning.summary())
    if engine is not None:
        extra["scene"] = checked(Scene, session_hooks().summary(assembly, engine.name))
    if link is not None:
        extra["link"] = site = checked(Site, link.summary(rig, assembly))
        pairs = with_sessions(pairs, site)
    summary = Summary(
        rig=rig.name,
        version=version("tautwave"),
        outcome=outcome,
        started_utc=started.isoformat(timespec="seconds"),
        command=command,
        clock=clock,
        asked_s=rig.duration_s,
        duration_s=slots * rig.period_s,
        rate_hz=rig.rate_hz,
        cycles=result.cycles,
        missed_cycles=result.missed_cycles,
        wall_time_s=moved.wall_time_s,
        period_us=Spread(**loop.period.summary()),
        lateness_us=Spread(**loop.lateness.summary()),
        compute_us=Spread(**loop.compute.summary()),
        realtime=(*moved.sentences, *(engine.sentences if engine is not None else ())),
        axes=_axes(assembly, result),
        faults=_faults(result.faults),
        certificate=summary_block(certificate, allow_uncertified),
        left_out=left_out(rig_plan(rig, clock=clock)),
        recording=recording_of(moved.stats),
        buses=_buses(assembly, ways),
        pairs=pairs,
        **extra,
    )
    summary, exit_code = report_run(directory, summary, exit_code, draw_later)
    return RunResult(summary, directory, exit_code)


def _other_site(
    rig: Rig, clock: str, progress: Callable[[float, str], None] | None
) -> AbstractContextManager[Any]:
    """Return a context in which the other site is joined."""
    if clock != "real":
        raise ConfigError(f"{rig.name}: --clock fake runs both sites in one process; leave --site")
    from tautwave.session.sites.joining import joined  # nothing else needs its sockets

    return joined(rig, lambda text: None if progress is None else progress(0.0, text))


def _kept_text(rig: Rig, directory: Path) -> str:
    """Return the rig.yaml of a run; copies of a scene's files are beside it."""
    if rig.scene is not None:
        rig = session_hooks().keep_files(rig, directory)
    return resolved_yaml(rig)


def _opened(
    rig: Rig, assembly: Assembly, real: Sequence[str], warn: Callable[[str], None]
) -> Callable[[], None]:
    """Return what is looked at when every bus is open; `real` are those with hardware."""
    unwatched = warning(assembly.buses, warn)
    compare = comparing(rig, [bus for bus in assembly.buses if bus.name in real], warn)

    def opened() -> None:
        for bus in assembly.buses:
            for sentence in getattr(bus.driver, "warnings", ()):
                warn(sentence)
        compare()
        unwatched()

    return opened


def _move(
    rig: Rig,
    clock: str,
    directory: Path,
    text: str,
    assembly: Assembly,
    progress: Callable[[float, str], None] | None,
    warn: Callable[[str], None] | None,
    keep: Callable[[], None],
    facts: dict[str, Any],
    real: Sequence[str],
) -> LoopOutcome:
    """Run the loop of a built rig with its recorder; call `keep` once it has begun.

    Raises
    ------
    TautwaveError, KeyboardInterrupt
        A bus was refused or a stop requested before all buses were open: nothing has moved.
    """
    rows = rig.duration_s * rig.rate_hz
    warn_of_little_room(directory, rows, len(assembly.columns), warn)
    waits = isinstance(assembly.clock, FakeClock)  # simulated time does, for the disk too
    if not waits:
        warn_of_slow_disk(directory, rig.rate_hz * len(assembly.columns) * VALUE_BYTES, warn)
    recorder = Recorder(
        directory / "recording.mcap",
        assembly.columns,
        metadata=metadata_of(rig, clock, assembly.columns),
        attachments={"rig.yaml": text.encode()},
        rows=rig.loop.ring_rows,
        lossless=waits,
        rate_hz=rig.rate_hz,
        live=facts,
    )
    tell_viewers(assembly, recorder)
    waiting = backlog_warning(lambda: recorder.backlog, warn)

    def going(share: float, text: str) -> None:
        waiting()
        if progress is not None:
            progress(share, text)

    loop = Loop(
        assembly.clock,
        assembly.buses,
        assembly.control,
        assembly.sources,
        recorder,
        progress if waits else going,
        begun=recorder.begin,
        opened=None if warn is None else _opened(rig, assembly, real, warn),
    )
    with interrupts() as heard, heard.calling(loop.stop):
        recorder.start()
        began = time.perf_counter()
        with loop_conditions(rig, clock) as sentences, quiet_collector():
            result = loop.run()
        tell_end(assembly, recorder, result)
        wall_time_s = time.perf_counter() - began
        for simulator in assembly.simulators:
            simulator.close()
        stats = recorder.close()
    if not result.opened:
        if isinstance(result.error, KeyboardInterrupt):
            raise Interrupted(heard.number)
        if isinstance(result.error, TautwaveError):
            raise result.error
    keep()
    if isinstance(assembly.clock, PacedClock):
        sentences.append(assembly.clock.sentence())
    return LoopOutcome(loop, result, stats, sentences, wall_time_s)


@contextmanager
def loop_conditions(rig: Rig, clock: str) -> Iterator[list[str]]:
    """Request real-time conditions on the real clock; a fake one needs none."""
    if clock != "real":
        yield ["fake clock: computing takes no time, so lateness and compute time are 0"]
        return
    keys = rig.loop
    with realtime(keys.fifo_priority, keys.cpu, keys.lock_memory) as sentences:
        yield sentences


def _axes(assembly: Assembly, result: LoopResult) -> dict[str, Axis]:
    names = [name for bus in assembly.buses for name in bus.axes]
    return {
        name: Axis(
            lost=result.lost[index],
            late=result.late[index],
            faults=_faults(fault for fault in result.faults if fault.axis == name),
        )
        for index, name in enumerate(names)
    }


def _faults(faults: Iterable[Fault]) -> tuple[DeviceFault, ...]:
    return tuple(
        DeviceFault(text=str(one.text), axis=one.axis or None, fatal=one.fatal) for one in faults
    )


def _buses(assembly: Assembly, ways: Mapping[str, BusWay]) -> dict[str, Bus]:
    return {
        bus.name: Bus(
            **ways[bus.name].as_dict(),
            command_delay=CommandDelayOf(**bus.driver.command_delay._asdict()),
            notes=tuple(map(str, getattr(bus.driver, "notes", ()))),
            watchdog_s=dict(bus.driver.watchdog_s),
            unwatched=dict(bus.driver.unwatched),
            unconfirmed=dict(bus.driver.unconfirmed),
        )
        for bus in assembly.buses
    }


def _pairs(rig: Rig, assembly: Assembly, cycles: int) -> dict[str, Pair]:
    delays = dict.fromkeys(rig.axes, CommandDelay(0, 0.0))  # another site's is not known here
    delays |= {name: bus.driver.command_delay for bus in assembly.buses for name in bus.axes}
    count = max(1, engagements(assembly))
    each = rig.model_copy(update={"duration_s": claimed_span(rig, cycles) / count})
    return {
        name: checked(
            Pair,
            {
                "kind": rig.master.axes[name].kind,
                **pair_facts(rig, name, delays)._asdict(),
                **summary_claims((each, *scales_of(each)), name, delays, count),
                **link_claims(rig, name, delays),
            },
        )
        for name in rig.coupling.pairs
    }
