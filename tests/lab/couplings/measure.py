"""What a coupling did in a run: tracking, effort, calm, and energy against what was claimed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.fast_motion import fast_share
from tautwave.certificate.couplings import coupling_verdict
from tautwave.config import Rig
from tautwave.rig import command_delays, pair_scale
from tautwave.simulation import simulate

Float = npt.NDArray[np.float64]

SETTLED_S = 0.5
SIDES = ("master", "slave")


class Outcome(NamedTuple):
    """Of one run, pair's units.

    error: rms of master minus slave [rad]; effort: standard deviation of the master's [N m]; apart:
    rms of what hand and contact do together, 0 where the hand feels the contact and nothing else
    [N m]; fast: share of motion power above 8 Hz [1]; made: most energy that both motors had given,
    and gave in truth, and in truth less the stated bound [J]; whether the run ended early.
    """

    error: float
    effort: float
    apart: float
    fast: float
    seen: float
    made: float
    excess: float
    stopped: bool


def stated_bound(rig: Rig) -> float:
    """Return what both ends may actually supply by their accounts, pair's units [J]."""
    power = pair_scale(rig.coupling.pairs["lever"]).power
    delays, verdict = command_delays(rig), coupling_verdict(rig)
    total = 0.0
    for name, weight in (("master.lever", 1.0), ("slave.lever", 1.0 / power)):
        [found] = verdict.axis_elements(rig, name, delays, 0.0)
        total += weight * float(found.numbers["true_j"])
    return total


def run_coupling(rig: Rig, *, bound: float = float("inf"), engine: str = "compiled") -> Outcome:
    """Simulate a rig of one pair called lever and measure it; `bound` [J] is what it may give."""
    run = simulate(rig, engine=engine)
    at = {name: run.data[:, place] for place, name in enumerate(run.columns)}
    power = pair_scale(rig.coupling.pairs["lever"]).power
    true = at["plant.master.lever.motor_work"] + at["plant.slave.lever.motor_work"] / power
    seen = -at["master.lever.port_energy"] - at["slave.lever.port_energy"]
    kept = at["time_s"] > min(SETTLED_S, 0.5 * at["time_s"][-1])
    moved = [at[f"true.{side}.lever.position"][kept] for side in SIDES]
    made = max(0.0, float(np.max(true)))
    scale = pair_scale(rig.coupling.pairs["lever"])
    met = at["true.slave.lever.environment_effort"] * (scale.sign * scale.scale / power)
    together = (at["true.master.lever.hand_effort"] + met)[kept]
    return Outcome(
        error=float(np.sqrt(np.mean(at["lever.position_error"][kept] ** 2))),
        effort=float(np.std(at["master.lever.port_effort"][kept])),
        apart=float(np.sqrt(np.mean(together**2))),
        fast=max(fast_share(each, rig.period_s) for each in moved),
        seen=max(0.0, float(np.max(seen))),
        made=made,
        excess=made - bound,
        stopped=run.error is not None,
    )
