"""The certificate as its own program: of a bus that is hardware, nothing simulated counts."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest

from tautwave.certificate.__main__ import main
from tautwave.config import load_rig, resolved_yaml

RIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
LATE = "simulation.axes.slave.lever.command_delay_s=0.005"


@pytest.mark.parametrize(("hardware", "said"), [((), True), (("hand",), True), (("arm",), False)])
def test_a_simulated_delay_counts_where_the_bus_is_simulated(
    monkeypatch: pytest.MonkeyPatch, hardware: tuple[str, ...], said: bool
) -> None:
    out = io.StringIO()
    monkeypatch.setattr(sys, "argv", ["certificate", *hardware])
    monkeypatch.setattr(sys, "stdin", io.StringIO(resolved_yaml(load_rig(RIG, [LATE]))))
    monkeypatch.setattr(sys, "stdout", out)
    assert main() == 0
    assert (
        "simulated commands act after 0.005 s" in json.dumps(json.loads(out.getvalue()))
    ) is said
