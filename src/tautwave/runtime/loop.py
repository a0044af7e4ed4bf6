"""The control loop: sense, close, decide, act, record, sleep. One thread, absolute deadlines.

Whatever ends it (time, Ctrl-C, a limit, a fault, a bug), the last commands are each axis' safe
command, then `disable`, then `close`: the one guarantee of this file.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple, Protocol

from tautwave.columns import Column, names
from tautwave.contracts import READ_SHARE, Clock, Row, RowSource
from tautwave.controller.stops import CHECK_CABLE, StopPlace
from tautwave.errors import BusTimeout, DeviceFault, DriverError, SettingsDifferError, TautwaveError
from tautwave.runtime.control import Control
from tautwave.runtime.damping import DampingDriver
from tautwave.runtime.sensing import LoopBus, Sensing, bus_commands, first_axes
from tautwave.runtime.timing import Histogram
from tautwave.traffic import note_leaving, note_running
from tautwave.types import SAFE_COMMAND, Fault

ENABLE_TIMEOUT_S = 10.0
MAX_LATER = 3
"""Faults reported after the reason to end that its sentence names."""
TIMING = (
    Column("time_s", "s", "start of the slot, since the first one"),
    Column("lateness_us", "µs", "delay of the cycle's start after its slot"),
    Column("compute_us", "µs", "from there to the end of the cycle, including waiting for buses"),
    Column("skipped_slots", "", "slots skipped before this one, because the loop was late"),
)
"""What the loop writes into a row."""

TIMING_COLUMNS = tuple(names(TIMING))


class RowSink(Protocol):
    """Destination of the rows: the recorder, or a list in tests."""

    @property
    def row(self) -> Row:
        """The row to fill; the same object in every cycle."""

    @property
    def commit(self) -> Callable[[], object]:
        """Take the row."""


class LoopResult(NamedTuple):
    """Result of a run. `error` is what ended it early, or None; `faults` are full sentences.

    `stop` says where the controller or a device found the reason. `opened` is False if a bus was
    refused, or a stop requested, before all of them were open.
    """

    cycles: int
    missed_cycles: int
    lost: Sequence[int]
    late: Sequence[int]
    faults: Sequence[Fault]
    error: BaseException | None
    stop: StopPlace | None
    interrupted: bool
    opened: bool


class Loop:
    """One run of one rig.

    Parameters
    ----------
    clock : Clock
        Real or fake.
    buses : sequence of LoopBus
        The buses.
    control : Control
        The controller; its axes are those of the buses, in their order.
    sources : sequence of RowSource
        They fill the columns after the timing columns, in this order.
    sink : RowSink
        Destination of the rows.
    progress : callable, optional
        Called now and then with the fraction done and a short text.
    torque : bool
        Enable the devices; else they are only read.
    begun : callable, optional
        Called with the time of the first slot [ns] when it is there.
    opened : callable, optional
        Called when every bus is open and nothing is enabled yet, also after a reset.
    """

    def __init__(
        self,
        clock: Clock,
        buses: Sequence[LoopBus],
        control: Control,
        sources: Sequence[RowSource],
        sink: RowSink,
        progress: Callable[[float, str], None] | None = None,
        *,
        torque: bool = True,
        begun: Callable[[int], None] | None = None,
        opened: Callable[[], None] | None = None,
    ) -> None:
        self._clock = clock
        self._buses = buses
        self._control = control
        for bus in buses:
            if isinstance(bus.driver, DampingDriver):
                bus.driver.control = control  # that of the rig's assembly may have been replaced
        self._sources = []
        at = len(TIMING_COLUMNS)
        for source in sources:
            self._sources.append((source.fill, at))
            at += len(source.columns)
        self._sink = sink
        self._progress = progress
        self._torque = torque
        self._begun = begun
        self._opened = opened
        self._sensing = Sensing(buses, control)
        self._firsts = first_axes(buses)
        self._patience_ns = int(READ_SHARE * control.run.period_ns)
        self._wake_ns = 0
        self._last_wake_ns = 0
        self._stop_asked = False
        self._leave_now = False
        self.lateness = Histogram()
        self.period = Histogram()
        self.compute = Histogram()

    # -- requests from outside ------------------------------------------------------------

    def stop(self) -> None:
        """Request a ramp down (first call) or an immediate end (second); signal-safe."""
        if self._stop_asked:
            self._leave_now = True
        self._stop_asked = True

    # -- the run ----------------------------------------------------------------------------

    def run(self) -> LoopResult:
        """Open, enable, run all cycles, and leave every axis safe, whatever happens."""
        steps = self.steps()
        while True:
            try:
                next(steps)
            except StopIteration as ended:
                result: LoopResult = ended.value
                return result

    def steps(self) -> Generator[None, None, LoopResult]:
        """Run as `run` does, cycle by cycle; one that is closed has left every axis safe."""
        cycles = missed = 0
        opened = False
        error: BaseException | None = None
        try:
            self._open()
            opened = True
            if self._torque:
                self._enable()
            for cycles, missed in self._cycles():  # noqa: B007  both are read after the loop
                yield
        except (Exception, KeyboardInterrupt) as err:  # noqa: BLE001  reported by the caller
            error = err
        finally:
            self._leave()
        self._sensing.take_last_faults()
        return LoopResult(
            cycles,
            missed,
            tuple(self._sensing.lost),
            tuple(self._sensing.late),
            tuple(self._sensing.faults),
            error or self._sensing.fault or self._reason(),
            self._control.place(),
            self._stop_asked,
            opened,
        )

    def _reason(self) -> TautwaveError | None:
        """Return the controller's reason to end; of an axis unseen, what its driver knows of it.

        A silent device often says only later why it was silent, while the others are stopped or
        when it is switched off: then that ends the sentence.
        """
        error, place = self._control.error(), self._control.place()
        if not isinstance(error, DriverError) or place is None:
            return error
        sensing, text = self._sensing, str(error)
        why = sensing.misses.get(place.axis, "")
        later = list(dict.fromkeys(one.text for one in sensing.later_faults if one.fatal))
        if why or later:
            text = text.removesuffix(CHECK_CABLE)
        text = "; then ".join([f"{text}: {why}" if why else text, *later[:MAX_LATER]])
        return DeviceFault(text) if later else DriverError(text)

    def _open(self) -> None:
        """Open every bus, unless a stop is requested; settings that differ are those of all."""
        differ: list[SettingsDifferError] = []
        for bus in self._buses:
            if self._stop_asked:
                raise KeyboardInterrupt
            try:
                bus.driver.open()
            except SettingsDifferError as err:
                differ.append(err)
        if differ:
            raise SettingsDifferError(
                [name for one in differ for name in one.buses],
                [text for one in differ for text in one.differences],
            )
        if self._opened is not None:
            self._opened()

    def _enable(self) -> None:
        """Advance the enabling of every bus, one step per bus period, until all are on."""
        period = self._control.run.period_ns
        on = [False] * len(self._buses)
        step = 0
        deadline = self._clock.now_ns()
        limit = deadline + int(ENABLE_TIMEOUT_S * 1e9)
        while True:
            # Buses that are already on are stepped too, to feed their drives' watchdogs.
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
                    f"bus {names}: not enabled after {ENABLE_TIMEOUT_S:g} s; check the drive's "
                    "state and faults"
                )
            deadline += period
            now = self._clock.now_ns()
            if now >= deadline:
                # A slow host must give the drives time to respond: back-to-back steps would find
                # nothing.
                deadline = now + period
            self._clock.sleep_until(deadline)

    def _cycles(self) -> Iterator[tuple[int, int]]:
        """Run cycle after cycle; yield (cycles run, slots skipped) so far.

        Slots lie on an absolute grid, `period` apart from the first one on, and a cycle belongs to
        the slot in which it starts. Before: every device is open and, with torque, enabled. In a
        slot: note how late it is, run the cycle, then obey requests from outside (stop, reset),
        which is safe because nothing is under way. Sleeping is to the next grid point, never for a
        period: an error of one cycle does not add to the next. Whatever slots passed meanwhile are
        skipped, counted, and handed to the next cycle, which books them as they were, with the
        last command held. They are never run in a burst: that would send several commands in one
        period to drives that hold the last. Afterwards `slot` is the controller's end, or a
        reason to leave exists; `_leave` follows in either case.
        """
        clock = self._clock
        control = self._control
        period = control.run.period_ns
        deadline = clock.now_ns()
        note_running(clock)
        if self._begun is not None:
            self._begun(deadline)
        slot = cycles = missed = skipped = 0
        self._last_wake_ns = deadline - period
        while slot < control.end:
            self._wake_ns = now = clock.now_ns()
            self.lateness.add(now - deadline)
            self.period.add(now - self._last_wake_ns)
            self._last_wake_ns = now
            if not self._cycle(slot, skipped, now - deadline, deadline + self._patience_ns):
                return
            cycles += 1
            yield cycles, missed
            if self._leave_now:
                return
            if self._stop_asked:
                control.stop_after(slot)
            if self._progress is not None and cycles & 63 == 0:
                self._progress(slot / control.end, "running")
            if control.wants_reset:
                self._reset_devices(slot)
                passed = (clock.now_ns() - deadline) // period
                self._last_wake_ns += passed * period
                slot += passed
                missed += passed
                deadline += passed * period
            deadline += period + control.trim_ns
            slot += 1
            clock.sleep_until(deadline)
            # Slots that passed while we were late are skipped and counted, never made up.
            skipped = (clock.now_ns() - deadline) // period
            if skipped > 0:
                slot += skipped
                deadline += skipped * period
                missed += skipped
                control.overrun(slot, skipped)
            else:
                skipped = 0

    def _cycle(self, slot: int, skipped: int, late_ns: int, deadline_ns: int) -> bool:
        """Sense, compute, write, record; return False if the run must not begin.

        Samples come first, since everything else rests on them, and commands leave as early as
        they are known, before the row is filled: recording may not delay a motor. A bus is
        written in the slots in which it was read, so that a command never rests on older samples
        than its neighbour's. `deadline_ns` is the latest time for answers of this slot.
        """
        self._sensing.sense(slot, deadline_ns)
        control = self._control
        if not control.step(slot, skipped):
            return False
        for bus, first in zip(self._buses, self._firsts, strict=True):
            if bus.due(slot):
                bus.driver.write(bus_commands(control, bus, first))
        sink = self._sink
        row = sink.row
        row[0] = slot * control.run.period_ns * 1e-9
        row[1] = late_ns * 1e-3
        row[3] = skipped
        for fill, at_column in self._sources:
            fill(row, at_column)
        spent = self._clock.now_ns() - self._wake_ns
        row[2] = spent * 1e-3
        self.compute.add(spent)
        sink.commit()
        return True

    def _reset_devices(self, slot: int) -> None:
        """Torque off and close; then open and enable every bus as before the run."""
        self._leave()
        refusal = ""
        try:
            self._open()
            self._enable()
        except TautwaveError as err:
            refusal = str(err)
            self._leave()
        self._control.devices_are(slot, refusal)

    def _leave(self) -> None:
        """Safe command on every axis, then disable, then close; no error interrupts this.

        First every axis of every bus, then every disable: a bus that hangs in its disable must
        not keep another one pushing. Each call stands alone, because a driver that failed is the
        very reason to be here.
        """
        buses = self._buses
        calls: list[Callable[[], object]] = [partial(note_leaving, self._clock)]
        calls += [partial(bus.driver.write, [SAFE_COMMAND] * len(bus.axes)) for bus in buses]
        calls += [partial(bus.driver.disable) for bus in buses]
        calls += [partial(bus.driver.close) for bus in buses]
        for call in calls:
            with suppress(Exception, KeyboardInterrupt):
                call()
