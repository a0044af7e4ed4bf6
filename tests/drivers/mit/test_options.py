"""Options of a bus of MIT motors: what does not go together, steps, and the time on the wire."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.mit import plugin
from tautwave_drivers.mit.options import facts, motors_of
from tautwave_drivers.turns import doubt, turns_back
from tests.drivers.mit.benches import block, bus_of, driver_options, motor


def joints(count: int, rate_hz: float, **more: Any) -> tuple[Any, BusSpec]:
    options = block(*(motor(number) for number in range(1, count + 1)), **more)
    return driver_options(options), bus_of(options, rate_hz)


@pytest.mark.parametrize(
    ("more", "rate_hz", "time_us"),
    [
        ({}, 423.28, 1890.0),  # 14 frames of 135 bits at 1 Mbit/s
        ({"data_bitrate": 5_000_000}, 1009.59, 792.4),  # 14 x (34 bits at 1, 113 at 5 Mbit/s)
        ({"bitrate": 500_000}, 211.64, 3780.0),
        ({"reserve": 0.5}, 264.55, 1890.0),
    ],
)
def test_seven_joints_fit_at_the_rate_that_their_wire_allows(
    more: dict[str, Any], rate_hz: float, time_us: float
) -> None:
    found = plugin.budget(*joints(7, 400.0, **more))
    assert found.greatest_rate_hz == pytest.approx(rate_hz, rel=1e-4)
    assert found.time_s * 1e6 == pytest.approx(time_us, rel=1e-3)
    assert "a command is the request" in found.arithmetic


def test_the_budget_says_what_each_remedy_gives() -> None:
    found = plugin.budget(*joints(7, 400.0))
    assert "data_bitrate 5000000, CAN FD (1010 Hz)" in found.remedy
    assert "two buses (741 Hz)" in found.remedy


def test_the_steps_are_those_of_the_codes() -> None:
    options = block(motor(1))
    (one,) = facts(driver_options(options), bus_of(options))
    assert one.encoder_quantum == pytest.approx(25.0 / 65535)
    assert one.effort_quantum == pytest.approx(20.0 / 4095)


@pytest.mark.parametrize(
    ("motors", "more", "words"),
    [
        ([motor(1), motor(1)], {}, "motor 1 is listed twice"),
        ([motor(1), motor(2, feedback_id=17)], {}, "two motors have feedback_id 0x11"),
        ([motor(1, feedback_id=2), motor(2)], {}, "0x2, which is a command to motor 2"),
        ([motor(1, feedback_id=1)], {}, "0x1, which is a command to motor 1"),
        ([motor(1, feedback_id=0x302), motor(2)], {}, "0x302, which is a command to motor 2"),
        ([motor(1, feedback_id=0x7FF)], {}, "is that of register frames"),
        ([motor(1)], {"watchdog_s": 0.002}, "less than 3 periods"),
        ([motor(1, t_max=0.5)], {}, "effort_limit 1 is more than motor 1 accepts"),
        ([motor(1, p_max=3.0)], {}, "positions end at p_max 3"),
        ([motor(1, zero=10.0)], {}, "narrow position_range, or correct zero"),
    ],
)
def test_what_does_not_go_together_is_refused(
    motors: list[dict[str, Any]], more: dict[str, Any], words: str
) -> None:
    options = block(*motors, **more)
    with pytest.raises(ConfigError, match=words):
        motors_of(driver_options(options), bus_of(options))


def test_feedback_id_0_is_no_id() -> None:
    with pytest.raises(ValueError, match="feedback_id"):
        driver_options(block(motor(1, feedback_id=0)))


@pytest.mark.parametrize(
    ("axis", "words"),
    [
        (AxisSpec("master.a", 9, "rotary", "impedance", 1.0), "id 9, but options.motors lists"),
        (AxisSpec("master.a", 1, "linear", "impedance", 1.0), "take effort: use kind: rotary"),
        (AxisSpec("master.a", 1, "rotary", "admittance", 1.0), "causality: impedance"),
        (
            AxisSpec("master.a", 1, "rotary", "impedance", 1.0, effort_sensor=True),
            "these motors read none",
        ),
    ],
)
def test_an_axis_that_is_not_its_motors_is_refused(axis: AxisSpec, words: str) -> None:
    options = driver_options(block(motor(1)))
    with pytest.raises(ConfigError, match=words):
        motors_of(options, BusSpec("can", (axis,), 1000.0))


def test_ids_that_only_the_rig_or_only_the_options_have_are_named() -> None:
    options, bus = joints(3, 400.0)
    axis = bus.axes[1]._replace(device_id=9)
    with pytest.raises(ConfigError) as refused:
        motors_of(options, bus._replace(axes=(bus.axes[0], axis)))
    assert list(refused.value.problems) == [
        f"bus {bus.name}: {axis.name} has id 9, but options.motors lists only 1, 2, 3; add it "
        "there, with the ranges that `tautwave scan mit` shows",
        *(
            f"bus {bus.name}: motor {number} in options.motors is not an axis of the rig; remove "
            "it there"
            for number in (2, 3)
        ),
    ]
    assert motors_of(options, bus._replace(axes=())) == []


@pytest.mark.parametrize(
    ("position", "limits", "turns"),
    [
        (0.5, (-1.0, 1.0), [0]),
        (0.5 + math.tau, (-1.0, 1.0), [-1]),
        (0.5 - math.tau, (-1.0, 1.0), [1]),
        (3.0, (-1.0, 1.0), []),
        (0.0, (-7.0, 7.0), [0, -1, 1]),
        (10.0, (-7.0, 7.0), [-1, -2]),
        (1e6, (-math.inf, math.inf), [0]),
    ],
)
def test_turns_that_a_range_allows(
    position: float, limits: tuple[float, float], turns: list[int]
) -> None:
    assert turns_back(position, limits) == turns


@pytest.mark.parametrize("per_turn", [math.tau, 0.7])
def test_a_doubt_names_each_other_place_of_a_range(per_turn: float) -> None:
    """Against a count of places, one by one; outside the range nothing is said here."""
    for low, high in ((-1.0, 1.0), (-0.3, 0.3), (-7.0, 7.0), (0.0, 6.0)):
        for position in (-6.5, -0.9, 0.0, 0.25, 2.0, 6.0):
            places = [position + turns * per_turn for turns in range(-30, 31)]
            others = [one for one in places if low <= one <= high and one != position]
            said = doubt(position, (low, high), per_turn)
            assert bool(said) == (low <= position <= high and bool(others))
            for one in sorted(others, key=lambda place: abs(place - position))[:1]:
                assert not said or f"{one:.4g}" in said
