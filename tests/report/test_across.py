"""Figures of sweeps with a column of panels per value: how cases are told apart."""

from __future__ import annotations

from tautwave.report.figures.across import looks_of
from tautwave.sweep.file import Sweep


def sweep(**cases: dict[str, str]) -> Sweep:
    keys = {"name": "delays", "rig": "rig.yaml", "measures": ("stable",), "cases": cases}
    return Sweep.model_validate(keys)


def test_a_sweep_without_cases_has_one_full_line_with_its_name() -> None:
    (look,) = looks_of(sweep()).values()
    assert look.label == "delays"
    assert not look.dashed


def test_a_case_beside_another_has_its_colour_and_a_dashed_line() -> None:
    looks = looks_of(sweep(one={}, two={"label": "second", "beside": "one"}, three={}))
    assert [look.label for look in looks.values()] == ["one", "second", "three"]
    assert [look.dashed for look in looks.values()] == [False, True, False]
    assert looks["one"].colour == looks["two"].colour != looks["three"].colour
