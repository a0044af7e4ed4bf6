"""Feetech servos in a running loop: what is measured and commanded, what ends a run, the end."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from tautwave.types import AxisCommand
from tests.drivers.feetech.benches import Rig, foreign, servo
from tests.foreign.feetech_line import ALL, SYNC_WRITE, WRITE, Servo, frame

COUNT = math.tau / 4096


def sent_goals(rig: Rig) -> list[int]:
    """Goals of the first servo in register 44, as they went over the wire."""
    return [
        params[3] | params[4] << 8
        for device, code, params in rig.line.sent
        if device == ALL and code == SYNC_WRITE and params[0] == 44
    ]


@pytest.mark.parametrize(
    ("kind", "unit", "sign"), [("HLS", 6.5e-3 * 0.814, 15), ("STS", 1.21 * 7.4 / 2.68 / 1000, 10)]
)
@pytest.mark.parametrize("direction", [1, -1])
def test_an_effort_is_sign_and_magnitude_within_its_limit(
    kind: str, unit: float, sign: int, direction: int
) -> None:
    rig = foreign(servo(1, kind, direction=direction))
    rig.up()
    for effort in (0.5, -0.5, 9.0, -9.0, math.nan, math.inf):
        rig.line.sent.clear()
        rig.cycle(effort)
        rig.cycle(effort)
        held = sent_goals(rig)[-1]
        goal = -(held ^ 1 << sign) if held >> sign & 1 else held
        wanted = min(max(effort, -1.0), 1.0) if not math.isnan(effort) else 0.0
        assert direction * goal * unit == pytest.approx(wanted, abs=0.51 * unit)
        assert abs(goal) <= math.floor(1.0 / unit)
    rig.driver.close()


def test_a_duty_goes_with_the_supply_as_the_servo_last_read_it() -> None:
    rig = foreign(servo(1, "STS"))
    rig.up()
    rig.run(3, effort=0.5)
    full = sent_goals(rig)[-1]
    rig.servos[0].volts = 6.2
    rig.run(3, effort=0.5)
    assert sent_goals(rig)[-1] == pytest.approx(full * 7.4 / 6.2, abs=1)
    rig.driver.close()


@pytest.mark.parametrize(("phase", "unit"), [(0, 50.0), (4, 1.0)])
def test_speed_is_in_the_unit_that_the_phase_register_says(phase: int, unit: float) -> None:
    rig = foreign(servo(1, direction=-1), registers={18: phase})
    rig.up()
    rig.servos[0].v = 2.0
    state = rig.cycle()[0]
    assert state.velocity == pytest.approx(-2.0, abs=0.51 * unit * COUNT)
    assert rig.driver.witness("master.a1")[0] == state.velocity
    rig.driver.close()


def restart(rig: Rig) -> None:
    rig.servos[1].start()


def overload(rig: Rig) -> None:
    rig.servos[1].status = 0x20


def limit(rig: Rig) -> None:
    rig.servos[1].memory[48] ^= 1


def unlock(rig: Rig) -> None:
    rig.servos[1].memory[55] = 0


def second_master(rig: Rig) -> None:
    one = rig.servos[1]
    take = one.write
    one.write = lambda address, data: take(address, b"\x20\0" if address == 44 else data)


FAULTS: dict[str, tuple[Callable[[Rig], None], str]] = {
    "power cycle without any gap": (restart, "torque(40) reads 0 instead of 1: it was switched"),
    "overload": (overload, "overloaded: its torque has fallen to what it holds with"),
    "another program sets a limit": (limit, "torque limit(48) reads 1001 instead of 1000"),
    "another program opens the lock": (unlock, "lock(55) reads 0 instead of 1"),
    "another program writes goals": (second_master, "its goal reads 32 instead of the 19"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_befalls_a_servo_is_a_fault_of_its_axis(name: str) -> None:
    blow, words = FAULTS[name]
    rig = foreign(servo(1), servo(2))
    rig.up()
    rig.run(5, effort=0.1)
    blow(rig)
    rows, faults = rig.run(12, effort=0.1)
    assert [(one.axis, one.fatal) for one in faults] == [("master.a2", True)]
    assert words in faults[0].text
    assert not rows[-1][1].valid
    assert rows[-1][0].valid
    rig.driver.close()
    assert all(one.memory[40] == 0 for one in rig.servos)


def test_one_silent_servo_costs_the_others_nothing() -> None:
    rig = foreign(servo(1), servo(2), servo(3), rate_hz=250.0)
    rig.up()
    rig.run(3)
    rig.servos[0].mute = True
    rows, faults = rig.run(60)
    assert not faults
    assert sum(row[1].valid and row[2].valid for row in rows) >= 58
    assert not any(row[0].valid for row in rows)
    rig.servos[0].mute = False
    rows, faults = rig.run(20)
    assert rows[-1][0].valid
    rig.driver.close()


def test_a_late_answer_is_not_taken_for_the_next_cycle() -> None:
    """Bytes of an older exchange that come before the request has left are dropped."""
    rig = foreign(servo(1))
    rig.up()
    rig.run(3)
    assert rig.driver._exchange.on_wire
    one = rig.servos[0]
    old = frame(1, 0, one.read(40, 31))
    one.x += 0.5
    rig.driver.request()
    rig.line.coming.insert(0, (rig.clock.now_ns() + 5_000, old))
    states = rig.driver.read(rig.clock.now_ns() + 1_600_000)
    assert states[0].valid
    assert states[0].position == pytest.approx(one.x, abs=COUNT)
    rig.driver.close()


def test_the_stop_goes_to_all_even_unlisted_ones() -> None:
    rig = foreign(servo(1))
    other = Servo(7)
    rig.line.servos.append(other)
    rig.up()
    other.memory[40] = 1
    rig.line.sent.clear()
    rig.driver.close()
    assert other.memory[40] == 0
    assert any(who == ALL and code == WRITE and p == b"\x28\0" for who, code, p in rig.line.sent)


def test_a_start_that_fails_half_way_stops_all_too() -> None:
    rig = foreign(servo(1), servo(2))
    rig.servos[1].mute = True
    rig.servos[0].memory[40] = 1
    with pytest.raises(Exception, match="no answer"):
        rig.driver.open()
    assert rig.servos[0].memory[40] == 0


def test_damped_is_what_hls_are_left_in_where_that_is_asked_for() -> None:
    rig = foreign(servo(1), stop="damped")
    rig.up()
    rig.driver.close()
    assert rig.servos[0].memory[40] == 2
    assert not rig.driver.unconfirmed


def test_a_servo_that_stays_on_is_named_with_its_register() -> None:
    rig = foreign(servo(1), servo(2))
    rig.up()
    rig.run(3, effort=0.3)
    rig.servos[1].stubborn = True
    rig.driver.close()
    assert rig.driver.unconfirmed == {
        "master.a2": "servo 2 did not confirm torque off: torque(40) still reads 1"
    }
    assert rig.servos[1].word(44, 15) == 0


def test_followers_go_nowhere_until_all_have_a_place() -> None:
    rig = foreign(servo(1), servo(2), bus={"follows": (1, 2)})
    rig.up()
    rig.driver.write([AxisCommand(0.0, 0.0, 0.5), AxisCommand(0.0, 0.0, math.nan)])
    rig.driver.request()
    assert not any(p[0] == 42 for _, code, p in rig.line.sent[-2:] if code == SYNC_WRITE)
    rig.driver.close()


def test_a_slow_bus_is_enabled_as_well() -> None:
    rig = foreign(servo(1), servo(2), rate_hz=20.0)
    rig.up()
    rows, faults = rig.run(5, effort=0.1)
    assert not faults
    assert all(state.valid for row in rows for state in row)
    rig.driver.close()
