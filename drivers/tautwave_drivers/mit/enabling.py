"""Switching motors on without ever waiting, and seeing that each is still as it was set.

A motor may have been switched off and on between bring-up and here: it would be enabled without its
watchdog. So once it says that it is enabled, TIMEOUT and CTRL_MODE are read again.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.can.exchange import Exchange
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.axis import FORGOT, Axis

LIMIT_NS = 1_000_000_000
"""How long all of it may take."""
CLEARS = 3
AGAIN_PERIODS = 2
"""Of the bus, after which what was not answered is sent again."""


class Enabling:
    """One step a cycle, for every motor of the bus.

    Parameters
    ----------
    exchange : Exchange
        The bus.
    clock : Clock
        Its time.
    axes : sequence of Axis
        The motors, off and set.
    armed : sequence of int or None
        Each motor's TIMEOUT [counts], None where it is unwatched.
    bus : BusSpec
        For messages.
    feed_ns : int
        Longest time between two frames to a motor that is enabled [ns].
    """

    def __init__(
        self,
        exchange: Exchange,
        clock: Clock,
        axes: Sequence[Axis],
        armed: Sequence[int | None],
        bus: BusSpec,
        feed_ns: int,
    ) -> None:
        self._exchange = exchange
        self._clock = clock
        self._axes = axes
        self._bus = bus
        self._until_ns = clock.now_ns() + LIMIT_NS
        self._clears = [0] * len(axes)
        self._feed_ns = feed_ns
        self._sent_ns = clock.now_ns() - AGAIN_PERIODS * bus.period_ns
        self._reading = [False] * len(axes)
        self._wanted = [
            [(damiao.CTRL_MODE, float(damiao.MIT_MODE))]
            + ([] if counts is None else [(damiao.TIMEOUT, float(counts))])
            for counts in armed
        ]
        """What is still to be read of each motor, once it is enabled."""

    def step(self) -> bool:
        """Do one step; return whether every motor is enabled, and as it was set.

        Raises
        ------
        DeviceFault
            A motor reports an error, or has forgotten what was set.
        DriverError
            A motor stays off, or the bus is lost.
        """
        self._exchange.begin()
        if self._exchange.lost:
            raise DriverError(f"bus {self._bus.name}: {self._exchange.lost}")
        now_ns = self._clock.now_ns()
        answered = all(axis.fresh for axis in self._axes) and not any(self._reading)
        if not answered and now_ns - self._sent_ns < AGAIN_PERIODS * self._bus.period_ns:
            return False
        on = [axis.state == damiao.ENABLED for axis in self._axes]
        done = all(on) and not any(self._wanted)
        if answered and done and now_ns - self._sent_ns < self._feed_ns:
            return True  # nothing is on its way: the loop's first request meets no answer
        self._sent_ns = now_ns
        for at, axis in enumerate(self._axes):
            axis.fresh = False
            self._step(at, axis)
        if not done and now_ns > self._until_ns:
            late = [
                f"{axis.spec.name} ({axis.label}: "
                f"{'silent' if axis.state is None else damiao.state_text(axis.state)})"
                for axis, wanted in zip(self._axes, self._wanted, strict=True)
                if axis.state != damiao.ENABLED or wanted
            ]
            raise DriverError(
                f"bus {self._bus.name}: not enabled within {LIMIT_NS * 1e-9:g} s: "
                f"{', '.join(late)}; check power and cable"
            )
        return False

    def heard(self, at: int, data: bytes) -> None:
        """Take what a motor said about a register.

        Raises
        ------
        DeviceFault
            It is not what was set.
        """
        for pair in self._wanted[at]:
            register, wanted = pair
            value = damiao.register_value(data, self._axes[at].motor.id, register)
            if value is None:
                continue
            self._reading[at] = False
            if value != wanted:
                raise DeviceFault(
                    f"{self._where(at)}: {register} reads {value:g} instead of {wanted:g}: {FORGOT}"
                )
            self._wanted[at].remove(pair)
            return

    def _step(self, at: int, axis: Axis) -> None:
        """Send a motor the next frame that is due."""
        state = axis.state
        if state not in (None, damiao.DISABLED, damiao.ENABLED):
            assert state is not None
            if state != damiao.TIMED_OUT or self._clears[at] == CLEARS:
                raise DeviceFault(f"{self._where(at)}: {damiao.state_text(state)}")
            self._clears[at] += 1
            axis.state = None
            self._exchange.send(axis.motor.id, damiao.CLEAR)
        # Also to one that is enabled: it feeds its watchdog, and asks how it is.
        self._exchange.send(axis.motor.id, damiao.ENABLE)
        self._reading[at] = state == damiao.ENABLED and bool(self._wanted[at])
        if self._reading[at]:
            register, _ = self._wanted[at][0]
            self._exchange.send(damiao.PARAMETERS, damiao.read_register(axis.motor.id, register))

    def _where(self, at: int) -> str:
        axis = self._axes[at]
        return f"bus {self._bus.name}: {axis.spec.name} ({axis.label})"
