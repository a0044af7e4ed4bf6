"""Every quirk of a drive, and every fault of the bus on its way to the master, with a seed."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from tautwave.errors import DriverError
from tautwave_sim.wire.can_faults import CanFaultPlan, CanFaults
from tests.sim.canopen.master import Master, SdoRefusal


def moving(cycles: int = 1, **keys: Any) -> Master:
    node = Master((1, 2), **keys)
    node.bring_up()
    for _ in range(cycles):
        node.torque(10)
    return node


def until(node: Master, at_s: float) -> None:
    """Go on until just after a time since slot 0, in the middle of a slot."""
    while (node.world.elapsed_ns(node.clock.now_ns()) or 0) < at_s * 1e9:
        node.torque(10)


def test_slow_transitions() -> None:
    node = Master((1, 2), quirks={"transition_ms": 5})
    node.bring_up()
    assert node.state(2) == "ENABLED"
    assert node.state(1) == "SWITCH_ON_DISABLED"
    for _ in range(15):
        node.torque(0)
    assert node.state(1) == "ENABLED"


def test_slow_mode_switch() -> None:
    node = moving(quirks={"mode_switch_ms": 10})
    node.write(1, 0x6060, 0, 9, 1)
    assert node.read(1, 0x6061) == 10
    node.wait(12_000_000)
    assert node.read(1, 0x6061) == 9


def test_a_mode_it_refuses_though_it_names_it() -> None:
    node = Master((1,), quirks={"refuses_modes": (10,)})
    node.bring_up()
    assert node.read(1, 0x6502) & 1 << 9
    assert (node.read(1, 0x6060), node.read(1, 0x6061)) == (10, 0)
    node.torque(100)
    assert node.device().drive.motor.torque_counts == 0


def test_a_mode_it_lacks() -> None:
    node = Master((1,), quirks={"lacks_modes": (10,)})
    node.wait()
    assert node.read(1, 0x6502) & 1 << 9 == 0
    with pytest.raises(SdoRefusal, match="06090030"):
        node.write(1, 0x6060, 0, 10, 1)


def test_a_fault_that_takes_two_resets() -> None:
    node = Master((1,), quirks={"starts_in_fault": True, "fault_resets": 2})
    node.wait()
    assert node.state() == "FAULT"
    assert node.read(1, 0x603F) == 0x2310
    for word, state in ((0, "FAULT"), (0x80, "FAULT"), (0, "FAULT"), (0x80, "SWITCH_ON_DISABLED")):
        node.write(1, 0x6040, 0, word, 2)
        assert node.state() == state


def test_a_coarse_torque() -> None:
    node = moving(quirks={"torque_step_permille": 8})
    acting = []
    for counts in (3, 4, 100, -3, -5, -100):
        node.torque(counts)
        acting.append(node.device().drive.motor.torque_counts)
    assert acting == [0, 8, 104, 0, -8, -96]
    assert node.device(2).drive.motor.torque_counts == -100


def test_heartbeats_end() -> None:
    node = Master((1, 2), quirks={"heartbeat_lost_at_s": 0.05})
    node.wait()
    for each in (1, 2):
        node.write(each, 0x1017, 0, 5, 2)
    node.bring_up()
    until(node, 0.1)
    origin = node.clock.now_ns() - (node.world.elapsed_ns(node.clock.now_ns()) or 0)
    last = {i: (t - origin) * 1e-9 for t, i, _ in node.log if i in (0x701, 0x702)}
    assert 0.044 < last[0x701] <= 0.0502
    assert last[0x702] > 0.09
    assert 1 in node.torque(10)  # all the rest goes on


def test_silence() -> None:
    node = moving(quirks={"silent_at_s": 0.02})
    until(node, 0.015)
    assert set(node.torque(10)) == {1, 2}
    until(node, 0.021)
    assert set(node.torque(10)) == {2}
    with pytest.raises(AssertionError, match="does not answer"):
        node.read(1, 0x1000)
    assert node.device().drive.motor.torque_counts == 0


def test_a_reset_behind_our_back() -> None:
    node = moving(quirks={"resets_at_s": 0.02, "boot_ms": 5})
    until(node, 0.021)
    assert set(node.torque(10)) == {2}
    node.wait(6_000_000)
    assert (0x701, b"\0") in [(i, data) for i, data, _ in node.heard]
    assert node.state() == "SWITCH_ON_DISABLED"
    assert node.device().nmt.name == "PRE_OPERATIONAL"
    assert node.read(1, 0x1A00, 0) == 1  # as after power-on


def test_lost_voltage() -> None:
    node = moving(quirks={"voltage_off_at_s": 0.02})
    until(node, 0.021)
    word = int.from_bytes(node.torque(10)[1][:2], "little")
    assert word & 0x7F == 0x40  # switch on disabled, bit 4 (voltage) off
    for command in (6, 7, 15):
        node.torque(10, command)
    assert node.state(1) == "SWITCH_ON_DISABLED"
    assert node.state(2) == "ENABLED"


def test_a_fault_of_its_own() -> None:
    node = moving(quirks={"fault_at_s": 0.02, "fault_code": 0x4310})
    until(node, 0.1)
    assert node.emergencies() == [0x4310]
    assert node.state() == "FAULT"
    assert node.read(1, 0x603F) == 0x4310
    assert node.state(2) == "ENABLED"


def test_a_warning_only() -> None:
    node = moving(quirks={"emergency_at_s": 0.02, "fault_code": 0x4210})
    until(node, 0.03)
    assert node.emergencies() == [0x4210]
    assert node.state() == "ENABLED"


def test_a_mode_that_is_lost() -> None:
    node = moving(quirks={"mode_lost_at_s": 0.02})
    until(node, 0.03)
    assert node.read(1, 0x6061) == 0
    assert node.state() == "ENABLED"
    assert node.device().drive.motor.torque_counts == 0


@pytest.mark.parametrize(
    ("quirk", "index", "sub", "code"),
    [
        ({"rpdo_timer": "no_subindex"}, 0x1400, 5, "06090011"),
        ({"rpdo_timer": "no_object"}, 0x1400, 5, "06020000"),
        ({"heartbeat_consumer": False}, 0x1016, 1, "06020000"),
        ({"abort_option": False}, 0x6007, 0, "06020000"),
        ({"interpolation_period": False}, 0x60C2, 1, "06020000"),
    ],
)
def test_objects_that_are_missing(quirk: Any, index: int, sub: int, code: str) -> None:
    node = Master((1, 2), quirks=quirk)
    node.wait()
    with pytest.raises(SdoRefusal, match=code):
        node.read(1, index, sub)
    node.read(2, index, sub)
    node.bring_up()
    assert node.state() == "ENABLED"


@pytest.mark.parametrize(
    ("quirk", "index", "sub", "value", "size", "code"),
    [
        ({"quick_stop_option": False}, 0x605A, 0, 6, 2, "06010002"),
        ({"least_heartbeat_ms": 100}, 0x1016, 1, 0x7F0032, 4, "06090032"),
    ],
)
def test_values_that_are_refused(
    quirk: Any, index: int, sub: int, value: int, size: int, code: str
) -> None:
    node = Master((1, 2), quirks=quirk)
    node.wait()
    with pytest.raises(SdoRefusal, match=code):
        node.write(1, index, sub, value, size)
    node.write(2, index, sub, value, size)
    assert node.read(2, index, sub) == value


def test_a_consumer_heartbeat_that_is_confirmed_and_forgotten() -> None:
    node = Master((1,), quirks={"ignores_heartbeat_consumer": True})
    node.wait()
    node.write(1, 0x1016, 1, 0x7F0014, 4)
    assert node.read(1, 0x1016, 1) == 0


def test_another_identity() -> None:
    node = Master((1, 2), quirks={"identity": 0xBAD})
    node.wait()
    assert [node.read(each, 0x1018, 2) for each in (1, 2)] == [0xBAD, 0]


@pytest.mark.parametrize("wrong", [{"transition": 5}, {"fault_resets": 0}, {"rpdo_timer": "no"}])
def test_a_wrong_quirk_is_refused(wrong: Any) -> None:
    with pytest.raises(ValidationError):
        Master((1,), quirks=wrong)


# -- the bus, as a master meets it ----------------------------------------------------------------


def event(kind: str, **keys: Any) -> dict[str, Any]:
    return {"events": ({"kind": kind, **keys},)}


def responses(node: Master, cycles: int = 30) -> list[int]:
    return [len(node.torque(10)) for _ in range(cycles)]


def test_a_lost_tpdo_costs_one_axis_one_cycle() -> None:
    reported = responses(moving(faults=event("lost", at_s=0.01, can_id=0x181)))
    assert sorted(reported) == [1] + [2] * 29


def test_a_lost_sync_costs_all_answers_of_its_cycle() -> None:
    reported = responses(moving(faults=event("sync_lost", at_s=0.01, times=2)))
    assert sorted(reported) == [0, 0] + [2] * 28


def test_a_late_tpdo_comes_in_the_next_cycle() -> None:
    node = moving(faults={**event("delayed", at_s=0.01, can_id=0x181), "delay_s": 1e-3})
    counts = []
    for _ in range(30):
        before = len(node.heard)
        node.torque(10)
        counts.append(sum(1 for i, _, _ in node.heard[before:] if i == 0x181))
    assert sorted(counts) == [0] + [1] * 28 + [2]


def test_a_destroyed_frame_arrives_later_in_its_cycle() -> None:
    node = moving(faults=event("error_frame", at_s=0.01, can_id=0x181))
    assert responses(node) == [2] * 30


def test_a_full_queue_is_reported_by_send() -> None:
    node = moving(faults=event("queue_full", at_s=0.01, duration_s=0.005))
    reported = []
    for _ in range(30):
        reported.append(node.port.send(0x80, b""))
        node.wait()
    assert reported.count(False) == 5
    assert reported[0]
    assert reported[-1]


def test_the_queue_holds_as_many_frames_as_it_is_deep() -> None:
    node = moving()
    reported = [node.port.send(0x7FF, bytes(8)) for _ in range(12)]
    assert reported == [True] * 10 + [False] * 2


def test_bus_off_is_an_error_and_stays() -> None:
    node = moving(faults=event("bus_off", at_s=0.01))
    with pytest.raises(DriverError, match="bus-off"):
        until(node, 1.0)
    node.wait(100_000_000)
    assert node.port.error_state == "off"
    with pytest.raises(DriverError, match="bus-off"):
        node.port.send(0x80, b"")


def test_a_disturbed_bus_makes_the_master_passive_and_then_off() -> None:
    node = moving(faults=event("error_frame", at_s=0.01, duration_s=10.0))
    states = []
    for _ in range(200):
        states.append(node.port.error_state)
        if states[-1] == "off":
            break
        node.port.send(0x80, b"")
        node.wait()
    assert list(dict.fromkeys(states)) == ["active", "passive", "off"]
    reported = [(i, data[1], data[6]) for i, data, _ in node.heard if i >= 0x20000000]
    assert reported == [(0x20000004, 0x20, 128), (0x20000040, 0, 255)]  # <linux/can/error.h>
    with pytest.raises(DriverError, match="bus-off"):
        node.port.send(0x80, b"")


def test_a_bus_that_goes_down_and_comes_back() -> None:
    node = moving(faults=event("bus_down", at_s=0.01, duration_s=0.02))
    with pytest.raises(DriverError, match="down"):
        until(node, 1.0)
    node.wait(30_000_000)
    assert len(node.torque(10)) == 2


@pytest.mark.sparse(3)
@pytest.mark.parametrize(
    "kind", ["lost", "delayed", "duplicated", "corrupted", "error_frame", "sync_lost"]
)
def test_the_same_seed_gives_the_same_frames(kind: str) -> None:
    def run(seed: int) -> tuple[Any, ...]:
        node = moving()
        plan = CanFaultPlan(CanFaults.model_validate({kind: 0.05, "seed": seed}))
        node.world.plan = node.world.medium.plan = plan  # only now: set up without faults
        for step in range(200):
            node.torque(step % 50 - 20)
        return node.log, node.heard, [axis.physics.x for axis in node.world.axes]

    one, again, other = run(1), run(1), run(2)
    assert one == again
    assert one[1] != other[1]


def test_the_plan_of_the_options_is_the_plan_of_the_bus() -> None:
    node = Master((1,), faults={"lost": 1.0})
    assert node.wait() == []
    assert len(node.log) == 1  # the boot-up frame was sent
