"""Simulated RobStride motors, frame by frame: what their manuals say, in integers written here."""

from __future__ import annotations

import json
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_sim.mit import simulator
from tautwave_sim.mit.bench import MitBench, bench
from tests.examples import tried
from tests.sim.truths import truth

PERIOD_NS = 1_000_000
LONG = 0x80000000
HOST = 0xFD
NOTHING = bytes(8)
PUSH = 0xFFFF  # t_max, in the identifier
STILL = bytes.fromhex("7fff7fff00000000")


class Client:
    """Sends frames to simulated motors by hand, and remembers what they answer."""

    def __init__(self, *ids: int, mass: float = 0.01, **quirks: Any) -> None:
        self.clock = FakeClock()
        ranges = {"p_max": 12.57, "v_max": 33.0, "t_max": 14.0}
        keys = {
            "interface": "virtual",
            "family": "robstride",
            "motors": [{"id": one, "feedback_id": HOST, **ranges} for one in ids],
            "simulator": {"motors": {str(ids[0]): quirks}},
        }
        options = simulator.options.model_validate_json(json.dumps(keys))
        axes = tuple(AxisSpec(f"arm.a{one}", one, "rotary", "impedance", 10.0) for one in ids)
        physics = [truth(mass=mass) for _ in ids]
        self.made: Any = simulator.make(options, BusSpec("arm", axes, 1000.0), physics, self.clock)
        self.port = self.made.transport
        self.motors = self.made.world.motors

    def ask(
        self,
        kind: int,
        data: bytes = NOTHING,
        field: int = HOST,
        motor: int = 1,
        wait_ns: int = 600_000,
    ) -> list[tuple[int, bytes]]:
        assert self.port.send(LONG | kind << 24 | field << 8 | motor, data)
        return self.wait(wait_ns)

    def wait(self, wait_ns: int) -> list[tuple[int, bytes]]:
        until = self.clock.now_ns() + wait_ns
        found = []
        while self.clock.wait(self.port, until):
            frame = self.port.receive()
            assert frame is not None
            found.append(frame[:2])
        return found

    def write(self, number: int, value: bytes) -> None:
        assert len(self.ask(18, struct.pack("<HH", number, 0) + value)) == 1

    def read(self, number: int) -> bytes:
        ((can_id, data),) = self.ask(17, struct.pack("<HHI", number, 0, 0))
        assert can_id == LONG | 17 << 24 | 1 << 8 | HOST
        assert data[:4] == struct.pack("<HH", number, 0)
        return data[4:]


def test_it_speaks_only_when_it_is_spoken_to_and_in_29_bits() -> None:
    client = Client(1, 2)
    assert client.wait(20_000_000) == []
    assert client.ask(0, motor=3) == []
    assert client.port.send(1, NOTHING)
    assert client.wait(1_000_000) == []
    ((can_id, unique),) = client.ask(0, motor=2)
    assert can_id == LONG | 2 << 8 | 0xFE
    assert unique != client.ask(0, motor=1)[0][1]


def test_feedback_has_mode_and_faults_in_its_identifier_and_goes_to_who_asked() -> None:
    client = Client(0x21, starts_with=0b100)
    ((can_id, data),) = client.ask(4, field=0xAA, motor=0x21)
    assert can_id == LONG | 2 << 24 | 0 << 22 | 0b100 << 16 | 0x21 << 8 | 0xAA
    assert data.hex() == "7fff7fff7fff00fa"  # 0 lies between two codes; 25.0 degC
    ((can_id, _),) = client.ask(3, motor=0x21)
    assert can_id >> 16 & 0xFF == 0b100  # with a fault it does not run
    client.ask(4, b"\x01" + bytes(7), motor=0x21)
    ((can_id, _),) = client.ask(3, motor=0x21)
    assert can_id == LONG | 2 << 24 | 2 << 22 | 0x21 << 8 | HOST


def test_parameters_are_little_endian_and_in_ram_until_saved() -> None:
    client = Client(1)
    assert struct.unpack("<f", client.read(0x700B)) == (14.0,)
    assert client.read(0x7005) == bytes(4)
    assert client.read(0x7028) == bytes(4)
    assert struct.unpack("<f", client.read(0x7019)) == (0.0,)
    assert client.ask(17, struct.pack("<HHI", 0x7777, 0, 0)) == []
    for save in (False, True):
        client.write(0x7028, struct.pack("<I", 1000))
        client.write(0x7005, b"\x03\0\0\0")
        client.write(0x701C, struct.pack("<f", 99.0))  # measured: stays
        assert (client.read(0x7028), client.read(0x7005)) == (b"\xe8\x03\0\0", b"\x03\0\0\0")
        if save:
            client.ask(22)
        client.motors[0].power_on()
        assert client.read(0x7028) == (struct.pack("<I", 1000) if save else bytes(4))
    assert struct.unpack("<f", client.read(0x701C)) == (24.0,)


def test_a_command_is_followed_only_while_it_runs_in_motion_mode_and_within_its_limit() -> None:
    client = Client(1)
    motor = client.motors[0]
    assert client.ask(1, STILL, PUSH)
    assert motor.torque == 0.0
    client.ask(3)
    client.write(0x7005, b"\x01\0\0\0")
    client.ask(1, STILL, PUSH)
    assert motor.torque == 0.0
    client.write(0x7005, bytes(4))
    client.ask(1, STILL, 0xC000)
    assert motor.torque == pytest.approx(7.0, abs=1e-3)
    client.write(0x700B, struct.pack("<f", 2.0))
    client.ask(1, STILL, 0xC000)
    assert motor.torque == 2.0
    client.ask(4)
    assert motor.torque == 0.0


def test_spring_and_damper_are_big_endian() -> None:
    client = Client(1)
    client.ask(3)
    p, v, kp, kd, t = 0x8A3C, 0x7770, 0x0199, 0x0333, 0x8200
    client.ask(1, struct.pack(">HHHH", p, v, kp, kd), t)
    place, pace, push = (
        (number / 65535 * 2 - 1) * top for number, top in ((p, 12.57), (v, 33.0), (t, 14.0))
    )
    wanted = kp / 65535 * 500 * place + kd / 65535 * 5 * pace + push
    assert client.motors[0].torque == pytest.approx(wanted)


def test_silence_stops_it_and_enabling_starts_it_again() -> None:
    client = Client(1)
    client.write(0x7028, struct.pack("<I", 200))  # 10 ms
    client.ask(3)
    client.ask(1, STILL, 0xC000)
    client.wait(8_000_000)
    assert client.motors[0].torque > 0.0
    client.wait(3_000_000)
    assert (client.motors[0].mode, client.motors[0].torque) == (0, 0.0)
    ((can_id, _),) = client.ask(3)
    assert can_id >> 22 & 3 == 2


def test_a_timeout_that_it_ignores_is_answered() -> None:
    client = Client(1, ignores_timeout=True)
    client.write(0x7028, struct.pack("<I", 200))
    assert client.read(0x7028) == bytes(4)


def test_zero_and_id_can_be_set() -> None:
    client = Client(1, turns=1)
    assert struct.unpack("<f", client.read(0x7019))[0] == pytest.approx(6.2831853)
    client.ask(6, b"\x01" + bytes(7))
    assert struct.unpack("<f", client.read(0x7019))[0] == 0.0
    ((can_id, _),) = client.ask(7, field=5 << 8 | HOST)
    assert can_id == LONG | 5 << 8 | 0xFE
    assert client.ask(4, motor=1) == []
    assert client.ask(4, motor=5)


def test_what_befalls_a_motor_is_said_once_by_itself() -> None:
    client = Client(1, error_at_s=0.005, error=1)
    client.ask(3)
    frames = [frame for _ in range(12) for frame in client.ask(1, STILL, PUSH, wait_ns=PERIOD_NS)]
    faults = [data for can_id, data in frames if can_id >> 24 & 0x1F == 21]
    assert faults == [struct.pack("<II", 1, 0)]
    assert frames[-1][0] >> 16 & 0xFF == 1
    assert client.motors[0].torque == 0.0


def test_a_constant_torque_moves_it_as_a_mass_is_moved() -> None:
    client = Client(1)
    client.ask(3)
    for _ in range(101):
        client.ask(1, STILL, 0x8800, wait_ns=PERIOD_NS)
    torque = (0x8800 / 65535 * 2 - 1) * 14.0
    assert client.motors[0].axis.physics.v == pytest.approx(torque / 0.01 * 0.1, rel=0.02)


def test_heat_stops_it() -> None:
    client = Client(1, heat=1e4)
    client.ask(3)
    for _ in range(200):
        client.ask(1, STILL, PUSH, wait_ns=PERIOD_NS)
    assert client.motors[0].faults == 0b100
    assert client.motors[0].torque == 0.0


@settings(max_examples=tried(60))
@given(
    st.lists(
        st.tuples(
            st.integers(0, 31), st.integers(0, 0xFFFF), st.sampled_from([0, 1, 2, 0xFE]),
            st.binary(max_size=8),
        ),
        max_size=12,
    )
)  # fmt: skip
def test_garbage_never_raises(frames: list[tuple[int, int, int, bytes]]) -> None:
    client = Client(1, 2)
    client.ask(3)
    for kind, field, motor, data in frames:
        client.ask(kind, data, field, motor)


@pytest.mark.parametrize("more", [{"ids": (128,)}, {"data_bitrate": 5_000_000}])
def test_a_bench_that_no_such_motor_has_is_refused(more: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"ids up to 127 on classic CAN; give --ids such as 1,2"):
        bench(MitBench(family="robstride", **more))
    made = bench(MitBench(family="robstride", interface="virtual"))
    assert [one.feedback_id for one in made.options.motors] == [0xFD, 0xFD]


@pytest.mark.parametrize(
    ("quirk", "words"),
    [
        ({"registers": {"82": 1.0}}, "simulator.motors.1: registers end at 81"),
        ({"starts_with": 16}, "simulator.motors.1: states end at 15"),
        ({"error": 4}, "simulator.motors.1: error begins at 8"),
    ],
)
def test_quirks_of_the_other_family_are_refused(quirk: dict[str, Any], words: str) -> None:
    motors = [{"id": 1, "feedback_id": 17, "p_max": 12.5, "v_max": 30.0, "t_max": 10.0}]
    keys = {"motors": motors, "simulator": {"motors": {"1": quirk}}}
    with pytest.raises(ValueError, match=words):
        simulator.options.model_validate_json(json.dumps(keys))
