"""Frames that no master should send: nothing raises, and the drive stays a drive."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave_sim.cia402 import State
from tests.examples import tried
from tests.sim.canopen.master import Master

IDS = st.one_of(
    st.sampled_from((0x000, 0x080, 0x201, 0x301, 0x401, 0x501, 0x601, 0x77F)),
    st.integers(0, 0x7FF),
)
OBJECTS = (
    *(0x1003, 0x1008, 0x1010, 0x1014, 0x1016, 0x1017, 0x1029, 0x1400, 0x1600, 0x1800, 0x1A00),
    *(0x6007, 0x6040, 0x605A, 0x6060, 0x6071, 0x6072, 0x6081, 0x6084, 0x6085, 0x607A),
    *(0x6098, 0x60C2, 0x60FF),
)
SDO = st.builds(
    lambda head, index, sub, data: bytes([head]) + index.to_bytes(2, "little") + sub + data,
    st.sampled_from((0x40, 0x2F, 0x2B, 0x27, 0x23, 0x22, 0x21, 0x20, 0x60, 0x70, 0x01, 0x10, 0x80)),
    st.sampled_from(OBJECTS),
    st.sampled_from((b"\0", b"\1", b"\2", b"\5")),
    st.binary(min_size=4, max_size=4),
)
FRAMES = st.lists(
    st.one_of(
        st.tuples(IDS, st.binary(max_size=8)),
        st.tuples(st.just(0x601), SDO),
        st.tuples(
            st.just(0x201),
            st.builds(
                lambda word, data: bytes([word, 0]) + data,
                st.sampled_from((0, 2, 6, 7, 15, 31, 128)),
                st.binary(min_size=2, max_size=2),
            ),
        ),
        st.just((0x80, b"")),
    ),
    max_size=60,
)


@settings(max_examples=tried(150))
@given(FRAMES, st.booleans(), st.booleans())
def test_garbage_never_raises(frames: list[tuple[int, bytes]], up: bool, servo: bool) -> None:
    node = Master((1, 2), servo=servo)
    node.wait()
    if up and not servo:
        node.bring_up()
    for can_id, data in frames:
        node.port.send(can_id, data)
        node.wait(300_000)
    device = node.device()
    assert device.drive.machine.state in State
    motor = device.drive.motor
    assert motor.position() - motor.position() == 0.0
    # whatever was done to it, a reset makes it a drive again
    node.send("000#8101")
    node.wait(60_000_000)
    node.send("000#8001")
    node.wait()
    assert node.read(1, 0x1000) == 0x00020192
    assert node.state() == "SWITCH_ON_DISABLED"


@given(st.lists(st.tuples(st.just(0x601), st.binary(min_size=8, max_size=8)), max_size=30))
def test_an_sdo_server_answers_every_request_once(frames: list[tuple[int, bytes]]) -> None:
    node = Master((1,))
    node.wait()
    for can_id, data in frames:
        node.port.send(can_id, data)
        reported = [response for i, response, _ in node.wait() if i == 0x581]
        if data[0] >> 5 == 4:  # an abort
            assert reported == []
        else:
            assert len(reported) == 1
            assert len(reported[0]) == 8
