"""Simulated Feetech servos by raw bytes: the table's rules, lock, status, modes, play, sag."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave_sim.feetech import simulator
from tests.foreign.feetech_line import ALL, FF, READ, SYNC_READ, SYNC_WRITE, WRITE, frame
from tests.sim.truths import truth

COUNT = math.tau / 4096
SYNC = SYNC_READ


class Bench:
    """Servos in memory, and what a host says and hears."""

    def __init__(
        self, *models: str, push: float = 0.0, mass: float = 0.05, viscous: float = 0.0, **more: Any
    ) -> None:
        options = {
            "port": "bench",
            "servos": [{"id": at, "model": model} for at, model in enumerate(models, 1)],
            **more,
        }
        axes = tuple(
            AxisSpec(f"a{at}", at, "rotary", "impedance", 5.0) for at, _ in enumerate(models, 1)
        )
        one = truth(mass=mass, viscous=viscous)
        if push:
            one = one._replace(push=(push,))
        self.clock = FakeClock()
        self.world = simulator.make(
            simulator.options.model_validate_json(json.dumps(options)),
            BusSpec("line", axes, 1000.0),
            [one] * len(axes),
            self.clock,
        )
        self.port = self.world.transport

    def say(self, *packets: bytes, wait_s: float = 0.01) -> bytes:
        self.clock.sleep_until(self.clock.now_ns() + 200_000)
        self.port.read()
        self.port.write(b"".join(packets))
        self.clock.sleep_until(self.clock.now_ns() + round(wait_s * 1e9))
        return bytes(self.port.read())

    def read(self, who: int, address: int, size: int) -> tuple[int, bytes]:
        """Return the error byte and the data."""
        answer = self.say(frame(who, READ, bytes((address, size))))
        assert answer[:4] == FF + bytes((who, size + 2))
        assert sum(answer[2:]) % 256 == 255
        return answer[4], answer[5:-1]

    def word(self, who: int, address: int) -> int:
        return int.from_bytes(self.read(who, address, 2)[1], "little")

    def write(self, who: int, address: int, *data: int) -> bytes:
        return self.say(frame(who, WRITE, bytes((address, *data))))

    def start(self) -> None:
        """Let time run: torque on, and a sync read of all."""
        ids = [servo.device_id for servo in self.world.servos]
        for one in ids:
            self.write(one, 40, 1)
        self.say(frame(ALL, SYNC, bytes((56, 2, *ids))))

    def pass_s(self, seconds: float) -> None:
        ids = bytes(servo.device_id for servo in self.world.servos)
        for _ in range(round(seconds * 100)):
            self.say(frame(ALL, SYNC, bytes((56, 2)) + ids))


def test_an_answer_is_the_one_of_the_makers_documents() -> None:
    """FF FF 01 04 02 38 02 BE: position 2048."""
    bench = Bench("STS3215")
    assert bench.say(bytes.fromhex("ffff0104023802be")) == bytes.fromhex("ffff0104000008f2")


def test_a_write_lasts_only_unlocked() -> None:
    bench = Bench("STS3215")
    servo = bench.world.servos[0]
    bench.write(1, 33, 2)
    assert (bench.read(1, 33, 1)[1], servo.saved[33]) == (b"\2", 0)
    bench.write(1, 55, 0)
    bench.write(1, 21, 16)
    bench.write(1, 55, 1)
    servo.restart(bench.clock.now_ns())
    bench.clock.sleep_until(bench.clock.now_ns() + 200_000_000)
    assert bench.read(1, 33, 1)[1] == b"\0"
    assert bench.read(1, 21, 1)[1] == b"\x10"


@pytest.mark.parametrize(("address", "size"), [(0, 5), (56, 2), (62, 1)])
def test_what_is_read_only_stays(address: int, size: int) -> None:
    bench = Bench("HLS3625")
    before = bench.read(1, address, size)
    bench.write(1, address, *([7] * size))
    assert bench.read(1, address, size) == before


def test_nobody_answers_a_broadcast_write_and_it_acts() -> None:
    bench = Bench("STS3215", "HLS3625")
    for who in (1, 2):
        bench.write(who, 40, 1)
    assert bench.say(frame(ALL, WRITE, b"\x28\0")) == b""
    assert bench.read(1, 40, 1)[1] == bench.read(2, 40, 1)[1] == b"\0"


def test_scs_know_no_sync_read_and_have_the_high_byte_first() -> None:
    bench = Bench("SCS0009")
    assert bench.say(frame(ALL, SYNC, bytes((56, 2, 1)))) == b""
    assert bench.read(1, 56, 2)[1] == b"\x08\x00"
    assert bench.read(1, 0, 5)[1] == bytes((0, 9, 1, 5, 4))


def test_a_return_delay_and_the_order_of_a_sync_read_take_their_time() -> None:
    bench = Bench("STS3215", "STS3215", simulator={"factory": True})
    bench.port.write(frame(ALL, SYNC, bytes((56, 2, 2, 1))))
    arrivals = []
    for _ in range(400):
        bench.clock.sleep_until(bench.clock.now_ns() + 10_000)
        if came := bench.port.read():
            arrivals.append((bench.clock.now_ns(), came[2]))
    assert [who for _, who in arrivals] == [2, 1]
    request, answer = 10 * 10e-6, 8 * 10e-6
    assert arrivals[0][0] * 1e-9 == pytest.approx(request + 520e-6 + answer, abs=2e-5)
    assert (arrivals[1][0] - arrivals[0][0]) * 1e-9 == pytest.approx(520e-6 + answer, abs=2e-5)


def test_answers_take_as_long_as_their_bytes() -> None:
    bench = Bench("HLS3625", baud=115_200)
    bench.port.write(frame(1, READ, bytes((40, 31))))
    bench.clock.sleep_until(round(45 * 10 / 115_200 * 1e9))
    assert bench.port.read() == b""
    bench.clock.sleep_until(round(46 * 10 / 115_200 * 1e9) + 30_000)
    assert len(bench.port.read()) == 37


def test_an_hls_with_a_block_of_an_sts_does_not_move() -> None:
    """Seven bytes from 41 put 0 in 44, which is the current that it may use."""
    bench = Bench("HLS3625")
    bench.start()
    bench.write(1, 41, 0, 0x00, 0x09, 0, 0, 0, 0)
    bench.pass_s(0.5)
    assert bench.word(1, 56) == 2048
    bench.write(1, 44, 100, 0)
    bench.pass_s(1.5)
    assert bench.word(1, 56) == pytest.approx(0x900, abs=3)


def test_a_current_is_an_effort_and_its_sign_is_bit_15() -> None:
    bench = Bench("HLS3625")
    bench.write(1, 33, 2)
    bench.write(1, 44, 50, 0x80)
    bench.start()
    servo = bench.world.servos[0]
    assert servo.effort == pytest.approx(-50 * 6.5e-3 * 0.814)
    assert bench.word(1, 69) == 50 | 0x8000
    bench.pass_s(0.3)
    assert bench.word(1, 56) < 2048


def test_a_stale_goal_acts_as_soon_as_torque_is_on() -> None:
    bench = Bench("STS3215", mass=0.5)
    bench.write(1, 42, 0, 9)
    assert bench.world.servos[0].effort == 0.0
    bench.start()
    assert bench.world.servos[0].effort > 0.1


def test_a_duty_is_a_voltage_that_sags_with_its_current() -> None:
    quirks = {"1": {"supply_ohm": 1.0}}
    bench = Bench("STS3215", simulator={"servos": quirks}, mass=10.0)
    bench.write(1, 33, 2)
    bench.write(1, 44, 0xE8, 3)
    bench.start()
    bench.pass_s(0.1)
    servo = bench.world.servos[0]
    amperes = 7.4 / (2.68 + 1.0)  # at standstill, with the supply's own resistance
    assert servo.effort == pytest.approx(1.21 * amperes, rel=0.02)
    assert bench.read(1, 62, 1)[1][0] == pytest.approx(10 * (7.4 - amperes), abs=1)


def test_an_overload_lets_the_torque_fall_until_it_is_off_and_on() -> None:
    bench = Bench("STS3215", mass=100.0)
    bench.write(1, 33, 2)
    bench.write(1, 28, 0xFF, 7)  # no over-current before
    bench.write(1, 35, 20)
    bench.write(1, 44, 0xE8, 3)
    bench.start()
    full = bench.world.servos[0].effort
    bench.pass_s(0.5)
    assert bench.read(1, 65, 1) == (0x20, b"\x20")
    assert bench.world.servos[0].effort == pytest.approx(0.2 * full)
    bench.write(1, 40, 0)
    bench.write(1, 40, 1)
    assert bench.world.servos[0].effort == pytest.approx(full)


def test_an_over_current_is_cut() -> None:
    bench = Bench("HLS3625", mass=100.0)
    bench.write(1, 33, 2)
    bench.write(1, 28, 100, 0)
    bench.write(1, 38, 10)
    bench.write(1, 44, 200, 0)
    bench.start()
    bench.pass_s(0.3)
    assert bench.read(1, 65, 1)[0] == 8
    assert bench.world.servos[0].effort == 0.0


def test_128_in_torque_and_the_calibration_make_here_a_place() -> None:
    for how in (lambda one: one.write(1, 40, 128), lambda one: one.say(frame(1, 0x0B, b"\0\x08"))):
        bench = Bench("STS3215", servos=[{"id": 1, "model": "STS3215", "zero_counts": 1500}])
        assert bench.word(1, 56) == 1500
        how(bench)
        assert bench.word(1, 56) == 2048
        assert bench.world.servos[0].saved[31] | bench.world.servos[0].saved[32] << 8 == 548 | 0x800


def test_a_second_id_of_an_hls_is_obeyed_and_not_answered() -> None:
    quirks = {"2": {"registers": {"7": 9}}}
    bench = Bench("HLS3625", "HLS3625", simulator={"servos": quirks})
    assert bench.write(9, 40, 1) == b""
    assert bench.read(2, 40, 1)[1] == b"\1"
    assert bench.say(frame(ALL, SYNC_WRITE, bytes((40, 1, 9, 0)))) == b""
    assert bench.read(2, 40, 1)[1] == b"\0"


@pytest.mark.parametrize("push", [0.3, -0.3])
def test_its_encoder_stands_where_the_play_lets_it_be_pushed(push: float) -> None:
    quirks = {"1": {"backlash": 0.02}}
    bench = Bench("STS3215", simulator={"servos": quirks}, push=push, mass=1000.0)
    bench.write(1, 33, 2)
    bench.start()
    bench.pass_s(0.1)
    shift = (bench.word(1, 56) - 2048) * COUNT
    assert shift == pytest.approx(math.copysign(0.01, push), abs=COUNT)


def test_feedback_beyond_a_turn_only_with_its_bit() -> None:
    for phase, shown in ((0, 4096 - 52), (0x10, 52 | 0x8000)):
        quirks = {"1": {"registers": {"18": phase}}}
        keys = [{"id": 1, "model": "STS3215", "zero_counts": -52}]
        bench = Bench("STS3215", servos=keys, simulator={"servos": quirks})
        assert bench.word(1, 56) == shown


@pytest.mark.parametrize(
    "wrong",
    [
        {"simulator": {"servos": {"7": {}}}},
        {"simulator": {"servos": {"1": {"registers": {"200": 1}}}}},
        {"simulator": {"faults": {"events": [{"kind": "power_cycle"}]}}},
        {"simulator": {"faults": {"events": [{"kind": "overload", "at_s": 1.0, "id": 9}]}}},
        {"simulator": {"servos": {"1": {"model": "XL330"}}}},
    ],
)
def test_options_that_name_what_is_not_there_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Bench("STS3215", **wrong)
