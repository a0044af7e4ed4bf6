"""Rigs with an admittance slave that are certified, on springs as stiff as was declared.

The hand is the lossless one of `adversaries`, tuned against the master; what the slave touches is a
spring without a damper, mostly the stiffest one declared to its port. Neither end's motors give
energy beyond what the account of the master's port may owe. Four times that stiffness breaks it:
else it could not fail.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from tautwave.certificate import Certificate, certify
from tautwave.config import Rig
from tautwave.rig import pair_scale
from tautwave.simulation import simulate
from tests.certificate.adversaries import Draw, draw_rig, gain, port_numbers, with_users
from tests.rigs.running import Tree, rig_of

pytestmark = pytest.mark.usefixtures("without_advice")

ROUNDING = 1e-9
LAG = 0.2
"""Time constant of the slave's drive in periods: the slowest that counts as reaching its velocity
within one."""


class Given(NamedTuple):
    """Shares of all the energy that the motors moved.

    slave: what the slave's port gave over what it claims [1]. beyond: what both ends' motors gave
    more than dampers took and both ports claim [1].
    """

    slave: float
    beyond: float


def draw_admittance_rig(seed: int, cycles: int, count: int) -> tuple[Tree, list[Tree]]:
    """Return a rig of `draw_rig` whose slave takes velocity, and truths of several users."""
    data, users = draw_rig(seed, cycles, count=count)
    draw = Draw(seed + 1)
    pair, rate = data["coupling"]["pairs"]["a"], data["rate_hz"]
    pair.pop("wall_slave", None)
    pair["matched_slave"] = False
    scale = pair.get("position_scale", 1.0)
    impedance = pair["wave_impedance"] * pair.get("force_scale", 1.0 / scale) / scale
    upper = impedance * rate * draw.magnitude(1e-3, 3.0)
    data["slave"]["axes"]["a"] = {
        "bus": "arm", "id": 1, "kind": "linear", "causality": "admittance",
        "effort_limit": 1e6, "velocity_limit": 1e4, "environment_stiffness_upper": upper,
    }  # fmt: skip
    for user in users:
        share = draw.among(1.0, 1.0, draw.between(0.0, 1.0))
        place = draw.among(0.01, -0.01, 0.0)
        user["axes"]["slave.a"] = {"velocity_time_constant_s": LAG / rate}
        spring = {"type": "spring", "stiffness": share * upper, "position": place}
        user["environment"] = {"a": spring}
    return data, users


def settle(rig: Rig, certificate: Certificate) -> Given | None:
    """Simulate, and say what came out; None where nothing moved."""
    run = simulate(rig)
    weight = 1.0 / pair_scale(rig.coupling.pairs["a"]).power
    master, slave = (gain(run, f"plant.{side}.a.motor_work") for side in ("master", "slave"))
    slave = weight * slave
    flow = float(np.abs(np.diff(master)).sum() + np.abs(np.diff(slave)).sum())
    if flow == 0.0:
        return None
    claim = weight * port_numbers(certificate, "slave")["seen_j"]
    may = port_numbers(certificate, "master")["seen_j"] + claim
    given = master - gain(run, "plant.master.a.viscous_loss") + slave
    own = float(np.max(-gain(run, "a.port_slave.absorbed")))
    return Given(own / claim, float(np.max(given - may)) / flow)


def meet(seeds: range, cycles: int, count: int) -> Iterator[Given]:
    """Yield what came of the certified rigs among the seeds, with each of their users."""
    for seed in seeds:
        data, users = draw_admittance_rig(seed, cycles, count)
        certificate = certify(rig_of(with_users(data, users[0])))
        if not certificate.verdicts["passive"].passed:
            continue
        for user in users:
            found = settle(rig_of(with_users(data, user)), certificate)
            if found is not None:
                yield found


def hold(seeds: range, cycles: int, count: int) -> None:
    met = list(meet(seeds, cycles, count))
    assert len(met) > len(seeds) * count // 20  # else too few were certified, or moved
    assert max(found.slave for found in met) <= 1.0
    assert max(found.beyond for found in met) <= ROUNDING


def test_no_spring_that_was_declared_draws_energy_from_an_admittance_slave() -> None:
    hold(range(4, 8), 300, 2)


@pytest.mark.slow
def test_hundreds_of_rigs_with_an_admittance_slave() -> None:
    hold(range(100, 116), 1000, 8)


@pytest.mark.slow
def test_nothing_more_comes_of_an_admittance_slave_with_time() -> None:
    hold(range(1010, 1018), 20_000, 3)
