"""Two sites on a line: symmetry, scaling, start, arming."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.controller.pair import mismatch
from tautwave.laws.wall import WallParams
from tests.runtime.parts import WIDE, Pair, site, state

WALL = WallParams(0.004, 1.0, 800.0, 1.0, controlled=True)


def wave_pair(line: int = 3, filtered: bool = False, swap: bool = False, delay: int = 0) -> Pair:
    """Return a pair of two unlike sites; `swap` makes the first one the slave."""
    corner = 50.0 if filtered else None
    one = site(b=10.0, mass=0.3, wall=WALL, delay=delay, filter_hz=corner)
    two = site(b=10.0, mass=0.9, limit=WIDE._replace(effort=2.0), filter_hz=corner)
    master, slave = (two, one) if swap else (one, two)
    return Pair(master, slave, line=line)


samples = st.lists(
    st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01), st.booleans(), st.booleans(),
              st.integers(0, 2)),
    min_size=2, max_size=30,
)  # fmt: skip


@given(samples, st.sampled_from([0, 1, 4]), st.booleans(), st.integers(0, 2))
def test_swapping_the_sites_changes_no_bit(
    script: list[tuple[float, float, bool, bool, int]], line: int, filtered: bool, delay: int
) -> None:
    """Master and slave change places, and so the order in which they are evaluated."""
    plain = wave_pair(line, filtered, swap=False, delay=delay)
    turned = wave_pair(line, filtered, swap=True, delay=delay)
    for pair in (plain, turned):
        pair.start(state(), state())
        pair.engage(1.0)
    for one, two, one_valid, two_valid, skipped in script:
        first, second = state(one, valid=one_valid), state(two, valid=two_valid)
        plain.cycle(first, second, skipped, 1.0)
        turned.cycle(second, first, skipped, 1.0)
        for a, b in ((plain.master, turned.slave), (plain.slave, turned.master)):
            for name in ("command", "leaving", "account", "gap", "port_energy", "wall_absorbed"):
                assert getattr(a, name) == getattr(b, name), name


@given(samples, st.integers(0, 3))
def test_a_line_without_delay_hands_over_at_once(
    script: list[tuple[float, float, bool, bool, int]], extra: int
) -> None:
    pair = wave_pair(line=0)
    pair.start(state(), state())
    pair.engage(1.0)
    for one, two, *_ in script:
        pair.cycle(state(one), state(two), 0, 1.0)
        assert pair.master.arrived == pair.slave.leaving
        assert pair.slave.arrived == pair.master.leaving


@pytest.mark.parametrize("power", [1.0, 4.0, 0.25])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_scaled_slave_is_the_same_machine_in_other_units(power: float, sign: float) -> None:
    """Twice the size, `power` over it: every wave on the line is unchanged."""
    scale = 2.0
    force = power / scale
    unit = force / scale  # slave's impedance, mass and energy over position squared
    plain = Pair(site(b=10.0), site(b=10.0, mass=0.7), line=2)
    slave = site(b=10.0 * unit, mass=0.7 * unit, wave=sign * math.sqrt(power))
    scaled = Pair(site(b=10.0), slave, line=2, scale=scale, sign=sign, power=power)
    for pair in (plain, scaled):
        pair.start(state(), state())
        pair.engage(1.0)
    for k in range(40):
        x, y = 0.01 * math.sin(0.1 * k), 0.008 * math.sin(0.1 * k - 0.3)
        plain.cycle(state(x), state(y), 0, 1.0)
        scaled.cycle(state(x), state(sign * scale * y), 0, 1.0)
        assert scaled.master.command == pytest.approx(plain.master.command, rel=1e-9, abs=1e-12)
        assert scaled.slave.command == pytest.approx(
            sign * force * plain.slave.command, rel=1e-9, abs=1e-12
        )
        assert scaled.position_error() == pytest.approx(plain.position_error(), abs=1e-12)
        assert scaled.effort_error() == pytest.approx(plain.effort_error(), rel=1e-9, abs=1e-12)


def test_an_offset_at_engagement_is_no_error() -> None:
    pair = wave_pair()
    pair.start(state(0.1), state(-0.3))
    assert pair.position_error() == pytest.approx(0.0, abs=1e-15)
    assert pair.slave.gap == 0.0


def test_a_given_offset_is_mended_over_time() -> None:
    """The slave is 1 mm off at the start; the line brings it there, with energy that comes in."""
    pair = Pair(site(), site(), offset=0.0)
    pair.start(state(0.0), state(0.001))
    assert mismatch(pair.q, 0.0, 0.001, 0.0) == pytest.approx(0.001)
    assert pair.slave.gap == pytest.approx(0.001 * pair.slave.params.end.port.root)
    assert pair.position_error() == pytest.approx(-0.001)


def test_it_arms_only_where_both_walls_ask_for_little() -> None:
    limit = WIDE._replace(effort=10.0)
    pair = Pair(site(limit=limit, wall=WALL), site(limit=limit))
    for position, armed in ((0.0, True), (0.0045, True), (0.01, False)):
        pair.start(state(position), state())
        assert pair.arm(0.1) is armed


def test_guards_of_both_sides_are_distinguished() -> None:
    limit = WIDE._replace(velocity=1.0)
    pair = Pair(site(limit=limit), site(limit=limit))
    pair.start(state(), state())
    pair.engage(1.0)
    pair.cycle(state(0.0), state(0.01), 0, 1.0)
    assert (pair.master.guard, pair.slave.guard) == (0, 2)


def test_the_ramp_scales_every_limit() -> None:
    limit = WIDE._replace(effort=10.0)
    pair = Pair(site(b=1e4, limit=limit), site(b=1e4, limit=limit))
    pair.start(state(), state())
    pair.engage(0.1)
    pair.cycle(state(0.01), state(-0.01), 0, 0.1)
    assert pair.master.command == -1.0
    assert pair.slave.command == 1.0


def position_pair(samples: int = 0) -> Pair:
    return Pair(site(spring=(100.0, 2.0)), site(spring=(100.0, 2.0)), line=samples)


def test_position_coupling_pulls_both_sides_together() -> None:
    pair = position_pair()
    pair.start(state(0.0), state(0.0))
    pair.engage(1.0)
    pair.cycle(state(0.001), state(0.0), 0, 1.0)
    # 1 mm ahead at 1 m/s
    assert pair.master.command == pytest.approx(-(100.0 * 0.001 + 2.0 * 1.0))
    assert pair.slave.command == pytest.approx(100.0 * 0.001 + 2.0 * 1.0)


def test_position_coupling_delays_what_the_other_side_sees() -> None:
    pair = position_pair(samples=3)
    pair.start(state(0.0), state(0.0))
    pair.engage(1.0)
    seen = []
    for _ in range(6):
        pair.cycle(state(0.001), state(0.0), 0, 1.0)
        seen.append(pair.slave.command)
    # Three slots later: K x and, for the one slot in which it moved, B v.
    assert seen == pytest.approx([0.0, 0.0, 0.0, 2.1, 0.1, 0.1])


@pytest.mark.parametrize("skipped", [0, 1, 2, 3])
def test_a_wave_takes_as_many_slots_whether_they_are_run_or_skipped(skipped: int) -> None:
    pair = Pair(site(), site(), line=6)
    pair.start(state(), state())
    pair.engage(1.0)
    pair.cycle(state(0.0), state(), 0, 1.0)
    pair.master.state.end.account = 1.0
    pair.cycle(state(0.001), state(), 0, 1.0)
    sent = pair.master.leaving
    assert sent > 0.0
    pair.cycle(state(0.001), state(), skipped, 1.0)
    for _ in range(4 - skipped):
        pair.cycle(state(0.001), state(), 0, 1.0)
    assert pair.slave.arrived == 0.0
    pair.cycle(state(0.001), state(), 0, 1.0)
    assert pair.slave.arrived == sent
