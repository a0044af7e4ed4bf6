"""A running loop: late answers, lost ones, noise, wrong units, exceptions, faults, lost links."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.errors import DriverError
from tautwave.types import JointState
from tautwave_drivers.modbus import leaving
from tautwave_drivers.modbus.protocol import frames
from tests.drivers.modbus.parts import FAST_RTU, Bench, bench, spec

pytestmark = pytest.mark.realtime

KINDS = (
    "request_lost", "answer_lost", "answer_late", "noise", "wrong_unit", "truncated", "corrupted",
    "exception",
)  # fmt: skip
SLOW_RTU: dict[str, Any] = {"link": "rtu", "baud": 115_200, "late_s": 0.02}


def faulty(link: str, **faults: Any) -> Bench:
    """A drive whose position tells when it was sampled: it runs at constant speed."""
    more = FAST_RTU if link == "rtu" else {}
    simulator = {**more.get("simulator", {}), "faults": faults}
    return bench(spec(1), **{**more, "late_s": 0.003, "simulator": simulator})


def spin(made: Bench, cycles: int) -> list[tuple[JointState, float]]:
    """Run with a constant torque; each sample with the truth of its slot."""
    found = []
    for _ in range(cycles):
        began = made.clock.now_ns()
        made.driver.request()
        state = made.driver.read(began + made.bus.period_ns * 7 // 10)[0]
        found.append((state, float(made.world.axes[0].physics.x)))
        made.driver.write([_push(0.3)])
        made.clock.sleep_until(began + made.bus.period_ns)
    return found


def _push(value: float) -> Any:
    from tautwave.types import AxisCommand

    return AxisCommand(value, 0.0)


@pytest.mark.sparse(3)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("link", ["tcp", "rtu"])
def test_what_is_valid_is_of_this_cycle_whatever_goes_wrong(link: str, kind: str) -> None:
    """Seeded faults: a sample is missing or right, and never an older one's."""
    made = faulty(link, seed=5, late_s=0.0013, **{kind: 0.1})
    made.enable()
    reported = spin(made, 600)
    valid = [(state.position, true) for state, true in reported if state.valid]
    assert 250 < len(valid) <= 600
    if (link, kind) != ("rtu", "noise"):
        assert len(valid) < 600
    quantum = made.driver.stations[0].device.scale.position
    for position, true in valid:
        assert position == pytest.approx(true, abs=0.51 * quantum)
    if kind != "answer_late" and link == "tcp":  # one answer that fails costs one sample
        assert len(valid) > 600 * 0.84
    assert not any(fault.fatal for fault in made.faults())
    made.driver.close()
    assert made.commanded(0) == 0.0


def test_noise_before_an_answer_costs_nothing_on_a_serial_line() -> None:
    made = faulty("rtu", seed=2, noise=0.3)
    made.enable()
    assert all(state.valid for state, _ in spin(made, 200))


def test_a_late_answer_is_not_taken_for_the_next() -> None:
    """RTU answers have no number: the one of cycle k comes when that of k + 1 is due."""
    late = {"kind": "answer_late", "nth": 62, "times": 1}
    period_s = 0.02
    made = bench(
        spec(1),
        rate_hz=1.0 / period_s,
        **SLOW_RTU | {"late_s": 0.05},
        simulator={"faults": {"late_s": period_s - 0.002, "events": [late]}},
    )
    made.enable()
    reported = spin(made, 60)
    missing = [number for number, (state, _) in enumerate(reported) if not state.valid]
    assert 1 <= len(missing) <= 3
    assert missing == list(range(missing[0], missing[0] + len(missing)))
    quantum = made.driver.stations[0].device.scale.position
    for state, true in reported:
        if state.valid:
            assert state.position == pytest.approx(true, abs=0.51 * quantum)
    link = made.driver._links.groups[0][0]
    assert link.late == 1


def test_one_missing_drive_costs_no_other() -> None:
    for more in ({}, FAST_RTU):
        silent = {"kind": "request_lost", "unit": 1, "at_s": 0.0, "times": 10_000}
        simulator = {**more.get("simulator", {}), "faults": {"events": [silent]}}  # type: ignore[attr-defined]
        made = bench(spec(1), spec(2), **{**more, "simulator": simulator})  # type: ignore[arg-type]
        made.enable()
        states = made.run(60, 0.2)
        first = [row[0].valid for row in states[3:]]
        assert not any(first)
        second = [row[1].valid for row in states]
        assert second.count(True) >= (59 if not more else 57)  # from then on it is asked last
        made.driver.close()
        assert made.commanded(1) == 0.0


def test_exceptions_are_reported_as_text_and_end_the_run_when_they_stay() -> None:
    busy = {"kind": "exception", "unit": 1, "at_s": 0.01, "times": 2, "code": 6}
    made = bench(simulator={"faults": {"events": [busy]}})
    made.enable()
    states = made.run(50, 0.2)
    assert [row[0].valid for row in states].count(False) == 2
    faults = made.faults()
    assert len(faults) == 1
    assert "device busy (exception 06) to read and write registers (FC 23)" in faults[0].text
    assert not faults[0].fatal
    for_ever = {"kind": "exception", "unit": 1, "at_s": 0.01, "times": 1000, "code": 4}
    made = bench(simulator={"faults": {"events": [for_ever]}})
    made.enable()
    made.run(50, 0.2)
    faults = made.faults()
    assert [fault.fatal for fault in faults] == [False, True]
    assert "3 times in a row" in faults[1].text
    assert made.driver.stations[0].failed


@pytest.mark.parametrize("profile", ["generic", "dsy-rs", "cia402"])
@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_a_fault_of_the_drive_is_decoded(profile: str, causality: str) -> None:
    code = {"generic": 4, "dsy-rs": 1, "cia402": 0x4310}[profile]
    broken = {"kind": "drive_fault", "unit": 1, "at_s": 0.02, "code": code}
    made = bench(spec(1, causality), profile=profile, simulator={"faults": {"events": [broken]}})
    made.enable()
    made.run(100, 0.2)
    faults = made.faults()
    assert [fault.fatal for fault in faults] == [True], faults
    words = {
        "generic": "too hot (code 0x4)",
        "dsy-rs": "does not report which; check its display",
        "cia402": "4310",
    }[profile]
    assert words in faults[0].text
    assert faults[0].axis == "slave.a1"
    made.run(5, 0.5)
    assert not made.faults()  # shown once
    made.driver.close()


def test_a_limit_of_the_drive_is_reported_once_and_stops_nothing() -> None:
    made = bench()
    made.enable()
    made.run(5, 0.2)
    readers = made.world.bus.drives[1].bank.readers
    shown = readers["status"]
    readers["status"] = lambda: shown() | 0x8
    made.run(20, 0.2)
    [fault] = made.faults()
    assert (fault.axis, fault.fatal) == ("slave.a1", False)
    assert fault.text == "unit 1: a limit or a warning is active (status 0xb)"
    assert made.commanded(0) == 200.0
    made.driver.close()


def test_a_drive_with_a_fault_is_kept_off() -> None:
    """Else it would go on by itself once somebody resets the fault at its keypad."""
    broken = {"kind": "drive_fault", "unit": 1, "at_s": 0.02, "code": 0x4310}
    made = bench(profile="cia402", simulator={"faults": {"events": [broken]}})
    made.enable()
    assert made.number(1, "controlword") == 0xF  # enable operation
    made.run(40, 0.2)
    assert made.number(1, "controlword") == 0  # disable voltage
    made.driver.close()


def test_a_state_machine_writes_mode_and_controlword_once() -> None:
    made = bench(profile="cia402")
    made.enable()
    machine = made.driver.stations[0].machine
    assert machine is not None
    assert machine.writes() == []
    made.run(5, 0.2)
    assert machine.writes() == []
    made.driver.close()


def test_a_drive_that_was_switched_off_and_on_is_reported() -> None:
    gone = {"kind": "power_cycle", "unit": 1, "at_s": 0.02}
    made = bench(simulator={"faults": {"events": [gone]}})
    made.enable()
    made.run(60, 0.2)
    assert ["switched itself off (status 0x1)" in fault.text for fault in made.faults()] == [True]


LINK_FAULTS = [("tcp", "reset"), ("tcp", "gone"), ("tcp", "half_open"), ("rtu", "unplugged")]


def test_a_drive_that_failed_is_as_new_when_it_is_enabled_again() -> None:
    busy = {"kind": "exception", "unit": 1, "times": 5, "code": 6}
    events = [busy | {"at_s": 0.01}, busy | {"at_s": 0.1}]
    made = bench(simulator={"faults": {"events": events}})
    made.enable()
    made.run(50, 0.2)
    first = [(fault.text, fault.fatal) for fault in made.faults()]
    assert [fatal for _, fatal in first] == [False, True]
    assert made.commanded(0) == 0.0
    made.driver.disable()
    for _ in range(20):
        if made.driver.enable_step():
            break
        made.clock.sleep_until(made.clock.now_ns() + made.bus.period_ns)
    made.run(5, 0.2)
    assert made.commanded(0) == 200.0
    made.run(50, 0.2)
    assert [(fault.text, fault.fatal) for fault in made.faults()] == first  # reported anew
    made.driver.close()


def losing(link: str, kind: str, span_s: float, **more: Any) -> Bench:
    base = FAST_RTU if link == "rtu" else {}
    event = {"kind": kind, "at_s": 0.05, "duration_s": span_s}
    simulator = {**base.get("simulator", {}), "faults": {"events": [event]}}
    return bench(spec(1), **{**base, "silence_s": 0.03, **more, "simulator": simulator})


@pytest.mark.parametrize(("link", "kind"), LINK_FAULTS)
def test_a_lost_link_ends_the_run(link: str, kind: str) -> None:
    made = losing(link, kind, 0.0)
    made.enable()
    states = made.run(200, 0.2)
    faults = made.faults()
    assert [fault.fatal for fault in faults] == [True], faults
    assert "connection lost: " in faults[0].text
    if kind == "half_open":
        assert "no response for" in faults[0].text
    assert states[40][0].valid
    assert not states[100][0].valid
    made.driver.close()
    made.driver.close()


@pytest.mark.parametrize(("link", "kind"), LINK_FAULTS)
def test_a_lost_link_comes_back_where_the_rig_says_so(link: str, kind: str) -> None:
    made = losing(link, kind, 0.02, reconnect="reconnect", comm_timeout_s=2.0)
    made.enable()
    states = made.run(700, 0.2)
    faults = made.faults()
    assert [fault.fatal for fault in faults] == [False, False], faults
    assert "trying again" in faults[0].text
    assert faults[1].text == "the connection is back"
    assert not states[60][0].valid or not states[90][0].valid
    assert all(row[0].valid for row in states[400:])
    assert made.commanded(0) == 200.0
    made.driver.close()


def test_a_drive_whose_connection_broke_is_switched_off_over_a_new_one() -> None:
    made = losing("tcp", "reset", 0.001, comm_timeout_s=5.0)
    made.enable()
    made.run(100, 0.2)
    assert made.faults()[0].fatal
    assert made.commanded(0) == 200.0
    made.driver.disable()
    assert made.number(1, "target_torque") == 200, "other buses are to be told first"
    assert "reset by the drive" in made.driver.unconfirmed["slave.a1"]
    made.driver.close()
    assert made.number(1, "target_torque") == 0
    assert not made.world.bus.drives[1].on
    assert made.driver.unconfirmed == {}


def test_a_drive_that_may_still_be_on_is_reported_and_the_next_one_is_switched_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = bench(spec(1), spec(2), **FAST_RTU)
    made.enable()
    made.run(5, 0.1)
    switch_off = leaving.switch_off

    def failing(client: Any, station: Any, clock: Any) -> None:
        if station.device.unit == 1:
            raise ZeroDivisionError("an error of ours")
        switch_off(client, station, clock)

    monkeypatch.setattr(leaving, "switch_off", failing)
    made.driver.close()
    assert made.driver.unconfirmed == {
        "slave.a1": "unit 1 did not confirm that it is off: an error of ours"
    }
    assert not made.world.bus.drives[2].on


def test_an_answer_that_comes_twice_answers_no_later_request() -> None:
    made = bench(spec(1), **FAST_RTU)
    made.enable()
    spin(made, 5)
    line = made.driver._links.groups[0][0].port  # type: ignore[union-attr]
    read, last = line.read, [b""]  # type: ignore[union-attr]

    def again() -> bytes:
        data, last[0] = (read(), b"") if not last[0] else (last[0], b"")
        return data

    line.read = again  # type: ignore[union-attr, method-assign]
    for _ in range(3):
        began = made.clock.now_ns()
        made.driver.request()
        first = made.driver.read(began + made.bus.period_ns * 7 // 10)[0]
        made.clock.sleep_until(began + made.bus.period_ns)
    assert first.valid
    twin = frames.rtu_frame(1, made.driver.stations[0].transaction.responses[-1])
    spin(made, 20)
    last[0] = twin  # lies in the host's buffer when the next question goes out
    (state, true) = spin(made, 1)[0]
    quantum = made.driver.stations[0].device.scale.position
    if state.valid:
        assert state.position == pytest.approx(true, abs=0.51 * quantum)


def test_a_drive_whose_watchdog_tripped_meanwhile_is_reported() -> None:
    made = losing("tcp", "gone", 0.3, reconnect="reconnect")
    made.enable()
    made.run(700, 0.2)
    faults = made.faults()
    assert [fault.fatal for fault in faults] == [False, False, True]
    assert "the line was silent for too long" in faults[2].text


def test_refused_at_the_start_is_a_sentence() -> None:
    made = bench()
    made.driver._transport = _Refusing()
    with pytest.raises(DriverError, match=r"bus arm: nothing listens"):
        made.driver.open()


class _Refusing:
    def port(self, endpoint: str) -> Any:
        raise DriverError("nothing listens")


def test_commands_that_are_no_number_or_too_great_are_held() -> None:
    made = bench(spec(1, effort=0.5))
    made.enable()
    for value, counts in ((9.0, 500), (-9.0, -500), (float("nan"), 0), (float("inf"), 0)):
        made.run(2, value)
        assert made.commanded(0) == counts


def test_a_drive_that_failed_is_commanded_nothing_but_zero() -> None:
    made = bench()
    made.enable()
    made.run(5, 0.5)
    assert made.commanded(0) == 500.0
    made.driver.stations[0].fail("is of no more use")
    made.run(5, 0.5)
    assert made.commanded(0) == 0.0


def test_between_request_and_read_a_poll_goes_on_with_the_exchange() -> None:
    """Two drives, two questions each, on a line that is looked at every millisecond only."""
    made = bench(spec(1), spec(2), rate_hz=20.0, profile="dsy-rs", **SLOW_RTU)
    made.enable()
    for _ in range(10):
        began = made.clock.now_ns()
        made.driver.request()
        for slot in range(1, 45):
            made.clock.sleep_until(began + slot * 1_000_000)
            made.driver.poll()
        states = made.driver.read(made.clock.now_ns())
        assert all(state.valid for state in states)
        made.clock.sleep_until(began + made.bus.period_ns)
    made.driver.close()


def test_rows_tell_how_long_each_answer_took() -> None:
    made = bench(spec(1), spec(2), turnaround_s=0.0001)
    made.enable()
    made.run(3, 0.1)
    row = [0.0, 0.0]
    made.driver.fill(row, 0)
    assert made.driver.columns == ["slave.a1.answer_us", "slave.a2.answer_us"]
    assert all(100.0 < value < 200.0 for value in row)
