"""Rigs drawn to be certified, held by passive users who are made to undo them, and what they got.

A rig is drawn from a seed. Its users are lossless: masses on springs, on both sides, tuned to where
the wall supplies most, to a few samples a swing, or as hard as steel; the hand is driven at its own
resonance. The plant's books, not the controller's, say how much energy the motors gave.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.rational import Sampled, rational
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall, wall_transfer
from tautwave.certificate import Certificate
from tautwave.config import Rig
from tautwave.rig import pair_scale
from tautwave.simulation import simulate
from tautwave.simulation.rows import Simulation
from tests.rigs.running import Tree, tree

Array = npt.NDArray[np.float64]
SAMPLES = (2.3, 3.0, 5.0, 9.0, 30.0, 200.0)
"""Samples in a swing of a user's spring with all that it holds."""

SIDES = (("master", "hand"), ("slave", "arm"))
HOLDERS = (("master", "hand"), ("slave", "environment"))


class End(NamedTuple):
    """One device: what is believed and true of it, and its wall."""

    lower: float
    mass: float
    damping: float
    late: int
    wall: SampledWall | None


class User(NamedTuple):
    """A lossless user: mass that is added [kg] and spring [N/m]."""

    mass: float
    stiffness: float


def tuned(wall: SampledWall, device: Device) -> Iterator[Device]:
    """Yield the device with undamped hands tuned to where the wall supplies most, and elsewhere."""
    pulse = wall_transfer(wall)
    law = rational(list(pulse.numerator), list(pulse.denominator))
    own = (device.mass, device.damping, device.stiffness)
    late = (wall.delay + device.command_delay) * wall.period
    controller = Sampled(law, wall.period, late, own)
    nyquist = math.pi / wall.period
    worst = 2.0 * math.pi * wall_leak(wall._replace(delay=late / wall.period)).frequency
    places = np.array([worst, 1e-2 * nyquist, 0.1 * nyquist, 0.4 * nyquist, 0.97 * nyquist])
    places = np.unique(np.clip(places, 1e-3 * nyquist, nyquist))
    for w, value in zip(places, controller.at(1j * places), strict=True):
        for mass in (0.0, device.mass, max(device.mass, 4.0 * abs(value.imag) / w)):
            stiffness = (mass * w + value.imag) * w
            if stiffness >= 0.0:
                yield device._replace(mass=float(device.mass + mass), stiffness=float(stiffness))


class Draw:
    """Numbers from one seed."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def among(self, *values: Any) -> Any:
        """Return one of the values."""
        return values[self.rng.integers(len(values))]

    def between(self, low: float, high: float) -> float:
        """Return a number, evenly spread."""
        return float(self.rng.uniform(low, high))

    def magnitude(self, low: float, high: float) -> float:
        """Return a number, its logarithm evenly spread."""
        return float(f"{math.exp(self.rng.uniform(math.log(low), math.log(high))):.6g}")


class Mischief(NamedTuple):
    """How far a rig goes beyond its certificate; nothing by default.

    wall: stiffness over the limit that the device's damping sets; inertia: believed over true.
    """

    wall: float = 1.0
    inertia: float = 1.0


HONEST = Mischief()


def draw_rig(
    seed: int, cycles: int, mischief: Mischief = HONEST, count: int = 8
) -> tuple[Tree, list[Tree]]:
    """Return a wave rig with walls that are passive, some just so, and truths of several users."""
    draw = Draw(seed)
    rate = draw.among(500.0, 1000.0, 4000.0)
    data = tree(
        {
            "rate_hz": rate,
            "duration_s": cycles / rate,
            "coupling.delay_s": draw.among(0, 1, 2, 5, 8, 40) / rate,
            "coupling.pairs.a": {
                "wave_impedance": draw.magnitude(0.01, 100.0),
                "pole_master": draw.among(0.5, 0.3, "plain"),
                "pole_slave": draw.among(0.5, 0.3, "plain"),
                "matched_master": draw.among(False, False, True),
                "matched_slave": draw.among(False, False, True),
                "sign": draw.among(1, -1),
            },
        }
    )
    if draw.among(True, False):
        data["coupling"]["pairs"]["a"]["wave_filter_hz"] = rate * draw.between(0.02, 0.5)
    if draw.among(True, False):
        scales = {"position_scale": draw.magnitude(0.2, 5.0), "force_scale": draw.magnitude(0.2, 5)}
        data["coupling"]["pairs"]["a"].update(scales)
    ends = {side: _draw_end(draw, data, side, bus, mischief) for side, bus in SIDES}
    users = [_truth(draw, data, ends) for _ in range(count)]
    return data, users


def _draw_end(draw: Draw, data: Tree, side: str, bus: str, mischief: Mischief) -> End:
    rate = data["rate_hz"]
    lower = draw.magnitude(0.05, 5.0)
    mass = lower * draw.among(1.0, draw.between(1.0, 2.0))
    late = draw.among(0, 0, 1, 2)
    stiffness = lower * rate**2 * draw.magnitude(1e-4, 0.2)
    damper = stiffness / rate * draw.among(0.0, 0.3, 2.0)
    wall = SampledWall(stiffness, damper, 1.0 / rate, float(late))
    damping = wall_leak(wall).damping * draw.among(1.0, 1.1, 2.0, 10.0)
    if mischief.wall > 1.0:
        damping = wall_leak(wall).damping / mischief.wall
    data["buses"][bus]["options"] = {"command_delay_s": late / rate}
    data[side]["axes"]["a"].update(
        damping=damping,
        effort_limit=draw.among(20.0, 1e6),
        effort_rate_limit=1e12,
        velocity_limit=1e3,
        inertia={
            "value": mass * mischief.inertia,
            "lower": lower * mischief.inertia,
            "source": "test",
        },
    )
    if draw.among(True, True, False):
        # Not pressed at the start: it would give back what it never took.
        place = draw.among(0.0, 0.004)
        above = draw.among(True, False)
        data["coupling"]["pairs"]["a"][f"wall_{side}"] = {
            "position": place if above else -place,
            "stiffness": stiffness,
            "damping": damper,
            "side": "above" if above else "below",
        }
        return End(lower, mass, damping, late, wall)
    return End(lower, mass, damping, late, None)


def _draw_user(draw: Draw, end: End, period: float) -> User:
    if end.wall is not None and draw.among(True, False):
        users = [u for u in tuned(end.wall, Device(end.mass, end.damping)) if u.stiffness > 0.0]
        found = users[draw.rng.integers(len(users))]
        return User(found.mass - end.mass, found.stiffness)
    extra = draw.among(0.0, 0.0, end.mass, 10.0 * end.mass)
    swing = 2.0 * math.pi / (period * draw.among(*SAMPLES))
    return User(extra, (end.mass + extra) * swing**2)


def _truth(draw: Draw, data: Tree, ends: dict[str, End]) -> Tree:
    """Return a `simulation` block with users on both sides."""
    period = 1.0 / data["rate_hz"]
    hand, other = (_draw_user(draw, ends[side], period) for side, _ in SIDES)
    held = ends["master"].mass + hand.mass
    walled = 0.0 if ends["master"].wall is None else ends["master"].wall.stiffness
    own = math.sqrt((hand.stiffness + draw.among(0.0, walled)) / held) / (2.0 * math.pi)
    reach = 0.01 * draw.among(1.0, -1.0)
    spring = {"stiffness": other.stiffness, "position": draw.among(0.01, -0.01, 0.0)}
    return {
        "axes": {
            "master.a": {"inertia": ends["master"].mass, "damping": ends["master"].damping},
            "slave.a": {
                "inertia": ends["slave"].mass + other.mass,
                "damping": ends["slave"].damping,
            },
        },
        "hand": {
            "a": {
                "mass": hand.mass,
                "damping": 0.0,
                "stiffness": hand.stiffness,
                "reference": {
                    "type": "multisine",
                    "ramp_s": 5.0 * period,
                    "offset": 0.5 * reach,
                    "components": [[min(own, 0.45 / period), reach, draw.between(0.0, 6.0)]],
                },
            }
        },
        "environment": {
            "a": {"type": "spring", **spring}
            if draw.among(True, True, False)
            else {"type": "wall", "side": "above", **spring, "position": 0.003}
        },
    }


def with_users(data: Tree, users: Tree) -> Tree:
    """Return the rig with these users."""
    out = deepcopy(data)
    out["simulation"] = users
    return out


class Account(NamedTuple):
    """What the motors gave, as shares of all the energy that went through them.

    beyond: more than they and the devices' dampers took, and all that the verdicts allow, encoder
    steps included. wall: a wall more than the damper of its device took. port: a port more than it
    claims.
    """

    beyond: float
    wall: float
    port: float


def settle(rig: Rig, certificate: Certificate) -> Account:
    """Simulate, and compare what the motors gave with what the certificate's numbers allow."""
    run = simulate(rig)
    power = pair_scale(rig.coupling.pairs["a"]).power
    given: Any = 0.0
    bound: Any = 0.0
    flow, wall, port = 0.0, -math.inf, -math.inf
    for side, weight in (("master", 1.0), ("slave", 1.0 / power)):
        work, lost = (
            weight * gain(run, f"plant.{side}.a.{key}") for key in ("motor_work", "viscous_loss")
        )
        given = given + work - lost
        flow += float(np.abs(np.diff(work)).sum())
        # The books of the elements are in the master's units already.
        if _has(run, f"wall_{side}"):
            wall = max(wall, float(np.max(-gain(run, f"a.wall_{side}.absorbed") - lost)))
        owed = -gain(run, f"a.port_{side}.absorbed")
        if _has(run, f"damper_{side}"):
            owed = owed - gain(run, f"a.damper_{side}.absorbed")
        may = weight * port_numbers(certificate, side)["seen_j"]
        bound = bound + may + weight * feigned(certificate, side, len(run))
        port = max(port, float(np.max(owed - may)))
    if flow == 0.0:
        return Account(0.0, 0.0, 0.0)
    beyond = float(np.max(given - bound)) / flow
    return Account(beyond, wall / flow, port / flow)


def _has(run: Simulation, element: str) -> bool:
    return f"a.{element}.absorbed" in run.columns


def gain(run: Simulation, column: str) -> Array:
    found: Array = run[column] - run[column][0]
    return found


def feigned(certificate: Certificate, side: str, rows: int) -> Array:
    """Return what encoder steps let out of a wall, row by row [J]."""
    periods = np.arange(float(rows))
    out: Array = np.zeros(rows)
    for element in certificate.elements:
        if element.kind == "wall" and element.axis == f"{side}.a":
            out = out + element.numbers["activity_j"] * (0.5 * periods + 1.0)
    return out


def port_numbers(certificate: Certificate, side: str) -> Mapping[str, Any]:
    """Return what the certificate computed of the port of a side."""
    [numbers] = [e.numbers for e in certificate.elements if e.name == f"{side}.a port"]
    return numbers
