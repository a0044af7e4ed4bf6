"""Software of others drives the simulated Feetech servos on a pseudo-terminal.

rustypot (Pollen Robotics), with the extra `peers` vassar-feetech-servo-sdk, which brings the
maker's own SDK, and LeRobot's Feetech bus where it is installed. It runs in real time: nothing here
asserts how fast.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rustypot

from tests.sim.feetech.lerobot_bus import GOALS

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

ROOT = Path(__file__).parents[3]
VASSAR = "comes with the extra `peers`: vassar-feetech-servo-sdk"
COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main()", "sim", "feetech"]


@contextmanager
def served(*options: str) -> Iterator[str]:
    """Run `tautwave sim feetech`; give its device."""
    child = subprocess.Popen([*COMMAND, *options], stdout=subprocess.PIPE)
    try:
        assert child.stdout is not None
        yield str(json.loads(child.stdout.readline())["endpoint"])
    finally:
        child.terminate()
        child.communicate(timeout=60)
    assert child.returncode == 0


def until(
    done: Callable[[], bool], act: Callable[[], object] = bool, limit_s: float = 30.0
) -> None:
    end = time.monotonic() + limit_s
    while not done():
        assert time.monotonic() < end
        act()
        time.sleep(0.02)


def patiently(ask: Callable[[], Any]) -> Any:
    """A busy machine answers late, which clients take for no answer."""
    for _ in range(20):
        try:
            return ask()
        except RuntimeError:
            time.sleep(0.05)
    return ask()


def test_rustypot_reads_and_moves_them() -> None:
    with served("--model", "STS3215", "--ids", "1,2") as device:
        client = rustypot.Sts3215PyController(device, 1_000_000, 1.0)
        ids = [1, 2]
        assert all(patiently(lambda one=one: client.ping(one)) for one in ids)
        places = patiently(lambda: client.sync_read_present_position(ids))
        assert places == pytest.approx([0.0, 0.0], abs=0.01)
        assert patiently(lambda: client.sync_read_present_voltage(ids)) == [74, 74]
        patiently(lambda: client.sync_write_torque_enable(ids, [True, True]))
        goals = [0.4, -0.3]

        def there() -> bool:
            found = patiently(lambda: client.sync_read_present_position(ids))
            return max(abs(one - goal) for one, goal in zip(found, goals, strict=True)) < 0.05

        until(there, lambda: client.sync_write_goal_position(ids, goals))
        patiently(lambda: client.sync_write_torque_enable(ids, [False, False]))
        assert patiently(lambda: client.sync_read_torque_enable(ids)) == [False, False]


def test_the_makers_sdk_and_vassars_client_drive_a_torque() -> None:
    vassar = pytest.importorskip("vassar_feetech_servo_sdk", reason=VASSAR)
    with served("--model", "HLS3625", "--ids", "1,2") as device:
        client = vassar.ServoController([1, 2], servo_type="hls", port=device)
        client.connect()
        try:
            until(lambda: client.read_positions() == {1: 2048, 2: 2048})
            assert client.read_voltage(1) == pytest.approx(12.0)
            until(lambda: client.write_torque({1: 0.05, 2: -0.05}) == {1: True, 2: True})
            until(lambda: client.read_position(1) != 2048 and client.read_position(2) != 2048)
            client.write_torque({1: 0.0, 2: 0.0})
        finally:
            client.disconnect()


def test_lerobots_bus_shakes_hands_configures_and_moves_them() -> None:
    for module in ("lerobot", "scservo_sdk"):
        if importlib.util.find_spec(module) is None:
            pytest.skip("pip install --no-deps lerobot==0.4.4 feetech-servo-sdk")
    with served("--model", "STS3215", "--ids", "1,2,3") as device:
        words = [sys.executable, "-m", "tests.sim.feetech.lerobot_bus", device]
        ended = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120)
        assert ended.returncode == 0, ended.stderr
        said = json.loads(ended.stdout.splitlines()[-1])
    assert said["found"] == {"1": 777, "2": 777, "3": 777}
    assert said["begun"] == {"m1": 2048, "m2": 2048, "m3": 2048}
    assert all(abs(said["reached"][name] - goal) < 30 for name, goal in GOALS.items())
    assert set(said["torque"].values()) == {0}


def test_the_makers_sdk_reads_firmware_and_sync_reads() -> None:
    pytest.importorskip("vassar_feetech_servo_sdk", reason=VASSAR)
    import scservo_sdk as scs

    with served("--model", "STS3215", "--ids", "1,2,3") as device:
        port = scs.PortHandler(device)
        assert port.openPort()
        assert port.setBaudRate(1_000_000)
        try:
            handler = scs.sms_sts(port)

            def model() -> int:
                return int(handler.ping(3)[0])

            until(lambda: model() == 777)
            group = scs.GroupSyncRead(handler, 56, 4)
            for one in (1, 2, 3):
                assert group.addParam(one)
            until(lambda: group.txRxPacket() == scs.COMM_SUCCESS)
            assert [group.getData(one, 56, 2) for one in (1, 2, 3)] == [2048] * 3
        finally:
            port.closePort()
