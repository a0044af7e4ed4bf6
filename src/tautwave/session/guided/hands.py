"""Hands on served devices, moved by lines that a person or a test types."""

from __future__ import annotations

import math
import os
import select
from collections.abc import Callable

from tautwave.contracts import Bench
from tautwave.errors import ConfigError
from tautwave.session.new.choosing import numbers
from tautwave.truth import AxisModel

GRIP_HZ = 4.0
"""Natural frequency of a device in the hand."""

SAG = 0.002
"""[rad or m] By which friction may keep a device from where the hand wants it."""

FASTEST = 0.2
"""Greatest angular frequency of a grip, in units of one over the period."""

MOVE_S = 1.0
LONGEST = 4096


class Hand:
    """One hand: it holds the device to a point that moves, or does not touch it."""

    def __init__(self, model: AxisModel) -> None:
        mass = model.plant.mass
        stiffest = mass * (FASTEST / model.period) ** 2
        wanted = max(mass * (2.0 * math.pi * GRIP_HZ) ** 2, model.plant.coulomb / SAG)
        self._stiffness = min(wanted, stiffest)
        self._damping = 2.0 * math.sqrt(self._stiffness * mass)
        self._from = self._to = 0.0
        self._time = self._whole = 0.0
        self._holds = self._fresh = False

    def move(self, to: float, seconds: float) -> None:
        """Take the device, and bring it there [rad or m] in this time."""
        self._to, self._whole, self._time = to, max(seconds, 1e-3), 0.0
        self._holds = self._fresh = True

    def let_go(self) -> None:
        """Do not touch it any more."""
        self._holds = False

    def __call__(self, position: float, velocity: float, period: float) -> float:
        """Return the effort of this slot [N m or N]."""
        if not self._holds:
            return 0.0
        if self._fresh:
            self._from, self._fresh = position, False
        self._time = min(self._time + period, self._whole)
        share = self._time / self._whole
        way = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)  # minimum jerk
        point = self._from + way * (self._to - self._from)
        return self._stiffness * (point - position) - self._damping * velocity


class TypedHands:
    """Hands on the devices of a bench, by their ids.

    Parameters
    ----------
    descriptor : int
        Where lines come from.
    complain : callable
        Takes a sentence about a line that is not understood.
    """

    def __init__(self, descriptor: int, complain: Callable[[str], None]) -> None:
        self._descriptor, self._complain = descriptor, complain
        self._hands: dict[int, Hand] = {}
        self._rest = b""
        self._open = True

    def on(self, bench: Bench) -> Bench:
        """Return the bench with a hand at each device.

        Raises
        ------
        ConfigError
            A device takes velocities: no hand moves it.
        """
        models = []
        for axis, model in zip(bench.bus.axes, bench.physics, strict=True):
            if model.servo is not None:
                raise ConfigError(f"sim --hand: device {axis.device_id} takes velocities")
            self._hands[axis.device_id] = hand = Hand(model)
            models.append(model._replace(grasp=hand))
        return bench._replace(physics=models)

    def look(self) -> None:
        """Obey the lines that have come; never waits."""
        if not self._open or not select.select([self._descriptor], [], [], 0)[0]:
            return
        data = os.read(self._descriptor, LONGEST)
        self._open = bool(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._obey(line.decode("utf-8", "replace").split())

    def _obey(self, words: list[str]) -> None:
        if not words:
            return
        try:
            chosen = [self._hands[number] for number in numbers(words[0], "hand")]
            if words[1:] == ["free"]:
                for hand in chosen:
                    hand.let_go()
                return
            to, seconds = [float(word) for word in (*words[1:], str(MOVE_S))][:2]
        except (ConfigError, KeyError, ValueError):
            known = ", ".join(str(number) for number in self._hands)
            self._complain(
                f"hand: write IDS POSITION [SECONDS], or IDS free, such as `1-2 0.5`; devices "
                f"are {known} (got {' '.join(words)[:40]!r})"
            )
            return
        if math.isfinite(to) and math.isfinite(seconds):
            for hand in chosen:
                hand.move(to, seconds)
