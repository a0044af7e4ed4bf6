"""Two arms with the inertia and friction that OpenArm publishes, coupled as it does and by waves.

    python -m tests.arms.open_arm [--delay 0 0.02] [--seconds 6]

OpenArm exchanges positions at its motors (240 N m/rad and 3 N m s/rad) and feeds forward the
friction of its model, all of it; gravity is left out, as both would carry it alike. Here the same
joints, 1 kHz, 18 bits, are moved by hands, each 0.3 rad at 0.25 Hz and a little at 3 Hz, free or
into a stop of 500 N m/rad at 0.1 rad. Printed for each coupling, of the worst joint: how far it is
from where the leader is and was a delay ago (rms), what the hand bears (rms), the most that its
coupling had given out at any time, the share of the motion's power above 8 Hz, how long it ran; and
what the certificate says beforehand. Where OpenArm's law does not couple, 0.8 of the lower bounds
of Coulomb friction is taken off, and half of the viscous.
"""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple

import numpy as np

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.config import Rig
from tautwave.config.load import parse_rig
from tautwave.sweep.measure import measure_run, scales_of

INERTIA = (0.55, 0.35, 0.10, 0.024, 0.020, 0.013, 0.008)
COULOMB = (0.31, 0.31, 0.40, 0.17, 0.05, 0.09, 0.17)
VISCOUS = (0.06, 0.06, 0.60, 0.81, 0.03, 0.07, 0.08)
LEVERS = (0.3, 0.3, 0.3, 0.25, 0.15, 0.1, 0.1)
"""[m] Of the hand at each joint: its grip acts at that distance."""

MEASURES = ("position_error_rms", "hand_effort_rms", "fast_share")
STOP = "{type: wall, stiffness: 500.0, damping: 1.0, position: 0.1}"


class Way(NamedTuple):
    """A coupling: its law, keys of its pairs, whether in an account, shares of friction."""

    law: str
    pair: str
    account: bool
    friction: str


WAYS = {
    "OpenArm's": Way("position", "stiffness: 240, damping: 3", False, "coulomb: 1.0, viscous: 1.0"),
    "the same, account": Way(
        "position", "stiffness: 240, damping: 3", True, "coulomb: 0.8, viscous: 0.5"
    ),
    "wave": Way("wave", "wave_filter_hz: 100", False, "coulomb: 0.8, viscous: 0.5"),
}


def rig_of(way: Way, delay_s: float, stopped: bool, seconds: float) -> Rig:
    """Return the rig of one coupling."""
    lines = [
        "{name: open-arm, rate_hz: 1000, require: passive, seed: 1",
        f"duration_s: {seconds}",
        "loop: {missing_limit: 2, overrun_limit: 2}",
        "buses: {leader: {driver: loopback}, follower: {driver: loopback}}",
    ]
    for side, bus in (("master", "leader"), ("slave", "follower")):
        axes = []
        for k, (m, c, b) in enumerate(zip(INERTIA, COULOMB, VISCOUS, strict=True), 1):
            axes.append(
                f"j{k}: {{id: {k}, inertia: {{value: {m}, lower: {0.8 * m}, source: published}}, "
                f"damping: {{value: {b}, lower: {0.8 * b}, source: published}}, "
                f"coulomb: {{value: {c}, lower: {0.8 * c}, source: published}}}}"
            )
        lines.append(
            f"{side}: {{defaults: {{bus: {bus}, kind: rotary, effort_limit: 20, "
            "effort_rate_limit: 20000, velocity_limit: 8, position_range: [-1.5, 1.5], "
            f"encoder_quantum: 2.4e-5, compensation: {{{way.friction}}}}}, "
            f"axes: {{{', '.join(axes)}}}}}"
        )
    pairs = ", ".join(f"j{k}: {{{way.pair}}}" for k in range(1, 8))
    account = "account: {}, " if way.account else ""
    lines.append(f"coupling: {{law: {way.law}, delay_s: {delay_s}, {account}pairs: {{{pairs}}}}}")
    hands = ", ".join(
        f"j{k}: {{lever_arm: {lever}, reference: {{type: multisine, "
        f"components: [[0.25, 0.3, 0.0], [3.0, 0.01, 0.0]]}}}}"
        for k, lever in enumerate(LEVERS, 1)
    )
    walls = ", ".join(f"j{k}: {STOP}" for k in range(1, 8)) if stopped else ""
    true = ", ".join(
        f"{side}.j{k}: {{coulomb: {c}}}"
        for side in ("master", "slave")
        for k, c in enumerate(COULOMB, 1)
    )
    lines.append(f"simulation: {{axes: {{{true}}}, hand: {{{hands}}}, environment: {{{walls}}}}}}}")
    return parse_rig(",\n ".join(lines), "open-arm.yaml", [])


def measured(way: Way, delay_s: float, stopped: bool, seconds: float) -> dict[str, float]:
    """Run one coupling; return the worst of all joints, `late` the error to a delay ago."""
    rig = rig_of(way, delay_s, stopped, seconds)
    found = simulate(rig)
    table: dict[str, Any] = dict(zip(found.columns, found.data.T, strict=True))
    worst = {"ended_s": len(found.data) / rig.rate_hz}
    for name in rig.coupling.pairs:
        values = measure_run(scales_of(rig, name), MEASURES, table, finished=found.error is None)
        late = rig.delay_samples
        leader = table[f"true.master.{name}.position"]
        follower = table[f"true.slave.{name}.position"]
        apart = leader[: len(leader) - late] - follower[late:]
        gave = -table[f"master.{name}.port_energy"] - table[f"slave.{name}.port_energy"]
        for side in ("master", "slave"):  # what takes friction off is paid by friction
            gave += table[f"{name}.compensation_{side}.absorbed"]
        values["made"] = max(0.0, float(gave.max()))
        values["late"] = float(np.sqrt(np.mean(apart**2)))
        for key, value in values.items():
            worst[key] = max(worst.get(key, 0.0), value)
    return worst


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--delay", type=float, nargs="+", default=[0.0, 0.02])
    parser.add_argument("--seconds", type=float, default=6.0)
    asked = parser.parse_args()
    print("delay ms, contact, coupling: error mrad, late mrad, hand N m, made J, above 8 Hz, s")
    for delay_s in asked.delay:
        for stopped in (False, True):
            for name, way in WAYS.items():
                w = measured(way, delay_s, stopped, asked.seconds)
                verdict = ""
                if not stopped:
                    found = certify(rig_of(way, delay_s, stopped, asked.seconds))
                    verdict = "; " + ", ".join(
                        f"{kind} {'yes' if found.verdicts[kind].passed else 'no'}"
                        for kind in ("passive", "coupled_stable")
                    )
                print(
                    f"{1e3 * delay_s:g}, {'stop' if stopped else 'free'}, {name}: "
                    f"{1e3 * w['position_error_rms']:.3g}, {1e3 * w['late']:.3g}, "
                    f"{w['hand_effort_rms']:.3g}, {w['made']:.2g}, "
                    f"{100 * w['fast_share']:.2g} %, {w['ended_s']:g} {verdict}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
