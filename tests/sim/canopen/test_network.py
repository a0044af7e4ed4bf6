"""NMT, heartbeat, EMCY, store and restore (CiA 301), and what a lost master does (6007h)."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.sim.canopen.master import Master, SdoRefusal


@pytest.fixture
def node() -> Master:
    master = Master((1, 2))
    master.wait()
    return master


def beats(node: Master, count: int, every_ms: int = 5, byte: int = 5) -> None:
    for _ in range(count):
        node.port.send(0x77F, bytes([byte]))
        node.wait(every_ms * 1_000_000)


def test_nmt_goes_to_one_node_or_to_all(node: Master) -> None:
    def states() -> list[str]:
        return [device.nmt.name for device in node.world.devices]

    for command, expected in (
        ("000#0102", ["PRE_OPERATIONAL", "OPERATIONAL"]),
        ("000#0100", ["OPERATIONAL", "OPERATIONAL"]),
        ("000#0201", ["STOPPED", "OPERATIONAL"]),
        ("000#8000", ["PRE_OPERATIONAL", "PRE_OPERATIONAL"]),
        ("000#7700", ["PRE_OPERATIONAL", "PRE_OPERATIONAL"]),
        ("000#01", ["PRE_OPERATIONAL", "PRE_OPERATIONAL"]),
    ):
        node.send(command)
        node.wait()
        assert states() == expected, command


def test_a_stopped_node_answers_no_sdo(node: Master) -> None:
    node.send("000#0201")
    assert node.ask("601#4000100000000000") == []
    node.send("000#8001")
    assert node.ask("601#4000100000000000") != []


@pytest.mark.parametrize(("command", "kept"), [(0x81, False), (0x82, True)])
def test_a_reset_takes_its_time_and_restores(node: Master, command: int, kept: bool) -> None:
    node.write(1, 0x1017, 0, 50, 2)
    node.write(1, 0x6072, 0, 123, 2)
    node.heard.clear()
    node.send(f"000#{command:02X}01")
    node.wait(10_000_000)
    assert node.heard == []
    assert node.ask("601#4017100000000000") == []
    node.wait(20_000_000)
    assert [(i, data) for i, data, _ in node.heard] == [(0x701, b"\0")]
    assert node.read(1, 0x1017) == 0
    assert (node.read(1, 0x6072) == 123) is kept


def test_saved_values_outlive_a_reset_until_the_defaults_are_loaded(node: Master) -> None:
    node.write(1, 0x6072, 0, 123, 2)
    with pytest.raises(SdoRefusal, match="08000020"):
        node.write(1, 0x1010, 1, 1, 4)
    node.write(1, 0x1010, 1, 0x65766173, 4)
    for expected in (123, 3000):
        node.send("000#8101")
        node.wait(30_000_000)
        assert node.read(1, 0x6072) == expected
        node.write(1, 0x1011, 1, 0x64616F6C, 4)


def test_heartbeats_come_at_their_period(node: Master) -> None:
    node.write(1, 0x1017, 0, 10, 2)
    got = [t for i, _, t in node.wait(55_000_000) if i == 0x701]
    assert [b - a for a, b in pairwise(got)] == [10_000_000] * 4
    node.write(1, 0x1017, 0, 0, 2)
    assert [f for f in node.wait(30_000_000) if f[0] == 0x701] == []


def enabled(reaction: int) -> Master:
    node = Master((1, 2))
    node.wait()
    for each in node.ids:
        node.write(each, 0x1016, 1, 0x7F << 16 | 20, 4)
        node.write(each, 0x6007, 0, reaction, 2)
    node.bring_up()
    for _ in range(10):
        node.torque(50)
    return node


@pytest.mark.parametrize(
    ("reaction", "state"),
    [(0, "ENABLED"), (1, "FAULT"), (2, "SWITCH_ON_DISABLED"), (3, "SWITCH_ON_DISABLED")],
)
def test_a_lost_master_ends_as_6007_says(reaction: int, state: str) -> None:
    node = enabled(reaction)
    beats(node, 10)  # from the first one on it is watched for
    assert [node.state(1), node.state(2)] == ["ENABLED", "ENABLED"]
    node.wait(15_000_000)
    assert node.emergencies(1) == []
    node.wait(200_000_000)  # without any SYNC
    assert [node.state(1), node.state(2)] == [state, state]
    assert node.emergencies(1) == [0x8130]
    assert node.read(1, 0x1001) & 0x10
    assert (node.device().drive.motor.torque_counts == 0) is (reaction != 0)
    beats(node, 1)
    assert node.emergencies(1) == [0x8130, 0]
    assert node.read(1, 0x1001) == 0


def test_a_master_that_never_beat_is_not_missed() -> None:
    node = enabled(2)
    node.wait(100_000_000)
    assert node.state() == "ENABLED"


@pytest.mark.parametrize(
    ("value", "nmt"), [(0, "PRE_OPERATIONAL"), (1, "OPERATIONAL"), (2, "STOPPED")]
)
def test_a_lost_master_changes_the_nmt_state_as_1029_says(value: int, nmt: str) -> None:
    node = enabled(2)
    node.write(1, 0x1029, 1, value, 1)
    beats(node, 3)
    node.wait(50_000_000)
    assert node.device().nmt.name == nmt


def test_errors_are_remembered_newest_first_and_forgotten_on_demand(node: Master) -> None:
    device = node.device()
    for code in (0x2310, 0x3210, 0x4310):
        device.emergency(code, 1)
    assert node.read(1, 0x1003) == 3
    assert [node.read(1, 0x1003, sub) for sub in (1, 2, 3)] == [0x4310, 0x3210, 0x2310]
    with pytest.raises(SdoRefusal, match="06090030"):
        node.write(1, 0x1003, 0, 1, 1)
    node.write(1, 0x1003, 0, 0, 1)
    assert node.read(1, 0x1003) == 0
    with pytest.raises(SdoRefusal, match="06090011"):
        node.read(1, 0x1003, 1)


def test_an_emcy_can_be_switched_off_and_moved(node: Master) -> None:
    node.write(1, 0x1014, 0, 0x80000081, 4)
    node.device().emergency(0x2310, 1)
    assert node.wait() == []
    node.write(1, 0x1014, 0, 0xA1, 4)
    node.device().emergency(0x2310, 1)
    assert [(i, data.hex()) for i, data, _ in node.wait()] == [(0xA1, "1023010000000000")]


def test_the_drive_tells_what_it_is_built_from() -> None:
    node = Master((3,))
    node.wait()
    assert node.read(3, 0x1000) == 0x00020192
    assert node.read(3, 0x1018, 4) == 3
    assert node.read(3, 0x6076) == 2000  # mN m
    assert [node.read(3, 0x608F, sub) for sub in (1, 2)] == [4096, 1]
    assert node.read(3, 0x6502) == 0x3AD  # PP, PV, PT, HM, CSP, CSV, CST
    servo = Master((3,), servo=True)
    servo.wait()
    assert servo.read(3, 0x6502) == 0x1A5  # no torque modes
