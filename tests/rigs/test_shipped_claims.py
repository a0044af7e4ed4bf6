"""A shipped rig whose ports claim more than a device has at its velocity limit says why."""

from __future__ import annotations

import re

import pytest

from tautwave.config import load_rig
from tautwave.couplings.wave.claim import claimed_joules
from tautwave.rig import command_delays
from tests.certificate.rigs import CONFIGS

TIMES = re.compile(r"([\d.,]+)\s+times\s+the\s+kinetic\s+energy")
FASTER = re.compile(r"overrun_limit\s+2,\s+and\s+claims\s+([\d.]+)\s+times")
RIGS = sorted(path for path in CONFIGS.glob("*.yaml") if "law: wave" in path.read_text())


def ratio(path, *changes: str) -> float:
    """Return the greatest claim over the kinetic energy at the velocity limit."""
    rig = load_rig(path, changes)
    delays = command_delays(rig)
    return max(
        claimed_joules(rig, name, delays) / (0.5 * axis.inertia.value * axis.velocity_limit**2)
        for name, axis in rig.axes.items()
        if axis.inertia is not None and axis.velocity_limit is not None
    )


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_a_claim_above_the_kinetic_energy_is_explained_in_its_file(path) -> None:
    comments = " ".join(
        line.removeprefix("#").strip()
        for line in path.read_text().splitlines()
        if line.startswith("#")
    )
    found = ratio(path)
    said = TIMES.search(comments)
    assert said or found <= 1.0
    if said:
        assert float(said[1].replace(",", "")) == pytest.approx(found, rel=0.1)
    if faster := FASTER.search(comments):
        assert float(faster[1]) == pytest.approx(ratio(path, "loop.overrun_limit=2"), rel=0.1)
