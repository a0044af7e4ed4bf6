"""The control loop: sense, close, think, act, record, sleep. One thread, absolute deadlines.

Whatever ends it (time, Ctrl-C, a limit, a fault, a bug), the last commands are each axis' safe
command, then `disable`, then `close`; that is the one promise this file makes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple, Protocol

from tautwave.contracts import READ_SHARE, Clock, Row, RowSource
from tautwave.errors import BusTimeout, SafetyStop, TautwaveError
from tautwave.laws.limit import OVERDRAWN, RUNAWAY
from tautwave.runtime.pair import Pair
from tautwave.runtime.sensing import LoopBus, Sensing
from tautwave.runtime.timing import Histogram
from tautwave.types import SAFE_COMMAND, Fault

ARM_SHARE = 0.1
"""The engage ramp begins when every effort asked for is below this share of its limit."""

ENABLE_TIMEOUT_S = 10.0
ARM_TIMEOUT_S = 5.0
GUARDS = {
    1: "left its position range",
    2: "exceeded its velocity limit",
    3: "is not finite",
    RUNAWAY: "is asked by its scene for over a million times its effort limit",
    OVERDRAWN: "got more energy out of its scene than went in, since efforts are held for a period "
    "(raise rate_hz, or lower the stiffness that it meets),",
}
TIMING_COLUMNS = ("time_s", "lateness_us", "compute_us", "skipped_slots")


class LoopSettings(NamedTuple):
    """How the loop runs: period [ns], cycles to run, engage and release ramps [cycles], limits."""

    period_ns: int
    cycles: int
    engage_cycles: int
    release_cycles: int
    missing_limit: int
    overrun_limit: int


class LoopPair(NamedTuple):
    """One pair, where its samples come from, and how it engages.

    `master_at`, `slave_at` index the flat list of all axes in bus order. `offset` is None to take
    the one found at engagement; a start mismatch above `tolerance` [slave's rad or m] refuses.
    """

    pair: Pair
    master_at: int
    slave_at: int
    offset: float | None
    tolerance: float


class RowSink(Protocol):
    """Where rows go: the recorder, or a list in tests."""

    @property
    def row(self) -> Row:
        """The row to fill; the same object in every cycle."""

    @property
    def commit(self) -> Callable[[], object]:
        """Take the row as it stands."""


class LoopResult(NamedTuple):
    """How a run went. `error` is what ended it early, or None; `faults` are whole sentences."""

    cycles: int
    missed_cycles: int
    lost: Sequence[int]
    late: Sequence[int]
    faults: Sequence[Fault]
    error: BaseException | None
    interrupted: bool


class Loop:
    """One run of one rig.

    Parameters
    ----------
    clock : Clock
        Real or fake.
    settings : LoopSettings
        Period, length, ramps and limits.
    buses, pairs : sequences
        What is moved.
    sources : sequence of RowSource
        Who fills the columns after the timing columns, in this order.
    sink : RowSink
        Where rows go.
    progress : callable, optional
        Called now and then with the share done and a word.
    """

    def __init__(
        self,
        clock: Clock,
        settings: LoopSettings,
        buses: Sequence[LoopBus],
        pairs: Sequence[LoopPair],
        sources: Sequence[RowSource],
        sink: RowSink,
        progress: Callable[[float, str], None] | None = None,
    ) -> None:
        self._clock = clock
        self._settings = settings
        self._buses = buses
        self._pairs = pairs
        self._sources = []
        at = len(TIMING_COLUMNS)
        for source in sources:
            self._sources.append((source.fill, at))
            at += len(source.columns)
        self._sink = sink
        self._progress = progress
        self._sensing = Sensing(buses, settings.period_ns, settings.missing_limit)
        self._patience_ns = int(READ_SHARE * settings.period_ns)
        self._wake_ns = 0
        self._last_wake_ns = 0
        self._end = settings.cycles
        self._armed_at = -1
        self._error: TautwaveError | None = None
        self._stop_asked = False
        self._leave_now = False
        self.lateness = Histogram()
        self.period = Histogram()
        self.compute = Histogram()

    # -- asked from outside ---------------------------------------------------------------

    def stop(self) -> None:
        """Ask for a ramp down (first call) or for an end at once (second); safe in a signal."""
        if self._stop_asked:
            self._leave_now = True
        self._stop_asked = True

    # -- the run ----------------------------------------------------------------------------

    def run(self) -> LoopResult:
        """Open, enable, run all cycles, and leave every axis safe, whatever happens."""
        cycles = missed = 0
        error: BaseException | None = None
        try:
            for bus in self._buses:
                bus.driver.open()
            self._enable()
            for cycles, missed in self._cycles():  # noqa: B007  both are read after the loop
                pass
        except (Exception, KeyboardInterrupt) as err:  # noqa: BLE001  reported by the caller
            error = err
        finally:
            self._leave()
        return LoopResult(
            cycles,
            missed,
            tuple(self._sensing.lost),
            tuple(self._sensing.late),
            tuple(self._sensing.faults),
            error if error is not None else self._error,
            self._stop_asked,
        )

    def _enable(self) -> None:
        """Step every bus' enabling, one step a period of the bus, until all are on."""
        period = self._settings.period_ns
        on = [False] * len(self._buses)
        step = 0
        deadline = self._clock.now_ns()
        limit = deadline + int(ENABLE_TIMEOUT_S * 1e9)
        while True:
            # Those that are on already are stepped too: their drives watch for silence.
            for number, bus in enumerate(self._buses):
                if step % bus.divisor == 0:
                    on[number] = bus.driver.enable_step()
            step += 1
            waiting = [bus for bus, done in zip(self._buses, on, strict=True) if not done]
            if not waiting:
                return
            if self._stop_asked:
                raise KeyboardInterrupt
            if self._clock.now_ns() > limit:
                names = ", ".join(bus.name for bus in waiting)
                raise BusTimeout(
                    f"bus {names}: not enabled after {ENABLE_TIMEOUT_S:g} s; "
                    "look at the drive's state and its faults"
                )
            deadline += period
            self._clock.sleep_until(deadline)

    def _cycles(self) -> Iterator[tuple[int, int]]:
        """Run cycle after cycle; yield (cycles run, slots skipped) so far."""
        settings = self._settings
        clock = self._clock
        period = settings.period_ns
        deadline = clock.now_ns()
        slot = cycles = missed = skipped = 0
        self._last_wake_ns = deadline - period
        while slot < self._end:
            self._wake_ns = now = clock.now_ns()
            self.lateness.add(now - deadline)
            self.period.add(now - self._last_wake_ns)
            self._last_wake_ns = now
            self._cycle(slot, skipped, now - deadline, deadline + self._patience_ns)
            cycles += 1
            yield cycles, missed
            if self._leave_now:
                return
            if self._stop_asked and self._end == settings.cycles:
                self._end = min(self._end, slot + 1 + settings.release_cycles)
            if self._progress is not None and cycles & 63 == 0:
                self._progress(slot / self._end, "running")
            deadline += period
            slot += 1
            clock.sleep_until(deadline)
            # Slots that passed while we were late are skipped and counted, never run twice.
            skipped = (clock.now_ns() - deadline) // period
            if skipped > 0:
                slot += skipped
                deadline += skipped * period
                missed += skipped
                if skipped >= settings.overrun_limit:
                    error = SafetyStop(
                        f"{skipped} slots of {period / 1e6:g} ms were missed in a row at "
                        f"{slot * period / 1e9:.3f} s; the host is too slow or was stopped"
                    )
                    self._begin_stop(slot, error)
            else:
                skipped = 0

    def _cycle(self, slot: int, skipped: int, late_ns: int, deadline_ns: int) -> None:
        """One cycle: sense, close and think, act, record."""
        error = self._sensing.sense(slot, deadline_ns)
        if error is not None and self._error is None:
            self._begin_stop(slot, error)
        if self._armed_at < 0:
            self._engage(slot)
        else:
            ramp = self._ramp(slot)
            states = self._sensing.states
            guard = 0
            for at in self._pairs:
                pair = at.pair
                pair.cycle(states[at.master_at], states[at.slave_at], skipped, ramp)
                guard |= pair.guard
            if guard and self._error is None:
                self._stop_on_guard(slot)
        for bus in self._buses:
            if bus.due(slot):
                bus.driver.write([site.axis_command() for site in bus.sites])
        sink = self._sink
        row = sink.row
        row[0] = slot * self._settings.period_ns * 1e-9
        row[1] = late_ns * 1e-3
        row[3] = skipped
        for fill, at_column in self._sources:
            fill(row, at_column)
        spent = self._clock.now_ns() - self._wake_ns
        row[2] = spent * 1e-3
        self.compute.add(spent)
        sink.commit()

    # -- engaging and stopping --------------------------------------------------------------

    def _engage(self, slot: int) -> None:
        """Start the pairs at what is measured; arm the ramp once every asked effort is small."""
        if self._error is not None:
            return  # a stop has begun: nothing engages any more
        states = self._sensing.states
        armed = True
        for at in self._pairs:
            master, slave = states[at.master_at], states[at.slave_at]
            if not (master.valid and slave.valid):
                armed = False
                continue
            if at.offset is not None:
                gap = at.pair.mismatch(master.position, slave.position, at.offset)
                if abs(gap) > at.tolerance:
                    raise SafetyStop(
                        f"pair {at.pair.name}: master and slave start {gap:+.6g} apart, more than "
                        f"engage_tolerance {at.tolerance:g}; move one of them, or use "
                        "offset: at_engage"
                    )
            at.pair.start(master, slave, at.offset)
            armed = at.pair.arm(ARM_SHARE) and armed
        if armed:
            self._armed_at = slot
            ramp = self._ramp(slot)
            for at in self._pairs:
                at.pair.slot = slot
                at.pair.engage(ramp)
        elif slot * self._settings.period_ns > ARM_TIMEOUT_S * 1e9:
            raise SafetyStop(
                f"not engaged after {ARM_TIMEOUT_S:g} s: an axis is not measured, or asks for "
                f"more than {ARM_SHARE:.0%} of its effort limit while standing; "
                "move the axes out of their walls"
            )

    def _ramp(self, slot: int) -> float:
        """Return the share of the limits allowed in this slot, 0 to 1."""
        settings = self._settings
        share = 1.0
        rise = slot + 1 - self._armed_at
        if rise < settings.engage_cycles:
            share = rise / settings.engage_cycles
        left = self._end - slot
        if left < settings.release_cycles:
            share *= left / settings.release_cycles
        return share

    def _begin_stop(self, slot: int, error: TautwaveError) -> None:
        """Begin a passive stop: certified damping instead of coupling, ramped to zero."""
        if self._error is None:
            self._error = error
        for at in self._pairs:
            at.pair.master.stopping = True
            at.pair.slave.stopping = True
        self._end = min(self._end, slot + 1 + self._settings.release_cycles)

    def _stop_on_guard(self, slot: int) -> None:
        """Stop because a limit was passed; the first axis that did is named."""
        for at in self._pairs:
            for side, code in (("master", at.pair.guard & 7), ("slave", at.pair.guard >> 3)):
                if code:
                    site = at.pair.master if side == "master" else at.pair.slave
                    error = SafetyStop(
                        f"{side}.{at.pair.name} {GUARDS[code]} at "
                        f"{slot * self._settings.period_ns / 1e9:.3f} s: position "
                        f"{site.position:.6g}, velocity {site.velocity:.6g}"
                    )
                    self._begin_stop(slot, error)
                    return

    def _leave(self) -> None:
        """Safe command on every axis, then disable, then close; nothing stops this."""
        buses = self._buses
        calls = [partial(bus.driver.write, [SAFE_COMMAND] * len(bus.axes)) for bus in buses]
        calls += [partial(bus.driver.disable) for bus in buses]
        calls += [partial(bus.driver.close) for bus in buses]
        for call in calls:
            with suppress(Exception, KeyboardInterrupt):
                call()
