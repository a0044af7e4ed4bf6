"""What `tautwave bench buses` measures of this bus: it runs, in turns with its floor."""

from __future__ import annotations

import os
import select
import tty

import pytest

from tautwave_drivers.dynamixel import plugin
from tautwave_drivers.dynamixel.measure import _sdk_cycle, _sdk_fast, bytes_of
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol.fast import FastStatus

pytestmark = pytest.mark.realtime


def test_the_answers_of_the_floor_are_those_of_two_servos() -> None:
    """Each says its id as its current, 3 as its velocity, and 2048 steps as its place."""
    samples = [bytes((one, 0, 3, 0, 0, 0, 0, 8, 0, 0)) for one in (1, 2)]
    answer = bytearray(bytes_of("2 servos, sync").response)
    for one, data in zip((1, 2), samples, strict=True):
        assert packet.take_packet(answer) == (one, 0x55, b"\0" + data)
    assert answer == b""
    answer = bytearray(bytes_of("2 servos, fast").response)
    assert FastStatus(2, 10).take(answer) == [(1, 0, samples[0], 0), (2, 0, samples[1], 1)]
    assert int.from_bytes(answer[5:7], "little") == len(answer) - 7
    asked, response, _ = bytes_of("1 servo")
    assert packet.take_packet(bytearray(asked)) == (1, 0x02, bytes((132, 0, 4, 0)))
    assert packet.take_packet(bytearray(response)) == (1, 0x55, bytes(5))


@pytest.mark.parametrize("kind", ["sync", "fast"])
def test_the_sdk_sends_a_goal_to_each_servo_and_as_much_as_its_floor(kind: str) -> None:
    """Two cycles on a line where nobody answers: the SDK gives up by itself, after 32 ms."""
    pytest.importorskip("dynamixel_sdk")
    line, end = os.openpty()
    tty.setraw(end)
    cycle, release = (_sdk_cycle if kind == "sync" else _sdk_fast)(os.ttyname(end))
    floor, answer, _ = bytes_of(f"2 servos, {kind}")
    sent = [b"", b""]
    for number in range(2):
        cycle()
        while len(sent[number]) < len(floor) and select.select([line], [], [], 5.0)[0]:
            sent[number] += os.read(line, 4096)
    release()
    os.close(end)
    os.close(line)
    goals = packet.sync_write_packet(102, 2, [(1, b"\1\0"), (2, b"\2\0")])
    asked = packet.sync_read_packet((1, 2), 126, 10, fast=kind == "fast")
    assert sent == [goals + asked] * 2
    assert len(floor) == len(goals + asked)
    if kind == "sync":
        assert len(answer) == 2 * (11 + 10)
    else:  # one packet with an error, a number, ten bytes and a checksum of each servo
        assert len(answer) == 8 + 2 * (2 + 10 + 2)


@pytest.mark.slow
def test_every_figure_has_its_floor_and_the_loops_have_their_goal() -> None:
    costs = plugin.measure(40)
    assert len(costs) == 6
    for cost in costs:
        assert len(cost.spent_us) == len(cost.floor_us) == 40, cost.what
        assert min(cost.floor_us) > 0.0
        assert sorted(cost.spent_us)[20] < 50_000.0, f"{cost.what}: nobody answered"
    assert [cost.goal_ratio for cost in costs] == [1.5, None, 1.5, None, None, None]
