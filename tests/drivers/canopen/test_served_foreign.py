"""Foreign drives in another process, on UDP multicast: each end of a run, seen from their side."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.drivers.canopen.test_on_the_wire import multicast_works
from tests.foreign import days

pytestmark = [
    pytest.mark.slow,
    pytest.mark.long,
    pytest.mark.realtime,
    pytest.mark.timeout(300),
    pytest.mark.skipif(not multicast_works(), reason="no multicast here"),
]


def test_up_fault_reset_and_down(tmp_path: Path) -> None:
    days.up_fault_reset_and_down(tmp_path, "udp_multicast", "239.74.163.221")


def test_a_reboot_and_a_kill(tmp_path: Path) -> None:
    days.reboot_and_kill(tmp_path, "udp_multicast", "239.74.163.222")
