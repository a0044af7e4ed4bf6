"""Every shipped wave rig holds a tenth of its effort limit for a minute, at its encoder steps."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave import simulate
from tautwave.config import Rig, parse_rig
from tautwave.rig import command_delays, end_constants

CONFIGS = Path(__file__).parents[2] / "configs"
TOUCH = 0.02
"""Where the slave meets its wall [rad or m]."""

STILL_S = 20.0
"""By then the hand has come to rest [s]."""


def cases() -> list[tuple[str, str]]:
    """Return rig and pair of every shipped rig that moves impedance axes by waves; no arms."""
    found = []
    for path in sorted(CONFIGS.glob("*.yaml")):
        tree = yaml.safe_load(path.read_text())
        if any("arm" in tree.get(side, {}) for side in ("master", "slave")):
            continue  # a minute of it takes minutes
        if "simulation" in tree and tree.get("coupling", {}).get("law") == "wave":
            found += [(path.stem, name) for name in tree["coupling"]["pairs"]]
    return found


def held(name: str, pair: str, reach: float, seconds: float, by_s: float = 8.0) -> Rig:
    """Return a rig whose hand presses the slave into a wall and stays; Coulomb friction is 0."""
    tree: Any = yaml.safe_load((CONFIGS / f"{name}.yaml").read_text())
    scene = tree["simulation"]
    hand = scene.get("hand", {}).get(pair, {}) | {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.06 * by_s, 0.0], [by_s, reach]]}
    }
    scene["hand"] = {pair: hand}
    slave = tree["slave"]["axes"][pair]
    stiff = slave.get("environment_stiffness_upper") or 20.0
    wall = {"type": "wall", "position": TOUCH, "stiffness": stiff}
    if tree["coupling"]["pairs"][pair].get("sign") == -1:
        wall |= {"position": -TOUCH, "side": "below"}
    scene["environment"] = {pair: wall}
    scene.pop("faults", None)
    if "link" in tree:
        tree["link"].pop("outage_s", None)  # a force is not held through silence
    for truth in scene.get("axes", {}).values():
        truth.pop("coulomb", None)
    for side in ("master", "slave"):
        for axis in tree[side]["axes"].values():
            once = tree["buses"][axis["bus"]]["driver"] == "feetech"  # an encoder of one turn
            axis["position_range"] = [-3.1, 3.1] if once else [-10.0, 10.0]
            axis.pop("mechanical_range", None)
    for keys in tree["coupling"]["pairs"].values():
        keys.pop("wall_master", None)
        keys.pop("wall_slave", None)
    tree["duration_s"] = seconds
    return parse_rig(yaml.safe_dump(tree), name)


def effort(run: Any, pair: str, side: str = "master") -> float:
    """Return the mean effort of a port over the last second of holding [N m or N]."""
    values = run.data[:, run.columns.index(f"{side}.{pair}.port_effort")]
    return float(np.mean(values[len(values) * 6 // 10 : len(values) * 9 // 10]))


def on_the_line(rig: Rig, run: Any, side: str, pair: str, rows: slice) -> tuple[float, float]:
    """Return the mean effort of a port and that of the wave that arrives at it."""
    keys = rig.coupling.pairs[pair]
    at = {column: run.data[rows, k] for k, column in enumerate(run.columns)}
    root = math.sqrt(2.0 * keys.in_device_units(side, keys.wave_impedance))
    line = -root * keys.wave_gain(side) * np.mean(at[f"{side}.{pair}.wave_in"])
    return float(np.mean(at[f"{side}.{pair}.port_effort"])), float(line)


def test_an_effort_that_is_held_is_that_of_its_line() -> None:
    """A second of the bench before it is released; a minute of each rig, by night."""
    rig = held("bench-1dof-loopback", "lever", 0.1, 1.2, by_s=0.2)
    run = simulate(rig, engine="python")
    assert run.error is None
    delay = command_delays(rig)
    for side in ("master", "slave"):
        got, line = on_the_line(rig, run, side, "lever", slice(-800, -300))
        quantum = end_constants(rig, f"{side}.lever", delay[f"{side}.lever"]).quantum
        assert abs(got - line) <= 0.02 * abs(line) + quantum
        assert abs(got) > 0.01


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize(("name", "pair"), cases())
def test_a_tenth_of_the_effort_limit_is_held_for_a_minute(name: str, pair: str) -> None:
    pytest.importorskip("numba")
    rig = held(name, pair, 0.1, 60.0)
    keys = rig.coupling.pairs[pair]
    axes = {side: rig.axes[f"{side}.{pair}"] for side in ("master", "slave")}
    slaves = axes["slave"].effort_limit / keys.in_device_units("slave", 1.0)
    wanted = 0.1 * min(axes["master"].effort_limit, slaves)
    excess = 0.1
    for _ in range(8):  # how far beyond the wall the hand has to reach for a tenth
        reach = TOUCH / keys.position_scale + excess
        found = abs(effort(simulate(held(name, pair, reach, 14.0), engine="compiled"), pair))
        if abs(found - wanted) < 0.05 * wanted:
            break
        excess *= min(4.0, max(0.1, wanted / max(found, 1e-9)))
    assert found == pytest.approx(wanted, rel=0.1)
    delays = command_delays(rig)
    ends = {side: end_constants(rig, f"{side}.{pair}", delays[f"{side}.{pair}"]) for side in axes}
    run = simulate(held(name, pair, reach, 60.0), engine="compiled")
    assert run.error is None
    at = {column: run.data[:, k] for k, column in enumerate(run.columns)}
    second, first, last = (round(seconds * rig.rate_hz) for seconds in (1.0, STILL_S, 58.0))
    error = at[f"{pair}.position_error"][first:last]
    drift = np.mean(error[-second:]) - np.mean(error[:second])
    assert abs(drift) < max(1e-4, 0.1 * max(a.encoder_quantum for a in axes.values()))
    for side in axes:
        got, line = on_the_line(rig, run, side, pair, slice(first, last))
        assert abs(got - line) <= 0.005 * abs(line) + ends[side].quantum
        stored = at[f"{pair}.port_{side}.stored"][first:last]
        # no wave was cut: the tank never emptied (waiting waves count in `stored`)
        assert stored.min() > -0.99 * ends[side].port.reserve
