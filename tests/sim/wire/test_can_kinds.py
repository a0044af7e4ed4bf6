"""Frames of 29 bits and of CAN FD on the simulated wire, and a gateway that knows its own."""

from __future__ import annotations

import os
import socket
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.errors import DriverError
from tautwave.multicast import GroupFrame, only_its_group
from tautwave_sim.wire.can import EXTENDED, CanTiming, frame_bits, priority
from tautwave_sim.wire.can_faults import CanFaultPlan, CanFaults
from tautwave_sim.wire.can_medium import CanMedium
from tautwave_sim.wire.can_served import Gateway, PythonCan, open_interface
from tautwave_sim.wire.can_world import CanWorld

can = pytest.importorskip("can")


def by_hand(number: int, data: bytes) -> int:
    """Bits of an extended frame from its string of bits, long division and a search for runs."""
    text = f"0{number >> 18:011b}11{number & 0x3FFFF:018b}000{len(data):04b}"
    text += "".join(f"{byte:08b}" for byte in data)
    rest = int(text, 2) << 15
    for at in range(len(text) - 1, -1, -1):
        if rest >> at + 15 & 1:
            rest ^= 0xC599 << at  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
    text += f"{rest:015b}"
    sent = ""
    for bit in text:
        sent += bit
        if sent.endswith(("00000", "11111")):
            sent += "0" if bit == "1" else "1"
    return len(sent) + 1 + 2 + 7 + 3  # CRC delimiter, acknowledge and its own, end, intermission


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8))
def test_extended_frames_have_the_bits_that_they_have_by_hand(number: int, data: bytes) -> None:
    bits = frame_bits(EXTENDED | number, data)
    assert bits == by_hand(number, data)
    assert bits <= 67 + 8 * len(data) + (53 + 8 * len(data)) // 4


def test_of_the_same_first_bits_the_shorter_identifier_wins() -> None:
    ids = [EXTENDED | 0x11 << 18, 0x12, EXTENDED | 0x10 << 18 | 5, 0x11]
    assert sorted(ids, key=priority) == [
        EXTENDED | 0x10 << 18 | 5,
        0x11,
        EXTENDED | 0x11 << 18,
        0x12,
    ]


def test_classic_and_fd_frames_share_a_bus_and_take_their_own_time() -> None:
    medium = CanMedium(CanTiming(1_000_000, 5_000_000))
    heard: list[tuple[int, bytes, bool]] = []
    medium.port(lambda _, can_id, data: heard.append((can_id, data, medium.fd)))
    port = medium.port(lambda *_: None)
    port.send(1, bytes(8))
    port.send(2, bytes(8), fd=False)
    fd_ns = medium.next_event_ns()
    medium.advance(10**7)
    assert heard == [(1, bytes(8), True), (2, bytes(8), False)]
    assert fd_ns == round(35e3 + (28 + 80) * 200)
    assert CanTiming(1_000_000, 5_000_000).frame_ns(2, bytes(8), fd=False) == 1000 * frame_bits(
        2, bytes(8)
    )


class Plain(CanWorld):
    """A bus without devices."""

    def __init__(self, data_bitrate: int | None = None) -> None:
        super().__init__(CanTiming(1_000_000, data_bitrate), CanFaultPlan(CanFaults()), 10**6, 0)

    def _device_event_ns(self) -> None:
        return None

    def _run(self, at_ns: int) -> None:
        pass


class Echoing:
    """An interface that returns what is sent on it, as udp_multicast does."""

    def __init__(self) -> None:
        self.frames: list[Any] = []
        self.send = self.frames.append

    def recv(self, timeout: float) -> Any:
        return self.frames.pop(0) if self.frames else None

    def fileno(self) -> int:
        return -1


def message(can_id: int, data: bytes, **more: bool) -> Any:
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False, **more)


def test_a_command_with_the_id_of_an_answer_reaches_the_wire() -> None:
    world, interface = Plain(), Echoing()
    heard: list[tuple[int, bytes]] = []
    device = world.medium.port(lambda _, can_id, data: heard.append((can_id, data)))
    gateway = Gateway(world, PythonCan(interface, FakeClock()))
    device.send(0x11, b"answer")
    gateway.run(10**6)  # the answer leaves, and comes back as an echo
    interface.frames += [message(0x11, b"command"), message(0x11, b"answer")]
    gateway.run(2 * 10**6)
    gateway.run(3 * 10**6)
    assert heard == [(0x11, b"command"), (0x11, b"answer")]


@pytest.mark.parametrize("fd", [False, True])
def test_what_a_bus_does_not_have_stays_outside(fd: bool) -> None:
    world, interface = Plain(5_000_000 if fd else None), Echoing()
    heard: list[tuple[int, bool]] = []
    world.medium.port(lambda _, can_id, __: heard.append((can_id, world.medium.fd)))
    gateway = Gateway(world, PythonCan(interface, FakeClock()))
    interface.frames += [
        message(1, b"", is_fd=True),
        message(2, b""),
        can.Message(arbitration_id=3, is_extended_id=True),
        message(4, b"", is_remote_frame=True),
    ]
    gateway.run(0)
    gateway.run(10**6)
    assert heard == ([(1, True), (2, False)] if fd else [(2, False)])


@pytest.mark.parametrize("group", ["239.74.{}.{}", "ff15:7079:7468:6f6e:6465:6d6f:{}:{}"])
def test_devices_of_one_multicast_group_do_not_hear_another(group: str) -> None:
    """Linux hands frames of every group to every socket of the port, and here two arms share ids.

    Devices that heard both would obey two masters, and each wire would carry twice its frames.
    """
    clock = MonotonicClock()
    channels = [group.format(1 + os.getpid() % 250, number) for number in (91, 92, 91, 92)]
    opened: list[Any] = []
    try:
        for channel in channels:
            place: Any = SimpleNamespace(interface="udp_multicast", channel=channel)
            try:
                opened.append(open_interface(place, clock))
            except DriverError as err:
                pytest.skip(f"no multicast here: {err}")
        mine, other, same, others = opened
        assert other.send(2, b"command", False)
        assert mine.send(1, b"command", False)
        for end, number in ((same, 1), (others, 2)):
            assert clock.wait(end, clock.now_ns() + 5 * 10**9)
            assert [frame[0] for frame in end.receive_some(9)] == [number]
        assert [end.receive_some(9) for end in opened] == [[]] * 4  # its own neither
    finally:
        for end in opened:
            end.close()


class Stamped:
    """An interface that says when the kernel got each frame."""

    def __init__(self) -> None:
        self.frames: list[GroupFrame] = []
        self.sent: list[int] = []

    def send(self, can_id: int, data: bytes, fd: bool) -> bool:
        self.sent.append(can_id)
        return True

    def receive_some(self, most: int) -> list[GroupFrame]:
        frames, self.frames = self.frames[:most], self.frames[most:]
        return frames

    def close(self) -> None:
        pass


@given(
    st.lists(st.tuples(st.integers(0, 3_000), st.integers(1, 3)), max_size=12),
    st.lists(st.integers(1, 900), min_size=8, max_size=8),
)
def test_a_process_that_comes_late_to_a_frame_delays_no_answer(
    arrivals: list[tuple[int, int]], pauses: list[int]
) -> None:
    """Devices hear and answer at the same times, however seldom the gateway runs."""
    arrivals = sorted(arrivals)
    heard: list[list[tuple[int, int]]] = []
    for steps in (range(0, 20_000, 10), None):
        world, interface, answers = Plain(), Stamped(), []
        ports: dict[int, Any] = {}

        def answer(now_ns: int, can_id: int, _: bytes, ports: Any = ports) -> None:
            if can_id in ports:
                ports[can_id].send(0x10 | can_id, bytes(can_id))

        for number in (1, 2, 3):
            ports[number] = world.medium.port(
                lambda now_ns, can_id, data, number=number, answer=answer: (
                    answer(now_ns, can_id, data) if can_id == number else None
                )
            )
        gateway = Gateway(world, interface)
        world.medium.listeners.append(
            lambda now_ns, can_id, _, answers=answers: answers.append((now_ns, can_id))
        )
        left, now_us, at = list(arrivals), 0, 0
        while now_us < 20_000:
            while left and left[0][0] <= now_us:
                at_us, number = left.pop(0)
                interface.frames.append((number, b"", False, 1000 * at_us or 1))
            gateway.run(1000 * now_us)
            if steps is not None:
                now_us += 10
                continue
            event = gateway.next_event_ns()
            woken = 20_000 if event is None else -(-event // 1000)
            arrives = left[0][0] if left else 20_000
            late = pauses[at % len(pauses)]
            now_us, at = max(now_us + 1, min(woken, arrives)) + late, at + 1
        gateway.run(10**9)
        heard.append(answers)
        assert len(interface.sent) == len(arrivals)
    assert len(heard[0]) == 2 * len(arrivals)
    if len({at for at, _ in arrivals}) == len(arrivals):
        assert heard[0] == heard[1]


def test_a_gateway_wakes_for_what_it_has_to_send_and_at_its_time() -> None:
    world, interface = Plain(), Stamped()
    device = world.medium.port(lambda *_: device.send(0x11, b"answer"))
    gateway = Gateway(world, interface)
    interface.frames.append((1, b"request", False, 5_000))
    woken = [5_000]
    while not interface.sent:
        gateway.run(woken[-1])
        if not interface.sent:
            woken.append(gateway.next_event_ns() or 0)
    request, answer = (1000 * frame_bits(*one) for one in ((1, b"request"), (0x11, b"answer")))
    assert woken == [5_000, 5_000 + request + 1000 * frame_bits(0, b""), 5_000 + request + answer]


def test_what_came_from_other_groups_while_a_bus_was_opened_is_dropped() -> None:
    """Between a bus' opening and its option the kernel hands it the frames of every group."""
    kind = socket.AF_INET, socket.SOCK_DGRAM
    with socket.socket(*kind) as port, socket.socket(*kind) as other:
        port.bind(("127.0.0.1", 0))
        for datagram in (b"a frame of another group", b"no frame", b""):
            other.sendto(datagram, port.getsockname())
        only_its_group(SimpleNamespace(_multicast=SimpleNamespace(_socket=port)))
        assert port.getsockopt(socket.IPPROTO_IP, 49) == 0  # IP_MULTICAST_ALL
        with pytest.raises(BlockingIOError):
            port.recv(1, socket.MSG_DONTWAIT)
