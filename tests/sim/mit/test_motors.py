"""Simulated MIT motors, frame by frame: what public clients send, what real ones are said to do."""

from __future__ import annotations

import json
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave_sim.mit import simulator
from tautwave_sim.mit.bench import MitBench, bench
from tests.examples import tried
from tests.sim.truths import truth

PERIOD_NS = 1_000_000
ENABLE, DISABLE, CLEAR = (bytes((0xFF,) * 7 + (last,)) for last in (0xFC, 0xFD, 0xFB))


class Client:
    """Sends frames to simulated motors by hand, and remembers what they answer."""

    def __init__(self, *ids: int, mass: float = 0.01, viscous: float = 0.0, **more: Any) -> None:
        self.clock = FakeClock()
        motors = [
            {"id": one, "feedback_id": one + 16, "p_max": 12.5, "v_max": 30.0, "t_max": 10.0}
            for one in ids
        ]
        keys = {"interface": "virtual", "motors": motors, **more}
        options = simulator.options.model_validate_json(json.dumps(keys))
        axes = tuple(AxisSpec(f"arm.a{one}", one, "rotary", "impedance", 10.0) for one in ids)
        physics = [truth(mass=mass, viscous=viscous) for _ in ids]
        self.made: Any = simulator.make(options, BusSpec("arm", axes, 1000.0), physics, self.clock)
        self.port = self.made.transport
        self.motors = self.made.world.motors

    def ask(self, can_id: int, data: bytes, wait_ns: int = 600_000) -> list[tuple[int, bytes]]:
        assert self.port.send(can_id, data)
        return self.wait(wait_ns)

    def wait(self, wait_ns: int) -> list[tuple[int, bytes]]:
        until = self.clock.now_ns() + wait_ns
        found = []
        while self.clock.wait(self.port, until):
            frame = self.port.receive()
            assert frame is not None
            found.append(frame[:2])
        return found

    def read(self, number: int, motor: int = 1) -> bytes:
        frames = self.ask(0x7FF, struct.pack("<HBBI", motor, 0x33, number, 0))
        assert [(can_id, data[:4]) for can_id, data in frames] == [
            (motor + 16, struct.pack("<HBB", motor, 0x33, number))
        ]
        return frames[0][1][4:]

    def write(self, number: int, data: bytes, motor: int = 1) -> None:
        sent = struct.pack("<HBB", motor, 0x55, number) + data
        assert self.ask(0x7FF, sent) == [(motor + 16, sent)]

    def mit(self) -> None:
        self.write(10, struct.pack("<I", 1))
        (frame,) = self.ask(1, ENABLE)
        assert frame[1][0] == 0x11


def test_it_speaks_only_when_it_is_spoken_to() -> None:
    client = Client(1, 2)
    assert client.wait(20_000_000) == []
    assert client.ask(0x7FF, bytes.fromhex("0300330700000000")) == []


def test_registers_answer_as_the_manual_numbers_them() -> None:
    client = Client(1)
    for number, wanted in ((21, 12.5), (22, 30.0), (23, 10.0), (20, 10.0)):
        assert struct.unpack("<f", client.read(number)) == (wanted,)
    for number, wanted in ((7, 17), (8, 1), (9, 0), (10, 2)):
        assert struct.unpack("<I", client.read(number)) == (wanted,)
    assert client.ask(0x7FF, bytes.fromhex("0100335000000000"))[0][1][:4].hex() == "01003350"
    assert client.ask(0x7FF, bytes.fromhex("0100333700000000")) == []  # there is no register 55


def test_what_is_written_is_gone_with_the_power_unless_saved() -> None:
    client = Client(1)
    client.write(9, struct.pack("<I", 2000))
    client.motors[0].power_on()
    assert client.read(9) == bytes(4)
    client.write(9, struct.pack("<I", 2000))
    client.ask(0x7FF, bytes.fromhex("0100aa0100000000"))
    client.motors[0].power_on()
    assert struct.unpack("<I", client.read(9)) == (2000,)


def test_a_read_only_register_stays() -> None:
    client = Client(1)
    before = client.read(20)
    client.write(20, struct.pack("<f", 3.0))
    assert client.read(20) == before


def test_a_mit_frame_of_damiao_motor_is_followed() -> None:
    """damiao-motor 1.0.6, truncated: p 1, v -2, kp 50, kd 1, t 3 on a motor held at 0."""
    client = Client(1)
    client.mit()
    client.ask(1, bytes.fromhex("8a3c777199333a65"))
    kp, kd, t = 0x199 / 4095 * 500, 0x333 / 4095 * 5, (0xA65 / 4095 * 2 - 1) * 10
    p, v = (0x8A3C / 65535 * 2 - 1) * 12.5, (0x777 / 4095 * 2 - 1) * 30
    assert (p, v, t) == pytest.approx((1.0, -2.0, 3.0), abs=0.02)
    assert client.motors[0].torque == pytest.approx(min(kp * p + kd * v + t, 10.0))


def test_neither_before_enable_nor_in_another_mode_does_it_follow() -> None:
    frame = bytes.fromhex("8000800000000a65")
    client = Client(1)
    assert client.ask(1, frame)[0][1][0] == 0x01
    assert client.motors[0].torque == 0.0
    client.ask(1, ENABLE)
    client.ask(1, frame)  # its mode is position and velocity, as from the maker
    assert client.motors[0].torque == 0.0


def test_feedback_is_truncated_and_has_state_nibble_and_temperatures() -> None:
    client = Client(0x21)
    ((can_id, data),) = client.ask(0x21, ENABLE)
    assert can_id == 0x31
    # position 0 lies between two codes, and so do velocity and torque
    assert data.hex() == "117fff7ff7ff1e19"


def test_silence_switches_torque_off_and_only_clear_gets_it_out() -> None:
    client = Client(1)
    client.write(9, struct.pack("<I", 200))  # 10 ms
    client.mit()
    client.ask(1, bytes.fromhex("8000800000000a65"))
    assert client.motors[0].torque == pytest.approx(3.0, abs=0.01)
    client.wait(8_000_000)
    assert client.motors[0].state == 1
    client.wait(3_000_000)
    assert (client.motors[0].state, client.motors[0].torque) == (0xD, 0.0)
    assert client.ask(1, ENABLE)[0][1][0] == 0xD1
    assert client.ask(1, DISABLE)[0][1][0] == 0xD1
    assert client.ask(1, CLEAR)[0][1][0] == 0x01
    assert client.ask(1, ENABLE)[0][1][0] == 0x11


def test_without_timeout_the_last_torque_stays() -> None:
    client = Client(1, mass=10.0)
    client.mit()
    client.ask(1, bytes.fromhex("8000800000000a65"))
    client.wait(500_000_000)
    assert client.motors[0].torque == pytest.approx(3.0, abs=0.01)


def test_after_power_up_it_knows_its_angle_but_not_its_turn() -> None:
    client = Client(1)
    motor = client.motors[0]
    motor.axis.physics.x = 7.0
    shown = int.from_bytes(client.ask(1, DISABLE)[0][1][1:3], "big")
    assert shown / 65535 * 25 - 12.5 == pytest.approx(7.0, abs=1e-3)
    motor.power_on()
    shown = int.from_bytes(client.ask(1, DISABLE)[0][1][1:3], "big")
    assert shown / 65535 * 25 - 12.5 == pytest.approx(7.0 - 6.2832, abs=1e-3)


def test_beyond_its_range_the_code_wraps() -> None:
    client = Client(1)
    client.motors[0].axis.physics.x = 12.6
    shown = int.from_bytes(client.ask(1, DISABLE)[0][1][1:3], "big")
    assert shown / 65535 * 25 - 12.5 == pytest.approx(12.6 - 25.0, abs=2e-3)


def test_it_gets_hot_by_its_torque_and_switches_off() -> None:
    client = Client(1, mass=1e3, simulator={"motors": {"1": {"heat": 50.0}}})
    client.mit()
    for _ in range(3000):
        client.ask(1, bytes.fromhex("8000800000000fff"), PERIOD_NS)
        if client.motors[0].state != 1:
            break
    assert client.motors[0].state == 0xC
    assert client.motors[0].torque == 0.0
    assert client.ask(1, DISABLE)[0][1][7] > 115


def test_two_motors_of_one_id_both_answer() -> None:
    client = Client(1, 2)
    client.motors[1].registers.put(8, 1)
    assert len(client.ask(0x7FF, bytes.fromhex("0100330800000000"))) == 2


def test_answers_about_registers_are_lost_now_and_then() -> None:
    client = Client(1, simulator={"motors": {"1": {"drops_register_answers": 3}}})
    request = bytes.fromhex("0100330800000000")
    assert [len(client.ask(0x7FF, request)) for _ in range(6)] == [1, 1, 0, 1, 1, 0]


@pytest.mark.parametrize(("rate", "classic"), [(9, False), (4, True)])
def test_classic_or_fd_is_a_setting_of_the_motor(rate: int, classic: bool) -> None:
    client = Client(
        1, data_bitrate=5_000_000, simulator={"motors": {"1": {"registers": {"35": rate}}}}
    )
    client.ask(1, DISABLE)
    assert (17 in client.port.classic_ids) == classic


@pytest.mark.parametrize(
    ("quirk", "state"),
    [
        ({"restarts_at_s": 0.005}, 0x0),
        ({"error_at_s": 0.005, "error": 9}, 0x9),
        ({"silent_at_s": 0.005}, None),
    ],
)
def test_what_befalls_a_motor_does_so_in_its_time(quirk: dict[str, Any], state: int | None) -> None:
    client = Client(1, simulator={"motors": {"1": quirk}})
    client.mit()
    frame = bytes.fromhex("8000800000000900")
    said = [client.ask(1, frame, PERIOD_NS) for _ in range(10)]
    assert said[2][0][1][0] >> 4 == 1
    assert [one[1][0] >> 4 for one in said[-1]] == ([] if state is None else [state])
    assert client.motors[0].torque == 0.0


def test_a_constant_torque_moves_it_as_a_mass_is_moved() -> None:
    client = Client(1, mass=0.01)
    client.mit()
    frame = bytes.fromhex("8000800000000a66")
    for _ in range(101):
        client.ask(1, frame, PERIOD_NS)
    torque = (0xA66 / 4095 * 2 - 1) * 10
    assert client.motors[0].axis.physics.v == pytest.approx(torque / 0.01 * 0.1, rel=0.02)


@settings(max_examples=tried(60))
@given(
    st.lists(
        st.tuples(st.sampled_from([0, 1, 2, 0x11, 0x101, 0x7FF]), st.binary(max_size=8)),
        max_size=12,
    )
)
def test_garbage_never_raises(frames: list[tuple[int, bytes]]) -> None:
    client = Client(1, 2)
    client.mit()
    for can_id, data in frames:
        client.ask(can_id, data)


def test_motors_on_an_interface_announce_what_a_driver_needs_and_end_when_stopped() -> None:
    pytest.importorskip("can")
    said: list[Any] = []
    motors = bench(MitBench(ids=(1, 3), interface="virtual", channel="served"))
    assert simulator.serve is not None
    simulator.serve(*motors, said.append, lambda: True)
    assert said == [
        {"driver": "mit", "endpoint": "virtual:served", "motors": [1, 3], "options": {}}
    ]
