"""What a simulation states of hands and contacts, as the certificate counts it."""

from __future__ import annotations

import pytest

from tautwave.certificate.belief import stated_environment
from tautwave.models.foam import FoamParams, elastic_force
from tests.certificate.rigs import rig

FOAM = "simulation.environment.lever={{type: foam, stiffness: {}, exponent: {}, position: 0.05}}"


@pytest.mark.parametrize("stiffness", [0.6, 8.0, 300.0])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.7])
def test_foam_counts_with_its_slope_where_the_slave_presses_hardest(
    stiffness: float, exponent: float
) -> None:
    """Where it pushes back with the effort limit, found by bisection on the simulated force."""
    loaded = rig(FOAM.format(stiffness, exponent))
    foam = FoamParams(stiffness, exponent, 0.0, 0.05, 1.0, 1)
    limit = loaded.slave.axes["lever"].effort_limit
    shallow, deep = 0.0, 100.0
    for _ in range(80):
        middle = 0.5 * (shallow + deep)
        shallow, deep = (middle, deep) if elastic_force(foam, middle) < limit else (shallow, middle)
    step = 1e-5 * deep
    slope = (elastic_force(foam, deep + step) - elastic_force(foam, deep - step)) / (2.0 * step)
    found = stated_environment(loaded, "lever")
    assert found is not None
    assert found.stiffness == pytest.approx(slope, rel=1e-7)
    assert found.damping == 0.0
