"""Random motions of two planar arms coupled at their tips: stretched, folded, clutched, walled.

    python -m tests.arms.motions --count 1000 [--first 0] [--following]

Each is 1.4 s with 20 ms of delay: a hand leads the tip to and fro, half of the arms begin stretched
out or folded (singular), the coupling is let go of, the hand goes on, rests, and it is engaged
again; walls are touched. What all motors
together gave the arms, at any moment, must stay below what ports and mapping claim before the run;
the truth is the simulated arms' own. With `--following` the joints of the follower take velocities,
and springs or walls hold its tip.
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import load_rig
from tautwave.rig import build_rig, command_delays
from tautwave.runtime.operate.commands import Order, Script
from tautwave.session.facts import port_claims
from tautwave.session.operating import with_operation
from tautwave.simulation.memory import run_in_memory

PLANAR = Path(__file__).parents[2] / "configs" / "arms" / "planar.yaml"
SECONDS = 1.4
SIZE = {"hand": (0.18, 0.16), "arm": (0.30, 0.25)}


class Motion(NamedTuple):
    """Most that the motors gave at any moment [J], what was claimed, how singular it became.

    `singular` is the least sine of an elbow; `fault` why it ended early.
    """

    given: float
    claimed: float
    singular: float
    engagements: int
    fault: str


FOLLOWING = (
    "slave.defaults={bus: arm, kind: linear, causality: admittance, effort_limit: 60, "
    "effort_rate_limit: 10000, velocity_limit: 3, position_range: [-2.0, 2.0], "
    "encoder_quantum: 1.5e-5, position_noise: 8.0e-6, position_noise_autocorrelation: [], "
    "environment_stiffness_upper: 300}",
    "coupling.defaults={wave_filter_hz: 100, position_scale: 1.5, wave_impedance: 5}",
    "buses.arm.options.walls={}",
    "buses.arm.options.truth={}",
    "require=coupled_stable",
)
"""What makes the joints of the follower take velocities."""


def random_rig(seed: int, following: bool = False) -> Any:
    """Return a rig with a motion of its own."""
    rng = random.Random(seed)
    more = ["operate={start: engaged}", f"seed={seed}", f"duration_s={SECONDS}"]
    times = (0.2, 0.35, 0.5, 0.6, 0.65, 0.75, 1.15, 1.3, 1.4)
    moving = (False, True, True, True, False, True, False, True, True)
    for c in "xy":
        at, way = 0.0, []
        for time, moves in zip(times, moving, strict=True):
            at = rng.uniform(-0.1, 0.1) if moves else at
            way.append([time, at])
        more.append(f"simulation.hand.{c}.reference={{type: minimum_jerk, waypoints: {way}}}")
    if following:
        more += FOLLOWING
        for c in "xy":
            kind = rng.choice(("spring", "wall"))
            keys = f"{{type: {kind}, stiffness: {rng.uniform(20, 290)}, "
            keys += f"position: {rng.uniform(-0.05, 0.05)}}}"
            more.append(f"simulation.environment.{c}={keys}")
            lag = rng.choice((1e-4, 0.002))
            more.append(f"simulation.axes.slave.{c}.velocity_time_constant_s={lag}")
    more += [f"{side}.defaults.position_range=[-2.0, 2.0]" for side in ("master", "slave")]
    for bus in ("hand", "arm"):
        joints = f"buses.{bus}.options.joints"
        # Half of them begin close to stretched out or folded.
        elbow = rng.choice([rng.uniform(0.02, 0.3), rng.uniform(2.8, 3.1), rng.uniform(0.5, 2.5)])
        home = [rng.uniform(-1.0, 1.0), rng.choice((-1, 1)) * elbow]
        more.append(f"buses.{bus}.options.home={home}")
        for joint in ("shoulder", "elbow"):
            more.append(f"{joints}.{joint}.position_range=[-50.0, 50.0]")
            more.append(f"{joints}.{joint}.velocity_limit=500")
    # A follower that is let go of has to come to rest before it is engaged again.
    if not following:
        for joint in ("shoulder", "elbow"):
            more.append(f"buses.arm.options.truth.joints.{joint}={{damping: 0.6, coulomb: 0.05}}")
    rig = load_rig(PLANAR, more)
    orders = [(0.62, "clutch"), (0.8, "engage")]
    script = Script([(round(1e9 * at), Order(word)) for at, word in orders])
    return rig, script


def move(seed: int, following: bool = False) -> Motion:
    """Run one motion."""
    rig, script = random_rig(seed, following)
    built = with_operation(rig, build_rig(rig, clock="fake"), [script], [])
    result, data = run_in_memory(built)
    rows = dict(zip(built.columns, data.T, strict=True))
    # The simulated arms have no weight here: what motors gave is what hands did not.
    given = np.zeros(len(data))
    least = 1.0
    for side, bus in (("master", "hand"), ("slave", "arm")):
        for c in "xy":
            given -= rows[f"{side}.{c}.port_energy"] - rows[f"{side}.{c}.port_energy"][0]
        given += rows[f"tip.{bus}.mapped"]
        for name in rig.buses[bus].options["walls"]:
            given -= rows[f"space.{bus}.{name}.absorbed"]
        least = min(least, float(np.abs(np.sin(rows[f"joints.{side}.elbow.position"])).min()))
    delays = command_delays(rig)
    claims = [port_claims(rig, pair, delays)["claim_j"] for pair in "xy"]
    engaged = int(rows["operation.engagement"][-1])
    claimed = max(1, engaged) * sum(sum(claim.values()) for claim in claims)
    fault = "" if result.error is None else str(result.error)
    return Motion(float(given.max()), claimed, least, engaged, fault)


def main() -> None:
    """Run many and say what was the worst."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--following", action="store_true")
    asked = parser.parse_args()
    motions = []
    for seed in range(asked.first, asked.first + asked.count):
        motions.append(move(seed, asked.following))
        if len(motions) % 50 == 0:
            print(summary(motions), flush=True)
    print(summary(motions))


def summary(motions: list[Motion]) -> str:
    """Return the worst of some motions, in a line."""
    worst = max(motions, key=lambda motion: motion.given)
    share = max(motion.given / motion.claimed for motion in motions)
    again = sum(motion.engagements > 1 for motion in motions)
    close = sum(motion.singular < 0.05 for motion in motions)
    ended = sum(bool(motion.fault) for motion in motions)
    return (
        f"{len(motions)} motions: most given {1e3 * worst.given:.3g} mJ, {share:.2%} of what was "
        f"claimed; {again} engaged again, {close} through a singular pose, {ended} stopped early"
    )


if __name__ == "__main__":
    main()
