"""The installed drivers are stand-ins here, so that messages do not depend on what is installed."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import Any

import pytest

from tautwave import registry

STAND_INS = {
    "loopback": "tests.config.plugins:loopback",
    "acme": "tests.config.plugins:acme",
    "open": "tests.config.plugins:opened",
    "halfway": "tests.config.no_such_module:plugin",
    "number": "tests.config.plugins:not_a_plugin",
}


def _entry_points() -> EntryPoints:
    ours = (registry.COUPLINGS, registry.CONTROLS, registry.ENVIRONMENTS, registry.HANDS)
    kept = [point for group in ours for point in entry_points().select(group=group)]
    put = [
        EntryPoint(name, value, group)
        for group in (registry.DRIVERS, registry.SIMULATORS)
        for name, value in STAND_INS.items()
    ]
    return EntryPoints([*kept, *put])


@pytest.fixture(autouse=True)
def stand_ins(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if not request.node.get_closest_marker("installed"):
        monkeypatch.setattr(registry, "entry_points", _entry_points)


def pytest_configure(config: Any) -> None:
    config.addinivalue_line("markers", "installed: uses the entry points that are installed")
