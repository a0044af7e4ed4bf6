"""Clients that others wrote drive the simulated motors: damiao-motor, robstride."""

from __future__ import annotations

import importlib.util
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tautwave.multicast import only_its_group
from tests.sim.mit.lerobot_bus import GOALS, NEAR

COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main()"]
CHANNEL, OTHER, THIRD = "239.74.163.83", "239.74.163.84", "239.74.163.85"
ROOT = Path(__file__).parents[3]
PEERS = "comes with the extra `peers`: {}".format


@contextmanager
def served(channel: str, *more: str) -> Iterator[str]:
    words = ["sim", "mit", "--ids", "1,2", "--interface", "udp_multicast", "--channel", channel]
    process = subprocess.Popen([*COMMAND, *words, *more], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["motors"] == [1, 2]
        yield channel
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
def test_damiao_motor_reads_sets_moves_loses_and_clears_a_motor() -> None:
    damiao_motor = pytest.importorskip("damiao_motor", reason=PEERS("damiao-motor"))
    with served(CHANNEL) as channel:
        controller = damiao_motor.DaMiaoController(channel=channel, bustype="udp_multicast")
        only_its_group(controller.bus)
        _damiao(controller)


def _damiao(controller: Any) -> None:
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


@pytest.mark.slow
@pytest.mark.realtime
def test_lerobots_bus_shakes_hands_with_motors_and_moves_them() -> None:
    if importlib.util.find_spec("lerobot") is None:
        pytest.skip("pip install --no-deps lerobot==0.4.4")
    with served(THIRD) as channel:
        words = [sys.executable, "-m", "tests.sim.mit.lerobot_bus", channel]
        ended = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120)
        assert ended.returncode == 0, ended.stderr
        said = json.loads(ended.stdout.splitlines()[-1])
    assert all(abs(place) < 0.1 for place in said["begun"].values())
    assert all(abs(said["reached"][name] - goal) < NEAR for name, goal in GOALS.items())


class OwnUnheard:
    """A bus as CAN is: who sends a frame does not receive it, as on UDP multicast."""

    def __init__(self, bus: Any) -> None:
        self._bus = bus
        self._sent: list[tuple[int, bytes]] = []

    def send(self, message: Any) -> None:
        self._sent.append((message.arbitration_id, bytes(message.data)))
        self._bus.send(message)

    def recv(self, timeout: float) -> Any:
        while (message := self._bus.recv(timeout)) is not None:
            content = message.arbitration_id, bytes(message.data)
            if content not in self._sent:
                return message
            self._sent.remove(content)
        return None


@pytest.mark.slow
@pytest.mark.realtime
def test_robstride_reads_sets_enables_and_renames_a_motor() -> None:
    """Version 0.1.0 takes one bit of the two of a motor's mode, so "run" reads as "reset" there."""
    robstride = pytest.importorskip("robstride", reason=PEERS("robstride"))
    can = pytest.importorskip("can")
    ranges = ("--p-max", "12.566370614", "--v-max", "44", "--t-max", "17")  # an RS01
    with (
        served(OTHER, "--family", "robstride", *ranges) as channel,
        can.Bus(interface="udp_multicast", channel=channel) as bus,
    ):
        only_its_group(bus)
        client = robstride.Client(OwnUnheard(bus), recv_timeout=30)
        assert client.read_param(1, "limit_torque") == 17.0
        assert client.read_param(1, "run_mode") == robstride.RunMode.Operation
        said = client.write_param(1, "run_mode", robstride.RunMode.Speed)
        assert (said.servo_id, said.errors, said.temp) == (1, [], 25.0)
        assert client.read_param(1, "run_mode") == robstride.RunMode.Speed
        client.write_param(1, "limit_torque", 2.5)
        assert client.read_param(1, "limit_torque") == 2.5
        assert abs(client.read_param(2, "mechpos")) < 1e-3
        said = client.enable(2)
        assert said.angle == pytest.approx(0.0, abs=1e-3)
        assert (said.velocity, said.torque) == pytest.approx((0.0, 0.0), abs=2e-3)
        client.disable(2)
        client.update_id(2, 9)
        assert client.disable(9).servo_id == 9
        assert client.error_rate() == 0.0
