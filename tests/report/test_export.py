"""`tautwave export`: every row of an episode, as recorded, in three formats."""

from __future__ import annotations

import csv
import json
import shutil
from array import array
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.report.export import tables
from tautwave.report.export.episodes import episodes
from tautwave.runtime.recorder import Recorder

COLUMNS = ("time_s", "operation.episode", "master.lever.position")
ROWS = [(0.1 * k, float({1: 1, 2: 1, 5: 2, 6: 2, 7: 2}.get(k, 0)), 1.0 / (k + 1)) for k in range(9)]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    recorder = Recorder(
        folder / "recording.mcap", COLUMNS, metadata={}, attachments={}, rows=64, lossless=True,
        rate_hz=10.0,
    )  # fmt: skip
    recorder.start()
    for values in ROWS:
        for at, value in enumerate(values):
            recorder.row[at] = value
        recorder.commit()
    recorder.close()
    episodes = [
        {"number": 1, "name": "pick/../x", "task": "the red one", "success": True},
        {"number": 2, "name": "place", "task": "", "success": None},
    ]
    (folder / "summary.json").write_text(json.dumps({"operation": {"episodes": episodes}}))
    return folder


def export(run: Path, out: Path, *more: str) -> list[str]:
    done = CliRunner().invoke(main, ["export", str(run), "--out", str(out), *more])
    assert done.exit_code == 0, done.output
    return [Path(line).name for line in done.output.split()]


@pytest.mark.parametrize("to", ["csv", "npz"])
def test_what_a_killed_run_lost_is_said(run: Path, tmp_path: Path, to: str) -> None:
    killed = tmp_path / "killed"
    shutil.copytree(run, killed)
    whole = (run / "recording.mcap").read_bytes()
    (killed / "recording.mcap").write_bytes(whole[:-60])
    done = CliRunner().invoke(main, ["export", str(killed), "--to", to])
    assert done.exit_code == 0
    assert done.stderr == (
        f"{killed}: the recording is cut short, as when a run is killed; 9 rows could be "
        "recovered and were exported\n"
    )
    done = CliRunner().invoke(main, ["export", str(run), "--to", to, "--out", str(tmp_path)])
    assert done.stderr == ""


def test_an_episode_is_a_file_and_its_rows_are_those_recorded(run: Path, tmp_path: Path) -> None:
    assert export(run, tmp_path) == ["001-pick-x.csv", "002-place.csv", "episodes.csv"]
    head, *rows = csv.reader((tmp_path / "002-place.csv").read_text().splitlines())
    assert tuple(head) == COLUMNS
    assert [tuple(map(float, row)) for row in rows] == ROWS[5:8]  # to the bit
    index = list(csv.DictReader((tmp_path / "episodes.csv").read_text().splitlines()))
    assert [(one["number"], one["success"], one["rows"], one["task"]) for one in index] == [
        ("1", "true", "2", "the red one"), ("2", "", "3", ""),
    ]  # fmt: skip
    assert [one["begin_s"] for one in index] == ["0.1", "0.5"]


def test_npz_and_parquet_hold_the_same(run: Path, tmp_path: Path) -> None:
    export(run, tmp_path, "--to", "npz", "--columns", "master.lever.position")
    with np.load(tmp_path / "001-pick-x.npz") as arrays:
        assert list(arrays) == ["master.lever.position"]
        assert arrays["master.lever.position"].tolist() == [row[2] for row in ROWS[1:3]]
    parquet = pytest.importorskip("pyarrow.parquet")
    export(run, tmp_path, "--to", "parquet")
    table = parquet.read_table(tmp_path / "002-place.parquet")
    assert table.column("time_s").to_pylist() == [row[0] for row in ROWS[5:8]]


def test_without_a_summary_the_rows_still_say_where_episodes_are(run: Path, tmp_path: Path) -> None:
    (tmp_path / "recording.mcap").write_bytes((run / "recording.mcap").read_bytes())
    assert [(one.name, one.rows) for one in episodes(tmp_path)] == [
        ("episode-1", slice(1, 3)), ("episode-2", slice(5, 8)),
    ]  # fmt: skip
    (tmp_path / "summary.json").write_text("{")
    assert len(episodes(tmp_path)) == 2


@pytest.mark.parametrize(
    ("more", "said"),
    [(("--columns", "time"), "time_s"), (("--to", "xls"), "'parquet'")],
)
def test_bad_input_is_one_sentence(
    run: Path, tmp_path: Path, more: tuple[str, ...], said: str
) -> None:
    out = tmp_path / "new"
    done = CliRunner().invoke(main, ["export", str(run), "--out", str(out), *more])
    assert done.exit_code != 0
    assert "Traceback" not in done.output
    assert said in done.output
    assert not out.exists()


def test_a_table_that_is_there_is_kept(run: Path, tmp_path: Path) -> None:
    (tmp_path / "002-place.csv").write_text("mine")
    done = CliRunner().invoke(main, ["export", str(run), "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "002-place.csv exists" in done.output
    assert (tmp_path / "002-place.csv").read_text() == "mine"
    assert not (tmp_path / "001-pick-x.csv").exists()
    named = ["export", str(run), "--to", "npz", "--out", str(tmp_path / "a.npz")]
    assert "tables go into a directory" in CliRunner().invoke(main, named).output
    assert not (tmp_path / "a.npz").exists()


def test_no_run_is_said(tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["export", str(tmp_path / "none")])
    assert done.exit_code != 0
    assert not (tmp_path / "none").exists()  # nor a folder made
    assert done.output.count("\n") == 1


def test_matlab_gets_structures_and_units(run: Path, tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    export(run, tmp_path, "--to", "mat")
    found = scipy_io.loadmat(tmp_path / "002-place.mat", simplify_cells=True)
    assert found["recording"]["master"]["lever"]["position"].tolist() == [r[2] for r in ROWS[5:8]]
    assert found["units"]["master"]["lever"]["position"] == "rad"
    assert found["units"]["time_s"] == "s"


def test_parquet_knows_its_units(run: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    export(run, tmp_path, "--to", "parquet")
    schema = parquet.read_schema(tmp_path / "001-pick-x.parquet")
    assert schema.field("master.lever.position").metadata[b"unit"] == b"rad"


def test_names_that_matlab_does_not_take_get_others(tmp_path: Path) -> None:
    """Axes may be named so; what MATLAB ignores or takes for the same would be lost."""
    scipy_io = pytest.importorskip("scipy.io")
    long = "x" * 70
    stems = ["_x", "a-b", "a_b", long, f"{long}y", "a", "a.value"]
    columns = ("time_s", *(f"master.{stem}.position" for stem in stems[:-1]),
               "master.a.position.value")  # fmt: skip
    recorder = Recorder(
        tmp_path / "recording.mcap", columns, metadata={}, attachments={}, rows=64, lossless=True,
        rate_hz=10.0,
    )  # fmt: skip
    recorder.start()
    recorder.row[:] = array("d", range(len(columns)))
    recorder.commit()
    recorder.close()
    export(tmp_path, tmp_path / "out", "--to", "mat")
    found = scipy_io.loadmat(tmp_path / "out" / "run.mat", simplify_cells=True)["recording"]
    fields = ["x_x", "a_b", "a_b_2", long[:58], f"{long[:58]}_2"]
    assert [found["master"][one]["position"] for one in fields] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert found["master"]["a"]["position"] == {"value": 6.0, "value_2": 7.0}
    units = scipy_io.loadmat(tmp_path / "out" / "run.mat", simplify_cells=True)["units"]
    assert units["master"]["x_x"]["position"] == "rad"


def test_a_long_run_is_not_in_memory_at_once(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number, block in enumerate((1 << 14, 2)):
        monkeypatch.setattr(tables, "BLOCK", block)
        for to in ("csv", "parquet"):
            export(run, tmp_path / str(number), "--to", to)
    one, two = ((tmp_path / at / "002-place.csv").read_bytes() for at in "01")
    assert one == two
    parquet = pytest.importorskip("pyarrow.parquet")
    files = [parquet.ParquetFile(tmp_path / at / "002-place.parquet") for at in "01"]
    assert [file.num_row_groups for file in files] == [1, 2]
    assert files[0].read().equals(files[1].read())
    monkeypatch.setattr(tables, "LARGEST_MAT", 10)
    done = CliRunner().invoke(main, ["export", str(run), "--to", "mat", "--out", str(tmp_path)])
    assert (done.exit_code, "too much for a MAT file" in done.output) == (2, True)


def test_several_runs_have_a_folder_each(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(run, other)
    export(run, tmp_path / "out", str(other))
    assert (tmp_path / "out" / "other" / "episodes.csv").exists()
    assert (tmp_path / "out" / run.name / "002-place.csv").exists()
    again = ["export", str(run), str(run), "--out", str(tmp_path / "again")]
    assert f"two runs are named {run.name}" in CliRunner().invoke(main, again).output
    assert not (tmp_path / "again").exists()


def test_a_recording_by_itself_is_exported_beside_it(run: Path, tmp_path: Path) -> None:
    shutil.copy(run / "recording.mcap", tmp_path)
    done = CliRunner().invoke(main, ["export", str(tmp_path / "recording.mcap")])
    assert (done.exit_code, len(list((tmp_path / "export").glob("*.csv")))) == (0, 3)
