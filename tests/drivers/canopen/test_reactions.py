"""Option codes 605Ah to 605Eh and the inhibit time of EMCYs, as foreign drives hold them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest

from tautwave_drivers.cia402.reactions import reaction_text
from tests.drivers.canopen.foreign import foreign

ALLOWED = {0x605B: (0, 1), 0x605C: (0, 1), 0x605D: (1, 2, 3, 4), 0x605E: (0, 1, 2, 3, 4)}
OPTIONS = [
    (index, value) for index in ALLOWED for value in (*ALLOWED[index], -1, -32768, 9)
]  # the manufacturer's own and reserved ones at the end


@pytest.mark.parametrize(("index", "value"), OPTIONS)
def test_an_option_code_is_read_said_and_kept(index: int, value: int) -> None:
    rig = foreign({(index, 0): value})
    rig.enable()
    said = reaction_text(index, value)
    assert ("see the drive's manual" in said) == (value not in ALLOWED[index])
    assert f"master.a1 (node 1): {said}" in rig.driver.notes
    rig.driver.close()
    assert not [key for key, _ in rig.drive.written if key[0] == index]


class Loss(NamedTuple):
    """What 6007h and the code that it leads to hold, and whether the drive is watched by that."""

    option: int
    objects: dict[tuple[int, int], int]
    watched: bool
    rig: Mapping[str, Any] = MappingProxyType({})
    fixed: frozenset[int] = frozenset()


QUICK = frozenset({0x605A})
LOSSES = {
    "fault reaction as CiA 402 has it": Loss(1, {(0x605E, 0): 2}, True),
    "fault reaction of the manufacturer": Loss(1, {(0x605E, 0): -1}, False),
    "a reserved fault reaction": Loss(1, {(0x605E, 0): 7}, False),
    "no 605Eh": Loss(1, {}, True),
    "605Eh is not asked": Loss(2, {(0x605E, 0): -1}, True),
    "quick stop that is set": Loss(3, {(0x605A, 0): -5}, True),
    "quick stop that stays the manufacturer's": Loss(3, {(0x605A, 0): -5}, False, {}, QUICK),
    "the manufacturer's, stated in the rig": Loss(
        3, {(0x605A, 0): -5}, True, {"quick_stop_option": -5}
    ),
    "quick stop that stays another": Loss(3, {(0x605A, 0): 6}, True, {}, QUICK),
    "605Ah is not asked": Loss(2, {(0x605A, 0): -5}, True, {}, QUICK),
}


@pytest.mark.parametrize("name", LOSSES)
def test_a_watchdog_that_ends_in_an_unknown_reaction_is_none(name: str) -> None:
    case = LOSSES[name]
    options = {"abort_connection_option": case.option, **case.rig}
    rig = foreign(case.objects, options=options, fixed=case.fixed)
    if case.watched:
        rig.enable()
        assert not rig.driver.unwatched
        rig.driver.close()
    else:
        said = rig.refused()
        assert "would keep following its last command" in said
        ((index, _), value), *_ = case.objects.items()
        assert reaction_text(index, value) in said
        assert "abort_connection_option: 2" in said
        rig = foreign(case.objects, options={"abort_connection_option": 2}, fixed=case.fixed)
        rig.enable()
        rig.driver.close()


@pytest.mark.parametrize(("inhibit", "fixed"), [(0, False), (5000, False), (5000, True)])
def test_emergencies_come_at_once_or_it_is_said(inhibit: int, fixed: bool) -> None:
    rig = foreign({(0x1015, 0): inhibit}, fixed=frozenset({0x1015} if fixed else ()))
    rig.enable()
    said = [note for note in rig.driver.notes if "1015:00" in note]
    assert rig.drive.value(0x1015) == (inhibit if fixed else 0)
    assert bool(said) == bool(inhibit)
    assert any("may be reported 0.5 s late" in note for note in said) == fixed
    rig.driver.close()
    assert rig.drive.value(0x1015) == inhibit, "a loan, given back"
