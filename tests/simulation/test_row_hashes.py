"""Rows of the shipped rigs are those of the commit that `tests/rigs/row_hashes.txt` names."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from tests.rigs.row_hashes import (
    FAST,
    ROOT,
    Case,
    cases,
    difference,
    hashed,
    math_of_this_machine,
    read_kept,
    rig_of,
    rows_of,
)
from tests.rigs.running import run_rig
from tests.simulation.live import COMPILED_APART

pytest.importorskip("numba")
MADE, KEPT = read_kept()
SMALL = [
    case
    for case in cases()
    if case.rig in FAST
    and not case.changes
    and not (case.engine == "compiled" and case.rig in COMPILED_APART)
]


def compare(case: Case) -> None:
    """Where sine and exponential have other bits than where the file was made, rows may too."""
    found = difference(KEPT[case], rows_of(case))
    if found is not None and math_of_this_machine() != MADE:
        pytest.skip(f"C library or NumPy round otherwise here than at the record: {found}")
    assert found is None, f"{case}: {found}; see the docstring of tests/rigs/row_hashes.py"


@pytest.mark.parametrize("case", SMALL, ids=str)
def test_rows_stay_as_they_are(case: Case) -> None:
    compare(case)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        # Of those compiled, which take a minute and more together, the fast rigs' are in `SMALL`.
        pytest.param(case, marks=pytest.mark.nightly if case.engine == "compiled" else ())
        for case in cases()
        if case not in SMALL
    ],
    ids=str,
)
def test_rows_of_every_rig_stay_as_they_are(case: Case) -> None:
    compare(case)


def test_every_case_is_kept() -> None:
    assert list(KEPT) == list(cases())


def test_a_single_bit_shows_and_has_a_name() -> None:
    """The comparison itself can fail: one last bit of one number, a column moved, a row less."""
    case = SMALL[0]
    run = run_rig(rig_of(case), raises=False, duration_s=0.2)
    kept = hashed(run.columns, run.table, None)
    assert difference(kept, hashed(run.columns, run.table, None)) is None
    at = run.columns.index("slave.lever.velocity")
    other = run.table.copy()
    row = int(abs(other[:, at]).argmax())
    other.view("u8")[row, at] ^= 1
    assert "in slave.lever.velocity" in str(difference(kept, hashed(run.columns, other, None)))
    assert "199 rows, was 200" in str(difference(kept, hashed(run.columns, other[:-1], None)))
    turned = [*run.columns[:4], run.columns[5], run.columns[4], *run.columns[6:]]
    assert "another order" in str(difference(kept, hashed(turned, run.table, None)))
    stopped = hashed(run.columns, run.table, RuntimeError("x"))
    assert "ended with RuntimeError" in str(difference(kept, stopped))


LEAKING = ("bench-1dof-2khz", "bench-1dof-loopback", "bench-2axis-loopback", "delay-stability")
LEAKS = """
import sys
from tautwave import load_rig
from tautwave.rig import command_delays
from tautwave.rig.controller import end_constants
for path in sys.argv[1:]:
    rig = load_rig(path)
    for name, delay in command_delays(rig).items():
        print(path, name, end_constants(rig, name, delay).port.leak.hex())
"""


def test_a_leak_has_the_same_bits_without_vector_instructions() -> None:
    """Every row holds it: NumPy's sums and sines on another processor must not change a run."""
    rigs = [str(ROOT / f"configs/{name}.yaml") for name in LEAKING]
    used = " ".join(name for name in __cpu_dispatch__ if __cpu_features__[name])
    plain = {"NPY_DISABLE_CPU_FEATURES": used, "OPENBLAS_CORETYPE": "Prescott"}
    there, here = (
        subprocess.run(
            [sys.executable, "-c", LEAKS, *rigs],
            env=os.environ | more,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for more in (plain, {})
    )
    assert there == here
    assert here.count("0x1.") >= 2 * len(rigs)
