"""The waiting is measured of whole processes, and a motion has a before and an after."""

from __future__ import annotations

import click
import pytest

from tests.lab import waiting


def test_a_process_that_fails_is_no_measurement(tmp_path) -> None:
    with pytest.raises(click.ClickException, match="nothing of the kind"):
        waiting.spent(("-c", "import sys; sys.exit('nothing of the kind')"), tmp_path)


def test_medians_are_taken_of_each_figure() -> None:
    found = iter((waiting.Spent(1.0, 9.0), waiting.Spent(3.0, 8.0), waiting.Spent(2.0, 1.0)))
    assert waiting.median(3, lambda: next(found)) == waiting.Spent(2.0, 8.0)


@pytest.mark.slow
def test_a_rig_is_measured() -> None:
    (table,) = waiting.measure(("bench-1dof-2khz",), 1, compiling=False).tables
    (row,) = table.rows
    assert row[0] == "bench-1dof-2khz"
    assert all(isinstance(value, float) and value > 0.0 for value in row[1:7])
    assert row[7:] == [None, None]
