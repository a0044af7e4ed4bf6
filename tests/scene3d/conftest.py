"""The steps of three dimensions are compiled once, whichever worker comes first."""

from __future__ import annotations

import pytest

from tests.compiling import compiling
from tests.scene3d.networks import everything


@pytest.fixture(scope="session")
def compiled3d() -> None:
    """Wait for who compiles them, or compile them: half a minute of a processor, then cached."""
    pytest.importorskip("numba")
    from tautwave_scenes.simulation.ticking3d import CompiledModel3d

    with compiling():
        CompiledModel3d(everything(), "symplectic", 1e-4)
