"""Models and units: e-manual values, conversions per model, the simulator's table beside ours."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.models.encoder import quantise
from tautwave.types import AxisCommand
from tautwave_drivers.dynamixel.options import Servo, ServoOptions
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.models import MODELS, VELOCITY_UNIT, Model, model_name
from tautwave_drivers.dynamixel.protocol.units import Scale, scale_of
from tautwave_sim.dynamixel.models import find_model
from tests.drivers.dynamixel.parts import spec

EVERY = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)


def scale(model: str = "XM430-W350", **more: object) -> Scale:
    options = ServoOptions.model_validate({"id": 1, "model": model, **more})
    return scale_of(Servo(spec(1), options, MODELS[model]))


# Current unit [A], stall torque [N m] / stall current [A]: reference/buses.md 6.2 and the e-manual.
SLOPES = {
    "XL330-M077": (1e-3, 0.146), "XL330-M288": (1e-3, 0.354), "XC330-M288": (1e-3, 0.517),
    "XM430-W210": (2.69e-3, 1.30), "XM430-W350": (2.69e-3, 1.78), "XH430-W350": (2.69e-3, 2.62),
    "XM540-W270": (2.69e-3, 2.41), "XH540-W150": (2.69e-3, 1.45), "XH540-W270": (2.69e-3, 2.02),
    "XH430-V350": (1.34e-3, 4.714), "XH430-V210": (1.34e-3, 3.714), "XH540-V150": (2.69e-3, 2.667),
}  # fmt: skip


@pytest.mark.parametrize("name", SLOPES)
def test_the_slopes_are_those_of_the_e_manual(name: str) -> None:
    unit, slope = SLOPES[name]
    assert MODELS[name].current_unit == unit
    assert MODELS[name].torque_constant == pytest.approx(slope, rel=4e-3)


@EVERY
def test_the_simulator_was_made_from_the_same_pages(model: Model) -> None:
    """Two people read the e-manual: what they noted agrees."""
    other = find_model(model.name)
    items = {item.name: item for item in other.items}
    assert (model.number, model.current_unit) == (other.number, other.current_unit_a)
    assert model.torque_constant == other.torque_constant
    assert model.fastest_baud == max(baud for _, baud in other.bauds)
    assert model.indirect_data == other.indirect[0].data
    if model.current_unit:
        assert model.current_range == items["Current Limit"].high
    for register, name in (
        (reg.RETURN_DELAY, "Return Delay Time"), (reg.OPERATING_MODE, "Operating Mode"),
        (reg.VELOCITY_LIMIT, "Velocity Limit"), (reg.TORQUE_ENABLE, "Torque Enable"),
        (reg.HARDWARE_ERROR, "Hardware Error Status"), (reg.BUS_WATCHDOG, "Bus Watchdog"),
        (reg.GOAL_VELOCITY, "Goal Velocity"), (reg.PRESENT_POSITION, "Present Position"),
        (reg.PRESENT_VELOCITY, "Present Velocity"), (reg.SHUTDOWN, "Shutdown"),
        (reg.PRESENT_TEMPERATURE, "Present Temperature"), (reg.DRIVE_MODE, "Drive Mode"),
        (reg.STATUS_RETURN_LEVEL, "Status Return Level"), (reg.MODEL_NUMBER, "Model Number"),
        (reg.PROFILE_ACCELERATION, "Profile Acceleration"), (reg.FIRMWARE, "Firmware Version"),
        (reg.SECONDARY_ID, "Secondary(Shadow) ID"), (reg.HOMING_OFFSET, "Homing Offset"),
        (reg.PWM_LIMIT, "PWM Limit"), (reg.GOAL_PWM, "Goal PWM"),
        (reg.STARTUP, "Startup Configuration"),
    ):  # fmt: skip
        item = items[name]
        assert (register.address, register.size) == (item.address, item.size)
        assert register.eeprom == (item.area == "EEPROM")


@EVERY
def test_a_model_is_known_by_its_number(model: Model) -> None:
    assert model_name(model.number) == model.name


def test_numbers_nobody_knows_are_reported_as_such() -> None:
    assert model_name(9999) == "model 9999"
    assert model_name(12, 1.0) == "AX-12A"
    assert model_name(30) == "MX-28(2.0)"


@EVERY
@given(data=st.data())
def test_counts_and_si_go_there_and_back(model: Model, data: st.DataObject) -> None:
    gear = data.draw(st.floats(0.05, 20.0))
    direction = data.draw(st.sampled_from([1, -1]))
    units = scale(model.name, gear_ratio=gear, direction=direction)
    counts = data.draw(st.integers(-1193, 1193))
    back = units.current_counts(AxisCommand(direction * counts * units.effort, 0.0))
    assert back == counts
    back = units.velocity_counts(AxisCommand(0.0, direction * counts * units.velocity))
    assert back == counts
    # The effort that a count stands for is what the loop's own rounding makes of it.
    effort = counts * units.effort
    assert quantise(effort, units.effort) == effort


def test_conversions_in_numbers() -> None:
    plain = scale()
    assert plain.position == 2.0 * math.pi / 4096
    assert plain.velocity == pytest.approx(0.02398, rel=1e-3) == VELOCITY_UNIT
    assert plain.effort == pytest.approx(2.69e-3 * 4.1 / 2.3)
    geared = scale(gear_ratio=4.0, torque_constant=1.5)
    assert geared.position == pytest.approx(2.0 * math.pi / 4096 / 4.0)
    assert geared.effort == pytest.approx(2.69e-3 * 1.5 * 4.0)
    assert geared.current_counts(AxisCommand(1.0, 0.0)) == round(1.0 / geared.effort)
    load = scale("XL430-W250")
    assert load.effort == pytest.approx(1.4e-3)  # 0.1 % of the stall torque


def test_commands_beyond_the_limit_and_no_numbers() -> None:
    units = scale(direction=-1)
    for effort, counts in (
        (1e9, -500), (-1e9, 500), (math.inf, 0), (-math.inf, 0), (math.nan, 0),
    ):  # fmt: skip
        assert units.current_counts(AxisCommand(effort, 0.0), 500) == counts


@given(st.integers(-(2**40), 2**40))
def test_a_register_holds_the_nearest_it_can(value: int) -> None:
    for register in (reg.GOAL_CURRENT, reg.GOAL_VELOCITY, reg.BUS_WATCHDOG, reg.RETURN_DELAY):
        data = register.encode(value)
        assert len(data) == register.size
        found = register.decode(data)
        low, high = -(1 << 8 * register.size - 1), (1 << 8 * register.size - 1) - 1
        if not register.signed:
            low, high = 0, (1 << 8 * register.size) - 1
        assert found == min(max(value, low), high)
