"""What `tautwave link test --rig` says of a rig on the path that was measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.cli.sites import _compliance
from tautwave.config import load_rig

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"


def test_an_offset_is_stated_by_the_law_itself() -> None:
    rig = load_rig(BENCH, ["coupling.pairs.lever.wave_filter_hz=null",
                           "coupling.pairs.lever.pole_master=0.5"])  # fmt: skip
    [line] = _compliance(rig, 0.03)
    impedance = rig.coupling.pairs["lever"].wave_impedance
    said = float(line.split(" offset of ")[1].split()[0])
    assert said == pytest.approx(1e3 * 0.03 / impedance, rel=0.01)
    assert line.endswith("mrad per N m between master and slave")


def test_a_law_without_an_offset_says_nothing() -> None:
    pairs = "{law: pd_damping, pairs: {lever: {stiffness: 2.0, damping: 0.1}}}"
    rig = load_rig(BENCH, [f"coupling={pairs}"])
    assert [line for line in _compliance(rig, 0.02) if "nan" in line] == []
