"""The bus between ports: time, arbitration, errors; and its seeded faults."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from tautwave_sim.wire.can import ERROR_FRAME, CanTiming, frame_bits
from tautwave_sim.wire.can_faults import CanFaultPlan, CanFaults
from tautwave_sim.wire.can_medium import CanMedium, MediumPort

Heard = list[tuple[int, int, int, bytes]]
"""Port, arrival, identifier, data."""


def bus(
    faults: Any = None, ports: int = 3, **keys: Any
) -> tuple[CanMedium, list[MediumPort], Heard]:
    heard: Heard = []
    plan = CanFaultPlan(CanFaults.model_validate(faults or {}))
    medium = CanMedium(CanTiming(1_000_000), 0, plan)

    def hear(at: int) -> Any:
        return lambda t, can_id, data: heard.append((at, t, can_id, data))

    made = [medium.port(hear(at), **keys) for at in range(ports)]
    return medium, made, heard


def us(can_id: int, data: bytes = b"") -> int:
    return 1000 * frame_bits(can_id, data)


def test_a_frame_arrives_at_all_others_when_its_bits_are_over() -> None:
    medium, ports, heard = bus()
    ports[1].send(0x123, b"abc")
    end = us(0x123, b"abc")
    assert medium.next_event_ns() == end
    medium.advance(end - 1)
    assert heard == []
    medium.advance(end)
    assert heard == [(0, end, 0x123, b"abc"), (2, end, 0x123, b"abc")]
    assert medium.next_event_ns() is None


def test_the_lowest_identifier_of_those_that_wait_goes_first() -> None:
    medium, ports, heard = bus()
    ports[0].send(0x300, b"")  # has the bus already
    ports[0].send(0x080, b"")
    ports[1].send(0x200, b"")
    ports[2].send(0x100, b"")
    medium.advance(10_000_000)
    seen = [(at, can_id) for at, _, can_id, _ in heard if at != 0]
    assert seen == [(1, 0x300), (2, 0x300), (1, 0x80), (2, 0x80), (1, 0x100), (2, 0x200)]
    ends = sorted({t for _, t, _, _ in heard})
    assert ends[-1] == us(0x300) + us(0x080) + us(0x100) + us(0x200)


def test_frames_of_one_port_keep_their_order() -> None:
    medium, ports, heard = bus(ports=2)
    for can_id in (0x300, 0x200, 0x100):
        ports[0].send(can_id, b"")
    medium.advance(10_000_000)
    assert [can_id for _, _, can_id, _ in heard] == [0x300, 0x200, 0x100]


def test_answers_to_one_frame_compete_before_any_is_sent() -> None:
    medium, ports, heard = bus()
    ports[1].receiver = lambda *_: ports[1].send(0x190, b"")
    ports[2].receiver = lambda t, can_id, _: can_id == 0x80 and ports[2].send(0x181, b"")
    ports[0].send(0x80, b"")
    medium.advance(us(0x80) + us(0x181) + us(0x190))
    assert [can_id for at, _, can_id, _ in heard if at == 0][:2] == [0x181, 0x190]


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=30
    )
)
def test_the_bus_carries_every_frame_once_and_one_at_a_time(
    frames: list[tuple[int, int, bytes]],
) -> None:
    medium, ports, heard = bus()
    seen: list[tuple[int, int, bytes]] = []
    medium.listeners.append(lambda *frame: seen.append(frame))
    for at, can_id, data in frames:
        assert ports[at].send(can_id, data)
    medium.advance(10**9)
    assert sorted(frame[1:] for frame in seen) == sorted(frame[1:] for frame in frames)
    assert len(heard) == 2 * len(frames)
    now = 0
    for t, can_id, data in seen:
        now += us(can_id, data)
        assert t == now


def test_a_full_queue_takes_nothing_more() -> None:
    medium, ports, _ = bus(depth=3)
    assert [ports[0].send(1, b"") for _ in range(5)] == [True, True, True, False, False]
    medium.advance(us(1))
    assert ports[0].send(1, b"")


# -- faults -------------------------------------------------------------------------------------


def one(kind: str, **keys: Any) -> dict[str, Any]:
    return {"events": ({"kind": kind, **keys},)}


def arrivals(
    faults: Any, frames: int = 4, can_id: int = 0x123
) -> tuple[CanMedium, list[int], Heard]:
    medium, ports, heard = bus(faults, ports=2)
    for number in range(frames):
        ports[0].send(can_id, bytes([number]))
    medium.advance(10**9)
    return medium, [data[0] for _, _, _, data in heard], heard


def test_the_nth_frame_is_lost() -> None:
    assert arrivals(one("lost", nth=2))[1] == [0, 2, 3]
    assert arrivals(one("lost", nth=2, times=2))[1] == [0, 3]
    assert arrivals(one("lost", nth=2, can_id=0x124))[1] == [0, 1, 2, 3]


def test_a_lost_sync_is_a_lost_sync_only() -> None:
    assert arrivals(one("sync_lost", nth=2), can_id=0x80)[1] == [0, 2, 3]
    assert arrivals(one("sync_lost", nth=2))[1] == [0, 1, 2, 3]
    assert arrivals({"sync_lost": 1.0}, can_id=0x80)[1] == []
    assert arrivals({"sync_lost": 1.0})[1] == [0, 1, 2, 3]


def test_the_first_frame_from_a_time_on_is_lost() -> None:
    at = (2 * us(0x123, b"\0") + 500) * 1e-9
    assert arrivals(one("lost", at_s=at))[1] == [0, 1, 3]


def test_a_duplicated_frame_arrives_twice() -> None:
    assert arrivals(one("duplicated", nth=2))[1] == [0, 1, 1, 2, 3]


def test_a_delayed_frame_arrives_later_and_others_pass_it() -> None:
    _, order, heard = arrivals({**one("delayed", nth=1), "delay_s": 100e-6})
    assert order == [1, 0, 2, 3]
    assert heard[1][1] == us(0x123, b"\0") + 100_000


def test_a_corrupted_frame_has_one_wrong_bit() -> None:
    _, order, _ = arrivals(one("corrupted", nth=3))
    assert [*order[:2], order[3]] == [0, 1, 3]
    assert (order[2] ^ 2).bit_count() == 1


def test_a_destroyed_frame_is_sent_again_and_counted() -> None:
    medium, order, heard = arrivals(one("error_frame", nth=1), frames=1)
    assert order == [0]
    assert heard[0][1] == 2 * us(0x123, b"\0") + 1000 * ERROR_FRAME
    assert medium.ports[0].errors == 7  # 8 for the failure, 1 back for the success


def test_errors_without_end_make_a_port_passive_and_then_bus_off() -> None:
    medium, ports, heard = bus({"error_frame": 1.0}, ports=2, recovers=False)
    states = []
    ports[0].send(1, b"")
    for _ in range(64):
        medium.advance(medium.next_event_ns() or 0)
        states.append(ports[0].error_state)
    # two events a try: the frame, and the end of its error frame; 8 errors each, 128 and 256
    assert states.index("passive") == 2 * 15
    assert states.index("off") == 2 * 31
    assert states[-1] == "off"
    assert ports[0].errors == 256
    assert not ports[0].send(1, b"")
    assert heard == []


def test_a_device_comes_back_from_bus_off() -> None:
    faults = one("error_frame", at_s=0.0, duration_s=0.01)
    medium, ports, heard = bus(faults, ports=2)
    ports[0].send(1, b"")
    medium.advance(9_000_000)
    assert ports[0].off
    medium.advance(20_000_000)
    ports[1].send(2, b"")
    medium.advance(21_000_000)
    assert heard[-1][2] == 2
    assert ports[0].send(1, b"")


def test_a_bus_that_is_down_carries_nothing() -> None:
    medium, ports, heard = bus()
    ports[0].send(1, b"")
    medium.down = True
    medium.advance(10**6)
    ports[0].send(2, b"")
    medium.advance(2 * 10**6)
    assert heard == []
    medium.down = False
    ports[0].send(3, b"")
    medium.advance(3 * 10**6)
    assert [can_id for at, _, can_id, _ in heard if at == 1] == [3]


@pytest.mark.parametrize("kind", ["lost", "delayed", "duplicated", "corrupted", "error_frame"])
def test_probabilities_are_met_and_seeded(kind: str) -> None:
    def run(seed: int) -> Heard:
        medium, ports, heard = bus({kind: 0.1, "seed": seed}, ports=2)
        for number in range(1000):
            ports[0].send(0x200, number.to_bytes(2, "big"))
        medium.advance(10**10)
        return heard

    first = run(1)
    assert run(1) == first
    assert run(2) != first
    plain = run_plain()
    touched = {
        "lost": 1000 - len(first),
        "duplicated": len(first) - 1000,
        "delayed": sum(a[3] > b[3] for a, b in pairwise(first)),
        "corrupted": len({h[3] for h in plain} ^ {h[3] for h in first}) // 2,
        "error_frame": (first[-1][1] - plain[-1][1]) // us(0x200, b"ab"),
    }[kind]
    assert 60 <= touched <= 160


def run_plain() -> Heard:
    medium, ports, heard = bus(ports=2)
    for number in range(1000):
        ports[0].send(0x200, number.to_bytes(2, "big"))
    medium.advance(10**10)
    return heard


def test_one_kind_of_fault_does_not_shift_another() -> None:
    def lost(faults: dict[str, float]) -> set[bytes]:
        medium, ports, heard = bus(faults, ports=2)
        for number in range(300):
            ports[0].send(0x200, number.to_bytes(2, "big"))
        medium.advance(10**10)
        return {data for _, _, _, data in heard}

    assert lost({"lost": 0.1}) == lost({"lost": 0.1, "delayed": 0.2, "duplicated": 0.2})


@pytest.mark.parametrize("wrong", [{"lost": 1.5}, {"lots": 0.1}, {"events": ({"kind": "gone"},)}])
def test_a_wrong_plan_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        CanFaults.model_validate(wrong)
