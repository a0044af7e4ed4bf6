"""Devices that are none of ours at the drivers of a rig, moved by who wants its energy.

What `Stepper` leaves to its caller are axes that take efforts in every slot. Here the innermost
driver of every bus is replaced, whatever is wrapped around it: the joints behind a tip, a device
that takes velocities or goals, one on a slow bus, and those of an operated rig that engages again
and again. Moves and books are this module's own: an effort is held over a slot, so its work is
effort times displacement, whatever the motion; contact efforts change linearly, as both of their
ends move. Who moves the devices sees what the motors do, and changes his ways every few slots.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.rig import build_rig, command_delays, pair_scale
from tautwave.runtime.operate.commands import Order, Script
from tautwave.session.facts import stated_claims
from tautwave.session.operating import with_operation
from tautwave.simulation.memory import run_in_memory
from tautwave.types import AxisCommand, JointState
from tests.certificate.adversaries import Draw
from tests.runtime.stopping import innermost

PAUSE_S = 0.28
"""From when a pair is let go of until its ends move again: it engages at rest."""

SLOWER = 0.7
"""Of its velocity limit, as which no device is moved faster."""

WAYS = ("go", "go", "yield", "hold", "swing", "run", "dither", "loaded", "loaded")
LEANS = ("against", "against", "with", "swing", "hold", "far")


class Device(NamedTuple):
    """What is known of a device: from where to where it may be moved, how fast, its least mass.

    `spring`: of an axis that takes velocities or goals, what its contact is no stiffer than
    [N m/rad or N/m], else 0; `effort`: the most that it may meet or send [N m or N]; `damping`:
    what it takes of any motion for certain, where its energy counts less that.
    """

    low: float
    high: float
    speed: float
    mass: float
    effort: float
    spring: float = 0.0
    goal: bool = False
    damping: float = 0.0


class Mover:
    """One device, its drive, and who moves it."""

    def __init__(self, device: Device, place: float, period: float, draw: Draw) -> None:
        self.device, self.place, self.period, self.draw = device, place, period, draw
        self.contact = place
        self.goal = place
        self.acting = AxisCommand(0.0, 0.0)
        self.given = 0.0
        self._left = 0
        self._way, self._rested = "hold", False
        self._phase = self._rate = self._size = self._gain = 0.0
        self._velocity = self._anchor = 0.0

    def pass_slot(self, *, calm: bool) -> None:
        """Move by a slot, and book what the motor gave; `calm`: it is to come to rest."""
        if calm:
            self._way, self._left, self._rested = "hold", 1, True
        if self._left == 0:
            self._choose()
        self._left -= 1
        if self.device.spring > 0.0:
            self._meet()
            return
        effort = self.acting.effort
        step = self._step(effort)
        if not self.device.low <= self.place + step <= self.device.high:
            step = self._velocity = 0.0
        self.given += effort * step - self.device.damping * step * step / self.period
        self.place += step

    def _choose(self) -> None:
        draw, device = self.draw, self.device
        self._left = int(draw.magnitude(4.0, 300.0))
        self._way = draw.among(*(LEANS if device.spring > 0.0 else WAYS))
        if self._rested and device.spring == 0.0:  # a contact is loaded as the pair engages
            self._way = draw.among("loaded", "loaded", self._way)
        self._rested = False
        self._phase = draw.between(0.0, 2.0 * math.pi)
        self._rate = draw.magnitude(1e-3, 1.0) * math.pi / self.period
        self._size = draw.magnitude(0.01, 1.0)
        self._gain = draw.magnitude(0.05, 500.0)
        if self._way == "loaded":  # on a spring that already presses with a part of the effort
            stiff = device.mass * (draw.magnitude(0.01, 1.0) / self.period) ** 2
            load = draw.between(-0.9, 0.9) * device.effort
            self._rate, self._anchor = stiff, self.place + load / stiff
            self._velocity = 0.0

    def _step(self, effort: float) -> float:
        """Return how far a device that takes efforts goes in a slot."""
        device, most = self.device, SLOWER * self.device.speed * self.period
        along = effort / device.effort
        self._phase += self._rate * self.period
        if self._way in ("go", "yield"):
            step = along * most * self._gain * (1.0 if self._way == "go" else -1.0)
        elif self._way == "swing":
            step = self._size * most * math.cos(self._phase)
        elif self._way == "run":
            step = self._size * most * math.copysign(1.0, math.cos(self._phase * 0.05))
        elif self._way == "dither":
            step = self._size * most * (1.0 if self._left % 2 else -1.0)
        elif self._way == "loaded":
            pull = self._rate * (self._anchor - self.place) + effort
            self._velocity += pull / device.mass * self.period
            self._velocity = max(-1.0, min(1.0, self._velocity * self.period / most)) * most
            self._velocity /= self.period
            step = self._velocity * self.period
        else:
            step = 0.0
        return max(-most, min(most, step))

    def _meet(self) -> None:
        """Move an axis that takes velocities or goals, and what it touches, by a slot."""
        device = self.device
        before = device.spring * (self.contact - self.place)
        if not device.goal:
            step = max(-device.speed, min(device.speed, self.acting.velocity)) * self.period
        elif math.isnan(self.acting.position):
            step = 0.0
        else:
            step = self.acting.position - self.place
        self._phase += self._rate * self.period
        reach = 0.9 * device.effort / device.spring
        lean = {
            "against": -math.copysign(self._size, step),
            "with": math.copysign(self._size, step),
            "swing": self._size * math.cos(self._phase),
            "far": math.copysign(1.0, math.cos(self._phase * 0.05)),
        }.get(self._way)
        self.place += step
        if lean is not None and (step != 0.0 or self._way in ("swing", "far")):
            wanted = self.place + lean * reach
            most = SLOWER * device.speed * self.period
            self.contact += max(-most, min(most, wanted - self.contact))
        # It gives way before it breaks something.
        self.contact = max(self.place - reach, min(self.place + reach, self.contact))
        after = device.spring * (self.contact - self.place)
        self.given -= 0.5 * (before + after) * step

    def measured(self) -> JointState:
        """Return what its driver reads."""
        device = self.device
        if device.goal:
            return JointState(self.contact, math.nan, math.nan, True, 0)
        effort = device.spring * (self.contact - self.place) if device.spring > 0.0 else math.nan
        return JointState(self.place, math.nan, effort, True, 0)


class Port:
    """Takes the place of a driver: samples at its request, and commands that act `late` later.

    `late` is in slots after that request; 0: at once.
    """

    def __init__(self, world: World, inner: Any, movers: Sequence[Mover], late: int) -> None:
        self._world, self._movers = world, movers
        self._waiting: deque[tuple[int, Sequence[AxisCommand]]] = deque()
        self._late = late
        self._asked = 0
        self._states: list[JointState] = []
        inner.request, inner.read, inner.write = self.request, self.read, self.write

    def request(self) -> None:
        """Bring the devices to the present slot."""
        self._asked = self._world.advance()
        self._states = [mover.measured() for mover in self._movers]
        if self._world.loses():
            self._states = [state._replace(valid=False) for state in self._states]

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the samples of the request."""
        return self._states

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Take a command for each device."""
        self._waiting.append((self._asked + self._late, commands))
        if self._late == 0:
            self.latch(self._asked)

    def latch(self, slot: int) -> None:
        """Let act what is due in a slot, whether the host is there or not."""
        while self._waiting and self._waiting[0][0] <= slot:
            _, commands = self._waiting.popleft()
            for mover, command in zip(self._movers, commands, strict=True):
                mover.acting = command


class World:
    """All devices of a rig, on its clock; `most`: what they were given at most in all [J]."""

    def __init__(
        self,
        rig: Rig,
        built: Any,
        devices: dict[str, Device],
        draw: Draw,
        calm: Sequence[tuple[float, float]] = (),
        *,
        lost: float = 0.0,
    ) -> None:
        self._draw, self._lost = draw, lost
        self._ports: list[Port] = []
        self._clock, self._period = built.clock, rig.period_ns
        self._calm = [(round(a * rig.rate_hz), round(b * rig.rate_hz)) for a, b in calm]
        self._slot: int | None = None
        self._begun = 0
        self.movers: dict[str, Mover] = {}
        self.most = 0.0
        delays = command_delays(rig)
        self._weights: dict[str, float] = {}
        for bus in built.buses:
            inner = innermost(bus.driver)
            names = [name for name in devices if devices_bus(rig, name) == bus.name]
            for state, name in zip(inner.read(0), names, strict=True):
                self.movers[name] = Mover(devices[name], state.position, rig.period_s, draw)
                side, _, pair = name.partition(".")
                power = pair_scale(next(iter(rig.coupling.pairs.values()))).power
                if pair in rig.coupling.pairs:
                    power = pair_scale(rig.coupling.pairs[pair]).power
                self._weights[name] = 1.0 if side == "master" else 1.0 / power
            late = delays[bus.axes[0]].periods * bus.divisor
            port = Port(self, inner, [self.movers[name] for name in names], late)
            self._ports.append(port)
            driver = bus.driver
            while driver is not inner:  # wrappers keep what they hand on in every slot
                driver.request, driver = port.request, driver._driver

    def loses(self) -> bool:
        """Return whether the samples of a bus are lost now."""
        return self._lost > 0.0 and self._draw.between(0.0, 1.0) < self._lost

    def advance(self) -> int:
        """Let the slots pass since the last time; return the present one."""
        slot = int(self._clock.now_ns() // self._period)
        if self._slot is None:
            self._begun = slot
        while self._slot is not None and self._slot < slot:
            for port in self._ports:
                port.latch(self._slot)
            calm = any(a <= self._slot - self._begun < b for a, b in self._calm)
            for mover in self.movers.values():
                mover.pass_slot(calm=calm)
            self._slot += 1
            given = math.fsum(self._weights[n] * mover.given for n, mover in self.movers.items())
            self.most = max(self.most, given)
        for port in self._ports:
            port.latch(slot)
        self._slot = slot
        return slot


def devices_bus(rig: Rig, name: str) -> str:
    """Return the bus of an axis, or of a joint `side.joint` of a tip."""
    if name in rig.axes:
        return str(rig.axes[name].bus)
    side = name.partition(".")[0]
    return str(next(iter(getattr(rig, side).axes.values())).bus)


class Got(NamedTuple):
    """What came of a motion: the most that was given, and what is stated for it [J].

    `claimed` is of every engagement, for a prompt host or, if it was none, for any; `ended` says
    why the run ended early.
    """

    given: float
    claimed: float
    engaged: int
    ended: str

    @property
    def share(self) -> float:
        return self.given / self.claimed


def meet(
    rig: Rig,
    devices: dict[str, Device],
    seed: int,
    orders: Sequence[tuple[float, str]] = (),
    *,
    reserve: float = 1.0,
    faults: float = 0.0,
) -> Got:
    """Run a rig whose devices are moved for gain; `orders` by their times [s], if it is operated.

    `reserve`: times what its ports' tanks hold that the certificate believes; 1 but to be caught.
    `faults`: share of the samples that are lost, and a tenth of that of the slots at which the host
    begins to stall, for up to as many as it may.
    """
    built = build_rig(rig, clock="fake")
    for which, p in enumerate(built.control.params):
        if reserve != 1.0 and p.impedance:
            port = p.end.port._replace(reserve=reserve * p.end.port.reserve)
            built.control.retune(which, p._replace(end=p.end._replace(port=port)))
    if rig.operate is not None:
        script = Script([(round(1e9 * at), Order(word)) for at, word in orders])
        built = with_operation(rig, built, [script], [])
    pauses = [at for at, word in orders if word == "clutch"]
    calm = [(0.0, 0.21), *((at, at + PAUSE_S) for at in pauses)] if orders else []
    world = World(rig, built, devices, Draw(seed), calm, lost=faults)
    if faults > 0.0:
        stalls, most = Draw(seed + 1), rig.overrun_limit
        clock: Any = built.clock
        clock._oversleep = lambda at: (
            rig.period_ns * int(stalls.between(1.0, most + 1.0))
            if stalls.between(0.0, 1.0) < 0.1 * faults
            else 0
        )
    result, data = run_in_memory(built)
    rows = dict(zip(built.columns, data.T, strict=True))
    engaged = int(rows["operation.engagement"].max()) if rig.operate is not None else 1
    delays, claimed = command_delays(rig), 0.0
    for name, keys in rig.coupling.pairs.items():
        for axis_name, (stated, _) in stated_claims(rig, name, delays, {}).items():
            weight = 1.0 if axis_name.startswith("master") else 1.0 / pair_scale(keys).power
            claimed += weight * (stated.claim_j if faults > 0.0 else stated.prompt_j)
    ended = "" if result.error is None else str(result.error)
    return Got(world.most, max(1, engaged) * claimed, engaged, ended)
