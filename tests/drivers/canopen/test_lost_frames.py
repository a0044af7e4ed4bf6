"""Frames that are lost, late, doubled or spoilt cost samples and never a wrong one."""

from __future__ import annotations

from typing import Any

import pytest

from tests.drivers.canopen.benches import Rig, make
from tests.drivers.canopen.faulty import AT_S, CYCLES, TORQUE, leave, started, with_faults


def test_a_lost_tpdo_costs_that_axis_and_that_cycle_only() -> None:
    rig = started(with_faults({"kind": "lost", "at_s": AT_S, "can_id": 0x182}))
    rows, reported = rig.run(CYCLES, TORQUE)
    assert [state.valid for row in rows for state in row[:1]] == [True] * CYCLES
    missing = [at for at, row in enumerate(rows) if not row[1].valid]
    assert len(missing) == 1
    assert missing[0] == pytest.approx(AT_S * 1e3, abs=2)
    assert rows[missing[0]][1].age_ns > 1_000_000
    assert not reported
    leave(rig)


def test_one_lost_tpdo_after_a_long_peace_is_no_silence() -> None:
    # not in a cycle with a heartbeat of the drive, which may delay what comes after the lost one
    rig = started(with_faults({"kind": "lost", "at_s": 0.605, "can_id": 0x182}))
    rows, reported = rig.run(700)  # more cycles than a silent drive is waited for
    assert sum(not row[1].valid for row in rows) == 1
    assert not reported
    assert not rig.driver.notes[-1].startswith("master.a2 (node 2): TPDOs")
    leave(rig)
    assert "master.a2 (node 2): TPDOs 1 missing" in rig.driver.notes


@pytest.mark.parametrize("kind", ["lost", "sync_lost"])
def test_a_lost_sync_costs_one_cycle(kind: str) -> None:
    rig = started(with_faults({"kind": kind, "at_s": AT_S, "can_id": 0x80}))
    rows, _ = rig.run(CYCLES, TORQUE)
    missing = [at for at, row in enumerate(rows) if not all(state.valid for state in row)]
    assert len(missing) == 1
    leave(rig)


def compare_positions(rows: list[list[Any]], expected: list[list[Any]]) -> None:
    """Valid samples are those of a run in which nothing is late."""
    for row, right in zip(rows, expected, strict=True):
        for state, wanted in zip(row, right, strict=True):
            assert not state.valid or state.position == wanted.position


@pytest.mark.sparse(4)
@pytest.mark.parametrize("delay_s", [0.3e-3, 0.9e-3, 1.05e-3, 1.4e-3, 2.0e-3, 2.05e-3])
def test_a_delayed_tpdo_is_never_taken_for_a_new_one(delay_s: float) -> None:
    late = started(with_faults({"kind": "delayed", "at_s": AT_S, "can_id": 0x182}, delay_s=delay_s))
    plain = started(with_faults())
    rows, _ = late.run(100, TORQUE)
    compare_positions(rows, plain.run(100, TORQUE)[0])
    assert sum(not row[1].valid for row in rows) <= 3
    assert all(state.valid for state in rows[-1])
    leave(late)
    leave(plain)


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [1.1e-3, 1.4e-3, 2.0e-3, 2.3e-3, 3.0e-3, 4.05e-3])
def test_when_every_tpdo_is_late_from_now_on_none_is_taken_for_a_new_one(delay_s: float) -> None:
    event = {"kind": "delayed", "at_s": AT_S, "can_id": 0x182, "times": 100_000}
    late, plain = started(with_faults(event, delay_s=delay_s)), started(with_faults())
    rows, _ = late.run(120, TORQUE)
    compare_positions(rows, plain.run(120, TORQUE)[0])
    assert not any(row[1].valid for row in rows[60:])
    others = [row[0].valid for row in rows[60:]]
    assert sum(others) >= 0.85 * len(others)  # a cycle without SYNC now and then, to find out
    late.driver.close()
    leave(plain)


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [2.0e-3, 3.0e-3])
@pytest.mark.parametrize("onset", range(10))
def test_late_by_whole_periods_from_any_cycle_between_two_heartbeats(
    onset: int, delay_s: float
) -> None:
    # The drive's heartbeat, every tenth cycle, may be in the cycle without SYNC: both are taken.
    at_s = AT_S + onset * 1e-3
    event = {"kind": "delayed", "at_s": at_s, "can_id": 0x182, "times": 100_000}
    rig = started(with_faults(event, delay_s=delay_s))
    rows, _ = rig.run(100 + onset, TORQUE)
    first = round(at_s * 1e3)
    assert all(row[1].valid for row in rows[: first - 1])
    assert not any(row[1].valid for row in rows[first + 1 :])  # only old samples come from here on
    rig.driver.close()


@pytest.mark.parametrize("times", [2, 3, 5])
def test_after_several_lost_tpdos_an_axis_comes_back(times: int) -> None:
    event = {"kind": "lost", "at_s": AT_S, "can_id": 0x182, "times": times}
    rig, plain = started(with_faults(event)), started(with_faults())
    rows, _ = rig.run(100, TORQUE)
    compare_positions(rows, plain.run(100, TORQUE)[0])
    assert times <= sum(not row[1].valid for row in rows) <= times + 3
    assert sum(not row[0].valid for row in rows) <= 1
    assert all(state.valid for state in rows[-1])
    leave(rig)
    leave(plain)


@pytest.mark.parametrize("delay_s", [0.1e-3, 0.2e-3])
def test_a_lost_tpdo_on_a_bus_that_has_become_slower_is_got_over(delay_s: float) -> None:
    lost = {"kind": "lost", "at_s": AT_S, "can_id": 0x182}
    slow = {"kind": "delayed", "at_s": AT_S, "can_id": 0x182, "times": 100_000}
    rig, plain = started(with_faults(lost, slow, delay_s=delay_s)), started(with_faults())
    rows, reported = rig.run(100, TORQUE)
    compare_positions(rows, plain.run(100, TORQUE)[0])
    assert 1 <= sum(not row[1].valid for row in rows) <= 4
    assert all(state.valid for state in rows[-1])
    assert not any(fault.fatal for fault in reported)
    leave(rig)
    leave(plain)


def in_peace_then(**faults: float) -> Rig:
    """A rig that was brought up before anything goes wrong.

    Its watchdogs wait for ten heartbeats, not for three: where every tenth frame is lost, two in a
    row often are within a second, 60 ms pass without any, and a drive rightly stops.
    """
    rig = started(with_faults(heartbeat_timeout_ms=200))
    storm = make(with_faults(**faults), mass=0.1).world.world.plan
    rig.world.world.plan.__dict__.update(storm.__dict__)
    return rig


@pytest.mark.slow
def test_one_frame_of_ten_may_be_lost_at_random() -> None:
    rig = in_peace_then(lost=0.1)
    rows, reported = rig.run(1000, TORQUE)
    assert not any(fault.fatal for fault in reported)
    for axis in (0, 1):
        missing = "".join(" " if row[axis].valid else "x" for row in rows)
        assert 0.15 < missing.count("x") / len(rows) < 0.35  # SYNC or TPDO are lost in 0.19
        assert max(map(len, missing.split())) < 15
    rig.driver.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lost", "delayed", "duplicated", "corrupted", "error_frame"])
def test_a_seeded_storm_never_raises_and_repeats_itself(kind: str) -> None:
    def run() -> list[Any]:
        rig = in_peace_then(**{kind: 0.05})
        rows, reported = rig.run(CYCLES, TORQUE)
        rig.driver.close()
        return [rows, [fault.text for fault in reported]]

    one, other = run(), run()
    assert str(one) == str(other)
    lost = sum(not state.valid for row in one[0] for state in row)
    if kind == "lost":
        assert lost > 0


def test_bring_up_survives_lost_frames() -> None:
    rig = make(with_faults(lost=0.02), mass=0.1)
    rig.driver.open()
    assert any("responds to SYNC" in note for note in rig.driver.notes)
    assert rig.clock.now_ns() > 600_000_000  # it waited for more than one answer in vain
    rig.driver.close()
