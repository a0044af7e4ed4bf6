"""The state around the laws: intervals, missing samples, delayed commands, books."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.wall import WallParams
from tests.runtime.parts import WIDE, Axis, T, site

WALL = WallParams(0.0, 1.0, 1000.0, 1.0, controlled=False)


def step(axis: Axis, position: float, wave: float = 0.0, slots: int = 1) -> None:
    """Pass `slots` slots, close at `position`, take a wave and think."""
    for k in range(slots):
        axis.pass_slot()
        if k < slots - 1:
            axis.receive(0.0)
    axis.close(position, math.nan)
    axis.receive(wave)
    axis.think(math.inf)


moves = st.lists(
    st.tuples(st.floats(-0.01, 0.01), st.floats(-1, 1), st.integers(1, 4)), min_size=1, max_size=40
)


@given(moves, st.integers(0, 3), st.booleans(), st.booleans())
def test_its_books_are_those_of_an_independent_count(
    script: list[tuple[float, float, int]], delay: int, matched: bool, walled: bool
) -> None:
    """Energy by hand: the efforts that acted, slot by slot, times measured displacement."""
    axis = site(delay=delay, matched=matched, wall=WALL if walled else None)
    commands = [0.0] * delay  # resisting efforts on their way, oldest first
    wave_in = wave_out = port = flow = 0.0
    position = 0.0
    for position, wave, slots in script:
        acted = 0.0
        for _ in range(slots):
            commands.append(-axis.command)
            acted += commands.pop(0)
        before = axis.position
        step(axis, position, wave, slots)
        energy = acted / slots * (position - before)
        port += energy
        flow += abs(energy) + T * (wave * wave + axis.leaving**2)
        wave_in += 0.5 * T * wave * wave
        wave_out += 0.5 * T * axis.leaving**2
        held = axis.account - axis.reserve + axis.waiting_energy() + axis.wall_stored()
        spent = axis.damper_dissipated + axis.wall_dissipated + axis.spilled
        flow += axis.damper_dissipated
        # A wall that gives back what it never took books a loss as large as what it holds.
        scale = flow + axis.wall_stored() + abs(axis.wall_dissipated)
        assert abs(port + wave_in - wave_out - held - spent) <= 1e-12 * scale + 1e-18
        assert abs(axis.port_energy - port) <= 1e-12 * flow + 1e-18
    assert axis.position == position


def test_a_missing_sample_lets_the_last_wave_leave_again_and_pays_for_it() -> None:
    axis = site()
    for k in range(4):  # one slot in five may be repeated
        step(axis, k * 1e-3, 0.2)
    command, account, gap, wave = axis.command, axis.account, axis.gap, axis.leaving
    assert wave != 0.0
    axis.pass_slot()
    axis.miss()
    assert (axis.command, axis.leaving, axis.valid) == (command, wave, False)
    assert axis.account == pytest.approx(account - 0.5 * T * wave * wave)
    assert axis.gap == pytest.approx(gap - T * wave)
    axis.receive(0.2)
    step(axis, 4e-3, 0.2)
    assert axis.valid


def test_where_most_samples_are_lost_nothing_leaves_in_their_place() -> None:
    """A wave that goes on without a look drives the other end on: no more than eight slots."""
    axis = site()
    for k in range(100):
        step(axis, k * 1e-5, 0.2)
    left = []
    for _ in range(12):
        axis.pass_slot()
        axis.miss()
        left.append(axis.leaving)
        axis.receive(0.2)
    assert all(wave != 0.0 for wave in left[:8])
    assert left[8:] == [0.0] * 4


def test_the_gap_is_closed_as_a_whole() -> None:
    """Positions over missed samples: the same energy as if each had been measured on the way."""
    whole, parts = site(mass=1e9), site(mass=1e9)
    for axis in (whole, parts):
        step(axis, 1e-3, 0.5)
    for axis in (whole, parts):
        axis.state.total = axis.state.port_effort = 3.0
    for k in range(1, 4):
        parts.pass_slot()
        parts.close(1e-3 + k * 1e-4, math.nan)
        parts.receive(0.0)
        whole.pass_slot()
        whole.receive(0.0)
    whole.close(1e-3 + 3e-4, math.nan)
    assert whole.port_energy == pytest.approx(parts.port_energy, rel=1e-12)
    assert whole.velocity == pytest.approx(parts.velocity, rel=1e-9)


@pytest.mark.parametrize("pole", [None, 0.3, 0.5])
def test_a_known_mass_is_predicted_exactly(pole: float | None) -> None:
    """The prediction of every acting period comes true, for a free mass and any delay."""
    for delay in (0, 1, 2):
        axis = site(mass=0.5, delay=delay, pole=pole)
        port = axis.params.end.port
        axis.start(0.0, math.nan, 0.0)
        axis.receive(0.7)
        x = v = 0.0
        commands = [0.0] * delay
        predicted: list[float] = []
        axis.think(math.inf)
        for k in range(60):
            predicted.append((axis.wanted + port.root * axis.wave_in) / port.impedance)
            commands.append(axis.command)
            force = commands.pop(0)
            moved = v * T + 0.5 * force / 0.5 * T * T
            v += force / 0.5 * T
            x += moved
            if k >= delay + 2:
                assert moved / T == pytest.approx(predicted[k - delay], rel=1e-9, abs=1e-12)
            axis.pass_slot()
            axis.close(x, math.nan)
            axis.receive(0.7 * math.cos(0.2 * k))
            axis.think(math.inf)


def test_a_remainder_of_delay_widens_the_interval_by_the_swing() -> None:
    axis = site(late=0.25)
    axis.start(0.0, math.nan, 0.0)
    axis.state.total = axis.state.port_effort = 4.0
    axis.pass_slot()
    axis.close(0.001, math.nan)
    # A quarter of the period at 0 N, the rest at 4 N; anything from 0 to 4 N is possible.
    assert axis.port_energy == pytest.approx(0.001 * 3.0)
    assert axis.uncertainty == pytest.approx(0.001 * 4.0)


def test_stopping_damps_within_limits() -> None:
    axis = site(limit=WIDE._replace(effort=1.0, stop_damping=2.0))
    step(axis, 1e-3)
    axis.stop(1.0)
    assert axis.command == pytest.approx(-1.0)  # 2 N s/m at 1 m/s, clipped
    assert axis.stopping
    assert axis.wall_effort == 0.0


def test_an_admittance_axis_stops_at_zero_velocity() -> None:
    axis = site(admittance=True, limit=WIDE._replace(velocity=1.0))
    axis.start(0.0, 2.0, 0.0)
    axis.receive(0.1)
    axis.think(1.0)
    assert axis.command > 0.0
    axis.stop(1.0)
    assert axis.command == 0.0


def test_an_admittance_axis_tells_its_ports_effort() -> None:
    axis = site(admittance=True, limit=WIDE._replace(velocity=1.0))
    axis.start(0.0, 2.0, 0.0)
    axis.receive(0.1)
    axis.think(1.0)
    axis.pass_slot()
    axis.close(1e-4, 2.0)
    assert axis.port_effort == pytest.approx(2.0)


def test_a_gap_with_commands_under_way_is_an_interval() -> None:
    axis = site(delay=1)
    axis.start(0.0, math.nan, 0.0)
    for wave in (0.1, 0.2):  # two different efforts follow each other, then no sample comes
        axis.receive(wave)
        axis.think(10.0)
        axis.pass_slot()
        axis.close(0.0, math.nan)
    assert axis.uncertainty == 0.0
    axis.receive(0.3)
    axis.think(10.0)
    axis.pass_slot()
    axis.miss()
    axis.pass_slot()
    axis.close(1e-3, math.nan)
    assert axis.uncertainty > 0.0


def test_start_forgets_everything() -> None:
    fresh, used = site(wall=WALL), site(wall=WALL)
    for k in range(10):
        step(used, 1e-3 * k, 0.3)
    for axis in (fresh, used):
        axis.start(2e-3, math.nan, 0.1)
        step(axis, 3e-3, 0.2)
    for name in (
        "command",
        "account",
        "gap",
        "velocity",
        "port_energy",
        "wall_absorbed",
        "damper_dissipated",
    ):
        assert getattr(fresh, name) == getattr(used, name), name


def test_an_admittance_axis_books_the_mean_of_two_efforts() -> None:
    axis = site(admittance=True, limit=WIDE._replace(velocity=1.0))
    axis.start(0.0, 2.0, 0.0)
    axis.pass_slot()
    axis.close(1e-3, 4.0)
    assert axis.port_energy == pytest.approx(3e-3)
    assert axis.uncertainty == pytest.approx(1e-3)  # from 2 mJ to 4 mJ


def test_the_walls_observer_begins_anew_with_each_contact() -> None:
    axis = site(wall=WALL, mass=1e9, b=1e-6)
    for x in (1e-3, 2e-3, 3e-3):
        step(axis, x)
    assert axis.wall_contact_energy > 0.0
    step(axis, -1e-3)
    assert axis.wall_contact_energy == 0.0
    assert axis.wall_absorbed != 0.0
    assert not axis.wall_owes


def test_a_wall_owes_what_a_held_effort_gave_until_it_is_paid() -> None:
    axis = site(wall=WALL, mass=1e9, b=1e-6)
    for x in (1e-3, 2e-3, 3e-3):
        step(axis, x)
    for _ in range(7):
        axis.pass_slot()
    step(axis, -0.05)
    owed = -axis.wall_contact_energy
    assert axis.wall_owes
    assert owed > 0.0
    step(axis, -0.04)
    assert axis.wall_contact_energy == -owed  # it is carried to the next contact
    for x in (1e-3, 2e-3, 1e-3):
        step(axis, x)
    assert axis.wall_effort == 0.0  # in debt it gives nothing on the way out
    assert -owed < axis.wall_contact_energy < 0.0
    x = 1e-3
    while axis.wall_owes:
        x += 1e-3
        step(axis, x)
    assert axis.wall_contact_energy >= 0.0
