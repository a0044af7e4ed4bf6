"""A load that states one part of its effort has nothing of the others."""

from __future__ import annotations

import pytest

from tautwave.config.keys.load import Load, TrueLoad

PARTS = ("constant", "cosine", "sine")


@pytest.mark.parametrize("kind", [TrueLoad, Load])
def test_what_is_left_out_is_nothing(kind: type[TrueLoad]) -> None:
    assert [getattr(kind(), name) for name in PARTS] == [0.0, 0.0, 0.0]
    for name in PARTS:
        one = kind.model_validate({name: 2.0})
        assert [getattr(one, each) for each in PARTS] == [2.0 * (each == name) for each in PARTS]


def test_a_load_is_carried_and_not_reflected_unless_that_is_said() -> None:
    assert (Load().compensate, Load().reflect_load) == (True, False)
