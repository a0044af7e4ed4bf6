"""An emptied tank recovers: what an end owes is led back where its device is moved."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from tautwave.certificate import certify
from tautwave.config import Rig, load_rig
from tautwave.contracts import Row
from tautwave.controller.records import AxisState
from tautwave.couplings.wave import port
from tautwave.rig import Assembly, build_rig
from tautwave.runtime.loop import Loop
from tautwave.simulation import simulate
from tests.rigs.running import ListSink

CONFIGS = Path(__file__).parents[2] / "configs"
BENCH = "bench-1dof-2khz"
SIDES = ("master", "slave")
MOVED = (
    "simulation.hand.lever.reference={type: multisine, ramp_s: 1.0, "
    "components: [[0.4, 0.1, 0.0], [1.1, 0.04, 1.0]]}"
)
FREE = "simulation.environment.lever={type: free}"
SPRING = "simulation.environment.lever={type: spring, stiffness: 3.2, position: 0.0}"
BEHIND = (
    "simulation.axes.slave.lever.start_position=-0.08",
    "coupling.pairs.lever.offset=0",
    "coupling.pairs.lever.engage_tolerance=0.1",
)
"""80 mrad that the slave owes when it engages."""
ENGAGED = 20
"""Row in which the slowest rig has engaged."""


class Emptied:
    """A row source that empties all tanks once, adds to gaps, and notes what is owed.

    `owes` [rad or m] is added to what an end owes, by its place among the axes.
    """

    columns: tuple[str, ...] = ()

    def __init__(self, built: Assembly, empties: bool, owes: dict[int, float]) -> None:
        self.ends = built.control.axes
        self.roots = [axis.end.port.root for axis in built.control.params]
        self.empties, self.owes = empties, owes
        self.owed: list[list[float]] = []
        self.tanks: list[list[float]] = []

    def fill(self, row: Row, at: int) -> None:
        if self.empties and len(self.owed) == ENGAGED:
            for axis in self.ends:
                axis.end.account = 0.0
            for which, gap in self.owes.items():
                self.ends[which].end.gap += gap * self.roots[which]
        ends: list[AxisState] = self.ends
        self.owed.append([s.end.gap / r for s, r in zip(ends, self.roots, strict=True)])
        self.tanks.append([s.end.account for s in ends])


class Recovery(NamedTuple):
    """A run: time [s], what each end owes [rad or m], tanks [J], master less slave [rad]."""

    time: npt.NDArray[np.float64]
    owed: npt.NDArray[np.float64]
    tanks: npt.NDArray[np.float64]
    apart: npt.NDArray[np.float64]

    def owes_until(self, least: float = 5e-3) -> float:
        """Return the time [s] from which on no end owes more than `least`."""
        late = np.flatnonzero((np.abs(self.owed) > least).any(axis=1))
        return float(self.time[late[-1]]) if len(late) else 0.0


def rig_of(name: str, *changes: str) -> Rig:
    return load_rig(CONFIGS / f"{name}.yaml", list(changes))


def played(rig: Rig, *, empties: bool = True, owes: dict[int, float] | None = None) -> Recovery:
    """Run a rig live on the fake clock."""
    built = build_rig(rig, clock="fake")
    noted = Emptied(built, empties, owes or {})
    sink = ListSink(len(built.columns))
    sources = (*built.sources, noted)
    result = Loop(built.clock, built.buses, built.control, sources, sink).run()
    assert result.error is None
    rows = np.array(sink.rows)
    first, second = (built.columns.index(f"{side}.{_axis(rig)}.position") for side in SIDES)
    return Recovery(
        rows[:, built.columns.index("time_s")],
        np.array(noted.owed),
        np.array(noted.tanks),
        rows[:, first] - rows[:, second],
    )


def _axis(rig: Rig) -> str:
    return next(iter(rig.axes)).partition(".")[2]


def without_friction(*given: float) -> float:
    return 0.0


def test_a_slave_that_was_left_behind_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """In 1.4 s at 1 kHz; the leak alone takes 3.9."""
    slower = (
        *("rate_hz=1000", "loop.overrun_limit=10", "loop.missing_limit=3"),
        *("coupling.pairs.lever.wave_filter_hz=100", "duration_s=2.5"),
    )
    rig = rig_of(BENCH, MOVED, FREE, *BEHIND, *slower)
    found = played(rig)
    assert found.owes_until() < 2.0
    assert np.abs(found.apart[-200:]).max() < 0.02
    monkeypatch.setattr(port, "recovery_friction", without_friction)
    assert played(rig).owes_until() > 2.4


def line(delay: float, impedance: float = 0.05) -> tuple[str, ...]:
    pair = f"wave_impedance: {impedance}, wave_filter_hz: 200, pole_master: 0.5, pole_slave: 0.5"
    return (f"coupling={{law: wave, delay_s: {delay}, pairs: {{lever: {{{pair}}}}}}}",)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("touched", "delay", "within"),
    [
        (FREE, 0.0, 3.0),
        (FREE, 0.02, 3.0),
        (SPRING, 0.0, 6.0),
        (SPRING, 0.02, 8.0),
        (SPRING, 0.1, 8.0),
    ],
    ids=["air", "air, 20 ms", "spring", "spring, 20 ms", "spring, 100 ms"],
)
def test_what_is_owed_is_led_back_within_seconds(touched: str, delay: float, within: float) -> None:
    """80 mrad and both tanks empty; a second later the pair is as if it had never been."""
    changes = (MOVED, touched, *line(delay), f"duration_s={within + 2.0}")
    found = played(rig_of(BENCH, *changes, *BEHIND))
    assert found.owes_until() < within
    never = played(rig_of(BENCH, *changes), empties=False)
    late = found.time > within + 1.0
    assert np.abs(found.apart - never.apart)[late].max() < 2e-3


KINDS: dict[str, tuple[str, tuple[str, ...], dict[int, float]]] = {
    "other scales, slave": (BENCH, (MOVED, FREE, "duration_s=4"), {1: 0.04}),
    "other scales, master": (BENCH, (MOVED, FREE, "duration_s=4"), {0: 0.08}),
    "a slow bus, slave": ("bench-multirate-loopback", ("duration_s=8",), {1: 0.08}),
    "a slow bus, master": ("bench-multirate-loopback", ("duration_s=6",), {0: 0.08}),
    "a network, slave": ("network-loopback", ("duration_s=4", "link.outage_s=0"), {1: 0.08}),
    "a network, master": ("network-loopback", ("duration_s=4", "link.outage_s=0"), {0: 0.08}),
    "a slave that takes velocity": ("bench-admittance-loopback", ("duration_s=5",), {0: 0.08}),
    "tips of arms": ("arms/planar", ("duration_s=3",), {2: 0.03, 3: 0.03}),
}
"""Rig, changes, and what ends owe by their place [rad or m]."""
SCALES = ("coupling.pairs.lever.position_scale=0.5", "coupling.pairs.lever.force_scale=2")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_pair_recovers_sooner(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a seventh at least; the leak alone is slower everywhere."""
    name, changes, owes = KINDS[kind]
    rig = rig_of(name, *changes, *(SCALES if "scales" in kind else ()))

    def until() -> float:
        found = played(rig, owes=owes)
        late = np.flatnonzero((np.abs(found.owed[:, list(owes)]) > 5e-3).any(axis=1))
        return float(found.time[late[-1]])

    with_friction = until()
    assert with_friction < rig.duration_s - 0.05
    monkeypatch.setattr(port, "recovery_friction", without_friction)
    assert until() > 1.15 * with_friction


@pytest.mark.slow
def test_a_hand_at_rest_pays_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the leak fills a tank while nothing moves, with friction as without."""
    rest = "simulation.hand.lever.reference={type: hold, position: 0.0}"
    rig = rig_of(BENCH, rest, SPRING, "duration_s=2")
    found = played(rig, owes={1: 0.08})
    monkeypatch.setattr(port, "recovery_friction", without_friction)
    assert found.tanks[-1] == pytest.approx(played(rig, owes={1: 0.08}).tanks[-1], rel=0.05)
    assert np.abs(found.owed[-1]).max() > 0.07


RATES = {"1 kHz": (1000.0, 1e-4), "400 Hz": (400.0, 3e-4)}
"""Rate of the loop [Hz], and noise that is declared and true [rad]."""


@pytest.mark.parametrize("kind", RATES)
def test_noise_of_a_lever_at_rest_takes_nothing_by_friction(kind: str) -> None:
    """Heavy levers on a light line: a friction on what noise feigns took five times the leak."""
    rate, noise = RATES[kind]
    inertia = "inertia={value: 6.5e-3, lower: 5.0e-3, source: test}"
    sides = [
        f"{side}.axes.lever.{key}"
        for side in SIDES
        for key in (inertia, f"position_noise={noise}", "velocity_limit=5")
    ]
    rest = "simulation.hand.lever.reference={type: hold, position: 0.0}"
    rig = rig_of(
        BENCH, rest, FREE, *sides, f"rate_hz={rate}", "duration_s=1.5",
        "loop.missing_limit=2", "loop.overrun_limit=3",
        *(f"simulation.axes.{side}.lever={{inertia: 6.0e-3, coulomb: 0.025}}" for side in SIDES),
        "coupling={law: wave, pairs: {lever: {wave_impedance: 0.01, wave_filter_hz: auto}}}",
    )  # fmt: skip
    assert certify(rig).passed
    found = played(rig, owes={0: 0.05, 1: -0.05})
    full = found.tanks[ENGAGED - 1]
    assert (found.tanks[ENGAGED:].min(axis=0) > -0.1 * full).all()


SWUNG = "simulation.hand.lever.reference={type: multisine, components: [[3.0, 0.1, 0.0]]}"


def noisy(true: float, declared: float, *changes: str) -> Rig:
    """Return the bench swung by hand in the air, its encoders noisier than declared [rad]."""
    return rig_of(
        BENCH, SWUNG, FREE, *changes,
        *(f"{side}.axes.lever.position_noise={declared}" for side in SIDES),
        *(f"simulation.axes.{side}.lever.position_noise={true}" for side in SIDES),
    )  # fmt: skip


@pytest.mark.slow
def test_live_and_compiled_recover_alike_to_the_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tanks that undeclared noise empties, and friction fills: lost without it after 4.6 s."""
    pytest.importorskip("numba")
    rig = noisy(2e-4, 0.0, "duration_s=6")
    compiled = simulate(rig, engine="compiled")
    python = simulate(rig, engine="python")
    assert compiled.error is python.error is None
    assert compiled.data.tobytes() == python.data.tobytes()
    built = build_rig(rig, clock="fake")
    sink = ListSink(len(built.columns))
    Loop(built.clock, built.buses, built.control, built.sources, sink).run()
    live = np.array(sink.rows)[:, [built.columns.index(name) for name in python.columns]]
    assert np.ascontiguousarray(live).tobytes() == python.data.tobytes()
    apart = python["master.lever.position"] - python["slave.lever.position"]
    assert np.abs(apart).max() < 0.02
    monkeypatch.setattr(port, "recovery_friction", without_friction)
    assert "lost its coupling" in str(simulate(rig, engine="python").error)


@pytest.mark.slow
@pytest.mark.parametrize("declared", [1.5e-5, 9e-5])
def test_noise_of_twice_the_declared_is_survived_for_a_minute(declared: float) -> None:
    pytest.importorskip("numba")
    run = simulate(noisy(2.0 * declared, declared, "duration_s=60"), engine="compiled")
    assert run.error is None
    apart = run["master.lever.position"] - run["slave.lever.position"]
    assert np.abs(apart).max() < 0.02
