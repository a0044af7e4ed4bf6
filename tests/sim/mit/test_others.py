"""A client that others wrote drives the simulated motors: damiao-motor, over UDP multicast."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

damiao_motor = pytest.importorskip("damiao_motor", reason="comes with the extra `peers`")

BIN = Path(sys.executable).parent
CHANNEL = "239.74.163.83"


@pytest.fixture
def served() -> Iterator[str]:
    words = ["sim", "mit", "--ids", "1,2", "--interface", "udp_multicast", "--channel"]
    process = subprocess.Popen(
        [str(BIN / "tautwave"), *words, CHANNEL], stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["motors"] == [1, 2]
        yield CHANNEL
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(20)
        assert process.stdout is not None
        process.stdout.close()


def until(done: Callable[[], bool], act: Callable[[], None], limit_s: float = 30.0) -> None:
    end = time.monotonic() + limit_s
    while not done():
        assert time.monotonic() < end
        act()
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.filterwarnings("ignore:The 'bustype' argument:DeprecationWarning")
def test_damiao_motor_reads_sets_moves_loses_and_clears_a_motor(served: str) -> None:
    controller = damiao_motor.DaMiaoController(channel=served, bustype="udp_multicast")
    try:
        motor = controller.add_motor(motor_id=1, feedback_id=17, motor_type="4310")
        found = [motor.get_register(number, timeout=10.0) for number in (7, 8, 21, 22, 23)]
        assert found == [17, 1, 12.5, 30.0, 10.0]
        motor.write_register(10, 1)
        until(lambda: motor.registers.get(10) == 1, lambda: motor.request_register_reading(10))
        motor.set_can_timeout(500)
        until(lambda: motor.registers.get(9) == 10_000, lambda: motor.request_register_reading(9))
        until(lambda: motor.get_states().get("status_code") == 1, motor.enable)
        until(
            lambda: abs(motor.get_states()["pos"] - 1.0) < 0.01,
            lambda: motor.send_cmd_mit(1.0, 0.0, 5.0, 0.3, 0.0),
        )
        time.sleep(1.0)  # twice its TIMEOUT, without a frame
        until(
            lambda: motor.get_states()["status_code"] != 1,
            lambda: motor.request_motor_feedback(),
        )
        assert motor.get_states()["status"] == "LOST_COMM"
        until(lambda: motor.get_states()["status_code"] == 0, motor.clear_error)
        until(lambda: motor.get_states()["status_code"] == 1, motor.enable)
        until(lambda: motor.get_states()["status_code"] == 0, motor.disable)
    finally:
        controller.shutdown()
