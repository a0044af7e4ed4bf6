"""What the hand feels of a pair, as two figures: stiffness of a pressed wall, drag of free motion.

Both are measured on a simulation of the rig as it is: its law, gains, delay, account, friction and
noise, and what its limits clip. So every law has them, whether it is linear or not.

- A hand with the grip that the rig states presses a wall of `WALLS` at the slave slowly: half,
  whole, half. The felt stiffness is the slope of its force over its position: friction, which
  turns with the direction, is not in it.
- The same hand moves the master to and fro. The drag is the work that it does, over the way: what
  masses and springs take, they give back. The speed is the one at which a damper takes as much
  over the same way; where the pair holds the hand back it is less than was wished.
"""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from tautwave.analysis.felt import slope
from tautwave.certificate.belief import SIDES
from tautwave.config import Hand, HandPart, Hold, MinimumJerk, Rig, SolidWall, simulation_of
from tautwave.config import Simulation as Truth
from tautwave.errors import TautwaveError
from tautwave.registry import load_driver
from tautwave.rig import axis_allowance, command_delays, line_delay, pair_scale
from tautwave.rig.hands import stated_hand
from tautwave.rig.scales import slave_offset
from tautwave.simulation import Simulation, simulate

WALLS = {"rotary": 250.0, "linear": 4.4e4}
"""[N m/rad, N/m] Stiffness of the wall; the same one, at a lever arm of 75 mm."""

SPEEDS = {"rotary": 1.0, "linear": 0.075}
"""[rad/s, m/s] Speed of the free motion, at that lever arm too."""

WAYS = {"rotary": 0.5, "linear": 0.0375}
"""[rad, m] Way of the free motion, there and back, at most."""

PRESSED = 0.25
"""Of the smaller effort that the pair has, the greater of the two forces."""

SLOW = 8.0
"""Delays of the line by which each part of the course takes longer."""

RUNAWAY = 2.0
"""Times the speed that the hand wishes, above which a pair moves by itself."""

RESTLESS = "it swings by itself"

BEGIN_S = 0.5
"""[s] The pair is engaged by then."""

MOVE_S, HOLD_S = 0.7, 0.2
"""[s] Times of a move of the pressing hand, and of a hold."""

SAME_SPEED = 10.0 / 7.0
"""Speed at which a damper takes as much over the way as in a move by minimum jerk, over its mean
speed [1]."""


class Feel(NamedTuple):
    """Two figures of a pair, in the master's units; None where the simulation ended before.

    felt `stiffness` [N m/rad or N/m] of a wall of `wall`, pressed with `pressed` [N m or N]; `drag`
    [N m or N] at `speed` [rad/s or m/s], `own` of it the friction of the master itself; `ended`:
    why a figure is missing.
    """

    pair: str
    rotary: bool
    law: str
    delay_s: float
    wall: float
    pressed: float
    stiffness: float | None
    speed: float
    drag: float | None
    own: float
    ended: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {key: value for key, value in self._asdict().items() if key != "pair"}

    def sentences(self) -> list[str]:
        """Return the figures as sentences."""
        effort, place = ("N m", "rad") if self.rotary else ("N", "m")
        name, sentences = f"pair {self.pair}", []
        if self.stiffness is not None:
            sentences.append(
                f"{name}: pressed with {self.pressed:.3g} {effort}, a wall of {self.wall:g} "
                f"{effort}/{place} feels like {self.stiffness:.3g} {effort}/{place}."
            )
        if self.drag is not None:
            sentences.append(
                f"{name}: moved freely at {self.speed:.3g} {place}/s, it drags with "
                f"{self.drag:.3g} {effort}; {self.own:.3g} of it is the master's own friction."
            )
        return [*sentences, *(f"{name}: {why}" for why in self.ended)]


class _Course(NamedTuple):
    """Where the hand of a pair goes, and how hard it presses; in the master's units.

    From `start` one way (`toward`: 1 or -1), to a wall `touch` far or freely up to `way`; a damper
    takes in that move what it takes at a `speed`. `force` at most, with a `grip` of that stiffness.
    """

    start: float
    toward: float
    touch: float
    way: float
    speed: float
    force: float
    grip: float

    @property
    def move_s(self) -> float:
        """Time of one way [s]."""
        return SAME_SPEED * self.way / self.speed

    def wish(self, share: float) -> float:
        """Return where the hand wants to be to press with a share of the force."""
        return self.start + self.toward * (self.touch + share * self.force / self.grip)


def rig_feel(rig: Rig) -> tuple[tuple[Feel, ...], tuple[str, ...]]:
    """Return the figures of every pair, and sentences why there are none.

    Parameters
    ----------
    rig : Rig
        A checked rig; what it does not simulate is as it believes.

    Notes
    -----
    It simulates some 5 s in Python, at 30 us a cycle. All pairs are measured at once, so joints of
    an arm, which move each other, are not.
    """
    if rig.scene is not None:
        return (), ()
    if any(rig.arms(side) for side in ("master", "slave")):
        return (), ("felt stiffness and drag: the joints of an arm move each other",)
    if any(load_driver(bus.driver).plain for bus in rig.buses.values()):
        return (), ("felt stiffness and drag: the tip of an arm takes too long to simulate",)
    bare = _bare(rig)
    courses = {pair: _course(bare, pair) for pair in bare.coupling.pairs}
    stuck = [pair for pair, course in courses.items() if not course.way > 0.0]
    if stuck:
        return (), tuple(f"felt stiffness and drag: {pair} starts at its range" for pair in stuck)
    slow = SLOW * _line_s(rig)
    try:
        pressed = _press(bare, courses, slow)
        moved = _move(bare, courses, slow)
    except TautwaveError as err:
        return (), (f"felt stiffness and drag: {err}",)
    return tuple(_feel(bare, pair, courses[pair], pressed, moved, slow) for pair in courses), ()


def _feel(
    rig: Rig, pair: str, course: _Course, pressed: Simulation, moved: Simulation, slow: float
) -> Feel:
    kind, axis = rig.master.axes[pair].kind, simulation_of(rig, f"master.{pair}")
    speed, drag = _drag(rig, pair, moved, course, slow)
    stiffness = _stiffness(rig, pair, pressed, slow)
    ended = [str(run.error) for run in (pressed, moved) if run.error is not None]
    if stiffness is not None and stiffness <= 0.0:
        ended.append(f"{RESTLESS} against a wall")
        stiffness = None
    if drag is not None and speed > RUNAWAY * course.speed:
        ended.append(f"{RESTLESS} in free motion")
        drag = None
    return Feel(
        pair,
        kind == "rotary",
        rig.coupling.law,
        _line_s(rig),
        WALLS[kind],
        course.force,
        stiffness,
        speed,
        drag,
        axis.coulomb + axis.damping * speed,
        tuple(dict.fromkeys(ended)),
    )


def _line_s(rig: Rig) -> float:
    """Return the delay of the line between the sides, a network's included [s]."""
    return line_delay(rig).samples * rig.period_s


def _bare(rig: Rig) -> Rig:
    """Return a rig without local walls and faults, and without what would wait for a command."""
    pairs = {
        name: keys.model_copy(update={"wall_master": None, "wall_slave": None})
        for name, keys in rig.coupling.pairs.items()
    }
    given = Truth() if rig.simulation is None else rig.simulation
    hands: dict[str, Hand | HandPart] = {
        name: Hand(
            **dict(zip(("mass", "damping", "stiffness"), stated_hand(rig, name).hand, strict=True)),
            lever_arm=1.0 if rig.master.axes[name].kind == "rotary" else None,
            reference=Hold(type="hold", position=0.0),
        )
        for name in pairs
    }
    return rig.model_copy(
        update={
            "coupling": rig.coupling.model_copy(update={"pairs": pairs}),
            "simulation": Truth(axes=given.axes, hand=hands, integrator=given.integrator),
            "operate": None,
        }
    )


def _course(rig: Rig, pair: str) -> _Course:
    """Return a course inside both ranges and velocity limits, toward the greater room."""
    scale = pair_scale(rig.coupling.pairs[pair])
    master, slave = rig.master.axes[pair], rig.slave.axes[pair]
    start, there = _starts(rig, pair)
    room = {
        toward: min(
            _room(master.position_range, start, toward),
            _room(slave.position_range, there, toward * scale.sign) / scale.scale,
        )
        for toward in (1.0, -1.0)
    }
    toward = max(room, key=lambda one: room[one])
    way = min(WAYS[master.kind], 0.6 * room[toward])
    limits = [
        one.velocity_limit / per
        for one, per in ((master, 1.0), (slave, scale.scale))
        if one.velocity_limit is not None
    ]
    delays = command_delays(rig)
    efforts = [
        axis_allowance(rig, name, delays[name]).shared_effort
        for name in (f"{side}.{pair}" for side in SIDES)
    ]
    return _Course(
        start,
        toward,
        0.1 * way,
        way,
        min((SPEEDS[master.kind], *(0.5 * limit for limit in limits))),
        PRESSED * min(efforts[0], efforts[1] / scale.force_scale),
        _hand(rig, pair).stiffness,
    )


def _starts(rig: Rig, pair: str) -> tuple[float, float]:
    """Return where master and slave begin, the slave where the pair's offset wants it."""
    keys = rig.coupling.pairs[pair]
    scale, zero = pair_scale(keys), slave_offset(keys)[0]
    start, there = (simulation_of(rig, f"{side}.{pair}").start_position for side in SIDES)
    return start, there if zero is None else zero + scale.sign * scale.scale * start


def _room(limits: tuple[float, float] | None, start: float, toward: float) -> float:
    if limits is None:
        return math.inf
    return limits[1] - start if toward > 0.0 else start - limits[0]


def _hand(rig: Rig, pair: str) -> Hand:
    assert rig.simulation is not None
    hand = rig.simulation.hand[pair]
    assert isinstance(hand, Hand)
    return hand


def _simulated(
    rig: Rig,
    hands: dict[str, Hand],
    walls: dict[str, SolidWall],
    duration_s: float,
) -> Simulation:
    assert rig.simulation is not None
    truth = rig.simulation.model_copy(update={"hand": hands, "environment": walls})
    rig = rig.model_copy(update={"simulation": truth})
    return simulate(rig, duration_s=duration_s, engine="python")


def _press(rig: Rig, courses: dict[str, _Course], slow: float) -> Simulation:
    """Return a run in which every hand presses its wall: half, whole, half."""
    times = _press_times(slow)
    hands, walls = {}, {}
    for pair, course in courses.items():
        keys = rig.coupling.pairs[pair]
        scale, (_, there) = pair_scale(keys), _starts(rig, pair)
        half, whole = course.wish(0.5), course.wish(1.0)
        wishes = (course.start, half, half, whole, whole, half)
        reference = MinimumJerk(
            type="minimum_jerk", waypoints=tuple(zip(times, wishes, strict=True))
        )
        hands[pair] = _hand(rig, pair).model_copy(update={"reference": reference})
        forward = course.toward * scale.sign
        walls[pair] = SolidWall(
            type="wall",
            stiffness=WALLS[rig.master.axes[pair].kind] * scale.force_scale / scale.scale,
            position=there + forward * scale.scale * course.touch,
            side="above" if forward > 0.0 else "below",
        )
    return _simulated(rig, hands, walls, times[-1])


def _press_times(slow: float) -> list[float]:
    """Return when the pressing hand begins and ends each move [s]."""
    steps = BEGIN_S, MOVE_S + slow, HOLD_S + slow, MOVE_S + slow, HOLD_S + slow, MOVE_S + slow
    return list(accumulate(steps))


def _stiffness(rig: Rig, pair: str, run: Simulation, slow: float) -> float | None:
    """Return the felt stiffness; None of a run that ended before, or of a hand that stands."""
    times = _press_times(slow)
    rows = _rows(rig, run, times[2], times[-1])
    if run.error is not None:
        return None
    stiffness = slope(
        *(run[f"true.master.{pair}.{what}"][rows] for what in ("position", "hand_effort"))
    )
    return None if math.isnan(stiffness) else stiffness


def _move(rig: Rig, courses: dict[str, _Course], slow: float) -> Simulation:
    """Return a run in which every hand moves to and fro, twice."""
    hands, longest = {}, 0.0
    for pair, course in courses.items():
        times = [BEGIN_S + slow + k * course.move_s for k in range(5)]
        far = course.start + course.toward * course.way
        points = tuple((at, far if k % 2 else course.start) for k, at in enumerate(times))
        reference = MinimumJerk(type="minimum_jerk", waypoints=points)
        hands[pair] = _hand(rig, pair).model_copy(update={"reference": reference})
        longest = max(longest, times[-1])
    return _simulated(rig, hands, {}, longest)


def _drag(
    rig: Rig, pair: str, run: Simulation, course: _Course, slow: float
) -> tuple[float, float | None]:
    """Return the speed of the second time to and fro, and the drag."""
    first = BEGIN_S + slow + 2.0 * course.move_s
    rows = _rows(rig, run, first, first + 2.0 * course.move_s)
    if run.error is not None:
        return course.speed, None
    at = run[f"true.master.{pair}.position"][rows]
    effort = run[f"true.master.{pair}.hand_effort"][rows]
    moved = np.diff(at)
    way = float(np.sum(np.abs(moved)))
    if way == 0.0:
        return 0.0, None
    work = float(np.sum(effort[1:] * moved))
    return float(moved @ moved) / (rig.period_s * way), work / way


def _rows(rig: Rig, run: Simulation, first: float, last: float) -> slice:
    """Return the rows from one time to another [s]."""
    begin, end = (round(at * rig.rate_hz) for at in (first, last))
    return slice(begin, min(end, len(run)))
