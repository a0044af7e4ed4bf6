"""What acts on the joints of an arm until its next sample, and the account of a wall in space."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from tautwave.contracts import Row
from tautwave.laws.space.wall import SpaceWallParams, allowed_share, wall_force, wall_proxy
from tautwave.models.chain.task import COORDINATES, joint_efforts
from tautwave_drivers.arm.walls import ArmWall

SURE = 3.0
"""Standard deviations of a stride's noise, beyond which a wall in debt believes that it takes."""

GUARDED = 1.4
"""Damping of a guard over the root of stiffness times mass: it comes back without a swing."""


class Effort:
    """Efforts on their way to the motors, and what acted since the last sample, summed by slot."""

    def __init__(self, size: int, delay: int, late: float) -> None:
        self.size = size
        self._late = late
        self._delay = delay
        self.drop()

    def drop(self) -> None:
        """Begin with nothing sent."""
        self._now = [0.0] * self.size
        self._acted = [0.0] * self.size
        self._waiting = deque([[0.0] * self.size for _ in range(self._delay)])
        self.begin()

    @property
    def acted(self) -> Sequence[float]:
        """What acted in the last slot."""
        return self._acted

    @property
    def waiting(self) -> Sequence[Sequence[float]]:
        """What was sent and does not act yet."""
        return self._waiting

    def set(self, efforts: list[float]) -> None:
        """Take what is sent from now on."""
        self._now = efforts

    def pass_slots(self, count: int) -> None:
        """File what acted in each of the slots that went by."""
        for _ in range(count):
            efforts = self._now
            if self._waiting:
                self._waiting.append(efforts)
                efforts = self._waiting.popleft()
            before, late = self._acted, self._late
            for j, effort in enumerate(efforts):
                self._sum[j] += late * before[j] + (1.0 - late) * effort
            self._acted = efforts
            self.slots += 1

    def work(self, moved: Sequence[float]) -> float:
        """Return the energy that it gave over a displacement since the last sample [J]."""
        return sum(a * b for a, b in zip(self._sum, moved, strict=True)) / self.slots

    def begin(self) -> None:
        """Begin anew with a sample."""
        self._sum = [0.0] * self.size
        self.slots = 0


class TipWall:
    """A wall for the tip of an arm: its proxy, its account, its force.

    `noise` is the variance of each joint's reading: what a held force loses to it in the account,
    stiffness times the tip's variance per period, is put back, and booked as `noise`.
    """

    def __init__(
        self,
        name: str,
        keys: ArmWall,
        noise: Sequence[float],
        effort: Effort,
        softness: Sequence[float],
        period: float,
    ) -> None:
        self.name = name
        self.effort = effort
        self._law = SpaceWallParams(
            keys.surface(), keys.stiffness, keys.damping, keys.friction, keys.force_limit
        )
        self._guard = keys.guard
        self._noise = noise
        self._softness = softness
        self._period = period
        self._proxy: tuple[float, float, float] | None = None
        self._force = [0.0, 0.0, 0.0]
        self._depth = 0.0
        self._account = 0.0
        self._absorbed = self._granted = 0.0

    def close(self, moved: Sequence[float]) -> None:
        """Book the displacement of the joints since the last sample."""
        taken = -self.effort.work(moved)
        self._absorbed += taken
        self._account += taken

    def push(
        self,
        place: Sequence[float],
        jacobian: Sequence[float],
        stride: Sequence[float],
        *,
        dead: bool = False,
    ) -> list[float]:
        """Return the joints' efforts for a tip at `place` that moves by `stride`.

        None after a gap, for what acts since the last sample is not in the account yet, and none
        where a joint is `dead`.
        """
        x, y, z = place
        if self._proxy is None:
            self._proxy = (x, y, z)
        *proxy, self._depth = wall_proxy(self._law, *self._proxy, x, y, z)
        px, py, pz = self._proxy = (proxy[0], proxy[1], proxy[2])
        count = len(stride)
        efforts = [0.0] * count
        self._force = [0.0, 0.0, 0.0]
        if self._depth == 0.0:
            pending = any(any(sent) for sent in self.effort.waiting)
            if not pending:
                self._account = min(self._account, 0.0)  # what it owes, the next contact pays
            self.effort.set(efforts)
            return efforts
        if self.effort.slots or dead:
            self.effort.set(efforts)
            return efforts
        speed = [0.0, 0.0, 0.0]
        variance = 0.0
        for j in range(count):
            k = COORDINATES * j
            for i in range(3):
                speed[i] += jacobian[k + i] * stride[j] / self._period
                variance += jacobian[k + i] * jacobian[k + i] * self._noise[j]
        granted = self._law.stiffness * variance
        self._granted += granted
        self._account += granted
        law = self._law
        if self._guard:
            law = law._replace(
                damping=law.damping + self._guarding(px - x, py - y, pz - z, jacobian)
            )
        force = wall_force(law, px - x, py - y, pz - z, *speed)
        joint_efforts(jacobian, (*force, 0.0, 0.0, 0.0), efforts)
        left, moving = self._foreseen(stride)
        given = sum(a * b for a, b in zip(efforts, moving, strict=True))
        if left < 0.0:  # in debt, what only the encoders' noise takes is not foreseen
            unsure = sum(a * a * b for a, b in zip(efforts, self._noise, strict=True))
            given += SURE * math.sqrt(2.0 * unsure)
        fast = self._added(efforts)
        share = allowed_share(left, given, fast)
        self._force = [share * part for part in force]
        efforts = [share * part for part in efforts]
        self.effort.set(efforts)
        return efforts

    def _foreseen(self, stride: Sequence[float]) -> tuple[float, list[float]]:
        """Return the account when a new force begins to act [J], and each joint's stride then.

        Its own forces are counted, that which acted and those under way; the stride measured is
        the mean of the period before.
        """
        soft = [share * self._period * self._period for share in self._softness]
        acted = self.effort.acted
        moving = [a + 0.5 * b * c for a, b, c in zip(stride, soft, acted, strict=True)]
        left = self._account
        for sent in self.effort.waiting:
            left -= sum(a * b for a, b in zip(sent, moving, strict=True)) + self._added(sent)
            moving = [a + b * c for a, b, c in zip(moving, soft, sent, strict=True)]
        return left, moving

    def _added(self, efforts: Sequence[float]) -> float:
        """Return the energy that efforts give in a period by the speed that they add [J]."""
        fast = sum(a * a * b for a, b in zip(efforts, self._softness, strict=True))
        return 0.5 * fast * self._period * self._period

    def _guarding(self, dx: float, dy: float, dz: float, jacobian: Sequence[float]) -> float:
        """Return the damping [N s/m] along a direction that lets nothing swing back."""
        size = math.sqrt(dx * dx + dy * dy + dz * dz)
        unit = (dx / size, dy / size, dz / size, 0.0, 0.0, 0.0)
        efforts = [0.0] * len(self._softness)
        joint_efforts(jacobian, unit, efforts)
        soft = sum(a * a * b for a, b in zip(efforts, self._softness, strict=True))
        return GUARDED * math.sqrt(self._law.stiffness / soft) if soft > 0.0 else 0.0

    def fill(self, row: Row, at: int) -> int:
        """Write its columns from index `at` on; return the next."""
        values = (*self._force, self._depth, self._account, self._absorbed, self._granted)
        for value in values:
            row[at] = value
            at += 1
        return at
