"""Exact closed-loop state matrix of one pair, as it is implemented, in its linear regime.

An *end* is a device with its hand or environment (a mass, a damper, a spring to ground; exact
under a held effort) and the controller's site on it. One slot moves the device, closes the
period, sends one scalar (a wave, or K x + B v of a position coupling), takes the one that
arrives and decides the next effort. The laws are those of the live loop, run on unit vectors:
there is no second version of them here. Linear means: the port's tank is full, nothing
is clipped, contact does not change, nothing is quantised, nothing is missing.

Positions that no spring ties to ground leave the wave's matrix: its port sees displacements only.

Sources: Colgate & Schenkel 1997 (a held effort on a device); the state matrix is written here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from tautwave.laws.coupler import coupler_effort
from tautwave.laws.velocity import track_velocity
from tautwave.models.linear import flow_rows

Matrix = npt.NDArray[np.float64]


class Device(NamedTuple):
    """What really moves at one end: SI, linear or rotary.

    mass [kg or kg m**2] with the hand's on it; damping [N s/m or N m s/rad] of bearing, grip and
    environment together; stiffness [N/m or N m/rad] of grip and environment to ground;
    command_delay [periods] until a command acts, with a fraction.
    """

    mass: float
    damping: float = 0.0
    stiffness: float = 0.0
    command_delay: float = 0.0


class Site(NamedTuple):
    """What the controller of one end believes of it.

    period T of the axis [s]; half_mobility: T / (2 mass lower bound); gain of the velocity tracker
    (1: plain difference); whole periods and share of a period of the command delay that the driver
    declares. A local wall with stiffness K [N/m or N m/rad] and damping B, if any, is in contact
    all the time.
    """

    period: float
    half_mobility: float
    gain: float = 1.0
    delay_periods: int = 0
    late_share: float = 0.0
    wall_stiffness: float = 0.0
    wall_damping: float = 0.0

    @property
    def has_wall(self) -> bool:
        """Whether a wall is pressed."""
        return self.wall_stiffness != 0.0 or self.wall_damping != 0.0


class Push(NamedTuple):
    """What a force f from outside, along the axis, does to an end in one slot [per N or N m].

    A hand's or an environment's: x[k+1] gains `state` f, leaving[k+1] gains `leaving` f. `state`
    has shape (n,).

    Attributes
    ----------
    observed, direct : ndarray of shape (n,), float
        What the controller sees, per state x[k] and per force. Of a device that takes effort: its
        displacement over the slot [m or rad]. Of a drive that takes velocity (`measured`): f.
    command : str
        Name of the state that the motor is given next: an effort, or a velocity.
    measured : bool
        Whether f is a sample taken at the end of the slot, not a force held over it.
    """

    state: Matrix
    leaving: float
    observed: Matrix
    direct: float
    command: str
    measured: bool = False


class LinearEnd(NamedTuple):
    """One end: x[k+1] = a x[k] + b arriving[k+1], leaving[k+1] = c x[k]. Shapes (n, n), (n,), (n,).

    `states` names the n states, in SI: true position and velocity, efforts and waves on their way,
    what the site remembers. `push` is what a force from outside does; without it nothing can be
    said of the impedance that a hand feels.
    """

    a: Matrix
    b: Matrix
    c: Matrix
    states: tuple[str, ...]
    push: Push | None = None


def position_end(
    device: Device,
    site: Site,
    *,
    stiffness: float,
    damping: float,
    sent_stiffness: float,
    sent_damping: float,
) -> LinearEnd:
    """Return one end of a position coupling.

    The end sends `sent_stiffness` x + `sent_damping` v: what its far end subtracts from its own
    K x + B v, so the far end's K and B times the position scale.

    Parameters
    ----------
    stiffness, damping : float
        K [N/m or N m/rad] and B [N s/m or N m s/rad] on this device.
    sent_stiffness, sent_damping : float
        Those at the far end, times the scale from here to there.
    """
    return linearise(
        device,
        site,
        lambda step: _PositionStep(step, stiffness, damping, sent_stiffness, sent_damping),
    )


def close_loop(master: LinearEnd, slave: LinearEnd, samples: int) -> Matrix:
    """Return the state matrix of two ends joined by a delay of `samples` slots each way.

    States: master's, slave's, then the samples under way to the slave and to the master, newest
    first. Shape (n, n) with n = both ends' states + 2 samples.
    """
    m, s = len(master.b), len(slave.b)
    whole = np.zeros((m + s + 2 * samples, m + s + 2 * samples))
    whole[:m, :m] = master.a
    whole[m : m + s, m : m + s] = slave.a
    if samples == 0:
        whole[:m, m:] = np.outer(master.b, slave.c)
        whole[m:, :m] = np.outer(slave.b, master.c)
        return whole
    there, back = m + s, m + s + samples
    whole[there, :m] = master.c
    whole[back, m : m + s] = slave.c
    for first in (there, back):
        at = np.arange(first, first + samples - 1)
        whole[at + 1, at] = 1.0
    whole[m : m + s, there + samples - 1] = slave.b
    whole[:m, back + samples - 1] = master.b
    return whole


class EndStep(Protocol):
    """One slot of one end on a plain list of states: the arriving scalar in, the leaving out."""

    size: int
    names: list[str]

    def __call__(self, state: list[float], arriving: float) -> tuple[list[float], float]:
        """Return the states a slot later and what leaves."""
        ...


# -- one slot of one end, on plain lists ---------------------------------------------------------


class SlotState:
    """What both laws share: the device over a slot, and the site's close up to the velocity.

    State: velocity; command; commands on their way to the motor; impulse and tracked velocity of
    the site; its own list of commands under way; then the acting ones where a command acts late.
    """

    def __init__(self, device: Device, site: Site) -> None:
        self.site = site
        period = site.period
        whole = math.floor(device.command_delay + 1e-9)
        late = device.command_delay - whole
        self._parts = [(late, 1), (1.0 - late, 0)] if late > 1e-9 else [(1.0, 0)]
        self._flows = [
            flow_rows(device.stiffness, device.damping, device.mass, share * period)
            for share, _ in self._parts
        ]
        self._device = device
        self.outside = self.moved = 0.0
        self._pipe = slice(3, 3 + whole)
        self._sent = slice(3 + whole, 3 + whole + site.delay_periods)
        self._tail = self._sent.stop
        self.size = self._tail + 4
        self.names = ["velocity", "command", "acted"]
        self.names += [f"motor_pipe_{at}" for at in range(whole)]
        self.names += [f"site_pipe_{at}" for at in range(site.delay_periods)]
        self.names += ["impulse", "tracked_velocity", "acting", "last_acted"]

    def move(self, state: list[float], x: float) -> tuple[float, float]:
        """Move the device by a slot; return displacement and tracked velocity. Changes state."""
        site, period = self.site, self.site.period
        v, command = state[0], state[1]
        tail = self._tail
        impulse, velocity, acting, acted = state[tail : tail + 4]
        pipe = [*state[self._pipe], command]
        efforts = (pipe[0], acting)
        start = x
        for (_, which), flow in zip(self._parts, self._flows, strict=True):
            net = self.outside - efforts[which]
            net -= self._device.stiffness * x + self._device.damping * v
            x, v = x + flow[0] * v + flow[1] * net, v + flow[3] * v + flow[4] * net
        state[0] = v
        state[self._pipe] = pipe[1:]
        sent = [*state[self._sent], command]
        state[self._sent] = sent[1:]
        self.moved = x - start
        mean = site.late_share * acted + (1.0 - site.late_share) * sent[0]
        expected = velocity - site.half_mobility * (impulse + mean)
        velocity = track_velocity(site.gain, expected, x - start, period)
        state[tail : tail + 4] = [mean, velocity, efforts[0], sent[0]]
        state[2] = mean
        return x - start, velocity

    def under_way(self, state: list[float]) -> float:
        """Return the sum of efforts that act before the next one, each times its periods."""
        acted = state[self._tail + 3]
        return sum(state[self._sent]) + self.site.late_share * acted


class WallState:
    """A pressed local wall. State: filtered velocity, command, commands on their way, last acted.

    Its share of the command is followed beside the whole: the port's books take what is left.
    """

    def __init__(self, site: Site) -> None:
        self._site = site
        self.size = 3 + site.delay_periods if site.has_wall else 0
        self.names = ["wall_velocity", "wall_command", "wall_last_acted"][: self.size]
        self.names += [f"wall_pipe_{at}" for at in range(self.size - 3)]

    def step(self, state: list[float], x: float, moved: float) -> tuple[float, float]:
        """Return the mean effort that acted and the next one [N m or N]. Changes its state."""
        if not self.size:
            return 0.0, 0.0
        site = self._site
        velocity, command, before = state[:3]
        sent = [*state[3:], command]
        acted = site.late_share * before + (1.0 - site.late_share) * sent[0]
        velocity += site.gain * (moved / site.period - velocity)
        effort = site.wall_stiffness * x + site.wall_damping * velocity
        state[:] = [velocity, effort, sent[0], *sent[1:]]
        return acted, effort

    def under_way(self, state: list[float]) -> float:
        """Return the sum of efforts that act before the next one, each times its periods."""
        if not self.size:
            return 0.0
        return sum(state[3:]) + self._site.late_share * state[2]


class _PositionStep:
    """One slot of an end of a position coupling. Extra state: position."""

    def __init__(self, common: SlotState, k: float, b: float, sent_k: float, sent_b: float) -> None:
        self._common = common
        self._law = k, b, sent_k, sent_b
        self._wall = WallState(common.site)
        self._at = common.size
        self.size = common.size + 1 + self._wall.size
        self.names = [*common.names, "position", *self._wall.names]

    def __call__(self, state: list[float], arriving: float) -> tuple[list[float], float]:
        k, b, sent_k, sent_b = self._law
        moved, velocity = self._common.move(state, state[self._at])
        x = state[self._at] + moved
        part = state[self._at + 1 :]
        _, wall = self._wall.step(part, x, moved)
        state[self._at :] = [x, *part]
        state[1] = coupler_effort(k, b, x, velocity, 0.0, 0.0) - arriving + wall
        return state, sent_k * x + sent_b * velocity


def linearise(device: Device, site: Site, law: Callable[[SlotState], EndStep]) -> LinearEnd:
    """Return the matrices of one end: each column is a slot begun at a unit vector."""
    common = SlotState(device, site)
    step = law(common)
    size = step.size
    a, b, c, moved = np.zeros((size, size)), np.zeros(size), np.zeros(size), np.zeros(size)
    for at in range(size):
        unit = [0.0] * size
        unit[at] = 1.0
        after, c[at] = step(unit, 0.0)
        a[:, at], moved[at] = after, common.moved
    b[:], _ = step([0.0] * size, 1.0)
    common.outside = 1.0
    pushed, leaving = step([0.0] * size, 0.0)
    push = Push(np.array(pushed), leaving, moved, common.moved, "command")
    return _without_unseen(LinearEnd(a, b, c, tuple(step.names), push))


def _without_unseen(end: LinearEnd) -> LinearEnd:
    """Leave out states that nothing else and no output depends on, such as a free position."""
    a, b, c, states, push = end
    assert push is not None
    while True:
        others = np.abs(a - np.diag(np.diag(a))).sum(axis=0)
        seen = (others > 0.0) | (c != 0.0)
        if seen.all():
            return LinearEnd(a, b, c, states, push)
        states = tuple(name for name, kept in zip(states, seen, strict=True) if kept)
        a, b, c = a[np.ix_(seen, seen)], b[seen], c[seen]
        push = push._replace(state=push.state[seen], observed=push.observed[seen])
