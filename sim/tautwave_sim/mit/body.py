"""What simulated motors of every family are under their frames: an axis, a law, heat, silence."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection
from typing import NamedTuple

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.mit.options import MotorKeys, Quirks
from tautwave_sim.physics import NO_LAW, MotorLaw

AMBIENT = 25.0
HEAT_S, HOTTER = 60.0, 120.0
"""Time constant of the rotor's heat [s], and how much hotter it gets at its greatest torque [K]."""
KP_TOP, KD_TOP = 500.0, 5.0


class Order(NamedTuple):
    """What a frame asks of the motor: a spring, a damper and a torque, at the motor; SI."""

    position: float
    velocity: float
    stiffness: float
    damping: float
    torque: float


NO_ORDER = Order(0.0, 0.0, 0.0, 0.0, 0.0)


class Body(ABC):
    """One motor without its frames.

    Parameters
    ----------
    keys : MotorKeys
        Its ids and ranges.
    quirks : Quirks
        How it differs.
    name : str
        Of its axis.
    truth : AxisModel
        The axis; its codes are its steps.

    Attributes
    ----------
    turns : int
        Whole turns by which it is off.
    present : bool
        It has its supply, and is on the bus.
    free : bool
        Its axis moves; else it is held.
    torque : float
        [N m] Torque of the motor, as commanded.
    derated : float
        [N m] Torque beyond which it gives none, whatever its range is.
    heard_ns : int or None
        When it last heard a frame that was for it.
    rotor_c : float
        [degC] Of its rotor.
    """

    def __init__(self, keys: MotorKeys, quirks: Quirks, name: str, truth: AxisModel) -> None:
        self.keys = keys
        self.quirks = quirks
        self.axis = SimulatedAxis(name, truth._replace(effort_quantum=0.0, encoder_quantum=0.0))
        self._period = truth.period
        self._measured: tuple[float, bool] | None = None
        self._order = NO_ORDER
        self.rotor_c = AMBIENT
        self.turns = quirks.turns
        self.present = True
        self.free = False
        self.torque = 0.0
        self.derated = math.inf
        self.heard_ns: int | None = None

    # -- what a family says -------------------------------------------------------------------

    @property
    @abstractmethod
    def on(self) -> bool:
        """Whether it follows commands."""

    @abstractmethod
    def fail(self, state: int) -> None:
        """Have an error, as its family counts them: torque off until it is cleared."""

    @abstractmethod
    def power_on(self) -> None:
        """Start: off, with what was saved, and within half a turn of the stored zero."""

    def ids(self) -> Collection[int] | None:
        """Return the identifiers of what it hears; None: not by these alone."""
        return None

    @abstractmethod
    def hears(self, can_id: int) -> bool:
        """Return whether a frame may be for it."""

    @abstractmethod
    def commands(self, can_id: int, data: bytes) -> bool:
        """Return whether a frame that it hears is a command of its law."""

    @abstractmethod
    def receive(self, now_ns: int, can_id: int, data: bytes) -> None:
        """Take a frame, and answer it."""

    @abstractmethod
    def _silence_ns(self) -> int:
        """Return after how long without a frame it stops; 0: never."""

    @abstractmethod
    def _time_out(self) -> None:
        """Stop, since no frame arrives any more."""

    @abstractmethod
    def _overheat(self) -> bool:
        """Stop where it is too hot; whether it is."""

    @abstractmethod
    def _most(self) -> float:
        """Return the greatest torque [N m] that it is set to give."""

    # -- time ---------------------------------------------------------------------------------

    def next_event_ns(self) -> int | None:
        """Return when its watchdog trips, None while nothing will."""
        span_ns = self._silence_ns()
        if not self.on or not span_ns or self.heard_ns is None or not self.present:
            return None
        return self.heard_ns + span_ns

    def run(self, now_ns: int) -> None:
        """Trip the watchdog where it is due."""
        due = self.next_event_ns()
        if due is not None and due <= now_ns:
            self._time_out()

    def pass_slot(self) -> None:
        """Move by one slot, unless it is held; `settle` follows, when all joints have moved."""
        self._measured = None
        if self.free:
            self.axis.pass_slot()

    def settle(self) -> None:
        """Heat up by a slot, and act where the axis has come to."""
        if not self.free:
            return
        share = self.torque / self.keys.t_max
        goal = AMBIENT + HOTTER * self.quirks.heat * share * share
        self.rotor_c += (goal - self.rotor_c) * min(1.0, self._period / HEAT_S)
        if not self._overheat():
            self._act()  # spring and damper follow where it is now

    # -- its axis -----------------------------------------------------------------------------

    def _halt(self) -> None:
        """Give no torque from now on."""
        self._order = NO_ORDER
        self._act()

    def _restart(self) -> None:
        """Forget what was heard, and the turns that it was away from its zero."""
        self.heard_ns = None
        self._halt()
        self.turns = -math.floor(self._at_motor(self.axis.physics.x) / math.tau + 0.5)

    def _act(self) -> None:
        """Give the axis the law, which it follows between slots too.

        Beyond its greatest torque, where the motor is now, it gives that torque for the slot.
        """
        law = NO_LAW
        effort = self.torque = 0.0
        if self.on and self.present:
            p, v, kp, kd, t = self._order
            asked = kp * (p - self._place()) + kd * (v - self._speed()) + t if kp or kd else t
            most = min(self._most(), self.derated)
            effort = self.torque = min(max(asked, -most), most)
            if (kp or kd) and self.torque == asked:
                place = self.keys.direction * (p - self.keys.zero - self.turns * math.tau)
                law = MotorLaw(kp, place, kd)
                effort = t + kd * v
        self.axis.command(self.keys.direction * effort, law)

    def _at_motor(self, position: float) -> float:
        """Return the motor's position [rad] of one of the axis, turns apart."""
        return self.keys.direction * position + self.keys.zero

    def _place(self) -> float:
        """Return where the motor is [rad]."""
        return self._at_motor(self.axis.physics.x) + self.turns * math.tau

    def _speed(self) -> float:
        """Return how fast the motor turns [rad/s]."""
        return self.keys.direction * self.axis.physics.v

    def _read(self) -> tuple[float, float, bool]:
        """Return measured position and velocity at the motor, and whether they can be sent."""
        position, valid = self.measure()
        speed = self._speed() if self.free else 0.0
        return self._at_motor(position) + self.turns * math.tau, speed, valid

    def measure(self) -> tuple[float, bool]:
        """Sample the encoder, once per slot; whether the sample is there to be sent."""
        if not self.free:
            return self.axis.physics.x, True  # not sampled yet: no random number is used
        if self._measured is None:
            state = self.axis.measure()
            self._measured = state.position, state.valid
        return self._measured


def code(value: float, top: float, codes: int) -> int:
    """Return the code of a value between -top and top, of so many beyond 0; truncated."""
    clipped = min(max(value, -top), top)
    # What is a code already stays that code, whatever its last bit is.
    return math.floor((clipped + top) / (2.0 * top) * codes + 1e-9)


def of_code(number: int, top: float, codes: int) -> float:
    """Return what a code stands for."""
    return 2.0 * top * number / codes - top
