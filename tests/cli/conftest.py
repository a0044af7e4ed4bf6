"""Backends of the command line as stubs, so that its own promises are tested alone."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner, Result

import tautwave
import tautwave.session.facts  # beneath a stub of the session there is no package to find it in
from tautwave.cli import main
from tautwave.contracts import Budget
from tautwave.summary import summary_of

SUMMARY: dict[str, Any] = {
    "outcome": {"kind": "finished", "sentence": "Ran for the 2 s asked for."},
    "cycles": 2000,
    "missed_cycles": 3,
    "rate_hz": 1000.0,
    "wall_time_s": 0.08,
    "period_us": {"p50": 1000.0, "p99": 1010.0, "p999": 1100.0, "max": 2000.0},
    "compute_us": {"p50": 41.5, "p99": 60.0, "p999": 80.0, "max": 95.0},
    "pairs": {
        "wrist": {
            "kind": "rotary",
            "position_error": {"rms": 0.0123, "max": 0.04},
            "effort_error": {"rms": 0.001, "max": 0.002},
            "elements": {},
        }
    },
    "energy_j": {"gross_flow": 2.5, "residual": 2.5e-14, "generated": 0.0, "sensing_gap": 1e-6},
    "axes": {"master.wrist": {"lost": 0, "late": 0, "faults": []}},
    "certificate": {"passed": None, "verdicts": {}},
    "left_out": [{"element": "wall_master", "reason": "the rig has none"}],
}


class Backend:
    """What `tautwave.config` and `tautwave.session` were asked, and what they shall answer."""

    def __init__(self) -> None:
        self.loaded: tuple[Path, Sequence[str]] | None = None
        self.run_arguments: dict[str, Any] = {}
        self.summary = dict(SUMMARY)
        self.exit_code = 0
        self.error: BaseException | None = None
        self.warnings: list[str] = []
        self.ways: list[str] = []
        self.ways_asked: dict[str, Any] = {}

    def load_rig(self, path: Path, overrides: Sequence[str] = (), **_: object) -> Any:
        self.loaded = (path, overrides)
        return SimpleNamespace(name="bench / 1dof", operate=None, sites=None, site=None)

    def run(self, rig: Any, **arguments: Any) -> Any:
        self.run_arguments = arguments
        if self.error is not None:
            raise self.error
        arguments["progress"](0.5, "running")
        for sentence in self.warnings:
            arguments["warn"](sentence)
        (arguments["out"] / "summary.json").write_text("{}")
        return SimpleNamespace(
            summary=summary_of(self.summary)[0],
            directory=arguments["out"],
            exit_code=self.exit_code,
        )

    def describe_ways(self, rig: Any, **asked: Any) -> list[str]:
        self.ways_asked = asked
        return self.ways

    def check(self, rig: Any, **asked: Any) -> Any:
        if self.error is not None:
            raise self.error
        return SimpleNamespace(
            facts=[("rate", "1000 Hz"), ("pair wrist", "50 ms, 50 samples")],
            pairs=[("wrist", "50 ms", "2.5 rad/(N m)", "98% of the effort")],
            claims=[],
            ways={},
            improvement=None,
            allowance=[],
            axes=[("master.wrist", "hand 1", "effort", "1 N m", "no step", "none")],
            failures=[],
            plan=[
                ("delay line", "in", "delay_s is 0.05"),
                ("wall_master", "left out", "the rig has none"),
            ],
            certificate={"passed": None, "verdicts": {}},
            budget={"hand": None, "arm": Budget(0.0004, 2500.0, "4 frames of 100 us")},
            exit_code=self.exit_code,
            as_dict=lambda: {"name": "bench", "plan": [["delay line", "in", ""]]},
        )


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> Backend:
    stub = Backend()
    for name, members in (
        ("config", {"load_rig": stub.load_rig, "rig_schema": lambda: {"title": "Rig"}}),
        ("session", {"run": stub.run, "check": stub.check, "describe_ways": stub.describe_ways}),
    ):
        module = ModuleType(f"tautwave.{name}")
        for member, value in members.items():
            setattr(module, member, value)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setattr(tautwave, name, module, raising=False)
    return stub


@pytest.fixture
def tautwave_cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Run the command line in an empty directory."""
    monkeypatch.chdir(tmp_path)

    def invoke(*arguments: object) -> Result:
        return CliRunner().invoke(main, [str(word) for word in arguments])

    return invoke
