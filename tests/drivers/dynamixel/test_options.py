"""What a rig file may not require of Dynamixel servos, and the messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave_drivers.dynamixel import plugin
from tautwave_drivers.dynamixel.options import DynamixelOptions, match_servos
from tautwave_drivers.dynamixel.protocol.models import MODELS
from tests.drivers.dynamixel.parts import block, bus_of, options_of, servo, spec


def refused(*servos: dict[str, Any], axes: Any = None, **more: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        match_servos(options_of(*servos, **more), bus_of(*(axes or [spec(1)])))
    return str(caught.value)


def test_an_axis_without_a_servo() -> None:
    reported = refused(servo(2), servo(3))
    assert "master.a1 has id 1, but options.servos lists 2, 3" in reported


def test_an_unknown_model_is_reported_with_the_nearest() -> None:
    assert "did you mean 'XM430-W350'?" in refused(servo(1, "xm430w350"))
    assert "known: XL330-M077" in refused(servo(1, "SG90"))


def test_a_servo_without_current_control_takes_no_effort() -> None:
    reported = refused(servo(1, "XL430-W250"))
    assert "a XL430-W250 has no current control, so it cannot take effort" in reported
    assert "causality: admittance" in reported
    match_servos(options_of(servo(1, "XL430-W250")), bus_of(spec(1, "admittance")))


def test_protocol_1_runs_no_axis() -> None:
    assert "protocol 1.0 servos have neither torque control" in refused(servo(1), protocol=1.0)


def test_an_effort_no_such_servo_gives() -> None:
    reported = refused(servo(1, "XL330-M288"))
    assert "effort_limit 1 exceeds a XL330-M288" in reported
    assert "1.75 A gives 0.619" in reported


def test_an_effort_that_is_no_count_of_the_goal() -> None:
    reported = refused(servo(1, gear_ratio=1e6))
    assert (
        "effort_limit 1 is less than one count of a XM430-W350's goal current (4.8e+03)" in reported
    )


@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_a_model_whose_torque_is_not_known(causality: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each model listed today states its stall torque; the next one may not."""
    new = MODELS["XM430-W350"]._replace(name="XM999", stall_torque=0.0, stall_current=0.0)
    monkeypatch.setitem(MODELS, "XM999", new)
    axes = [spec(1, causality)]
    reported = refused(servo(1, "XM999"), axes=axes)
    assert reported == (
        "bus hand: master.a1: the stall torque of a XM999 is not known; give torque_constant"
    )
    (found,) = match_servos(options_of(servo(1, "XM999", torque_constant=1.5)), bus_of(*axes))
    assert found.torque_constant == 1.5


def test_a_current_limit_beyond_the_model() -> None:
    reported = refused(servo(1, current_limit=4.0))
    assert "current_limit 4 exceeds the 3.21 A" in reported


def test_a_baud_rate_beyond_the_model() -> None:
    axes = [spec(1, effort=0.1)]
    assert "goes up to 4000000 baud" in refused(servo(1, "XL330-M288"), axes=axes, baud=4_500_000)


def test_a_watchdog_shorter_than_the_loop() -> None:
    bus = bus_of(spec(1))._replace(rate_hz=20.0)
    with pytest.raises(
        ConfigError, match=r"watchdog_s 0.1 is shorter than 3 periods.*0.15 or more"
    ):
        match_servos(options_of(servo(1)), bus)
    match_servos(options_of(servo(1), watchdog_s=0.16), bus)


def test_ids_twice_and_many_mistakes_at_once() -> None:
    reported = refused(servo(1), servo(1, "X"), axes=[spec(1), spec(9)])
    assert "servo id 1 is listed twice" in reported
    assert "unknown model 'X'" in reported
    assert "master.a9 has id 9" in reported


def test_status_blocks_of_two_families_are_refused() -> None:
    options = options_of(servo(1), servo(2, "XL330-M288"), status_block=True)
    bus = bus_of(spec(1), spec(2, effort=0.1))
    with pytest.raises(ConfigError, match="different addresses"):
        plugin.facts(options, bus)
    plugin.facts(options_of(servo(1), servo(2), status_block=True), bus_of(spec(1), spec(2)))


@pytest.mark.parametrize(
    "change",
    [
        {"speed": 3}, {"port": 5}, {"baud": 100}, {"baud": "fast"}, {"protocol": 3.0},
        {"read": "bulk"}, {"servos": []}, {"return_delay_s": 1e-3}, {"watchdog_s": 3.0},
        {"usb_latency_s": -1.0}, {"servos": [{"id": 1}]}, {"servos": [servo(1, direction=2)]},
        {"servos": [servo(253)]}, {"servos": [servo(1, gear_ratio=0.0)]},
        {"servos": [servo(1, colour="red")]},
    ],
    ids=str,
)  # fmt: skip
def test_wrong_options_do_not_pass(change: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        DynamixelOptions.model_validate({**block(servo(1)), **change})


def test_the_simulators_block_is_none_of_the_drivers_business() -> None:
    options_of(servo(1), simulator={"anything": [1, {"goes": True}]})


def test_the_facts_are_the_servos_steps() -> None:
    bus = bus_of(spec(1), spec(2, "admittance"))
    one, two = plugin.facts(options_of(servo(1), servo(2, gear_ratio=2.0)), bus)
    assert one.encoder_quantum == 2.0 * two.encoder_quantum
    assert two.effort_quantum == 2.0 * one.effort_quantum
    assert one.velocity_quantum == 0.0
    assert two.velocity_quantum == pytest.approx(0.02398 / 2.0, rel=1e-3)


def test_a_sentence_of_a_block_stands_for_itself_in_a_rig_file() -> None:
    """Not as pydantic puts it, `Value error, ... (got a mapping)`."""
    path = Path(__file__).parents[3] / "configs" / "bench-dynamixel-sim.yaml"
    with pytest.raises(ConfigError) as caught:
        load_rig(path, ["buses.servos.options.simulator={servos: {9: {}}}"])
    [problem] = caught.value.problems
    assert problem.endswith(
        "buses.servos.options: simulator.servos names servo 9, which is not listed"
    )
