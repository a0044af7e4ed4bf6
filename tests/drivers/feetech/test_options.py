"""What a Feetech bus' options allow: each refusal with its sentence; steps, bus time, notes."""

from __future__ import annotations

import json
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.errors import ConfigError
from tautwave_drivers.feetech import plugin
from tautwave_drivers.feetech.budget import budget
from tautwave_drivers.feetech.options import facts, foreseen, match_servos
from tautwave_drivers.feetech.tables import HLS, SMS, STS, Identity, Register, identity_of
from tests.drivers.feetech.benches import block, bus_of, driver_options, servo

REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown model": ({"model": "STS3216"}, "did you mean 'STS3215'?"),
    "no constant": ({"model": "STS3250"}, "the torque constant of a STS3250 is not known"),
    "no resistance": (
        {"model": "STS3250", "torque_constant": 2.0}, "the resistance of a STS3250 is not known",
    ),
    "no supply": (
        {"model": "STS3250", "torque_constant": 2.0, "resistance": 2.0}, "give supply_v",
    ),
    "gear of an unknown one": ({"model": "STS3250", "gear": 147.0}, "give torque_constant with"),
    "too weak": ({"model": "STS3215", "gear": 70.0}, "which gives 0.542 N m at 80% of 7.4 V"),
    "over the seam": ({"model": "HLS3625", "zero_counts": 100}, "over the seam of its encoder"),
    "too coarse": ({"model": "HLS3625", "gear_ratio": 300.0}, "less than one count of its goal"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_servo_cannot_do_is_refused_before_any_wire(name: str) -> None:
    one, words = REFUSED[name]
    options = block({"id": 1, **one})
    with pytest.raises(ConfigError) as told:
        match_servos(driver_options(options), bus_of(options))
    assert words in str(told.value)


def test_all_problems_are_listed_at_once() -> None:
    options = block(servo(1), servo(1), servo(2), power_cut="")
    bus = bus_of(block(servo(1), servo(3)))
    with pytest.raises(ConfigError) as told:
        match_servos(driver_options(options), bus)
    for words in ("no watchdog", "servo id 1 is listed twice", "master.a3 has id 3"):
        assert words in str(told.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "linear"}, "use kind: rotary"),
        ({"effort_sensor": True}, "remove effort_sensor"),
        ({"causality": "admittance"}, "or give it a follower"),
    ],
)
def test_an_axis_that_no_servo_is_made_for_is_refused(change: dict[str, Any], words: str) -> None:
    options = block(servo(1))
    bus = bus_of(options)
    bus = bus._replace(axes=(bus.axes[0]._replace(**change),))
    with pytest.raises(ConfigError, match=words):
        match_servos(driver_options(options), bus)


@pytest.mark.parametrize(
    "wrong", [{"baud": 2_000_000}, {"stop": "brake"}, {"return_delay_s": 1e-3}, {"watchdog_s": 0.1}]
)
def test_wrong_keys_and_values_are_errors(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        driver_options(block(servo(1), **wrong))


def test_steps_are_those_of_current_and_voltage() -> None:
    options = block(servo(1), servo(2, "STS"), servo(3, "STS", gear=147.0))
    bus = bus_of(options)
    current, slow, fast = facts(driver_options(options), bus)
    assert current.effort_quantum == pytest.approx(5.29e-3, rel=1e-3)  # 6.5 mA, 0.814 N m/A
    assert slow.effort_quantum == pytest.approx(3.34e-3, rel=1e-3)  # 1.21 x 7.4 / 2.68 / 1000
    assert fast.effort_quantum == pytest.approx(slow.effort_quantum * 147 / 345)
    assert current.encoder_quantum == pytest.approx(1.534e-3, rel=1e-3)


def test_check_says_what_nobody_watches_and_what_the_motor_brakes_with() -> None:
    options = block(servo(1, "STS"), servo(2, "STS", gear=147.0), servo(3))
    bus = bus_of(options)
    bus = bus._replace(axes=(*bus.axes[:2], bus.axes[2]._replace(effort_limit=4.0)))
    said = "\n".join(foreseen(driver_options(options), bus))
    assert "their power is cut by hand: switch on the supply" in said
    assert "0.546 N m s/rad of back-EMF" in said
    assert "0.0992 N m s/rad of back-EMF" in said
    assert "effort_limit 4 is 4.9 A; users of these servos took 3 A for safe" in said


def test_bus_time_is_bytes_delays_latency_and_an_assumed_turn_around() -> None:
    options = block(
        *[servo(at, "STS") for at in range(1, 7)], return_delay_s=500e-6, usb_latency_s=1e-3
    )
    found = budget(driver_options(options), bus_of(options, 100.0))
    wire = (8 + 6 * 3 + 8 + 6 + 6 * 37) * 10 / 1e6
    exchange = wire + 6 * (500e-6 + 50e-6) + 1e-3
    assert found.time_s == pytest.approx(exchange / 0.8)
    assert found.greatest_rate_hz == pytest.approx(0.8 / exchange)
    for words in ("return delay: 6 x 500 us", "6 x 50 us, assumed", "USB latency: 1 ms"):
        assert words in found.arithmetic
    assert "return_delay_s: 0 gives 204 Hz" in found.remedy


@pytest.mark.parametrize(
    ("firmware", "big", "table", "series"),
    [
        ((3, 10), 0, STS, "STS"), ((3, 39), 0, STS, "STS"), ((3, 40), 0, HLS, "HLS"),
        ((3, 59), 0, HLS, "HLS"), ((3, 60), 0, None, "unknown"), ((2, 40), 0, SMS, "SMS"),
        ((2, 70), 0, None, "unknown"), ((1, 5), 0, SMS, "SMS"), ((0, 9), 1, None, "SCS"),
        ((0, 9), 0, None, "SCS"), ((3, 25), 1, None, "SCS"), ((4, 1), 0, None, "unknown"),
    ],
)  # fmt: skip
def test_the_table_follows_the_firmware(
    firmware: tuple[int, int], big: int, table: Any, series: str
) -> None:
    identity = identity_of(bytes((*firmware, big, 9, 3)))
    assert (identity.table, identity.series) == (table, series)
    assert identity == Identity(*firmware, bool(big), 0x903 if big else 0x309)


@pytest.mark.parametrize("sign", [10, 11, 15])
@pytest.mark.parametrize("value", [0, 1, -1, 25, -25, 1000, -1000, 5000, -5000, 70000, -70000])
def test_numbers_are_sign_and_magnitude(sign: int, value: int) -> None:
    register = Register("x", 44, 2, sign)
    most = (1 << sign) - 1
    held = int.from_bytes(register.encode(value), "little")
    assert held & most == min(abs(value), most)
    assert held >> sign == (value < 0)
    assert register.decode(register.encode(value)) == min(max(value, -most), most)


def test_the_plugin_needs_no_library_and_takes_positions() -> None:
    assert plugin.positions
    assert not plugin.needs
    options = plugin.options.model_validate_json(json.dumps(block(servo(1))))
    assert plugin.endpoint is not None
    assert plugin.endpoint(options).kind == "real"
