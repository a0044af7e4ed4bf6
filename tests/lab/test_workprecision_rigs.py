"""Work-precision of whole rigs: schemes in closed loop, each run from the same start."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.bench.precision.rigs import rig_scene, run_job
from tautwave.simulation import simulate
from tautwave.simulation.kernel.compiled import compiled_kernel
from tautwave.simulation.kernel.pack import pack_rig
from tests.lab.workprecision.rigs import WAVE_FOAM

pytest.importorskip("numba")
pytestmark = pytest.mark.timeout(600)  # where the kernel has to be compiled first

SECONDS = 0.7  # the hand begins to move at 0.5 s


def test_every_round_begins_as_the_first_did() -> None:
    rig = WAVE_FOAM.load()
    job = pack_rig(rig, SECONDS)
    found = run_job(job, compiled_kernel(job.law), 3)
    np.testing.assert_array_equal(found.rows, simulate(rig, duration_s=SECONDS).data)
    assert found.cpu_s > 0.0


@pytest.mark.slow
def test_schemes_converge_to_the_oracle_with_their_orders() -> None:
    scene = rig_scene(WAVE_FOAM, (1, 4), (1e-6,), 1e-4, SECONDS, 1)
    errors: dict[str, list[float]] = {}
    for point in scene.points:
        errors.setdefault(point.method, []).append(point.error)
        if point.method == "discrete_gradient":
            assert point.energy_error < 1e-13
    # Where the foam is let go its force has a kink, and no scheme has more than its second order.
    for method, order in (("symplectic_euler", 1), ("implicit_midpoint", 2), ("rk4", 2)):
        coarse, fine = errors[method]
        assert math.log(coarse / fine, 4.0) == pytest.approx(order, abs=0.4), method
    assert errors["dormand_prince"][0] < 1e-6
