"""Predicted and simulated: the same motion, the same growth, the same boundary."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tautwave.analysis.ports.loop_modes import least_damped
from tautwave.analysis.ports.multirate import common_slots
from tautwave.analysis.ports.sampled_loop import Matrix, close_loop
from tautwave.config import Rig, load_rig
from tautwave.controller import run
from tautwave.controller.records import PairView
from tautwave.errors import ConfigError
from tautwave.rig import build_rig, end_constants, line_delay
from tautwave.runtime.loop import Loop
from tautwave.sweep.measure import STEADY, Growth, growth_of, moving_energy, scales_of
from tautwave.sweep.predict import pair_ends, pair_mode, rated_ends
from tautwave.sweep.rows import Simulator
from tautwave.types import CommandDelay
from tests.analysis.reference.boundary import stability_boundary
from tests.analysis.reference.multirate import period_matrix

CONFIGS = Path(__file__).parents[2] / "configs"
BASE = CONFIGS / "delay-stability.yaml"
SIDES = ("master", "slave")
NOW = CommandDelay(0, 0.0)
BOUNDED = 1.1
"""Greatest energy of the last half per that of the first half that still counts as bounded."""

PULLED = [
    "simulation.hand.cart.reference={type: hold, position: 0}",
    "simulation.axes={master.cart: {start_position: -1.0e-3}}",
]


def position_law(stiffness: float, damping: float) -> list[str]:
    pair = f"{{stiffness: {stiffness!r}, damping: {damping!r}}}"
    return ["coupling.law=position", f"coupling.pairs.cart={pair}"]


def is_bounded(energy: npt.NDArray[np.float64], growth: Growth) -> bool:
    """Return whether an energy [J] stays bounded, as far as a finite run can tell.

    It does not if the last half exceeds the first, or if it grows steadily, however slowly.
    """
    half = len(energy) // 2
    within = half > 0 and bool(energy[half:].max() <= BOUNDED * energy[:half].max())
    return within and not (growth.rate > 0.0 and growth.steadiness > STEADY)


def growth(rig: Rig, duration: float = 10.0) -> tuple[float, bool]:
    columns, _, outcome = Simulator("python", whole=True).simulate(rig, "cart", duration)
    energy = moving_energy(scales_of(rig, "cart"), columns)
    found = growth_of(energy, rig.period_s)
    return found.rate, outcome == "finished" and is_bounded(energy, found)


def pair_matrix(rig: Rig, name: str) -> Matrix:
    """Return the closed-loop state matrix of one pair, shape (n, n).

    It is that of a cycle or, with a slow bus, of all cycles until both sides are in phase again.
    """
    one, two = rated_ends(rig, name)
    if common_slots(one, two) > 1:
        return period_matrix(one, two, line_delay(rig).samples)
    return close_loop(one.end, two.end, line_delay(rig).samples)


def predicted_motion(rig: Rig, cycles: int) -> np.ndarray[Any, Any]:
    """Master's position from the state matrix, started like the simulation: pulled, at rest."""
    master, slave = pair_ends(rig, "cart")
    matrix = pair_matrix(rig, "cart")
    start = np.zeros(len(matrix))
    at = master.states.index("position")
    start[at] = -1e-3
    if "observed_position" in master.states:
        start[master.states.index("observed_position")] = -1e-3
    if rig.coupling.law == "position":  # it engages without a mismatch, also not under way
        pair = rig.coupling.pairs["cart"]
        ratio = pair.sign * pair.position_scale
        there, back = (end_constants(rig, f"{side}.cart", NOW).stiffness for side in SIDES)
        start[len(master.b) + slave.states.index("position")] = -1e-3 * ratio
        first = len(master.b) + len(slave.b)
        start[first : first + rig.delay_samples] = back * ratio * -1e-3
        start[first + rig.delay_samples :] = there * -1e-3
    motion = [start]
    for _ in range(cycles - 1):
        motion.append(matrix @ motion[-1])
    return np.array(motion)[:, at]


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    "overrides",
    [
        [],
        [
            "coupling.pairs.cart.wave_filter_hz=80",
            "coupling.pairs.cart.pole_master=0.3",
            "coupling.pairs.cart.pole_slave=0.5",
        ],
        ["coupling.delay_s=0"],
        [
            "buses.table.options={command_delay_s: 0.001}",
            "master.axes.cart.inertia.lower=0.3",
            "simulation.axes.slave.cart={inertia: 0.9, damping: 1.5}",
        ],
        ["buses.table.options={command_delay_s: 0.0013}"],
        [
            "coupling.pairs.cart={wave_impedance: 10, position_scale: 2, sign: -1}",
            "coupling.pairs.cart.force_scale=0.7",
            "coupling.pairs.cart.matched_slave=true",
            "simulation.environment={cart: {type: spring, stiffness: 200, position: 0}}",
        ],
        position_law(700.0, 10.0),
        [
            *position_law(300.0, 5.0),
            "coupling.delay_s=0.004",
            "coupling.pairs.cart.position_scale=2",
            "slave.axes.cart.velocity_filter_s=0.003",
            "buses.table.options={command_delay_s: 0.001}",
        ],
    ],
)
def test_matrix_moves_as_the_loop_does(
    overrides: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = load_rig(BASE, [*PULLED, *overrides])
    assembly = build_rig(rig, clock="fake", duration_s=1.0)
    start = run.start_pair

    def rich(pair: PairView, *others: Any) -> None:
        start(pair, *others)  # the linear regime: an account that never limits
        if hasattr(pair.one.end, "account"):
            pair.one.end.account = pair.two.end.account = 1e3

    monkeypatch.setattr(run, "start_pair", rich)
    rows: list[float] = []
    column = assembly.columns.index("true.master.cart.position")

    class Sink:
        def __init__(self) -> None:
            self.row = [0.0] * len(assembly.columns)

        def commit(self) -> None:
            rows.append(self.row[column])

    result = Loop(assembly.clock, assembly.buses, assembly.control, assembly.sources, Sink()).run()
    assert result.error is None
    expected = predicted_motion(rig, len(rows))
    # A huge account costs digits of what is added to it, nothing else.
    assert np.abs(np.array(rows) - expected).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("stiffness", "samples"), [(50.0 / 0.01, 10), (50.0 / 0.08, 80), (1000.0, 20), (1000.0, 14)]
)
def test_growth_is_the_predicted_one(stiffness: float, samples: int) -> None:
    overrides = [*position_law(stiffness, 10.0), f"coupling.delay_s={samples / 1000!r}"]
    rig = load_rig(BASE, overrides)
    found, stable = growth(rig)
    mode = pair_mode(rig, "cart")
    assert found == pytest.approx(mode.growth, rel=0.01)
    assert stable == (mode.radius <= 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("b", "mass"), [(10.0, 0.5), (20.0, 0.5), (10.0, 0.2)])
def test_boundary_is_the_predicted_one(b: float, mass: float) -> None:
    def rig(samples: int) -> Rig:
        return load_rig(
            BASE,
            [
                *position_law(5.0 * b / 0.05, b),
                f"coupling.delay_s={samples / 1000!r}",
                *(f"simulation.axes.{side}.cart.inertia={mass}" for side in SIDES),
            ],
        )

    ends = pair_ends(rig(1), "cart")
    boundary = stability_boundary(lambda m: least_damped(*ends, m, 1e-3).radius, [0, 5, 20, 60])
    assert boundary is not None
    assert growth(rig(boundary - 1))[1]
    assert not growth(rig(boundary))[1]


@pytest.mark.sparse(3)
@pytest.mark.parametrize("samples", [1, 50, 400])
def test_wave_line_stays_bounded(samples: int) -> None:
    rig = load_rig(BASE, [f"coupling.delay_s={samples / 1000!r}"])
    assert pair_mode(rig, "cart").radius <= 1.0 + 1e-9
    assert growth(rig)[1]


def test_shipped_rigs_are_predicted_stable() -> None:
    rig = load_rig(CONFIGS / "bench-1dof-loopback.yaml")
    assert pair_mode(rig, "lever").radius < 1.0
    assert pair_mode(rig, "lever", contact=True).radius < 1.0
    assert pair_mode(rig, "lever", samples=300).radius < 1.0


def test_what_cannot_be_predicted_is_said() -> None:
    rig = load_rig(CONFIGS / "bench-admittance-loopback.yaml")
    with pytest.raises(ConfigError, match="takes velocit"):
        pair_mode(rig, next(iter(rig.coupling.pairs)))
    with pytest.raises(ConfigError, match="simulation block"):
        pair_mode(load_rig(BASE).model_copy(update={"simulation": None}), "cart")


def test_growth_of_an_exponential_and_of_nothing() -> None:
    time = 1e-3 * np.arange(20000)
    swing = np.exp(2 * 0.3 * time) * (1.2 + np.sin(40 * time))
    found = growth_of(swing, 1e-3)
    assert found.rate == pytest.approx(0.3, rel=0.01)
    assert not is_bounded(swing, found)
    assert np.isnan(growth_of(np.zeros(100), 1e-3).rate)
