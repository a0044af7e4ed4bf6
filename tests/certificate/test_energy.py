"""What is certified as passive gives nothing, on the plant's own account."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.certificate import certify
from tautwave.config import render_stiffness
from tests.rigs.drawing import rigs
from tests.rigs.running import Tree, pair_of, rig_of, run_rig


@pytest.mark.slow
@pytest.mark.usefixtures("without_advice")
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(rigs(cycles=250), st.sampled_from([0.0, 0.5, 5.0, 50.0]))
def test_motors_give_no_more_than_they_took(data: Tree, damping: float) -> None:
    """Wall and damping of its device are one: Colgate's condition is on both together."""
    data["simulation"]["faults"] = {}
    for side in ("master", "slave"):
        for name, axis in data[side]["axes"].items():
            axis.update(encoder_quantum=0.0, position_noise=0.0, effort_quantum=0.0)
            axis["damping"] = data["simulation"]["axes"][f"{side}.{name}"]["damping"] = damping
    for pair in data["coupling"]["pairs"].values():
        for side in ("master", "slave"):
            if f"wall_{side}" in pair:
                pair[f"wall_{side}"]["derate"] = True
    rig = rig_of(data)
    certificate = certify(rig)
    verdict = certificate.verdicts["passive"]
    if not verdict.passed or any("effort_rate_limit" in text for text in verdict.conditions):
        return  # a condition that nobody checked here may be broken
    walls = certificate.walls.items()
    rig = render_stiffness(rig, {axis: wall["rendered_stiffness"] for axis, wall in walls})
    run = run_rig(rig, raises=False)
    for name in rig.coupling.pairs:
        pair = pair_of(run.assembly, name)
        given_out, flow = 0.0, 0.0
        for side, weight in (("master", 1.0), ("slave", pair.params.weight)):
            work, lost = (
                weight * run[f"plant.{side}.{name}.{part}"]
                for part in ("motor_work", "viscous_loss")
            )
            given_out = given_out + (work - work[0]) - (lost - lost[0])
            flow += float(np.abs(np.diff(work)).sum())
        assert np.max(given_out) <= 1e-9 * flow
