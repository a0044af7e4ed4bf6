from pathlib import Path

import numpy as np
import pytest

from tests.report.recordings import Sample, slots, write
from tests.report.synthetic import Columns, make_columns, make_run


@pytest.fixture(scope="session")
def columns() -> Columns:
    """Three seconds of one pair; tests that change it take a copy."""
    return make_columns(rows=3000)


@pytest.fixture(scope="session")
def reported(tmp_path_factory: pytest.TempPathFactory, columns: Columns) -> Path:
    """A whole run with its report written."""
    from tautwave.report import write_report

    directory = tmp_path_factory.mktemp("runs") / "first"
    make_run(directory, columns=columns)
    write_report(directory)
    return directory


@pytest.fixture
def unpainted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made, and not painted: where the words of a page count, it takes a tenth."""
    empty = '<svg xmlns="http://www.w3.org/2000/svg"><title>empty</title></svg>'
    monkeypatch.setattr("tautwave.report.run.parts.svg", lambda *_: empty)


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Sample:
    """A complete file of 2500 rows, its rows, and the rows in one chunk."""
    path = tmp_path_factory.mktemp("sample") / "recording.mcap"
    rows = slots(2500)
    rows[7, 1:5] = np.nan, np.inf, -0.0, 5e-324
    return path, rows, write(path, rows).rows_per_chunk
