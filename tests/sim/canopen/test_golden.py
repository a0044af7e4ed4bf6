"""Frames of a bring-up as public manuals print them, answered by a simulated drive.

Sources: Beckhoff, AX2000 CANopen communication profile, 6.1.2 (statusword after power-on);
Festo, CiA 402 for motor controllers CMMS/CMMD (GDCP-CMMS/D-C-CO-EN, 1404NH), p. 20 (SDO access of
8, 16 and 32 bit objects); EAO, series 09 keypad manual, p. 51, after CiA's CANopen poster (boot-up,
NMT start, heartbeat); CiA 301 v4.2.0, 7.2.4.3 (aborts, segments) and 7.2.7 (EMCY); CiA 402-2
v3.0, table of statuswords.
"""

from __future__ import annotations

import pytest

from tests.sim.canopen.master import Master


@pytest.fixture
def node() -> Master:
    master = Master((1,))
    master.wait()
    return master


def test_boot_up_and_heartbeats_are_those_of_the_canopen_poster() -> None:
    master = Master((0x0B,))
    assert [(i, data.hex()) for i, data, _ in master.wait()] == [(0x70B, "00")]
    assert master.ask("60B#2B171000 02000000".replace(" ", "")) == ["58B#6017100000000000"]
    assert master.wait(2_000_000)[0][:2] == (0x70B, b"\x7f")
    master.send("000#010B")
    assert master.wait(2_500_000)[-1][:2] == (0x70B, b"\x05")


def test_the_statusword_after_power_on_is_switch_on_disabled(node: Master) -> None:
    (response,) = node.ask("601#4041600000000000")
    # Beckhoff prints 4B 41 60 00 40 00 00 00; ours adds voltage (bit 4) and remote (bit 9)
    assert response == "581#4B41600050020000"
    assert int.from_bytes(bytes.fromhex(response[12:16]), "little") & 0x6F == 0x40


@pytest.mark.parametrize(
    ("request_", "response"),
    [
        # Festo p. 20, with the object of that size which this drive has
        ("601#4061600000000000", "581#4F61600000000000"),
        ("601#4041600000000000", "581#4B41600050020000"),
        ("601#4000100000000000", "581#4300100092010200"),
        ("601#2F01140200000000", "581#6001140200000000"),
        ("601#2B406000E8030000", "581#6040600000000000"),
        ("601#237A600078563412", "581#607A600000000000"),
        # CiA 301: no such object, no such sub-index, read only, too long, unknown command
        ("601#4000300000000000", "581#8000300000000206"),
        ("601#4018100900000000", "581#8018100911000906"),
        ("601#2300100001000000", "581#8000100002000106"),
        ("601#2340600006000000", "581#8040600012000706"),
        ("601#E040600000000000", "581#8040600001000405"),
        ("601#C021100000000000", "581#8021100001000405"),
    ],
)
def test_sdo_access(node: Master, request_: str, response: str) -> None:
    assert node.ask(request_) == [response]


def test_a_name_comes_in_segments(node: Master) -> None:
    name = b"tautwave simulated CiA 402 drive"
    assert node.ask("601#4008100000000000") == [f"581#41081000{len(name):02X}000000"]
    got, toggle = b"", 0
    while True:
        (response,) = node.ask(f"601#{0x60 | toggle:02X}00000000000000")
        data = bytes.fromhex(response[4:])
        assert data[0] & 0x10 == toggle
        got += data[1 : 8 - (data[0] >> 1 & 7)]
        toggle ^= 0x10
        if data[0] & 1:
            break
    assert got == name


def test_a_wrong_toggle_is_aborted(node: Master) -> None:
    node.ask("601#4008100000000000")
    assert node.ask("601#7000000000000000") == ["581#8008100000000305"]


def test_a_value_written_in_segments(node: Master) -> None:
    assert node.ask("601#217A600004000000") == ["581#607A600000000000"]
    assert node.ask("601#07785634120000 00".replace(" ", "")) == ["581#2000000000000000"]
    assert node.read(1, 0x607A) == 0x12345678


def test_segments_alternate_their_toggle(node: Master) -> None:
    assert node.ask("601#217A600004000000") == ["581#607A600000000000"]
    assert node.ask("601#0A78560000000000") == ["581#2000000000000000"]
    assert node.ask("601#1B34120000000000") == ["581#3000000000000000"]
    assert node.read(1, 0x607A) == 0x12345678


def test_fewer_bytes_than_announced_are_refused(node: Master) -> None:
    assert node.ask("601#217A600008000000") == ["581#607A600000000000"]
    assert node.ask("601#0778563412000000") == ["581#807A600013000706"]
    assert node.read(1, 0x607A) == 0


def test_the_states_up_and_the_fault_down_again(node: Master) -> None:
    node.map(1)
    node.write(1, 0x6060, 0, 10, 1)
    node.send("000#0101")
    reported = [node.torque(0, word)[1] for word in (0x0000, 0x0006, 0x0007, 0x000F, 0x000F)]
    words = [int.from_bytes(data[:2], "little") & 0x6F for data in reported]
    assert words == [0x40, 0x21, 0x23, 0x27, 0x27]
    node.device().drive.fail(0x2310)
    frames = [f"{i:03X}#{data.hex().upper()}" for i, data, _ in node.wait(300_000)]
    assert frames == ["081#1023010000000000"]
    node.sync()
    for _ in range(3):
        node.torque(0)
    assert node.torque(0)[1][:1] == b"\x18"
    assert node.read(1, 0x603F) == 0x2310
    assert node.read(1, 0x1001) == 1
    assert node.read(1, 0x1003, 1) == 0x2310
    node.torque(0, 0x0000)
    assert node.torque(0, 0x0080)[1][:1] == b"\x50"
    assert node.emergencies() == [0x2310, 0]


def test_the_frames_of_a_cycle(node: Master) -> None:
    node.bring_up()
    node.torque(100)
    node.log.clear()
    node.torque(-2)
    assert [(can_id, data.hex()) for _, can_id, data in node.log] == [
        (0x201, "0f00feff"),
        (0x080, ""),
        (0x181, "371200000000feff"),
    ]
