"""Options that a rig states for its simulated devices: which of them are checked, and how often."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.config.messages import validate
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError


def test_what_options_say_to_simulated_devices_alone_is_checked_too() -> None:
    """The driver takes its `simulator` block as it is; only the simulator knows its keys."""
    path = Path(__file__).parents[2] / "configs" / "bench-modbus-tcp-sim.yaml"
    block = "buses.arm.options.simulator"
    with pytest.raises(ConfigError) as found:
        load_rig(path, [f"{block}.fautls={{}}", f"{block}.strict=1"])
    assert set(found.value.problems) == {
        f"--set {block}.fautls={{}}: unknown key 'fautls'; did you mean 'faults'? "
        "Allowed: faults, devices, server, silent_s, strict, latency_s",
        f"--set {block}.strict=1: Input should be a valid boolean (got 1); write true or false",
    }


def test_options_of_a_driver_that_is_its_own_simulator_are_checked_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = []

    def noted(document: Document, model: type[Any], path: KeyPath = ()) -> Any:
        seen.append(path)
        return validate(document, model, path)

    monkeypatch.setattr("tautwave.config.load.validate", noted)
    path = Path(__file__).parents[2] / "configs" / "bench-modbus-tcp-sim.yaml"
    load_rig(path, ["buses.hand.options={}"])
    assert seen.count(("buses", "hand", "options")) == 1
    assert seen.count(("buses", "arm", "options")) == 2
