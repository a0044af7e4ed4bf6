"""Rigs for `worlds`: followers, tips, slow buses, operated ones that engage on a loaded contact."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from tautwave.certificate import certify
from tautwave.config import Rig
from tautwave.errors import ConfigError
from tests.certificate.adversaries import Draw
from tests.certificate.worlds import PAUSE_S, Device, Got, meet
from tests.rigs.running import Tree, rig_of, tree

CONFIGS = Path(__file__).parents[2] / "configs"
SIDES = ("master", "slave")


class Foe(NamedTuple):
    """A rig, what moves at its drivers, and when it is operated how."""

    rig: Rig
    devices: dict[str, Device]
    orders: tuple[tuple[float, str], ...] = ()


def mass_tree(draw: Draw, seconds: float) -> Tree:
    """Two masses on a line of waves, as unlike as they may be."""
    rate = draw.among(500.0, 1000.0, 2000.0)
    pair: Tree = {
        "wave_impedance": draw.magnitude(0.3, 30.0),
        "pole_master": draw.among(0.5, 0.3, "plain"),
        "pole_slave": draw.among(0.5, 0.3, "plain"),
        "matched_master": draw.among(False, False, True),
        "sign": draw.among(1, -1),
        "wave_filter_hz": draw.between(0.02, 0.4) * rate / 8.0,
    }
    if draw.among(True, False):
        pair |= {"position_scale": draw.magnitude(0.3, 3.0), "force_scale": draw.magnitude(0.3, 3)}
    data = tree(
        {
            "rate_hz": rate,
            "duration_s": seconds,
            "coupling.delay_s": draw.among(0, 1, 3, 10, 40) / rate,
            "coupling.pairs.a": pair,
            "coupling.engage_ramp_s": draw.among(0.0, 0.05),
            "coupling.release_ramp_s": 0.02,
            "loop": {"missing_limit": 3, "overrun_limit": 2},
        }
    )
    for side in SIDES:
        data[side]["axes"]["a"].update(
            inertia={"value": 0.5, "lower": draw.magnitude(0.1, 0.5), "source": "test"},
            damping=draw.magnitude(0.05, 5.0),
            effort_limit=draw.magnitude(5.0, 80.0),
            effort_rate_limit=draw.among(2e3, 1e5),
            velocity_limit=draw.magnitude(0.5, 5.0),
        )
        if draw.among(True, False):
            # The driver of a bus with a divisor says it in periods of its own.
            data["buses"]["hand" if side == "master" else "arm"]["options"] = {
                "command_delay_s": draw.among(0, 1, 2) / rate
            }
    return data


def mass_of(rig: Rig, name: str) -> Device:
    """Return what moves at an axis with keys of its own."""
    axis = rig.axes[name]
    low, high = axis.position_range or (-50.0, 50.0)
    span = high - low
    spring = axis.environment_stiffness_upper or 0.0
    if axis.follower is not None:
        spring = axis.follower.stiffness
    return Device(
        low + 0.05 * span,
        high - 0.05 * span,
        axis.velocity_limit or 5.0,
        axis.inertia.lower if axis.inertia is not None else 0.1,
        axis.effort_limit,
        spring,
        axis.follower is not None,
    )


def masses_of(rig: Rig) -> dict[str, Device]:
    return {name: mass_of(rig, name) for name in rig.axes}


def taking_velocity(draw: Draw, data: Tree) -> None:
    """Have the slave take velocities."""
    pair = data["coupling"]["pairs"]["a"]
    scale = pair.get("position_scale", 1.0)
    impedance = pair["wave_impedance"] * pair.get("force_scale", 1.0 / scale) / scale
    pair.pop("pole_slave")
    data["slave"]["axes"]["a"] = {
        "bus": "arm", "id": 1, "kind": "linear", "causality": "admittance",
        "effort_limit": draw.magnitude(5.0, 80.0), "velocity_limit": draw.magnitude(0.5, 5.0),
        "environment_stiffness_upper": impedance * data["rate_hz"] * draw.magnitude(0.01, 1.0),
    }  # fmt: skip
    drive = {"velocity_time_constant_s": 0.1 / data["rate_hz"]}
    data["simulation"] = {"axes": {"slave.a": drive}}


def slow_bus(seed: int, seconds: float) -> Foe:
    """One bus or both are served in every nth slot only."""
    draw = Draw(seed)
    data = mass_tree(draw, seconds)
    if draw.among(True, False, False):
        taking_velocity(draw, data)
    data["buses"]["arm"]["divisor"] = draw.among(2, 3, 5, 8)
    if draw.among(True, False, False):
        data["buses"]["hand"]["divisor"] = draw.among(2, 4)
    for bus in data["buses"].values():
        slow = bus.get("divisor", 1)
        late = bus.pop("options", {}).get("command_delay_s", 0.0)
        if late > 0.0:
            bus["options"] = {"command_delay_s": slow * late}
    rig = rig_of(data)
    return Foe(rig, masses_of(rig))


def engaging_again(seed: int, seconds: float) -> Foe:
    """An operated rig is let go of and engaged again and again, its slave on a loaded contact."""
    draw = Draw(seed)
    data = mass_tree(draw, seconds)
    if draw.among(True, False):
        taking_velocity(draw, data)
    data["operate"] = {"start": "engaged"}
    rig = rig_of(data)
    orders, at = [], 0.35
    while at < seconds - PAUSE_S:
        orders += [(at, "clutch"), (at + 0.06, "engage")]
        at += PAUSE_S + draw.between(0.05, 0.3)
    return Foe(rig, masses_of(rig), tuple(orders))


def follower(seed: int, seconds: float) -> Foe:
    """The gripper's finger, which takes goals, and its trigger."""
    draw = Draw(seed)
    data: Tree = yaml.safe_load((CONFIGS / "bench-gripper-loopback.yaml").read_text())
    for at in (data["master"]["axes"], data["slave"]["axes"], data["coupling"]["pairs"],
               data["simulation"]["hand"]):  # fmt: skip
        del at["elbow"]
    for side in SIDES:
        del data["simulation"]["axes"][f"{side}.elbow"]
    changes: dict[str, Any] = {
        "duration_s": seconds,
        "rate_hz": draw.among(250, 500, 1000),
        "coupling.delay_s": draw.among(0.0, 0.004, 0.02, 0.1),
        "coupling.pairs.gripper.wave_impedance": draw.magnitude(0.01, 0.3),
        "slave.axes.gripper.follower.stiffness": draw.magnitude(0.2, 5.0),
        "slave.axes.gripper.effort_limit": draw.magnitude(0.1, 1.0),
        "slave.axes.gripper.velocity_limit": draw.magnitude(1.0, 10.0),
        "slave.axes.gripper.encoder_quantum": 0.0,
        "coupling.pairs.gripper.pole_master": draw.among("plain", "plain", 0.3),
        "simulation.axes.slave/gripper.inertia": 1e-6,
    }
    if draw.among(True, False):
        changes["coupling.pairs.gripper.position_scale"] = draw.magnitude(0.3, 3.0)
        changes["coupling.pairs.gripper.force_scale"] = draw.magnitude(0.3, 3.0)
    rig = rig_of(tree(changes, base=data))
    return Foe(rig, masses_of(rig))


def tips(seed: int, seconds: float) -> Foe:
    """Two arms coupled at their tips: their joints are moved, wherever the tips go."""
    draw = Draw(seed)
    data: Tree = yaml.safe_load((CONFIGS / "arms" / "planar.yaml").read_text())
    for bus in ("hand", "arm"):
        options = data["buses"][bus]["options"]
        options["walls"] = {}
        elbow = draw.among(1, -1) * draw.between(0.4, 2.5)
        options["home"] = [draw.between(-1.0, 1.0), elbow]
    changes: dict[str, Any] = {
        "duration_s": seconds,
        "coupling.delay_s": draw.among(0.0, 0.002, 0.02),
        "coupling.defaults.wave_impedance": draw.magnitude(1.0, 10.0),
        "coupling.defaults.position_scale": draw.magnitude(0.5, 2.0),
        "loop": {"missing_limit": 3, "overrun_limit": 2},
    }
    if draw.among(True, False):
        changes["coupling.defaults.force_scale"] = draw.magnitude(0.5, 2.0)
    rig = rig_of(tree(changes, base=data))
    devices = {}
    for side, bus in (("master", "hand"), ("slave", "arm")):
        for at, (joint, keys) in enumerate(data["buses"][bus]["options"]["joints"].items()):
            home = data["buses"][bus]["options"]["home"][at]
            devices[f"{side}.{joint}"] = Device(
                home - 0.3,
                home + 0.3,
                draw.magnitude(0.3, 3.0),
                keys["inertia_lower"],
                keys["effort_limit"],
                damping=keys["damping_lower"],
            )
    return Foe(rig, devices)


KINDS = {"follower": follower, "tips": tips, "slow bus": slow_bus, "engaging": engaging_again}


def attack(
    kind: str, seeds: Iterable[int], seconds: float, *, reserve: float = 1.0, faults: float = 0.0
) -> Iterator[tuple[int, Got | None]]:
    """Yield what came of each rig that is certified among the seeds; None of one that is not.

    `reserve`, `faults`: see `meet`.
    """
    for seed in seeds:
        try:
            foe = KINDS[kind](seed, seconds)
        except ConfigError:
            yield seed, None
            continue
        if not certify(foe.rig, brief=True).verdicts["passive"].passed:
            yield seed, None
            continue
        yield seed, meet(foe.rig, foe.devices, seed, foe.orders, reserve=reserve, faults=faults)
