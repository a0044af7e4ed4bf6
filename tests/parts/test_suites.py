"""The suites for parts pass on ours and on the example package's, and notice planted faults."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tautwave import registry
from tautwave.config import EnvironmentPart
from tautwave.config.keys.coupling import Account
from tautwave.couplings.account import with_account
from tautwave.models.part_contact import part_step
from tautwave.models.plant_params import PlantParams
from tautwave.testing import (
    CouplingBench,
    CouplingContract,
    EnvironmentBench,
    EnvironmentContract,
    HandBench,
    HandContract,
    environments,
)
from tautwave.truth import EnvironmentPlugin

PACKAGE = Path(__file__).parents[2] / "docs/examples/tautwave-example-parts/tautwave_example_parts"


def example(name: str) -> ModuleType:
    if str(PACKAGE.parent) not in sys.path:
        sys.path.append(str(PACKAGE.parent))
    return importlib.import_module(f"{PACKAGE.name}.{name}")


class TestWave(CouplingContract):
    test_compiled_it_is_the_same_to_the_bit = None  # type: ignore[assignment] # as TestFilteredWave

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"wave_impedance": 0.02, "pole_master": "plain", "pole_slave": "plain"}
        return CouplingBench(
            registry.load_coupling("wave"), "wave", {**keys, "wave_filter_hz": None}
        )


class TestFilteredWave(CouplingContract):
    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"wave_impedance": 0.02, "wave_filter_hz": 100.0, "pole_master": 0.5}
        keys["pole_slave"] = 0.5
        return CouplingBench(registry.load_coupling("wave"), "wave", keys)


class TestPosition(CouplingContract):
    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1}
        return CouplingBench(registry.load_coupling("position"), "position", keys)


class TestPositionInAnAccount(CouplingContract):
    test_compiled_it_is_the_same_to_the_bit = None  # type: ignore[assignment] # the accounts below are compiled

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1}
        plugin = with_account(registry.load_coupling("position"), Account())
        return CouplingBench(plugin, "position", keys)


class TestPdInjectionInAnAccount(CouplingContract):
    """A law that knows nothing of accounts."""

    test_compiled_it_is_the_same_to_the_bit = None  # type: ignore[assignment]

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1, "injection": 0.05}
        plugin = with_account(example("pd_injection").plugin, Account(leader="slave"))
        return CouplingBench(plugin, "pd_injection", keys)


class TestPdDamping(CouplingContract):
    test_compiled_it_is_the_same_to_the_bit = None  # type: ignore[assignment] # as TestPdInjection

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1, "injection": 0.05}
        return CouplingBench(registry.load_coupling("pd_damping"), "pd_damping", keys)


class TestPositionForceInAnAccount(CouplingContract):
    """Bare, it gives energy."""

    test_compiled_it_is_the_same_to_the_bit = None  # the steps are those of four_channel

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1}
        plugin = with_account(registry.load_coupling("position_force"), Account())
        return CouplingBench(plugin, "position_force", keys)


class TestFourChannelInAnAccount(CouplingContract):
    """With rejection it spends what its account claims on a motion that nothing stops: 0.2 J.

    A small reserve, and a follower that keeps little: credit goes over both ways.
    """

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1, "rejection": 0.0}
        account = Account(kept=0.05, tank=0.01, reserve=1e-5)
        plugin = with_account(registry.load_coupling("four_channel"), account)
        return CouplingBench(plugin, "four_channel", keys)


class TestMediatedInAnAccount(CouplingContract):
    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 20.0, "damping": 0.1, "touch": 0.02, "stiffest": 50.0}
        plugin = with_account(registry.load_coupling("mediated"), Account())
        return CouplingBench(plugin, "mediated", keys)


class TestPdInjection(CouplingContract):
    test_compiled_it_is_the_same_to_the_bit = None  # type: ignore[assignment] # its package is run

    @pytest.fixture
    def bench(self) -> CouplingBench:
        keys = {"stiffness": 1.5, "damping": 0.01, "injection": 0.05}
        return CouplingBench(example("pd_injection").plugin, "pd_injection", keys)


class TestTremor(HandContract):
    @pytest.fixture
    def bench(self) -> HandBench:
        return HandBench(example("tremor").plugin, {"position": 0.3, "amplitude": 0.01})


class TestFluid(EnvironmentContract):
    @pytest.fixture
    def bench(self) -> EnvironmentBench:
        keys = {"surface": 0.1, "viscosity": 0.05, "thickening": 2.0, "buoyancy": 0.3}
        return EnvironmentBench(example("fluid").plugin, keys, -0.2, 0.6, 3.0, 2e-3)


class Bare(EnvironmentPart):
    """No keys of its own."""


def planted(force: Any, stored: Any = lambda p, x: 0.0) -> EnvironmentBench:
    plugin = EnvironmentPlugin("planted", Bare, lambda keys: (1.0,), force, stored)
    return EnvironmentBench(plugin, {}, -1.0, 1.0, 1.0)


KEPT: list[float] = []


@pytest.mark.parametrize(
    ("force", "stored", "check"),
    [
        (lambda p, x, v: float("nan") if x > 0.5 else 0.0, None, "force_and_energy_are_finite"),
        (lambda p, x, v: 2.0 * v, None, "motion_is_opposed"),
        (lambda p, x, v: 2.0 * v, None, "it_gives_no_energy_to_what_shakes_it"),
        (lambda p, x, v: -x, None, "the_force_at_rest_is_the_slope_of_the_energy"),
        (
            lambda p, x, v: -x,
            lambda p, x: 0.5 * x * x * x * x,
            "the_force_at_rest_is_the_slope_of_the_energy",
        ),
        (lambda p, x, v: sum([0.0] * 500), None, "a_call_allocates_nothing_but_numbers"),
        (
            lambda p, x, v: (KEPT.append(x + v + 0.1), 0.0)[1],
            None,
            "a_call_allocates_nothing_but_numbers",
        ),
    ],
)
def test_a_planted_fault_is_caught(force: Any, stored: Any, check: str) -> None:
    bench = planted(force) if stored is None else planted(force, stored)
    with pytest.raises(AssertionError):
        getattr(EnvironmentContract(), f"test_{check}")(bench)


@pytest.mark.parametrize(("share", "given"), [(1e-13, False), (9e-13, False), (3e-12, True)])
def test_rounding_is_no_gift_and_what_is_more_is_caught(share: float, given: bool) -> None:
    """A force that leans with the motion: by 1e-12 of its own size it may be rounding."""
    bench = planted(lambda p, x, v: -x + math.copysign(share * x, v) if v else -x)
    suite = EnvironmentContract()
    if given:
        with pytest.raises(AssertionError, match=r"it generates energy at -1\.0, 1\.0"):
            suite.test_motion_is_opposed(bench)
    else:
        suite.test_motion_is_opposed(bench)


def test_rounding_is_measured_against_the_force_however_slow_the_motion() -> None:
    def force(p: Any, x: float, v: float) -> float:
        return -x + math.copysign(3e-12 * x, v) if 0.0 < math.fabs(v) < 0.01 else -x

    with pytest.raises(AssertionError, match=r"it generates energy at -1\.0, 0\.001"):
        EnvironmentContract().test_motion_is_opposed(planted(force))


@pytest.mark.parametrize("fastest", [True, False])
def test_what_gives_energy_at_one_speed_only_is_caught(fastest: bool) -> None:
    """At the greatest speed, or so slowly that a step of any size would pass over it."""

    def force(p: Any, x: float, v: float) -> float:
        return 0.1 * v if fastest == (math.fabs(v) > 0.5) else -v

    with pytest.raises(AssertionError, match="it generates energy at"):
        EnvironmentContract().test_motion_is_opposed(planted(force))


def test_a_planted_jump_is_caught() -> None:
    bench = planted(lambda p, x, v: -v if x > 0.1234 else 0.0)
    with pytest.raises(AssertionError, match=r"it jumps by 1 near 0.1234"):
        EnvironmentContract().test_jumps_are_declared_as_kinks(bench, 1.0)


@pytest.mark.parametrize(
    "force",
    [
        lambda p, x, v: 5.008 if x > 0.1234 else 5.0,  # small beside the force
        lambda p, x, v: 1e-9 if x > 0.1234 else 0.0,
        lambda p, x, v: 5.0 - x + (x > 0.1234),
    ],
)
def test_a_jump_of_any_size_is_caught(force: Any) -> None:
    with pytest.raises(AssertionError, match=r"it jumps by .* near 0\.1234, which is not a dec"):
        EnvironmentContract().test_jumps_are_declared_as_kinks(planted(force), 0.0)


def test_steepness_and_a_declared_jump_are_none() -> None:
    suite = EnvironmentContract()
    suite.test_jumps_are_declared_as_kinks(planted(lambda p, x, v: -math.tanh(1e5 * x)), 0.0)
    plugin = EnvironmentPlugin(
        "planted",
        Bare,
        lambda keys: (0.1234,),
        lambda p, x, v: -1.0 if x > p[0] else 0.0,
        lambda p, x: x - p[0] if x > p[0] else 0.0,
        lambda p: p,
    )
    bench = EnvironmentBench(plugin, {}, -1.0, 1.0, 1.0)
    assert bench.places()[112:115] == [pytest.approx(0.12), 0.1234, pytest.approx(0.13)]
    suite.test_jumps_are_declared_as_kinks(bench, 1.0)
    suite.test_the_force_at_rest_is_the_slope_of_the_energy(bench)
    wrong = plugin._replace(stored=lambda p, x: 1.1 * (x - p[0]) if x > p[0] else 0.0)
    with pytest.raises(AssertionError, match=r"at 0\.13"):
        suite.test_the_force_at_rest_is_the_slope_of_the_energy(bench._replace(plugin=wrong))


SEEN: list[tuple[float, float]] = []


def seen(p: Any, x: float, v: float) -> float:
    SEEN.append((x, v))
    return 0.0


def wide(force: Any = seen, stored: Any = lambda p, x: 0.0) -> EnvironmentBench:
    """From -2 to 3, at up to 4, of mass 0.5."""
    return planted(force, stored)._replace(low=-2.0, high=3.0, speed=4.0, mass=0.5)


def test_the_suite_looks_at_the_whole_range_at_every_speed() -> None:
    suite, bench = EnvironmentContract(), wide()
    places = [-2.0 + 0.025 * at for at in range(201)]
    assert bench.places() == pytest.approx(places, abs=1e-12)
    for check, speeds in (
        (suite.test_force_and_energy_are_finite, [-4.0, 0.0, 4.0]),
        (suite.test_motion_is_opposed, [-4.0, -0.4, -0.004, 0.0, 0.004, 0.4, 4.0]),
        (suite.test_the_force_at_rest_is_the_slope_of_the_energy, [0.0]),
    ):
        SEEN.clear()
        check(bench)
        assert sorted({v for _, v in SEEN}) == pytest.approx(speeds)
        assert sorted({x for x, _ in SEEN}) == bench.places()
    for share in (0.0, 1.0, -1.0):
        SEEN.clear()
        suite.test_jumps_are_declared_as_kinks(bench, share)
        assert {v for _, v in SEEN} == {4.0 * share}


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
def test_what_is_shaken_goes_beyond_either_end_at_about_its_greatest_speed(
    monkeypatch: pytest.MonkeyPatch, scale: float
) -> None:
    """Whatever the range, the speed and the inertia are measured in."""
    shaken: list[tuple[float, float]] = []

    def step(plant: PlantParams, *more: Any) -> Any:
        assert plant == PlantParams(0.5 / scale, *[0.0] * 9, 1.0)
        shaken.append(more[1:3])
        return part_step(plant, *more)

    monkeypatch.setattr(environments, "part_step", step)
    bench = wide()._replace(low=-2.0 * scale, high=3.0 * scale, mass=0.5 / scale)
    EnvironmentContract().test_it_gives_no_energy_to_what_shakes_it(bench)
    assert len(shaken) == 500
    assert shaken[0] == (0.5 * scale, 0.0)
    places = [x / scale for x, _ in shaken]
    assert -2.5 < min(places) < -2.0
    assert 3.0 < max(places) < 3.5
    assert 3.2 < max(math.fabs(v) for _, v in shaken) <= 4.0


@pytest.mark.parametrize("scale", [1.0, 1e-9])
@pytest.mark.parametrize(("gain", "caught"), [(0.0, False), (1e-5, True)])
def test_a_spring_keeps_its_energy_and_one_that_gives_a_little_is_caught(
    gain: float, caught: bool, scale: float
) -> None:
    """Of a light device at a soft spring as well, where all energies are small."""
    bench = wide(
        lambda p, x, v: scale * (-3.0 * x + gain * v), lambda p, x: scale * 1.5 * x * x
    )._replace(mass=0.5 * scale)
    suite = EnvironmentContract()
    if caught:
        with pytest.raises(AssertionError, match=r"it gave [0-9].* J at"):
            suite.test_it_gives_no_energy_to_what_shakes_it(bench)
    else:
        suite.test_it_gives_no_energy_to_what_shakes_it(bench)


@pytest.mark.parametrize(
    ("force", "stored", "caught"),
    [
        (lambda x: -1.00005 * x, lambda x: 0.5 * x * x, False),
        (lambda x: -1.0003 * x, lambda x: 0.5 * x * x, True),
        (lambda x: -x - 5e-7, lambda x: 0.5 * x * x, False),  # of the greatest force, 1
        (lambda x: -x - 3e-6, lambda x: 0.5 * x * x, True),
        (lambda x: -100.0 * x - 5e-5, lambda x: 50.0 * x * x, False),
        (lambda x: 0.0, lambda x: 1e-13 * x, False),
        (lambda x: 0.0, lambda x: 1e-9 * x, True),
        (lambda x: -(x**3), lambda x: 0.25 * x**4, False),  # bends
    ],
)
def test_a_slope_is_a_force_to_four_digits_of_its_own_and_six_of_the_greatest(
    force: Any, stored: Any, caught: bool
) -> None:
    bench = planted(lambda p, x, v: force(x), lambda p, x: stored(x))
    suite = EnvironmentContract()
    if caught:
        with pytest.raises(AssertionError, match="at "):
            suite.test_the_force_at_rest_is_the_slope_of_the_energy(bench)
    else:
        suite.test_the_force_at_rest_is_the_slope_of_the_energy(bench)


def test_calls_are_measured_in_the_middle_of_the_range_at_the_greatest_speed() -> None:
    def force(p: Any, x: float, v: float) -> float:
        return sum([0.0] * 500) if (x, v) == (0.5, 4.0) else 0.0

    with pytest.raises(AssertionError, match="bytes in a call"):
        EnvironmentContract().test_a_call_allocates_nothing_but_numbers(wide(force))


def test_what_numba_cannot_compile_says_why() -> None:
    bench = planted(lambda p, x, v: 0.0 * len(repr(open)))
    with pytest.raises(
        pytest.skip.Exception, match="numba cannot compile it, so it runs in Python"
    ):
        EnvironmentContract().test_compiled_it_is_the_same_to_the_bit(bench)
