"""Sites, pairs and a scripted driver of which every call can be made to fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tautwave.clock import FakeClock
from tautwave.laws.admittance import admittance_params
from tautwave.laws.limit import LimitParams
from tautwave.laws.port import port_params, rigid_port
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import WallParams
from tautwave.link.memory import DelayLine
from tautwave.runtime.books import PairRow
from tautwave.runtime.loop import TIMING_COLUMNS, Loop, LoopPair, LoopSettings
from tautwave.runtime.pair import PairScale, WavePair
from tautwave.runtime.sensing import LoopBus
from tautwave.runtime.site import SiteAxis
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tests.rigs.running import ListSink

T = 1e-3
PERIOD_NS = 1_000_000
NO_WALL = WallParams(0.0, 1.0, 0.0, 0.0, controlled=False)
WIDE = LimitParams(1e6, math.inf, 0.0, math.inf, -math.inf, math.inf, 0.0)


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
    allowance: float = 0.0,
    delay: int = 0,
    late: float = 0.0,
    admittance: bool = False,
    upper: float = 0.0,
    velocity_quantum: float = 0.0,
) -> SiteAxis:
    """Return one axis of a wave coupling."""
    port = port_params(T, b, mass, matched, 0.05, allowance)
    if admittance:
        port = rigid_port(T, b, 0.05, allowance)
    params = SiteParams(
        port, admittance_params(T, b, upper, delay), wall or NO_WALL, limit, gain, 0.0, 0.0,
        velocity_quantum, has_wall=wall is not None,
    )  # fmt: skip
    return SiteAxis(params, delay_periods=delay, late_share=late, impedance=not admittance)


def state(position: float = 0.0, effort: float = math.nan, valid: bool = True) -> JointState:
    """Return a fresh sample."""
    return JointState(position, math.nan, effort, valid, 0)


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
        master: SiteAxis | None = None,
        slave: SiteAxis | None = None,
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
        self.master = master or site()
        self.slave = slave or site()
        self.hand = ScriptedDriver("hand", log=self.log, **(hand or {}))  # type: ignore[arg-type]
        self.arm = ScriptedDriver("arm", log=self.log, **(arm or {}))  # type: ignore[arg-type]
        self.pair = WavePair(
            "a", self.master, self.slave, PairScale(1.0, 1.0, 1.0, 1.0),
            DelayLine(line, T) if line else None, None,
        )  # fmt: skip
        source = PairRow(self.pair)
        self.columns = [*TIMING_COLUMNS, *source.columns]
        super().__init__(len(self.columns))
        self._on_commit = on_commit
        self.clock = FakeClock(oversleep=oversleep)
        self.loop = Loop(
            self.clock,
            LoopSettings(PERIOD_NS, cycles, engage, release, missing_limit, overrun_limit),
            [
                LoopBus("hand", self.hand, [self.master], ["master.a"]),
                LoopBus("arm", self.arm, [self.slave], ["slave.a"]),
            ],
            [LoopPair(self.pair, 0, 1, offset, tolerance)],
            [source],
            self,
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
