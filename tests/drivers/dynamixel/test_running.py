"""While running: missing servos, noise, alerts in words, watchdogs, an unplugged adapter."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.errors import DeviceFault, DriverError
from tautwave.types import JointState
from tests.drivers.dynamixel.parts import PERIOD_NS, Bench, bench, servo, spec

READS = pytest.mark.parametrize("read", ["sync", "fast_sync"])


def valid(states: list[JointState]) -> list[bool]:
    return [state.valid for state in states]


def three(**more: Any) -> Bench:
    made = bench(spec(1), spec(2), spec(3), **more)
    made.enable()
    for _ in range(3):
        assert valid(made.cycle(0.3, 0.3, 0.3)) == [True] * 3
    return made


@READS
@pytest.mark.parametrize("gone", [0, 1, 2])
def test_a_removed_servo_costs_the_others_nothing_but_one_cycle(read: str, gone: int) -> None:
    made = three(read=read)
    made.world.servos[gone].present = False
    others = [index for index in range(3) if index != gone]
    lost = 0
    for _ in range(30):
        before = made.world.servos[others[0]].slot
        states = made.cycle(0.3, 0.3, 0.3)
        assert not states[gone].valid
        for index in others:
            if not states[index].valid:
                lost += 1
                continue
            # This very slot's sample, not an old one.
            assert made.world.servos[others[0]].slot == before + 1
            quantum = made.driver._scales[index].position
            true = made.world.axes[index].physics.x
            assert abs(states[index].position - true) <= 0.5 * quantum + 1e-12
    assert lost <= 2  # of 60: one cycle at most, and for fast reads that of all behind
    made.world.servos[gone].present = True
    recovered = [valid(made.cycle(0.3, 0.3, 0.3))[gone] for _ in range(10)]
    assert recovered[-1]


def test_a_servo_that_is_gone_is_not_waited_for_until_the_deadline() -> None:
    made = three()
    made.world.servos[2].present = False
    spent = []
    for _ in range(12):
        began = made.clock.now_ns()
        made.driver.request()
        made.driver.read(began + 700_000)
        spent.append(made.clock.now_ns() - began)
        made.clock.sleep_until(began + PERIOD_NS)
    whole_ns = (23 + 17 + 3 * 21) * 10_000_000_000 // 4_000_000 // 1000 * 1000
    assert spent[0] == 700_000
    assert min(spent) <= whole_ns + 110_000 < 700_000
    assert sum(one < 700_000 for one in spent) >= 7


def test_everybody_gone_leaves_invalid_samples_and_no_fault() -> None:
    made = three()
    for one in made.world.servos:
        one.present = False
    for _ in range(10):
        assert valid(made.cycle(0.3, 0.3, 0.3)) == [False] * 3
    assert not made.driver.faults()


FAULTS = {
    "lost": 0.1, "truncated": 0.1, "corrupted": 0.1, "wrong_id": 0.05, "extra_bytes": 0.1,
    "deaf": 0.05,
}  # fmt: skip


@pytest.mark.sparse(4)
@READS
@pytest.mark.parametrize("kind", [*FAULTS, "all"])
def test_bad_bytes_cost_samples_but_never_a_wrong_one(read: str, kind: str) -> None:
    chances = FAULTS if kind == "all" else {kind: 0.3}
    made = bench(spec(1), spec(2), read=read)
    made.enable()
    made.world.bus._plan._chances = dict(chances)
    bad = 0
    for count in range(200):
        effort = 0.2 if count % 60 < 30 else -0.2
        states = made.cycle(effort, -effort)  # apart, so that one is never taken for the other
        for index, state in enumerate(states):
            bad += not state.valid
            if state.valid:
                # Where the servo is now, or was one slot ago under a late command; never elsewhere.
                true = made.world.axes[index].physics.x
                quantum = made.driver._scales[index].position
                assert abs(state.position - true) <= 0.51 * quantum, (count, index, state, true)
    assert bad < 400
    assert bad > 0 or kind == "extra_bytes"


@READS
def test_an_answer_that_comes_a_cycle_late_never_passes_for_the_next(read: str) -> None:
    """It comes while the next question is still on the wire, which no answer to that can do."""
    made = bench(spec(1), spec(2), mass=1e-3, read=read)
    made.world.bus._late_ns = 850_000
    made.enable()
    for _ in range(20):
        made.cycle(0.2, 0.2)
    made.world.bus._plan._chances = {"late": 0.3}
    lost = 0
    for count in range(100):
        states = made.cycle(0.0, 0.0)
        for index, state in enumerate(states):
            lost += not state.valid
            if state.valid:
                # It moves by several steps a slot: an old sample would be seen.
                true = made.world.axes[index].physics.x
                quantum = made.driver._scales[index].position
                assert abs(state.position - true) <= 0.51 * quantum, (count, index)
    assert made.world.axes[0].physics.v * 1e-3 > 2.0 * made.driver._scales[0].position
    assert lost > 0
    assert made.driver._exchange.stale > 0


@pytest.mark.parametrize("status_block", [False, True])
@READS
@pytest.mark.parametrize(
    ("bit", "words"),
    [
        (0, "input voltage outside its limits"),
        (2, "overheated"),
        (3, "motor encoder failed"),
        (4, "electrical shock"),
        (5, "overloaded for too long"),
    ],
)
def test_an_alert_is_reported_as_text_with_its_axis(
    bit: int, words: str, read: str, status_block: bool
) -> None:
    made = bench(spec(1), spec(2), read=read, status_block=status_block)
    made.enable()
    made.cycle(0.1, 0.1)
    made.world.servos[1].fail(bit)
    faults = []
    for _ in range(4):
        states = made.cycle(0.1, 0.1)
        assert states[0].valid
        faults += made.driver.faults()
    [fault] = faults
    assert fault.fatal
    assert fault.axis == "master.a2"
    assert words in fault.text


def test_an_alert_is_read_even_when_no_cycle_has_time_for_it() -> None:
    # 41 bytes and 250 us of return delay: the deadline comes right behind the answer.
    made = bench(spec(1), baud=1_000_000, return_delay_s=150e-6)
    made.enable()
    made.cycle(0.1)
    made.world.servos[0].fail(2)
    faults, samples = [], []
    for _ in range(8):
        samples += valid(made.cycle(0.1))
        faults += made.driver.faults()
    [fault] = faults
    assert "overheated" in fault.text
    assert samples.count(False) == 2  # that of the alert, and the one that was given up for it
    assert samples[-1]


@pytest.mark.parametrize("status_block", [False, True])
def test_a_tripped_watchdog_is_reported_and_ends_the_run(status_block: bool) -> None:
    made = bench(spec(1), status_block=status_block)
    made.enable()
    for _ in range(3):
        made.cycle(0.2)
    assert not made.driver.faults()
    made.clock.sleep_until(made.clock.now_ns() + 200_000_000)
    made.cycle(0.2)
    [fault] = made.driver.faults()
    assert "its bus watchdog tripped" in fault.text
    assert fault.fatal
    assert made.peek(0, "Goal Current") == 0


def test_a_silence_that_trips_nothing_is_no_fault() -> None:
    made = bench(spec(1))
    made.enable()
    made.world.servos[0]._watchdog_ns = 10**12
    for _ in range(3):
        made.clock.sleep_until(made.clock.now_ns() + 150_000_000)
        made.cycle(0.2)
        assert not made.driver.faults()


def test_the_watchdog_is_fed_while_other_buses_are_still_enabling() -> None:
    made = bench(spec(1))
    made.enable()
    ready = 0
    for _ in range(500):
        ready += made.driver.enable_step()
        made.clock.sleep_until(made.clock.now_ns() + PERIOD_NS)
    assert ready > 450, "other buses have to find it ready, too"
    while not made.driver.enable_step():
        made.clock.sleep_until(made.clock.now_ns() + PERIOD_NS)
    assert made.world.bus._origin_ns is None  # feeding is no exchange
    made.cycle(0.0)
    assert made.peek(0, "Bus Watchdog") == 5
    assert made.world.servos[0].torque_on


def enabled_slowly(made: Bench, step_ns: int) -> None:
    made.driver.open()
    while not made.driver.enable_step():
        made.clock.sleep_until(made.clock.now_ns() + step_ns)
        made.world.advance(made.clock.now_ns())


def test_the_watchdogs_of_many_servos_are_fed_while_each_is_asked_for_its_torque() -> None:
    """An adapter of 16 ms a response and a dozen servos take longer than a watchdog waits."""
    made = bench(*(spec(one) for one in range(1, 9)))
    enabled_slowly(made, 25_000_000)
    made.cycle(*[0.2] * 8)
    assert [made.peek(index, "Bus Watchdog") for index in range(8)] == [5] * 8
    assert all(one.torque_on for one in made.world.servos)


def test_a_host_that_stalls_while_it_enables_asks_the_watchdogs() -> None:
    made = bench(spec(1))
    enabled_slowly(made, 300_000_000)
    assert [valid(made.cycle(0.2)) for _ in range(5)] == 5 * [[False]]
    (fault,) = made.driver.faults()
    assert fault.fatal
    assert "bus watchdog tripped" in fault.text


def test_leaving_tells_all_at_once_before_it_asks_anybody() -> None:
    """A servo whose answers are lost is stopped too, and at once."""
    made = bench(spec(1), spec(2))
    made.enable()
    made.cycle(0.2, 0.2)
    made.cycle(0.2, 0.2)
    made.world.bus._plan._chances = {"lost": 1.0}
    sent = []
    write = made.world.transport.write
    made.world.transport.write = lambda data: (sent.append(data), write(data))
    made.driver.disable()
    assert len(sent[0]) == 2 * 14 + 2 * 3 + 2 * 2
    assert [made.peek(index, "Goal Current") for index in (0, 1)] == [0, 0]
    assert not any(one.torque_on for one in made.world.servos)


def test_the_first_thing_sent_on_leaving_takes_all_torque_off() -> None:
    """Also where nothing that follows arrives."""
    made = bench(spec(1), spec(2))
    made.enable()
    made.cycle(0.2, 0.2)
    sent = []
    write = made.world.transport.write

    def once(data: bytes) -> None:
        sent.append(data)
        if len(sent) == 1:
            write(data)

    made.world.transport.write = once
    made.driver.disable()
    assert len(sent) > 1
    assert not any(one.torque_on for one in made.world.servos)


def keep_enabling(made: Bench, steps: int) -> None:
    for _ in range(steps):
        if made.driver.enable_step():
            return
        made.clock.sleep_until(made.clock.now_ns() + PERIOD_NS)


def test_a_watchdog_stays_armed_where_torque_off_was_not_confirmed() -> None:
    made = three()
    write = made.driver._line.write

    def deaf(device_id: int, address: int, data: bytes) -> Any:
        return None if (device_id, address) == (2, 64) else write(device_id, address, data)

    made.driver._line.write = deaf  # type: ignore[method-assign]
    made.driver.disable()
    assert [made.peek(index, "Bus Watchdog") for index in range(3)] == [0, 5, 0]
    assert made.driver.unconfirmed == {"master.a2": "servo 2 did not confirm torque off: no answer"}


def test_an_answer_to_an_earlier_request_confirms_nothing() -> None:
    made = three()
    made.driver.request()
    made.clock.sleep_until(made.clock.now_ns() + 10_000)  # the answers are still to come
    made.world.servos[1].memory.poke("Torque Enable", 0)
    response = made.driver._line.read(2, 64, 1)
    assert response is not None
    assert response.data == b"\x00"


def test_a_servo_that_was_away_for_longer_than_its_watchdog_waits_is_asked_about_it() -> None:
    made = three(watchdog_s=0.02)
    line, made.world.servos[1].present = made.world.servos[1], False
    for _ in range(30):
        made.cycle(0.3, 0.3, 0.3)
    made.poke(1, "Bus Watchdog", -1)
    line.present = True
    for _ in range(20):
        made.cycle(0.3, 0.3, 0.3)
    (fault,) = made.driver.faults()
    assert fault.fatal
    assert "bus watchdog tripped" in fault.text


def test_torque_that_does_not_come_on_is_reported() -> None:
    made = bench(spec(1))
    made.world.servos[0]._shut_down = True
    made.driver.open()
    with pytest.raises(DriverError, match="torque does not switch on"):
        keep_enabling(made, 2000)


def test_a_torque_order_that_was_lost_is_given_again() -> None:
    made = bench(spec(1))
    made.driver.open()
    made.world.servos[0].present = False
    assert not made.driver.enable_step()
    made.clock.sleep_until(made.clock.now_ns() + PERIOD_NS)
    made.world.advance(made.clock.now_ns())
    made.world.servos[0].present = True
    keep_enabling(made, 100)
    assert made.world.servos[0].torque_on
    assert valid(made.cycle(0.1)) == [True]


def test_a_hardware_error_while_enabling_is_reported() -> None:
    made = bench(spec(1))
    made.driver.open()
    made.driver.enable_step()
    made.world.servos[0].fail(0)
    with pytest.raises(DeviceFault, match="input voltage"):
        keep_enabling(made, 50)


def test_the_command_acts_from_the_next_request_on() -> None:
    made = bench(spec(1))
    made.enable()
    made.cycle(0.5)
    assert made.peek(0, "Goal Current") == 0
    made.cycle(0.5)
    assert made.peek(0, "Goal Current") == round(0.5 / made.driver._scales[0].effort)


@pytest.mark.parametrize("transport", ["own", "sdk"])
def test_unplugged_in_memory_is_one_fatal_fault_and_close_is_quiet(transport: str) -> None:
    made = bench(spec(1), spec(2), transport=transport)
    made.enable()
    made.cycle(0.1, 0.1)
    made.world.line.unplug()
    for _ in range(3):
        assert valid(made.cycle(0.1, 0.1)) == [False, False]
    [fault] = made.driver.faults()
    assert fault.fatal
    assert "unplugged" in fault.text
    made.driver.close()
    assert list(made.driver.unconfirmed) == ["master.a1", "master.a2"]
    assert all("unplugged" in why for why in made.driver.unconfirmed.values())
    made.world.line.plugged = True
    made.enable()
    assert valid(made.cycle(0.1, 0.1)) == [True, True]


def test_commands_beyond_the_limits_of_the_rig_are_cut_there() -> None:
    made = bench(spec(1, effort=1.0), spec(2, "admittance", velocity=2.0))
    made.enable()
    most = int(1.0 / made.driver._scales[0].effort)
    fast = 84  # of 0.229 rev/min, the first beyond 2 rad/s
    for wanted, sign in ((5.0, 1), (-5.0, -1), (float("inf"), 0), (float("nan"), 0)):
        made.cycle(wanted, wanted)
        made.cycle(wanted, wanted)
        assert made.peek(0, "Goal Current") == sign * most
        assert made.peek(1, "Goal Velocity") == sign * fast


def test_an_admittance_axis_measures_what_pushes_it() -> None:
    given = [servo(1, "XM430-W350", direction=-1)]
    made = bench(spec(1, "admittance"), servos=given)
    made.enable()
    made.world.axes[0].physics.forces = lambda *_: (0.2, 0.1)  # from outside
    made.cycle(0.0)
    [state] = made.cycle(0.0)
    assert state.effort == pytest.approx(0.3, abs=5e-3)
    assert made.peek(0, "Present Current") > 0  # against the axis' sense, the motor holds it
