"""Sites, pairs and a scripted driver of which every call can be made to fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from tautwave.clock import FakeClock
from tautwave.controller.axis import (
    close_axis,
    decide_command,
    is_calm,
    miss_sample,
    pass_slot,
    start_axis,
    stored_in_wall,
)
from tautwave.controller.braking import stop_axis
from tautwave.controller.pair import (
    cycle_pair,
    effort_error,
    engage_pair,
    position_error,
    start_pair,
)
from tautwave.controller.records import (
    PIPE,
    AxisParams,
    AxisState,
    PairParams,
    PairView,
    RunParams,
    Sample,
)
from tautwave.controller.steps import NoParams
from tautwave.controller.stops import AxisName
from tautwave.couplings.position.law import PositionEndParams
from tautwave.couplings.position.law import law as position_law
from tautwave.couplings.wave.law import law as wave_law
from tautwave.couplings.wave.port import WaveEndParams, receive_wave, start_end, waiting_energy
from tautwave.laws.limit import LimitParams
from tautwave.laws.observer import observer_params, plain_observer
from tautwave.laws.port import port_params
from tautwave.laws.servo.admittance import admittance_params, rigid_port
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import NO_WALL, WallParams
from tautwave.laws.wave_filter import filter_gain
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.loop import TIMING_COLUMNS, Loop
from tautwave.runtime.sensing import LoopBus
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tests.rigs.running import ListSink

T = 1e-3
PERIOD_NS = 1_000_000
WIDE = LimitParams(effort=1e6)


def swing(axis: int, cycle: int) -> float:
    return 0.01 * math.sin(0.3 * cycle)


def site(
    *,
    b: float = 10.0,
    mass: float = 0.5,
    limit: LimitParams = WIDE,
    wall: WallParams | None = None,
    matched: bool = False,
    gain: float = 1.0,
    reserve: float = 1.0,
    leak: float = 0.0,
    filter_hz: float | None = None,
    pole: float | None = None,
    delay: int = 0,
    late: float = 0.0,
    admittance: bool = False,
    upper: float = 0.0,
    velocity_quantum: float = 0.0,
    wave: float = 1.0,
    divisor: int = 1,
    spring: tuple[float, float] | None = None,
) -> Axis:
    """Return one axis of a wave coupling, or of a position coupling with this K and B."""
    period = divisor * T
    step = 1.0 if filter_hz is None else filter_gain(filter_hz, period)
    port = port_params(
        period, b, mass, delay=delay + late, matched=matched, filter_gain=step, reserve=reserve,
        leak=leak,
    )  # fmt: skip
    if admittance:
        port = rigid_port(period, b, filter_gain=step, reserve=reserve, leak=leak)
    params = SiteParams(
        period, port.half_mobility, wall or NO_WALL, limit, gain, velocity_quantum,
        has_wall=wall is not None,
    )  # fmt: skip
    seen = plain_observer(period, mass)
    if pole is not None:
        seen = observer_params(period, mass, pole)
    end: Any = WaveEndParams(
        port, seen, admittance_params(period, b, upper, delay), wave, 1e-12,
        0.0, late, delay, round(1.0 / period), 0.1, 0.0, math.inf, 1000,
    )  # fmt: skip
    if spring is not None:
        end = PositionEndParams(*spring)
    return Axis(
        AxisParams(
            params, 0.5 * period, late, limit.velocity if admittance else limit.effort, 1.0,
            delay, 0, not admittance, divisor, 0.5 * T, end,
        )
    )  # fmt: skip


class Axis:
    """One axis of the controller with a table of its own; its state's numbers are attributes."""

    def __init__(self, params: AxisParams) -> None:
        self.params = params
        self.table = [0.0] * (PIPE * params.delay)
        self.law = wave_law if isinstance(params.end, WaveEndParams) else position_law
        self.state = AxisState(end=self.law.end())
        self.start(0.0, math.nan, 0.0)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.state if hasattr(self.state, name) else self.state.end, name)

    def start(self, position: float, outside: float, gap: float) -> None:
        start_axis(self.state, self.params, position, outside)
        if self.law is wave_law:
            start_end(self.state, self.params, gap)

    def pass_slot(self) -> None:
        pass_slot(self.state, self.params, self.table, self.law.steps)

    def receive(self, wave: float) -> None:
        receive_wave(self.state, self.params, wave)

    def miss(self) -> None:
        miss_sample(self.state, self.params, self.law.steps)

    def close(self, position: float, outside: float) -> None:
        close_axis(self.state, self.params, position, outside, self.law.steps)

    def think(self, ceiling: float) -> int:
        return decide_command(self.state, self.params, self.table, ceiling, self.law.steps)

    def stop(self, ceiling: float) -> None:
        stop_axis(self.state, self.params, ceiling)

    def waiting_energy(self) -> float:
        return waiting_energy(self.state, self.params, self.table)

    def wall_stored(self) -> float:
        return stored_in_wall(self.state, self.params)


class Pair:
    """A pair as the controller runs it; the axes given are used up.

    `scale` and `sign` map positions, `power` is the energy of the slave per energy of the pair.
    `rated` sends even a pair without a slow side through the slots of one.
    """

    def __init__(
        self,
        master: Axis,
        slave: Axis,
        *,
        line: int = 0,
        scale: float = 1.0,
        sign: float = 1.0,
        power: float = 1.0,
        offset: float | None = None,
        tolerance: float = math.inf,
        rated: bool = False,
        run: RunParams | None = None,
    ) -> None:
        one, two = master.params, slave.params
        rated = rated or max(one.divisor, two.divisor) > 1
        two = two._replace(pipe=PIPE * one.delay, weight=1.0 / power)
        law = master.law
        at = PIPE * (one.delay + two.delay)
        q = PairParams(
            0, 1, rated, offset is None, sign * scale, sign, power / scale, sign / scale,
            1.0 / power, T, 0.5 * T, 0.0 if offset is None else offset, tolerance, line, at,
            NoParams(),
        )  # fmt: skip
        self.control = CoupledControl(
            run or RunParams(PERIOD_NS, 20, 2, 1, 0, 5, 4, 50, 0.1, 5e9),
            [AxisName("master.a", "hand", "rad"), AxisName("slave.a", "arm", "rad")],
            [one, two],
            ["a"],
            [q],
            [0.0] * (at + law.rings * line),
            law,
        )
        self.q, self.c = q, self.control.states[0]
        self.master, self.slave = (Axis(p) for p in (one, two))
        for axis, own in zip((self.master, self.slave), self.control.axes, strict=True):
            axis.state, axis.table = own, self.control.table
        self.weight = q.weight
        self.slot = 0

    def _view(self) -> PairView:
        one, two = self.master, self.slave
        states, params = (one.state, two.state), (one.params, two.params)
        return PairView(self.c, self.q, *states, *params, self.control.table)

    def start(self, master: Sample, slave: Sample) -> None:
        start_pair(self._view(), master, slave, self.control.law.steps)

    def engage(self, ramp: float) -> None:
        engage_pair(self._view(), ramp, self.control.law.steps)

    def cycle(self, master: Sample, slave: Sample, skipped: int, ramp: float) -> None:
        self.slot += 1 + skipped
        rest = self.slot, skipped, ramp, self.control.law.steps
        cycle_pair(self._view(), master, slave, *rest)

    def arm(self, share: float) -> bool:
        return all(is_calm(axis.state, axis.params, share) for axis in (self.master, self.slave))

    def position_error(self) -> float:
        return position_error(self._view())

    def effort_error(self) -> float:
        return effort_error(self._view())

    def elements(self) -> dict[str, tuple[float, float, float]]:
        """Return absorbed, stored and dissipated energy of every element, from their columns."""
        row = [0.0] * len(self.control.columns)
        self.control.fill(row, 0)
        values = dict(zip(self.control.columns, row, strict=True))
        parts = ("absorbed", "stored", "dissipated")
        return {
            name: tuple(values[f"a.{name}.{part}"] for part in parts)  # type: ignore[misc]
            for name in self.control.elements("a")
        }


def state(position: float = 0.0, effort: float = math.nan, valid: bool = True) -> Sample:
    """Return a fresh sample."""
    return Sample(position, effort, valid)


class ScriptedDriver:
    """A driver whose samples, faults and failures are written down beforehand.

    `fails` maps (method, how many calls before it) to what is raised. Every call is logged in
    `log`, shared between drivers, as (bus, method).
    """

    def __init__(
        self,
        name: str,
        axes: int = 1,
        *,
        positions: Callable[[int, int], float] = lambda axis, cycle: 0.0,
        valid: Callable[[int, int], bool] = lambda axis, cycle: True,
        efforts: Callable[[int, int], float] = lambda axis, cycle: math.nan,
        fails: dict[tuple[str, int], BaseException] | None = None,
        enable_steps: int = 1,
        faults: dict[int, Fault] | None = None,
        log: list[tuple[str, str]] | None = None,
        states: int | None = None,
    ) -> None:
        self.name = name
        self.axes = axes
        self.command_delay = CommandDelay(0, 0.0)
        self.positions, self.valid, self.efforts = positions, valid, efforts
        self.fails = fails or {}
        self.enable_steps = enable_steps
        self.script = faults or {}
        self.log = [] if log is None else log
        self.written: list[list[AxisCommand]] = []
        self.counts: dict[str, int] = {}
        self.cycle = -1
        self.states = axes if states is None else states

    def _call(self, method: str) -> int:
        count = self.counts.get(method, 0)
        self.counts[method] = count + 1
        self.log.append((self.name, method))
        if (method, count) in self.fails:
            raise self.fails[method, count]
        return count

    def open(self) -> None:
        self._call("open")

    def enable_step(self) -> bool:
        return self._call("enable_step") + 1 >= self.enable_steps

    def request(self) -> None:
        self.cycle = self._call("request")

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        self._call("read")
        return [
            JointState(
                self.positions(axis, self.cycle), math.nan, self.efforts(axis, self.cycle),
                self.valid(axis, self.cycle), 0,
            )
            for axis in range(self.states)
        ]  # fmt: skip

    def write(self, commands: Sequence[AxisCommand]) -> None:
        self.written.append(list(commands))
        self._call("write")

    def faults(self) -> Sequence[Fault]:
        count = self._call("faults")
        return [self.script[count]] if count in self.script else []

    def disable(self) -> None:
        self._call("disable")

    def close(self) -> None:
        self._call("close")


class Bench(ListSink):
    """One pair on two scripted buses, in a loop; the bench is its sink, too."""

    def __init__(
        self,
        *,
        cycles: int = 20,
        master: Axis | None = None,
        slave: Axis | None = None,
        line: int = 0,
        offset: float | None = None,
        tolerance: float = math.inf,
        engage: int = 0,
        release: int = 5,
        missing_limit: int = 4,
        overrun_limit: int = 50,
        oversleep: Callable[[int], int] | None = None,
        hand: dict[str, object] | None = None,
        arm: dict[str, object] | None = None,
        on_commit: Callable[[Bench], object] | None = None,
    ) -> None:
        self.log: list[tuple[str, str]] = []
        self.hand = ScriptedDriver("hand", log=self.log, **(hand or {}))  # type: ignore[arg-type]
        self.arm = ScriptedDriver("arm", log=self.log, **(arm or {}))  # type: ignore[arg-type]
        self.pair = Pair(
            master or site(),
            slave or site(),
            line=line,
            offset=offset,
            tolerance=tolerance,
            run=RunParams(
                PERIOD_NS, cycles, 2, 1, engage, release, missing_limit, overrun_limit, 0.1, 5e9
            ),
        )
        self.master, self.slave = self.pair.master, self.pair.slave
        source = self.pair.control
        self.columns = [*TIMING_COLUMNS, *source.columns]
        super().__init__(len(self.columns))
        self._on_commit = on_commit
        self.clock = FakeClock(oversleep=oversleep)
        self.begun: list[int] = []
        self.loop = Loop(
            self.clock,
            [LoopBus("hand", self.hand, ["master.a"]), LoopBus("arm", self.arm, ["slave.a"])],
            source,
            [source],
            self,
            begun=self.begun.append,
        )

    def commit(self) -> None:
        super().commit()
        if self._on_commit is not None:
            self._on_commit(self)

    def column(self, name: str) -> list[float]:
        at = self.columns.index(name)
        return [row[at] for row in self.rows]

    def efforts(self, driver: ScriptedDriver) -> list[float]:
        """Return all efforts written to a bus' first axis, the last safe command included."""
        return [commands[0].effort for commands in driver.written]
