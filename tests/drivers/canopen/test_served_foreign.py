"""Foreign drives on the real clock, each end of a run seen from their side.

By default on the fake clock: `tests/drivers/canopen/test_quirks.py`.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.clock import MonotonicClock
from tautwave.types import AxisCommand
from tautwave_drivers.canopen import plugin
from tests.drivers.canopen.benches import block, bus_of, driver_options, node
from tests.drivers.canopen.test_on_the_wire import multicast_works
from tests.foreign import days
from tests.foreign.slcan import adapter

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(300)]
MULTICAST = pytest.mark.skipif(not multicast_works(), reason="no multicast here")


@MULTICAST
@pytest.mark.nightly
def test_up_fault_reset_and_down(tmp_path: Path) -> None:
    days.up_fault_reset_and_down(tmp_path, "udp_multicast", "239.74.163.221")


@MULTICAST
@pytest.mark.nightly
def test_a_reboot_and_a_kill(tmp_path: Path) -> None:
    days.reboot_and_kill(tmp_path, "udp_multicast", "239.74.163.222")


def test_a_usb_adapter_by_python_can() -> None:
    """`interface: slcan` with the adapter's terminal as its channel."""
    pytest.importorskip("serial")
    with adapter(1, 2) as usb:
        keys = {"heartbeat_ms": 200, "heartbeat_timeout_ms": 4000, "sdo_timeout_s": 1.0}
        options = block(node(1), node(2), **keys) | {"interface": "slcan", "channel": usb.path}
        options["bitrate"] = 500_000
        bus = bus_of(options, ("impedance", "impedance"), 50.0)
        clock = MonotonicClock()
        parsed = driver_options(options)
        assert plugin.endpoint is not None
        assert plugin.endpoint(parsed).kind == "real"
        driver = plugin.make(parsed, bus, clock, None)
        try:
            driver.open()
            for _ in range(400):
                if driver.enable_step():
                    break
                clock.sleep_until(clock.now_ns() + bus.period_ns)
            valid = 0
            for _ in range(40):
                begun = clock.now_ns()
                driver.request()
                valid += all(state.valid for state in driver.read(begun + bus.period_ns * 7 // 10))
                driver.write([AxisCommand(0.02, 0.0)] * 2)
                clock.sleep_until(begun + bus.period_ns)
        finally:
            driver.close()
        assert valid > 0
        assert {"S6", "O"} <= set(usb.commands)
        for drive in usb.drives:
            assert drive.most_torque > 0.0
            assert (drive.state, drive.torque) == ("disabled", 0.0)
            assert (drive.value(0x6072), drive.value(0x1016, 1)) == (3000, 0)
