"""Exchanges and slots: the servos move like a loopback whose commands act one period later."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.dynamixel import packets as p2
from tests.sim.dynamixel.line import MS, STEP, Host, split, words
from tests.sim.truths import truth

EFFORT = 2.69e-3 * (4.1 / 2.3)
REFERENCE = [0.3 * math.sin(0.01 * k) for k in range(600)]
TRUTH = {
    "mass": 0.01,
    "viscous": 0.01,
    "quantum": STEP,
    "effort_quantum": EFFORT,
    "reference": REFERENCE,
    "grip": (8.0, 0.05),
}


class Cycle:
    """The smallest driver: what `write` gives is sent with the next exchange."""

    def __init__(self, host: Host, ids: Sequence[int], code: int = p2.SYNC_READ) -> None:
        self.host = host
        self.ids = ids
        self.code = code
        self.staged: dict[int, int] = {}
        self.apart = False

    def request(self) -> None:
        sent = b""
        if self.staged:
            body = bytes((p2.SYNC_WRITE, *words(102), *words(2)))
            for one, counts in self.staged.items():
                body += bytes((one,)) + (counts & 0xFFFF).to_bytes(2, "little")
            sent = p2.frame(p2.BROADCAST, body)
        body = bytes((self.code, *words(132), *words(4), *self.ids))
        if self.apart and sent:
            self.host.send(sent)
            sent = b""
        self.host.send(sent + p2.frame(p2.BROADCAST, body))

    def read(self) -> dict[int, int]:
        responses = split(self.host.hear(2 * MS // 3))
        return {one[4]: int.from_bytes(one[9:13], "little", signed=True) for one in responses}

    def enable(self) -> None:
        for one in self.ids:
            self.host.write(one, "Goal Current", 0)
            self.host.write(one, "Torque Enable", 1)


def configured(ids: Sequence[int] = (1, 2), **more: object) -> Host:
    return Host(ids, free=False, simulator={"factory": False}, truths={**TRUTH, **more})


def law(position: float, k: int) -> float:
    return 0.3 * math.sin(0.05 * k) - 1.5 * position


def counts_of(effort: float) -> int:
    return math.floor(effort / EFFORT + 0.5)


def run(host: Host, cycles: int, late: Sequence[int] = ()) -> list[list[float]]:
    """Return positions as measured and as they are, cycle by cycle."""
    cycle = Cycle(host, (1, 2))
    cycle.enable()
    begin = host.clock.now_ns() + 3 * MS
    rows = []
    for k in range(cycles):
        host.clock.sleep_until(begin + k * MS + (MS // 3 if k in late else 0))
        cycle.request()
        found = cycle.read()
        positions = [(found[one] - 2048) * STEP for one in (1, 2)]
        rows.append([*positions, *(axis.physics.x for axis in host.axes)])
        cycle.staged = {
            one: counts_of(law(position, k))
            for one, position in zip((1, 2), positions, strict=True)
        }
    return rows


def loopback(cycles: int) -> list[list[float]]:
    axes = [
        SimulatedAxis(f"servo.{one}", truth(**{**TRUTH, "seed": (one,), "delay": 1.0}))  # type: ignore[arg-type]
        for one in (1, 2)
    ]
    rows = []
    for k in range(cycles):
        if k:
            for axis in axes:
                axis.pass_slot()
        positions = [axis.measure().position for axis in axes]
        rows.append([*positions, *(axis.physics.x for axis in axes)])
        for axis, position in zip(axes, positions, strict=True):
            axis.command(law(position, k))
    return rows


def test_rows_are_those_of_a_loopback_one_period_late() -> None:
    assert run(configured(), 500) == loopback(500)


@pytest.mark.parametrize("model", ["XM430-W350", "XL430-W250"])
def test_admittance_rows_are_those_of_a_loopback_too(model: str) -> None:
    """Position and the effort from outside, by velocity commands: exact to the bit."""
    host = Host((1,), model, free=False, causality="admittance", simulator={"factory": False})
    joint = host.servos[0].joint
    quanta = {"effort_quantum": joint.effort, "velocity_quantum": joint.velocity}
    given = {**TRUTH, **quanta}
    host = Host(
        (1,), model, free=False, causality="admittance", simulator={"factory": False}, truths=given
    )
    assert host.write(1, "Torque Enable", 1) == 0
    begin = host.clock.now_ns() + MS
    rows, staged = [], b""
    for k in range(300):
        host.clock.sleep_until(begin + k * MS)
        body = bytes((p2.SYNC_READ, *words(126), *words(10), 1))
        host.send(staged + p2.frame(p2.BROADCAST, body))
        response = host.hear(2 * MS // 3)
        effort = -int.from_bytes(response[9:11], "little", signed=True) * joint.effort
        position = (int.from_bytes(response[15:19], "little", signed=True) - 2048) * STEP
        rows.append((position, effort, host.axes[0].physics.x))
        wanted = math.floor((0.5 * effort + 0.3) / joint.velocity + 0.5)
        head = bytes((p2.SYNC_WRITE, *words(104), *words(4), 1))
        staged = p2.frame(p2.BROADCAST, head + wanted.to_bytes(4, "little", signed=True))
    axis = SimulatedAxis("servo.1", truth(**{**given, "servo": True, "seed": (1,), "delay": 1.0}))  # type: ignore[arg-type]
    others = []
    for k in range(300):
        if k:
            axis.pass_slot()
        state = axis.measure()
        others.append((state.position, state.effort, axis.physics.x))
        axis.command(0.5 * state.effort + 0.3)
    assert rows == others


def test_a_host_late_by_a_third_of_a_period_moves_no_row() -> None:
    assert run(configured(), 200, late=range(0, 200, 7)) == loopback(200)


@pytest.mark.parametrize("apart", [False, True])
def test_wire_time_of_many_bytes_before_the_read_moves_no_row(apart: bool) -> None:
    """The latch belongs to the exchange's first byte, however long its packets take."""
    host = configured()
    cycle = Cycle(host, (1, 2))
    cycle.enable()
    cycle.apart = apart
    for k in range(3):
        cycle.staged = dict.fromkeys(range(1, 40), 5) if k else {}  # 1.4 ms of wire at 1 Mbaud
        cycle.request()
        host.clock.sleep_until(host.clock.now_ns() + 4 * MS)
        host.port.read()
        assert host.servos[0].slot == 4 * k


def test_nothing_moves_before_the_first_exchange_with_torque() -> None:
    host = configured()
    cycle = Cycle(host, (1, 2))
    for _ in range(3):
        host.pass_time(0.1)
        cycle.request()
        cycle.read()
    assert [servo.slot for servo in host.servos] == [0, 0]
    host.write(1, "Torque Enable", 1)
    cycle.request()
    cycle.read()
    host.pass_time(0.1)
    assert host.servos[0].slot == 0  # the other one is still off
    host.write(2, "Torque Enable", 1)
    host.pass_time(0.1)
    host.read(1, "Present Position")
    assert host.servos[0].slot == 0  # a plain read is no exchange
    cycle.request()
    cycle.read()
    assert host.servos[0].slot == 0  # slot 0
    host.pass_time(0.05)
    assert host.servos[0].slot in (50, 51)


def test_all_torque_off_is_rest_and_one_off_is_not() -> None:
    host = configured()
    cycle = Cycle(host, (1, 2))
    cycle.enable()
    cycle.request()
    cycle.read()
    host.pass_time(0.02)
    host.write(1, "Torque Enable", 0)
    host.pass_time(0.02)
    moved = host.servos[0].slot
    assert moved >= 40
    host.write(2, "Torque Enable", 0)
    rest = host.servos[0].slot
    host.pass_time(0.5)
    assert host.servos[0].slot == rest
    cycle.enable()
    cycle.request()
    cycle.read()
    host.pass_time(0.01)
    assert host.servos[0].slot == rest + 10 or host.servos[0].slot == rest + 11


def test_time_goes_on_while_the_host_is_silent() -> None:
    host = configured()
    cycle = Cycle(host, (1, 2))
    cycle.enable()
    begin = host.clock.now_ns()
    cycle.request()
    cycle.read()
    host.clock.sleep_until(begin + 100 * MS)
    cycle.request()
    cycle.read()
    assert [servo.slot for servo in host.servos] == [100, 100]


@pytest.mark.parametrize("code", [p2.SYNC_READ, p2.FAST_SYNC_READ])
def test_two_reads_in_one_slot_see_one_sample(code: int) -> None:
    host = configured(noise=0.01)
    first = host.sync_read((1, 2), code=code)
    assert host.sync_read((1, 2), code=code) == first
    assert first[9:13] != bytes(4)


def test_a_missing_sample_is_silence() -> None:
    host = configured(missing=0.5)
    cycle = Cycle(host, (1, 2))
    cycle.enable()
    heard = []
    for k in range(60):
        host.clock.sleep_until(100 * MS + k * MS)
        cycle.request()
        heard.append(len(cycle.read()))
    assert heard[0] == 2  # slot 0 is never missing
    assert {0, 1, 2} == set(heard)
