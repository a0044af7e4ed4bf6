"""Requirements of a coupling's declaration: `class TestX(CouplingContract)` with a `bench`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from tautwave.certificate.data import CouplingVerdict
from tautwave.config import Coupling, Pair
from tautwave.contracts import CouplingPlugin, PortConstants
from tautwave.registry import load_named
from tautwave.wording import CouplingWords


class CouplingBench(NamedTuple):
    """A law, its name, and keys of a rig file for one of its pairs."""

    plugin: CouplingPlugin
    law: str
    pair: Mapping[str, Any]

    def block(self, **more: Any) -> Coupling:
        """Return the keys of a coupling of one pair; `more` are keys of that pair."""
        pairs = {"wrist": {**self.pair, **more}}
        found: Coupling = load_named(self.plugin.keys).model_validate(
            {"law": self.law, "pairs": pairs}
        )
        return found


class CouplingContract:
    """The suite; pytest collects the subclasses."""

    @pytest.fixture
    def bench(self) -> CouplingBench:
        raise NotImplementedError

    def test_its_keys_are_those_of_a_coupling_and_more(self, bench: CouplingBench) -> None:
        coupling = bench.block()
        assert isinstance(coupling, Coupling)
        assert isinstance(coupling.pairs["wrist"], Pair)
        for block in (coupling, coupling.pairs["wrist"]):
            assert block.model_config.get("extra") == "forbid"
            assert block.model_config.get("frozen")
            for name, field in type(block).model_fields.items():
                assert field.description, f"{name} has no description"

    def test_everything_that_is_named_is_there(self, bench: CouplingBench) -> None:
        plugin = bench.plugin
        for named in (plugin.constants, plugin.linear):
            if named:
                assert callable(load_named(named))
        if plugin.verdict:
            verdict = load_named(plugin.verdict)
            assert isinstance(verdict, CouplingVerdict) or callable(verdict)
        if plugin.words:
            assert isinstance(load_named(plugin.words), CouplingWords)
        assert plugin.carries in ("waves", "states")
        assert set(plugin.causalities) <= {"impedance", "admittance"}

    def test_constants_are_finite_and_in_the_units_of_each_device(
        self, bench: CouplingBench
    ) -> None:
        constants = load_named(bench.plugin.constants)
        pair = bench.block(position_scale=2.0, force_scale=3.0).pairs["wrist"]
        master, slave = constants(pair, "master"), constants(pair, "slave")
        assert isinstance(master, PortConstants)
        assert master.wave_impedance > 0.0
        for key in ("wave_impedance", "stiffness", "damping", "injection"):
            here, there = getattr(master, key), getattr(slave, key)
            assert math.isfinite(here)
            assert there == pytest.approx(1.5 * here)  # force over position scale

    def test_what_stands_passes_its_filter(self, bench: CouplingBench) -> None:
        assert 0.0 < bench.block().filter_step(1e-3) <= 1.0
