"""Requirements of every hand part: `class TestX(HandContract)` with a `bench`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from tautwave.config import HandPart
from tautwave.registry import load_named
from tautwave.truth import HandPlugin


class HandBench(NamedTuple):
    """A hand and its keys in a rig file (without `part`), at a rate [Hz]."""

    plugin: HandPlugin
    keys: Mapping[str, Any]
    rate_hz: float = 1000.0

    def wanted(self, count: int, seed: tuple[int, ...] = (1, 2)) -> list[float]:
        """Return its wanted positions at the first slots [rad or m]."""
        block = load_named(self.plugin.keys).model_validate({"part": "mine", **self.keys})
        times = [slot / self.rate_hz for slot in range(count)]
        return list(load_named(self.plugin.motion)(block, times, seed))


class HandContract:
    """The suite; pytest collects the subclasses."""

    @pytest.fixture
    def bench(self) -> HandBench:
        raise NotImplementedError

    def test_its_keys_are_a_hand_part_that_takes_no_others(self, bench: HandBench) -> None:
        keys = load_named(bench.plugin.keys)
        assert issubclass(keys, HandPart)
        assert keys.model_config.get("extra") == "forbid"
        for name, field in keys.model_fields.items():
            assert field.description, f"{name} has no description"

    def test_it_wants_one_finite_position_for_each_time(self, bench: HandBench) -> None:
        wanted = bench.wanted(3000)
        assert len(wanted) == 3000
        assert all(math.isfinite(position) for position in wanted)

    def test_the_same_seed_wants_the_same(self, bench: HandBench) -> None:
        assert bench.wanted(500) == bench.wanted(500)

    def test_how_long_a_run_lasts_changes_nothing_before(self, bench: HandBench) -> None:
        assert bench.wanted(1000)[:300] == bench.wanted(300)

    def test_no_times_give_no_positions(self, bench: HandBench) -> None:
        assert bench.wanted(0) == []
