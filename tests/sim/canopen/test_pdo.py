"""PDOs: the order of their configuration, and when they act and are sent (CiA 301, 7.5.2.35-38)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.sim.canopen.master import Master, SdoRefusal

WRONG_STATE, COUNT_FIRST, NOT_MAPPABLE, TOO_LONG = 0x08000022, 0x06010003, 0x06040041, 0x06040042


@pytest.fixture
def node() -> Master:
    master = Master((1,))
    master.wait()
    return master


def refused(node: Master, index: int, sub: int, value: int, size: int) -> int:
    with pytest.raises(SdoRefusal) as reported:
        node.write(1, index, sub, value, size)
    return reported.value.code


def test_a_mapping_changes_in_its_order_only(node: Master) -> None:
    assert refused(node, 0x1A00, 0, 0, 1) == WRONG_STATE  # it is valid
    node.write(1, 0x1800, 1, 0x80000181, 4)
    assert refused(node, 0x1A00, 1, 0x60640020, 4) == COUNT_FIRST
    node.write(1, 0x1A00, 0, 0, 1)
    node.write(1, 0x1A00, 1, 0x60640020, 4)
    node.write(1, 0x1A00, 0, 1, 1)
    node.write(1, 0x1800, 1, 0x181, 4)
    assert node.read(1, 0x1A00, 0) == 1


@pytest.mark.parametrize(
    ("index", "part", "code"),
    [
        (0x1600, 0x60410010, NOT_MAPPABLE),  # a statusword is not received
        (0x1A00, 0x60710008, NOT_MAPPABLE),  # wrong length
        (0x1A00, 0x10180120, NOT_MAPPABLE),
        (0x1A00, 0x5FFF0010, 0x06020000),
        (0x1600, 0x605A0010, NOT_MAPPABLE),
    ],
)
def test_what_cannot_be_mapped(node: Master, index: int, part: int, code: int) -> None:
    com = index - 0x200
    node.write(1, com, 1, node.read(1, com, 1) | 0x80000000, 4)
    node.write(1, index, 0, 0, 1)
    assert refused(node, index, 1, part, 4) == code


def test_nine_bytes_are_too_many(node: Master) -> None:
    node.write(1, 0x1800, 1, 0x80000181, 4)
    node.write(1, 0x1A00, 0, 0, 1)
    for sub, part in enumerate((0x60640020, 0x606C0020, 0x60610008), start=1):
        node.write(1, 0x1A00, sub, part, 4)
    assert refused(node, 0x1A00, 0, 3, 1) == TOO_LONG
    assert refused(node, 0x1A00, 0, 9, 1) == 0x06090031
    node.write(1, 0x1A00, 0, 2, 1)


def test_identifiers_and_types_that_are_refused(node: Master) -> None:
    assert refused(node, 0x1800, 1, 0x191, 4) == 0x06090030  # another one while valid
    node.write(1, 0x1800, 1, 0x80000181, 4)
    for wrong in (0x20000181, 0x601, 0x80, 0x701):
        assert refused(node, 0x1800, 1, wrong, 4) == 0x06090030
    for wrong in (241, 252, 253):
        assert refused(node, 0x1800, 2, wrong, 1) == 0x06090030


def test_a_mapping_stays_as_it_is_in_operation(node: Master) -> None:
    node.write(1, 0x1800, 1, 0x80000181, 4)
    node.send("000#0101")
    node.wait()
    assert refused(node, 0x1A00, 0, 0, 1) == WRONG_STATE


def test_a_synchronous_rpdo_acts_at_the_next_sync(node: Master) -> None:
    node.bring_up()
    node.port.send(0x201, bytes.fromhex("0f006400"))
    node.wait(300_000)
    assert node.device().drive.motor.torque_counts == 0
    node.sync()
    assert node.device().drive.motor.torque_counts == 100


def test_the_last_rpdo_before_a_sync_counts(node: Master) -> None:
    node.bring_up()
    node.port.send(0x201, bytes.fromhex("0f006400"))
    node.torque(7)
    assert node.device().drive.motor.torque_counts == 7


def test_an_event_driven_rpdo_acts_on_receipt(node: Master) -> None:
    node.bring_up(kind=255)
    node.sync()
    start = node.clock.now_ns()
    node.wait(400_000)  # as `sync` does it: the slots go from SYNC to SYNC
    node.port.send(0x80, b"")
    node.wait(200_000)
    node.port.send(0x201, bytes.fromhex("0f00E803"))
    node.wait(start + 1_000_000 - node.clock.now_ns())
    motor = node.device().drive.motor
    assert motor.torque_counts == 1000
    assert motor.velocity() == 0.0
    node.sync()
    latch, arrival = (
        next(t for t, can_id, _ in node.log if can_id == wanted and t > start)
        for wanted in (0x80, 0x201)
    )
    # 2 N m on 0.5 kg m^2 for what was left of the slot at the frame's arrival
    left_s = (latch + 1_000_000 - arrival) * 1e-9
    assert 0.5e-3 < left_s < 0.8e-3
    assert motor.velocity() == pytest.approx(2.0 / 0.5 * left_s)


@pytest.mark.parametrize(("kind", "responses"), [(1, 6), (2, 3), (3, 2)])
def test_every_nth_sync_is_answered(node: Master, kind: int, responses: int) -> None:
    node.map(1)
    node.write(1, 0x1800, 2, kind, 1)
    node.send("000#0101")
    node.wait()
    assert sum(bool(node.sync()) for _ in range(6)) == responses


def test_an_acyclic_tpdo_is_sent_at_the_sync_after_a_change(node: Master) -> None:
    node.map(1)
    node.write(1, 0x1800, 2, 0, 1)
    node.send("000#0101")
    node.wait()
    assert [bool(node.sync()) for _ in range(3)] == [True, False, False]
    node.write(1, 0x6040, 0, 6, 2)
    assert [bool(node.sync()) for _ in range(3)] == [True, False, False]


def test_an_event_driven_tpdo_is_sent_at_a_change_and_by_its_timer(node: Master) -> None:
    node.write(1, 0x1800, 5, 20, 2)
    node.send("000#0101")
    got = [t for i, _, t in node.wait(70_000_000) if i == 0x181]
    assert [b - a for a, b in pairwise(got)] == [20_000_000] * 3
    node.write(1, 0x6040, 0, 6, 2)
    assert [(i, data.hex()) for i, data, _ in node.heard if i == 0x181][-1] == (0x181, "3102")


def test_the_inhibit_time_keeps_two_apart(node: Master) -> None:
    node.write(1, 0x1800, 1, 0xC0000181, 4)
    node.write(1, 0x1800, 3, 50, 2)  # 5 ms
    node.write(1, 0x1800, 1, 0x40000181, 4)
    node.send("000#0101")
    node.wait()
    for word in (6, 7, 6, 7):
        node.write(1, 0x6040, 0, word, 2)
    node.wait(20_000_000)
    got = [(t, data.hex()) for i, data, t in node.heard if i == 0x181]
    assert [data for _, data in got] == ["5002", "3302"]
    assert got[1][0] - got[0][0] == pytest.approx(5_000_000, abs=200_000)


def test_nothing_is_sent_or_taken_before_operation(node: Master) -> None:
    node.map(1)
    assert node.sync({1: bytes.fromhex("06000000")}) == {}
    assert node.state() == "SWITCH_ON_DISABLED"


def test_a_short_rpdo_is_reported_and_dropped_a_long_one_taken(node: Master) -> None:
    node.map(1)
    node.send("000#0101")
    node.sync({1: bytes.fromhex("0600")})
    assert node.emergencies() == [0x8210]
    assert node.state() == "SWITCH_ON_DISABLED"
    node.sync({1: bytes.fromhex("0600000000000000")})
    assert node.state() == "READY"


def test_fillers_keep_their_place(node: Master) -> None:
    node.write(1, 0x1400, 1, 0x80000201, 4)
    node.write(1, 0x1600, 0, 0, 1)
    for sub, part in enumerate((0x00060010, 0x60400010), start=1):
        node.write(1, 0x1600, sub, part, 4)
    node.write(1, 0x1600, 0, 2, 1)
    node.write(1, 0x1400, 1, 0x201, 4)
    node.send("000#0101")
    node.ask("201#FFFF0600")
    assert node.state() == "READY"


def test_the_deadline_of_an_rpdo(node: Master) -> None:
    node.map(1)
    node.write(1, 0x1400, 5, 20, 2)
    node.write(1, 0x6007, 0, 2, 2)
    node.write(1, 0x6060, 0, 10, 1)
    node.send("000#0101")
    for word in (6, 7, 15, 15):
        node.torque(0, word)
    for _ in range(30):
        node.torque(10)
    assert node.state() == "ENABLED"
    for _ in range(18):
        node.sync()
    assert node.state() == "ENABLED"
    for _ in range(5):
        node.sync()
    assert node.state() == "SWITCH_ON_DISABLED"
    assert node.emergencies() == [0x8250]
    assert node.device().drive.motor.torque_counts == 0
