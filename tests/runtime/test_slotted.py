"""Constants with slots: the same numbers, read by name, all the way down."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.config import load_rig
from tautwave.controller.slotted import slotted
from tautwave.couplings.wave.port import WaveEndParams
from tautwave.rig import command_delays, end_constants
from tests.rigs.row_hashes import ROOT


class Own(NamedTuple):
    """Constants with a method, as a part may bring them."""

    gain: float

    def twice(self) -> float:
        """Return twice the gain."""
        return 2.0 * self.gain


class Outer(NamedTuple):
    """Constants in constants, beside a tuple."""

    own: Own
    lags: tuple[float, ...]


def test_they_are_the_same_numbers_without_a_tuple() -> None:
    """Every field of every level; neither level is a tuple any more."""
    rig = load_rig(ROOT / "configs/bench-1dof-2khz.yaml")
    given = end_constants(rig, "master.lever", command_delays(rig)["master.lever"])
    made = slotted(given)
    assert isinstance(given, WaveEndParams)
    for inner in (given.port, given.observer, given.admittance):
        name = next(name for name in given._fields if getattr(given, name) is inner)
        quick = getattr(made, name)
        assert not isinstance(quick, tuple)
        for field, value in zip(inner._fields, inner, strict=True):
            found = getattr(quick, field)
            if isinstance(value, tuple):
                found = tuple(getattr(found, name) for name in value._fields)
            assert found == value
    assert not isinstance(made, tuple)
    assert made.quantum == given.quantum


def test_constants_with_methods_stay_as_they_are() -> None:
    """A part may give its constants methods, and plain tuples are no constants."""
    given = Outer(Own(1.5), (1.0, 0.5))
    made = slotted(given)
    assert not isinstance(made, tuple)
    assert made.own is given.own
    assert made.own.twice() == 3.0
    assert made.lags is given.lags
