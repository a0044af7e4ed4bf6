"""Rigs of public arms: chains with the figures of their sources, errors as stated."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.config import load_rig
from tautwave.config.inputs.chains import chain_constants
from tautwave.models.chain.inertia import BASE, chain_screws, mass_matrix
from tautwave.models.chain.kinematics import chain_frames
from tautwave.registry import load_driver

ARMS = Path(__file__).parents[2] / "configs" / "arms"
READY = ("koch", "widowx-viperx", "z1-panda")
POSTURE = (0.3, -0.4, 0.5, -0.6, 0.7, -0.8, 0.9)

# Masses of all moving links [kg], and at POSTURE the weight's efforts [N m] and the tip [m] beside
# the first joint's foot, computed by another reader from the sources' files: MuJoCo Menagerie's
# low_cost_robot_arm.xml, Interbotix' wx250s and vx300s.urdf.xacro, z1.urdf and panda.urdf of
# example-robot-data 6.0.0. The Koch's first joint counts the other way there.
PUBLIC: dict[str, tuple[float, tuple[float, ...], tuple[float, ...]]] = {
    "koch slave": (
        0.2260, (0.0, 0.1455, -0.0635, 0.0014, -0.0001, -0.0021), (-0.1201, -0.0542, 0.0157),
    ),
    "widowx-viperx master": (
        1.5991, (0.0, -0.8211, -1.4165, -0.0475, -0.1175, 0.0078), (0.3127, 0.0364, 0.2393),
    ),
    "widowx-viperx slave": (
        2.7729, (0.0, -1.7176, -2.9731, -0.1220, -0.2586, 0.0079), (0.3647, 0.0454, 0.2895),
    ),
    "z1-panda hand": (
        4.7485, (0.0, 2.8212, -7.4880, -2.1275, -0.4734, -0.0015), (-0.0144, 0.0287, 0.0538),
    ),
    "z1-panda arm": (
        16.8221, (0.0, 10.0073, -2.5864, -1.3705, 0.1938, -0.5076, 0.0288),
        (-0.1156, 0.0272, 0.9113),
    ),
}  # fmt: skip


def chain_of(case: str) -> Any:
    name, side = case.split()
    rig = load_rig(ARMS / f"{name}.yaml")
    if side in rig.buses:
        bus = rig.buses[side]
        if bus.driver == "arm":
            return load_driver("arm").options.model_validate(bus.options).chain
    return rig.master.arm if side == "master" else rig.slave.arm


def tip_of(rows: Any, posture: tuple[float, ...]) -> Any:
    """Return the tip by the textbook's product of four matrices a row."""
    place = np.eye(4)
    for row, angle in zip(rows, posture, strict=False):
        c, s = np.cos(row.theta + angle), np.sin(row.theta + angle)
        ca, sa = np.cos(row.alpha), np.sin(row.alpha)
        place = place @ np.array(
            [
                [c, -s * ca, s * sa, row.a * c],
                [s, c * ca, -c * sa, row.a * s],
                [0.0, sa, ca, row.d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    return place[:3, 3]


@pytest.mark.parametrize("case", PUBLIC)
def test_the_chain_has_the_figures_of_its_source(case: str) -> None:
    mass, efforts, tip = PUBLIC[case]
    keys = chain_of(case)
    chain = chain_constants(keys)
    count = len(efforts)
    assert sum(joint.mass for joint in chain.joints) == pytest.approx(mass, abs=1e-4)
    weight, matrix = [0.0] * count, [0.0] * count**2
    posture = list(POSTURE[:count])
    frames = chain_frames(chain, posture)
    mass_matrix(chain, posture, frames, chain_screws(frames), BASE, matrix, weight)
    assert weight == pytest.approx(efforts, abs=2e-4)
    assert tip_of(keys.dh, POSTURE) == pytest.approx(tip, abs=1e-4)


def stated(text: str) -> dict[str, float]:
    """Return the errors that a file states, by pair, in rad or m."""
    said = re.sub(r"\n# ?", " ", text).partition("Tracking error over the 60 s, rms: ")[2]
    found = re.findall(r"(\w+) ([\d.]+) m(rad|m)\b", said)
    return {name: float(value) * 1e-3 for name, value, _ in found}


@pytest.mark.slow
@pytest.mark.parametrize("name", READY)
def test_errors_are_within_those_that_the_file_states(name: str) -> None:
    """In the first seconds, in which they reach, grip or press, with room for the way there."""
    path = ARMS / f"{name}.yaml"
    rig = load_rig(path, ["duration_s=8"])
    run = simulate(rig)
    said = stated(path.read_text())
    assert list(said) == list(rig.coupling.pairs)
    assert run.error is None
    errors = {pair: run[f"{pair}.position_error"] for pair in said}
    rms = {pair: float(np.sqrt(np.nanmean(np.square(one)))) for pair, one in errors.items()}
    assert {pair: value for pair, value in rms.items() if value > 1.7 * said[pair]} == {}
    assert sum(rms[pair] > 0.5 * said[pair] for pair in said) >= len(said) - 2


@pytest.mark.parametrize("name", READY)
def test_a_minute_of_each_rig_is_certified(name: str) -> None:
    rig = load_rig(ARMS / f"{name}.yaml")
    assert rig.duration_s == 60.0
    assert certify(rig).passed
