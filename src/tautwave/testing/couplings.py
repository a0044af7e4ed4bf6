"""Requirements of a coupling's declaration: `class TestX(CouplingContract)` with a `bench`."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from tautwave.certificate.data import CouplingVerdict
from tautwave.columns import ACCOUNT
from tautwave.config import Coupling, Pair
from tautwave.contracts import CouplingPlugin
from tautwave.controller.steps import Law
from tautwave.registry import load_named
from tautwave.testing.steps import (
    AXIS,
    Driven,
    allocated,
    at_random,
    controller,
    drive,
    there_and_back,
)
from tautwave.wording import CouplingMessages


def numbers(constants: Any) -> dict[str, float]:
    """Return the numbers of nested constants by their names; inner ones win."""
    by_name: dict[str, float] = {}
    for name, value in constants._asdict().items():
        by_name |= numbers(value) if isinstance(value, tuple) else {name: float(value)}
    return by_name


class CouplingBench(NamedTuple):
    """A law, its name, and keys of a rig file for one of its pairs."""

    plugin: CouplingPlugin
    law: str
    pair: Mapping[str, Any]

    def block(self, **more: Any) -> Coupling:
        """Return the keys of a coupling of one pair; `more` are keys of that pair."""
        pairs = {"wrist": {**self.pair, **more}}
        block: Coupling = load_named(self.plugin.keys).model_validate(
            {"law": self.law, "pairs": pairs}
        )
        return block


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
        assert isinstance(load_named(plugin.law), Law)
        assert callable(load_named(plugin.end_constants))
        for named in (plugin.link_constants, plugin.linear):
            if named:
                assert callable(load_named(named))
        if plugin.verdict:
            verdict = load_named(plugin.verdict)
            assert isinstance(verdict, CouplingVerdict) or callable(verdict)
        if plugin.messages:
            assert isinstance(load_named(plugin.messages), CouplingMessages)
        assert plugin.carries in ("waves", "states")
        assert set(plugin.causalities) <= {"impedance", "admittance"}

    def test_constants_are_finite_and_in_the_units_of_each_device(
        self, bench: CouplingBench
    ) -> None:
        constants = load_named(bench.plugin.end_constants)
        pair = bench.block(position_scale=2.0, force_scale=3.0).pairs["wrist"]
        ends = [numbers(constants(pair, side, AXIS)) for side in ("master", "slave")]
        assert ends[0].keys() == ends[1].keys()
        for end in ends:
            assert all(math.isfinite(value) for value in end.values())
        for key in ("impedance", "stiffness", "damping", "injection"):
            if ends[0].get(key):  # a master may have none
                # Force over position scale.
                assert ends[1][key] == pytest.approx(1.5 * ends[0][key]), key

    @pytest.mark.parametrize("samples", [0, 7])
    def test_its_steps_return_numbers(self, bench: CouplingBench, samples: int) -> None:
        driven = drive(controller(bench.plugin, bench.block(), samples), at_random())
        assert not driven.reason
        assert len(driven.rows) > 2000
        for name in driven.columns:
            assert all(map(math.isfinite, driven.column(name))), f"{name} is not finite"

    @pytest.mark.parametrize("samples", [0, 7])
    def test_its_books_close(self, bench: CouplingBench, samples: int) -> None:
        """Energy supplied equals energy stored and dissipated, per element and in total."""
        driven = drive(controller(bench.plugin, bench.block(), samples), at_random())
        flow = sum(driven.column(f"{side}.wrist.gross_flow")[-1] for side in SIDES)
        given = sum(driven.column(f"{side}.wrist.port_energy")[-1] for side in SIDES)
        taken = 0.0
        for element in elements_of(driven):
            absorbed, stored, lost = (driven.column(f"wrist.{element}.{it}")[-1] for it in ACCOUNT)
            assert absorbed == pytest.approx(stored + lost, abs=1e-9 * flow), element
            taken += stored + lost
        assert flow > 0.0, "it commanded nothing"
        assert given == pytest.approx(taken, abs=1e-9 * flow)

    def test_it_gives_no_energy(self, bench: CouplingBench) -> None:
        """Moved slowly there and back without delay, it returns no more energy than it received."""
        driven = drive(controller(bench.plugin, bench.block()), there_and_back())
        flow = (
            driven.column("master.wrist.gross_flow")[-1]
            + driven.column("slave.wrist.gross_flow")[-1]
        )
        sides = [driven.column(f"{side}.wrist.port_energy") for side in SIDES]
        least = min(map(sum, zip(*sides, strict=True)))
        assert least >= -0.02 * flow, f"it generated {-least:.3g} J of {flow:.3g} J exchanged"

    def test_a_cycle_allocates_nothing_but_numbers(self, bench: CouplingBench) -> None:
        # The least of three: a thread of the test runner may allocate meanwhile.
        few, many = (
            min(
                allocated(controller(bench.plugin, bench.block()), at_random(cycles=cycles))
                for _ in range(3)
            )
            for cycles in (200, 2000)
        )
        assert few < 4000, f"{few} bytes in a cycle"
        assert many < few + 2000, f"{many - few} bytes leaked after 900 cycles"

    def test_no_run_remembers_another(self, bench: CouplingBench) -> None:
        first = drive(controller(bench.plugin, bench.block(), 3), at_random(cycles=300))
        second = drive(controller(bench.plugin, bench.block(), 3), at_random(cycles=300))
        assert same(first, second)

    def test_compiled_it_is_the_same_to_the_bit(self, bench: CouplingBench) -> None:
        numba: Any = pytest.importorskip("numba")
        from tautwave.simulation.live.control import CompiledControl

        plain = controller(bench.plugin, bench.block(), 3)
        try:
            compiled = CompiledControl(controller(bench.plugin, bench.block(), 3))
        except numba.core.errors.NumbaError as err:
            pytest.skip(f"numba does not compile it, it runs in Python: {said(err)}")
        assert same(drive(plain, at_random()), drive(compiled, at_random()))


SIDES = ("master", "slave")


def elements_of(driven: Driven) -> list[str]:
    """Return the names of the elements in the columns of a drive."""
    ending = ".dissipated"
    return [name.split(".")[1] for name in driven.columns if name.endswith(ending)]


def same(one: Driven, two: Driven) -> bool:
    """Return whether two drives left the same bits."""
    rows = ([array("d", row).tobytes() for row in it.rows] for it in (one, two))
    return list(next(rows)) == list(next(rows)) and one.reason == two.reason


def said(err: Exception) -> str:
    """Return the line of an error of numba's that says what it could not do."""
    lines = [line.strip() for line in str(err).splitlines() if line.strip()]
    return lines[0] if lines else type(err).__name__
