"""What is wrong with an options block, and the steps that follow from a right one."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.clock import FakeClock
from tautwave.config import load_rig
from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError, DriverError
from tautwave.types import SAFE_COMMAND, CommandDelay
from tautwave_drivers.canopen import plugin
from tautwave_drivers.canopen.foresight import facts
from tautwave_drivers.canopen.options import nodes_of
from tautwave_drivers.canopen.scan import ScanOptions, scan
from tests.drivers.canopen.benches import block, bus_of, driver_options, make, node

CONFIG = Path(__file__).parents[3] / "configs" / "bench-canopen-virtual.yaml"


@pytest.mark.parametrize(
    ("options", "changes", "sentence"),
    [
        (block(node(1), node(1)), {}, "node 1 is listed twice"),
        (block(node(7)), {"device_id": 3}, "has id 3, but options.nodes lists only 7"),
        (block(node(127)), {}, "has the same id as this master"),
        (block(node(1)), {"kind": "linear"}, "is linear, but node 1 has no feed"),
        (block(node(1, feed=0.01)), {}, "is rotary, but node 1 has a feed"),
        (block(node(1), bitrate=123_456), {}, "bitrate 123456 is not one of CANopen's"),
        (block(node(1), heartbeat_timeout_ms=30), {}, "at least twice heartbeat_ms"),
        (block(node(1), sync=False), {}, "rpdo must be event"),
        (block(node(1, rated_torque=1e-6)), {}, "6071h holds 1 to 32766"),
        (block(node(1, mapping="lean", homing={"method": 35})), {}, "mapping: full"),
        (
            block(node(1, mapping="lean", effort_sensor={"effort": 0.0})),
            {"effort_sensor": True},
            "effort_sensor.effort (per count) must not be 0",
        ),
        (
            block(node(1, mapping="lean", report_torque=True)),
            {"causality": "admittance"},
            "is velocity-controlled and already reports 6077h; remove report_torque",
        ),
    ],
)
def test_a_block_that_does_not_fit_its_axes_is_refused(
    options: dict[str, Any], changes: dict[str, Any], sentence: str
) -> None:
    bus = bus_of(options, ("impedance",) * len(options["nodes"]))
    axes = tuple(axis._replace(**changes) for axis in bus.axes)
    with pytest.raises(ConfigError, match=re.escape(sentence)):
        nodes_of(driver_options(options), bus._replace(axes=axes))


def test_a_node_without_an_axis_is_refused() -> None:
    options = block(node(1), node(2))
    bus = bus_of(options, ("impedance", "impedance"))
    with pytest.raises(ConfigError, match=r"node 2 in options\.nodes is not an axis"):
        nodes_of(driver_options(options), bus._replace(axes=bus.axes[:1]))


def test_an_event_timer_needs_whole_milliseconds() -> None:
    options = block(node(1), sync=False, rpdo="event")
    with pytest.raises(ConfigError, match="whole ms"):
        nodes_of(driver_options(options), bus_of(options, ("impedance",), 400.0))


@pytest.mark.parametrize("wrong", [{"id": 0}, {"gear_ratio": -1.0}, {"direction": 0}, {"gear": 2}])
def test_a_wrong_key_or_value_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        driver_options(block(node(1) | wrong))


def test_steps_of_a_geared_rotary_axis() -> None:
    options = block(node(1, gear_ratio=5.2, direction=-1, velocity_factor=10.0))
    spec = bus_of(options, ("admittance",))
    fact = facts(driver_options(options), spec)[0]
    assert fact.encoder_quantum == pytest.approx(math.tau / (4096 * 5.2))
    assert fact.velocity_quantum == pytest.approx(10.0 * fact.encoder_quantum)
    assert fact.effort_quantum == pytest.approx(0.5e-3 * 5.2)


def test_steps_of_a_spindle() -> None:
    options = block(node(1, feed=0.005, gear_ratio=2.0))
    bus = bus_of(options, ("impedance",))
    bus = bus._replace(axes=(AxisSpec("master.z", 1, "linear", "impedance", 100.0),))
    fact = facts(driver_options(options), bus)[0]
    assert fact.encoder_quantum == pytest.approx(0.005 / (4096 * 2.0))
    # power: torque times motor angle is force times way
    assert fact.effort_quantum == pytest.approx(0.5e-3 * math.tau * 2.0 / 0.005)


def test_the_command_delay_is_one_period_by_sync_and_the_wire_by_event() -> None:
    assert make(block(node(1)), ("impedance",)).driver.command_delay == CommandDelay(1, 0.0)
    delay = make(block(node(1), rpdo="event"), ("impedance",)).driver.command_delay
    assert delay.periods == 0
    assert delay.remainder_s == pytest.approx((55 + 125 + 105) * 1e-6)


def test_make_touches_nothing_and_a_wrong_number_of_commands_is_reported() -> None:
    options = block(node(1), interface="no-such-interface")
    bus = bus_of(options, ("impedance",))
    driver = plugin.make(driver_options(options), bus, FakeClock(), None)
    with pytest.raises(DriverError, match="2 commands for 1 axes"):
        driver.write([SAFE_COMMAND] * 2)
    with pytest.raises(DriverError, match="cannot open no-such-interface"):
        driver.open()
    driver.close()


def test_fd_is_for_the_budget_only() -> None:
    rig = make(block(node(1)), ("impedance",))
    options = driver_options(block(node(1), data_bitrate=5_000_000))
    driver = plugin.make(options, rig.bus, rig.clock, rig.world.transport)
    with pytest.raises(DriverError, match="data_bitrate is for `tautwave check` only"):
        driver.open()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"nodes": {"2": {"identiti": 7}}}, "unknown key 'identiti'; did you mean 'identity'?"),
        ({"fault": {}}, "unknown key 'fault'; did you mean 'faults'?"),
        ({"faults": {"lost": 2.0}}, "less than or equal to 1"),
    ],
)
def test_a_wrong_key_of_the_simulated_drives_is_a_sentence(
    wrong: dict[str, Any], words: str
) -> None:
    override = "buses.can.options.simulator=" + json.dumps(wrong)
    with pytest.raises(ConfigError) as reported:
        load_rig(CONFIG, [override])
    assert words in str(reported.value)
    assert "options.simulator" in str(reported.value)


@pytest.mark.parametrize(
    ("interface", "why"),
    [
        ("nothing-at-all", "Unknown interface type"),
        ("serial", "Must specify a serial port"),
        ("kvaser", "cannot open kvaser:0 through python-can"),
        ("socketcand", "cannot open socketcand:0 through python-can"),
    ],
)
def test_an_interface_that_cannot_be_opened_is_a_sentence(interface: str, why: str) -> None:
    """Whatever python-can raises: NameError without Kvaser's library, TypeError, ..."""
    with pytest.raises(DriverError, match=f"(?s){why}.*check interface and channel"):
        scan(ScanOptions(interface=interface, channel="0"))


def test_the_driver_names_the_bus_that_cannot_be_opened() -> None:
    options = block(node(1)) | {"interface": "serial", "channel": "0"}
    spec = bus_of(options, ("impedance",))
    driver = plugin.make(driver_options(options), spec, FakeClock(), None)
    with pytest.raises(DriverError, match=r"^bus can: cannot open serial:0"):
        driver.open()
    driver.close()


@pytest.mark.parametrize(
    ("key", "value"),
    [("gear_ratio", 1e-12), ("gear_ratio", 1e12), ("counts_per_revolution", 10**20)],
)
def test_what_no_drive_can_hold_is_refused(key: str, value: float) -> None:
    """A ratio of 1e-12 once ended in ZeroDivisionError."""
    with pytest.raises(ValidationError, match=key):
        driver_options(block(node(1, **{key: value})))
