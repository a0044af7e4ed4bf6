"""Foreign drives in another process, on the kernel's own CAN bus, seen from their side."""

from __future__ import annotations

import pytest

from tests.foreign.cia402 import PRODUCT, VENDOR
from tests.foreign.days import MASTER, WATCH_MS, all_off, enabled
from tests.foreign.served_drives import foreign_drives
from tests.vcan.test_canopen import Stepped

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(240)]


def test_up_down_and_a_master_that_falls_silent() -> None:
    with foreign_drives("socketcan", "vcan0") as drives:
        rig = Stepped(1, 2, heartbeat_ms=200, heartbeat_timeout_ms=WATCH_MS)
        rig.driver.open()
        said = rig.driver.identities["master.a1"]
        assert (said["vendor"], said["product"]) == (f"0x{VENDOR:X}", f"0x{PRODUCT:X}")
        rig.enable()
        rig.run(20, 0.05)
        ran = drives.until(enabled(1))
        assert ran["watches"] == MASTER << 16 | WATCH_MS  # armed before it has torque
        assert drives.now()[1]["most"] > 0.0
        rig.driver.close()
        all_off(drives)

        since = len(drives.seen)
        rig = Stepped(1, 2, heartbeat_ms=200, heartbeat_timeout_ms=WATCH_MS)
        rig.driver.open()
        rig.enable()
        rig.run(5, 0.05)
        for number in (1, 2):
            drives.until(enabled(number), since)
        since = len(drives.seen)  # from here on nothing is sent, as after kill -9
        for number in (1, 2):
            off = drives.until(
                lambda seen, n=number: seen.get("node") == n and seen["state"] == "disabled", since
            )
            assert off["watches"] == MASTER << 16 | WATCH_MS
        assert not any(seen["torque"] for seen in drives.now().values())
        rig.driver.close()
        all_off(drives)
