"""Suites for authors of parts and drivers; they need pytest.

Inherit from a suite and provide its one fixture:

    from tautwave.testing import DriverBench, DriverContract

    class TestMyDriver(DriverContract):
        @pytest.fixture
        def bench(self) -> DriverBench: ...
"""

import pytest

pytest.register_assert_rewrite(
    "tautwave.testing.couplings", "tautwave.testing.drivers",
    "tautwave.testing.environments", "tautwave.testing.hands",
)  # fmt: skip

from tautwave.testing.couplings import CouplingBench, CouplingContract  # noqa: E402
from tautwave.testing.drivers import DriverBench, DriverContract  # noqa: E402
from tautwave.testing.environments import EnvironmentBench, EnvironmentContract  # noqa: E402
from tautwave.testing.hands import HandBench, HandContract  # noqa: E402

__all__ = [
    "CouplingBench",
    "CouplingContract",
    "DriverBench",
    "DriverContract",
    "EnvironmentBench",
    "EnvironmentContract",
    "HandBench",
    "HandContract",
]
