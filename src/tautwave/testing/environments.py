"""Requirements of every environment part: `class TestX(EnvironmentContract)` with a `bench`.

A simulation relies on every test: the books close whatever the part does, so no other check finds
an energy that does not match its force.
"""

from __future__ import annotations

import itertools
import math
import random
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import pytest

from tautwave.config import EnvironmentPart
from tautwave.models.part_contact import PartContact, part_step
from tautwave.models.plant_params import PlantParams
from tautwave.registry import load_named
from tautwave.truth import EnvironmentPlugin

PLACES = 201
ALLOCATED = 512
"""Bytes that a call may allocate temporarily: numbers, no arrays."""


class EnvironmentBench(NamedTuple):
    """An environment, its keys in a rig file (without `part`), and the range of device motion.

    `low` and `high` [rad or m] are positions it reaches, `speed` [rad/s or m/s] its greatest,
    `mass` [kg m^2 or kg] its inertia.
    """

    plugin: EnvironmentPlugin
    keys: Mapping[str, Any]
    low: float
    high: float
    speed: float
    mass: float = 1.0

    def contact(self) -> PartContact:
        """Return the part with its numbers."""
        keys = load_named(self.plugin.keys).model_validate({"part": "mine", **self.keys})
        p = tuple(float(value) for value in load_named(self.plugin.params)(keys))
        kinks = load_named(self.plugin.kinks)
        edges = () if kinks is None else tuple(sorted(kinks(p)))
        return PartContact(p, load_named(self.plugin.force), load_named(self.plugin.stored), edges)

    def places(self) -> list[float]:
        """Return positions from low to high, those of kinks too."""
        step = (self.high - self.low) / (PLACES - 1)
        even = [self.low + step * index for index in range(PLACES)]
        return sorted({*even, *(kink for kink in self.contact().kinks)})


def smooth_places(bench: EnvironmentBench, span: float) -> Iterator[float]:
    """Yield positions that have no kink within `span`."""
    kinks = bench.contact().kinks
    for x in bench.places():
        if all(math.fabs(x - kink) > span for kink in kinks):
            yield x


class EnvironmentContract:
    """The suite; pytest collects the subclasses."""

    @pytest.fixture
    def bench(self) -> EnvironmentBench:
        raise NotImplementedError

    def test_its_keys_are_an_environment_part(self, bench: EnvironmentBench) -> None:
        keys = load_named(bench.plugin.keys)
        assert issubclass(keys, EnvironmentPart)
        assert keys.model_config.get("extra") == "forbid"
        for name, field in keys.model_fields.items():
            assert field.description, f"{name} has no description"

    def test_force_and_energy_are_finite(self, bench: EnvironmentBench) -> None:
        part = bench.contact()
        for x in bench.places():
            assert math.isfinite(part.stored(part.params, x)), f"stored at {x}"
            for v in (-bench.speed, 0.0, bench.speed):
                assert math.isfinite(part.force(part.params, x, v)), f"force at {x}, {v}"

    def test_the_force_at_rest_is_the_slope_of_the_energy(self, bench: EnvironmentBench) -> None:
        part = bench.contact()
        h = 1e-5 * (bench.high - bench.low)
        stiffest = max(
            [math.fabs(part.force(part.params, x, 0.0)) for x in bench.places()], default=0.0
        )
        for x in smooth_places(bench, 2.0 * h):
            slope = (part.stored(part.params, x + h) - part.stored(part.params, x - h)) / (2.0 * h)
            force = part.force(part.params, x, 0.0)
            assert force == pytest.approx(-slope, rel=1e-4, abs=1e-6 * stiffest + 1e-12), f"at {x}"

    def test_motion_is_opposed(self, bench: EnvironmentBench) -> None:
        part = bench.contact()
        for x in bench.places():
            still = part.force(part.params, x, 0.0)
            for share in (1.0, 0.1, 1e-3):
                for v in (share * bench.speed, -share * bench.speed):
                    added = part.force(part.params, x, v) - still
                    assert added * v <= 1e-12 * math.fabs(still * v), (
                        f"it generates energy at {x}, {v}"
                    )

    @pytest.mark.parametrize("share", [0.0, 1.0, -1.0])
    def test_jumps_are_declared_as_kinks(self, bench: EnvironmentBench, share: float) -> None:
        part = bench.contact()
        v = share * bench.speed
        places = bench.places()

        def force(x: float) -> float:
            return part.force(part.params, x, v)

        largest = max(math.fabs(force(x)) for x in places)
        for low, high in itertools.pairwise(places):
            at_kink = any(low <= kink <= high for kink in part.kinks)
            before = math.fabs(force(high) - force(low))
            if at_kink or before <= 1e-9 * largest:
                continue
            for _ in range(40):  # bisect towards the largest change
                middle = 0.5 * (low + high)
                left, right = force(middle) - force(low), force(high) - force(middle)
                low, high = (low, middle) if math.fabs(left) > math.fabs(right) else (middle, high)
            jump = math.fabs(force(high) - force(low))
            assert jump < 1e-3 * before, (
                f"it jumps by {jump:g} near {low:g}, which is not a declared kink"
            )

    def test_it_gives_no_energy_to_what_shakes_it(self, bench: EnvironmentBench) -> None:
        part = bench.contact()
        plant = PlantParams(bench.mass, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        draw = random.Random(1)
        x, v, lost, flow = 0.5 * (bench.low + bench.high), 0.0, 0.0, 0.0
        h = 0.01 * (bench.high - bench.low) / bench.speed  # 500 steps: from end to end, and back
        push = 0.05 * bench.mass * bench.speed / h
        for _ in range(500):
            inward = (
                0.0 if bench.low < x < bench.high else -2.0 * math.copysign(push, x - bench.low)
            )
            command = push * draw.uniform(-1.0, 1.0) + inward
            before = x
            x, v, _, _, _, _, given = part_step(plant, part, x, v, command, 0.0, 0.0, h)
            flow += math.fabs(command * (x - before)) + math.fabs(given)
            lost += given
            assert lost >= -1e-9 * flow, f"it gave {-lost:g} J at {x:g}"

    def test_a_call_allocates_nothing_but_numbers(self, bench: EnvironmentBench) -> None:
        part = bench.contact()
        x = 0.5 * (bench.low + bench.high)
        calls: list[Callable[[], float]] = [
            lambda: part.force(part.params, x, bench.speed),
            lambda: part.stored(part.params, x),
        ]
        for call in calls:
            for _ in range(10):
                call()
            tracemalloc.start()
            try:
                tracemalloc.reset_peak()
                before = tracemalloc.get_traced_memory()[0]
                for _ in range(50):
                    call()
                kept, peak = tracemalloc.get_traced_memory()
            finally:
                tracemalloc.stop()
            assert peak - before < ALLOCATED, f"{peak - before} bytes in a call"
            assert kept - before < ALLOCATED, f"{kept - before} bytes leaked after 50 calls"

    def test_compiled_it_is_the_same_to_the_bit(self, bench: EnvironmentBench) -> None:
        numba: Any = pytest.importorskip("numba")
        part = bench.contact()
        try:
            force: Any = numba.njit(part.force)
            stored: Any = numba.njit(part.stored)
            force(part.params, 0.0, 0.0), stored(part.params, 0.0)
        except numba.core.errors.NumbaError as err:
            pytest.skip(
                f"numba cannot compile it, so it runs in Python: {str(err).splitlines()[0]}"
            )
        for x in bench.places():
            assert stored(part.params, x) == part.stored(part.params, x)
            for v in (-bench.speed, 0.0, bench.speed):
                assert force(part.params, x, v) == part.force(part.params, x, v)
