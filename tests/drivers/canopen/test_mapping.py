"""PDO mappings that a drive has already, has fixed, or has otherwise: read first, then written."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.drivers.canopen.foreign import Foreign, foreign
from tests.foreign.cia402 import Key

CONTROL, TORQUE, MODE = 0x60400010, 0x60710010, 0x60600008
STATUS, POSITION, DISPLAY = 0x60410010, 0x60640020, 0x60610008
TORQUE_ACTUAL, VELOCITY, FILLER = 0x60770010, 0x606C0020, 0x00050008
RPDO, TPDO = 0x1600, 0x1A00
FIXED = frozenset({RPDO, TPDO})


def mapped(received: list[int], sent: list[int]) -> dict[Key, int]:
    found: dict[Key, int] = {}
    for index, words in ((RPDO, received), (TPDO, sent)):
        found |= {(index, at): word for at, word in enumerate(words, 1)}
        found[index, 0] = len(words)
    return found


def works(rig: Foreign) -> str:
    """It runs: torques act, positions come; return its notes on PDOs."""
    rig.enable()
    for _ in range(20):
        before = rig.drive.angle
        (state,) = rig.cycle(0.1)
    assert rig.drive.torque == pytest.approx(0.1, abs=5e-4)
    assert state.valid
    assert state.position == pytest.approx(before, abs=0.003 + 0.004 * rig.drive.speed)
    rig.driver.close()
    assert rig.drive.state == "disabled"
    return "\n".join(note for note in rig.driver.notes if "PDO1 0x" in note)


def mapping_writes(rig: Foreign) -> set[int]:
    return {index for (index, _), _ in rig.drive.written if index in (RPDO, TPDO)}


def test_a_mapping_that_is_as_wanted_is_not_written() -> None:
    held = mapped([CONTROL, TORQUE, MODE], [STATUS, POSITION, DISPLAY])
    for fixed in (FIXED, frozenset[int]()):
        rig = foreign(held, fixed=fixed)
        assert works(rig).count("; already so") == 2
        assert not mapping_writes(rig)


@pytest.mark.parametrize(
    ("received", "sent"),
    [
        ([MODE, CONTROL, TORQUE], [POSITION, STATUS, DISPLAY]),
        ([CONTROL, MODE, TORQUE], [STATUS, DISPLAY, POSITION, FILLER]),
        ([CONTROL, FILLER, TORQUE, FILLER, MODE], [DISPLAY, STATUS, FILLER, POSITION]),
    ],
)
def test_a_fixed_mapping_with_all_of_it_elsewhere_is_taken(
    received: list[int], sent: list[int]
) -> None:
    objects: dict[Key, int] = mapped(received, sent)
    rig = foreign(objects, fixed=FIXED)
    rig.drive.kinds |= {(5, 0): "u1"}
    rig.drive.values[5, 0] = 0
    assert works(rig).count("as the drive has it fixed") == 2


def test_a_fixed_mapping_without_the_mode_is_taken_lean() -> None:
    rig = foreign(mapped([TORQUE, CONTROL], [STATUS, POSITION]), fixed=FIXED)
    said = works(rig)
    assert "as the drive has it fixed (lean: " in said
    assert "already so (lean: " in said


@pytest.mark.parametrize("missing", [0x6060, 0x6061])
def test_a_mode_that_cannot_be_mapped_is_polled(missing: int) -> None:
    rig = foreign(unmappable=frozenset({missing}))
    said = works(rig)
    assert said.count("written and read back (lean: ") == 1
    assert f"{missing:04X}0008" in said or "cannot be mapped to a PDO" in said


@pytest.mark.parametrize(
    ("objects", "more", "first", "words"),
    [
        (
            mapped([CONTROL], [STATUS, POSITION, DISPLAY]),
            {"fixed": FIXED},
            {},
            r"RPDO1 cannot be mapped as 6040 controlword, 6071 target torque, 6060 mode of "
            r"operation; nor as 6040 controlword, 6071 target torque: .*; it has 60400010 .1600:00",
        ),
        (
            mapped([CONTROL, TORQUE, MODE], [STATUS, VELOCITY]),
            {"fixed": FIXED},
            {},
            "TPDO1 cannot be mapped as .*; it has 60410010, 606C0020 .1A00:00",
        ),
        (  # it would be sent a position that nobody meant
            mapped([CONTROL, TORQUE, 0x607A0020], [STATUS, POSITION, DISPLAY]),
            {"fixed": FIXED},
            {},
            "RPDO1 cannot be mapped as .*; it has 60400010, 60710010, 607A0020",
        ),
        (
            {},
            {"unmappable": frozenset({0x6060})},
            {"move": {"position": 0.1, "velocity": 1.0}},
            "RPDO1 cannot be mapped as 6040 controlword, 6071 target torque, 6060 mode of oper",
        ),
        ({}, {"unmappable": frozenset({0x6071})}, {}, "object cannot be mapped to a PDO"),
    ],
)
def test_what_cannot_be_had_is_refused_with_what_the_drive_has(
    objects: dict[Key, int], more: dict[str, Any], first: dict[str, Any], words: str
) -> None:
    sentence = foreign(objects, first=first, **more).refused()
    assert re.search(words, sentence), sentence


def test_lean_of_one_start_is_not_kept_for_the_next() -> None:
    rig = foreign(unmappable=frozenset({0x6061}))
    works(rig)
    rig.drive._unmappable = frozenset()
    rig.drive.angle = rig.drive.speed = 0.0
    rig.driver.notes.clear()
    assert "(lean" not in works(rig)
