"""Everything that a drive could hear or say unasked is off before it is enabled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import canopen
import pytest

from tautwave_drivers.canopen.setup import pdo
from tests.drivers.canopen.foreign import Foreign, foreign
from tests.drivers.canopen.test_eds import dcf, entry
from tests.foreign.cia402 import INVALID, PRODUCT, VENDOR, Key

NO_ACCESS = 0x06010002
FREE = {"sync": False, "rpdo": "event"}


def frames_of(rig: Foreign) -> set[int]:
    """COB-IDs of what the drive sends in some cycles."""
    sent: set[int] = set()
    plain = rig.drive._send

    def note(can_id: int, data: bytes) -> None:
        sent.add(can_id)
        plain(can_id, data)

    rig.drive._send = note
    for _ in range(30):
        rig.cycle(0.05)
    return sent


def on(rig: Foreign) -> list[int]:
    """PDOs of the drive that are on, by the index of their parameters."""
    return sorted(
        index
        for index, sub in rig.drive.values
        if sub == 1 and index in (*range(0x1400, 0x1600), *range(0x1800, 0x1A00))
        and not rig.drive.values[index, 1] & INVALID
    )  # fmt: skip


def test_pdos_beyond_the_four_are_switched_off() -> None:
    rig = foreign(pdos=12, eager=True)
    rig.enable()
    assert on(rig) == [0x1400, 0x1800]
    assert frames_of(rig) == {0x181, 0x701}
    (said,) = [note for note in rig.driver.notes if "switched off" in note]
    assert "RPDO2, RPDO3" in said
    assert "TPDO12" in said
    rig.driver.close()


def far(at: int) -> dict[Key, int]:
    """A PDO far from the others, as a drive of several axes has them."""
    own = {(0x1800 + at, sub): value for sub, value in ((0, 2), (1, 0x1F0), (2, 1))}
    return own | {(0x1A00 + at, 0): 1, (0x1A00 + at, 1): 0x60410010}


@pytest.mark.parametrize(("at", "listed"), [(64, False), (40, True), (40, False)])
def test_pdos_of_other_axes_and_of_the_eds_are_switched_off(
    tmp_path: Path, at: int, listed: bool
) -> None:
    path = tmp_path / "a.eds"
    section = entry("-", name=f"{0x1800 + at:04X}sub1", DefaultValue="0x1F0")
    path.write_text(dcf(section if listed else entry("-", name="1000")))
    rig = foreign(far(at), first={"eds": str(path)})
    rig.driver.open()
    assert (0x1800 + at in on(rig)) == (at == 40 and not listed)
    rig.driver.close()


def stuck(rig: Foreign, which: int) -> None:
    """It refuses to have an object written."""

    def refuse(index: int, subindex: int, **rest: Any) -> None:
        if index == which:
            raise canopen.SdoAbortedError(NO_ACCESS)

    rig.drive.node._write_callbacks.insert(0, refuse)


def test_a_pdo_that_stays_on_is_refused_where_its_id_has_another_use() -> None:
    taken = {(0x1804, 1): 0x181}
    rig = foreign(taken, pdos=8)
    stuck(rig, 0x1804)
    said = rig.refused()
    assert "1804:01 TPDO5 has the COB-ID 0x181, which has another use on this bus" in said
    rig = foreign({(0x1804, 1): 0x1F1}, pdos=8)
    stuck(rig, 0x1804)
    rig.driver.open()
    assert any("TPDO5 stays on" in note for note in rig.driver.notes)
    rig.driver.close()


def test_a_drive_with_hundreds_of_pdos_that_takes_its_time_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pdo, "PROBING_NS", 20_000_000)
    rig = foreign(pdos=60)
    rig.driver.open()
    assert any("to list its PDOs: not all were checked" in note for note in rig.driver.notes)
    rig.driver.close()


@pytest.mark.parametrize("options", [{}, FREE], ids=["sync", "free"])
def test_times_of_our_tpdo_are_ours(options: dict[str, Any]) -> None:
    left = {(0x1800, 3): 100, (0x1800, 5): 7, (0x1800, 6): 3}
    rig = foreign(left, options=options)
    rig.enable()
    held = [rig.drive.value(0x1800, sub) for sub in (3, 5, 6)]
    assert held == [0, 2 if options else 0, 0]
    for _ in range(3):  # until the first sample is in
        rig.cycle()
    valid = [state.valid for _ in range(200) for state in rig.cycle(0.01)]
    assert sum(valid) >= 199
    rig.driver.close()


def test_an_inhibit_time_that_stays_is_refused() -> None:
    rig = foreign({(0x1800, 3): 100}, options=FREE)
    write = rig.drive._written

    def keeps(index: int, subindex: int, data: bytes, **rest: Any) -> None:
        if (index, subindex) != (0x1800, 3):
            write(index, subindex, data, **rest)

    rig.drive.node._write_callbacks[:] = [keeps]
    assert "1800:03 inhibit time is 100 100 us after 0 100 us was written; the drive would" in (
        rig.refused()
    )


def test_a_drive_without_an_event_timer_is_refused_where_it_needs_one() -> None:
    rig = foreign(options=FREE)
    rig.drive.node.object_dictionary[0x1800].subindices.pop(5)
    assert "has no 1800:05: without SYNC a drive has to send by its event timer" in rig.refused()


@pytest.mark.parametrize(
    ("objects", "key", "after"),
    [
        ({(0x1019, 0): 10}, (0x1019, 0), 0),
        ({(0x1012, 0): 0x40000100}, (0x1012, 0), 0x100),
        ({(0x1012, 0): 0x80000100}, (0x1012, 0), 0x80000100),  # it listens, and nobody sends
        ({(0x1005, 0): 0x40000080}, (0x1005, 0), 0x80),
        ({(0x1005, 0): 0x81}, (0x1005, 0), 0x80),
    ],
)
def test_sync_has_no_counter_and_one_master(objects: dict[Key, int], key: Key, after: int) -> None:
    rig = foreign(objects)
    rig.enable()
    assert rig.drive.values[key] == after
    assert all(state.valid for _ in range(20) for state in rig.cycle())
    rig.driver.close()


def test_a_drive_that_counts_sync_and_cannot_be_told_is_refused() -> None:
    rig = foreign({(0x1019, 0): 10}, fixed=frozenset({0x1019}))
    assert "it would wait for a counter, which this master's SYNC does not have" in rig.refused()


@pytest.mark.parametrize(("mute", "loud"), [(5, True), (2, False), (0, False)])
def test_a_loop_that_gets_no_sample_in_most_cycles_says_so(mute: int, loud: bool) -> None:
    rig = foreign(first={"identity": {"vendor": VENDOR, "product": PRODUCT}}, options=FREE)
    rig.enable()
    rig.drive.mute_of = mute
    said = []
    for _ in range(1100):  # two seconds and more
        rig.cycle(0.01)
        said += [fault.text for fault in rig.driver.faults()]
    assert bool(said) == loud, said
    if loud:
        assert said == [
            "master.a1 (node 1): most of the last 500 cycles had no sample, so control is that "
            "much coarser; check the drive's inhibit time, the bus load and answer_share"
        ]
    rig.driver.close()
