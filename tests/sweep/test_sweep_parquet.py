"""A sweep's table as Parquet: types of its own, what it says of itself, the same bytes again."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave import __version__
from tautwave.cli import main
from tautwave.sweep import file as sweep_file
from tautwave.sweep import parquet as sweep_parquet
from tautwave.sweep import runs as sweep_module
from tautwave.sweep.file import load_sweep
from tautwave.sweep.parquet import column_types, type_of, write_parquet
from tautwave.sweep.runs import run_sweep

RIG = Path(__file__).parents[2] / "configs/delay-stability.yaml"
TEXT = f"""\
name: kinds
rig: {RIG}
duration_s: 0.03
cases:
  wave:
    grid: {{coupling.pairs.cart.matched_master: [false, true]}}
  position:
    set: {{coupling.law: position, coupling.pairs.cart: {{stiffness: 1, damping: 10}}}}
    columns:
      coupling.pairs.cart.stiffness: [500, -1]
      coupling.pairs.cart.position_scale: [1, 1.05]
grid:
  seed: [1, 2]
  name: ["a, b", "say \\"c\\""]
  simulation.hand.cart.reference: [{{type: hold, position: 0}}]
measures: [stable, growth_rate, peak_amplitude]
"""


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sweep_file, "CHECKED", 0)  # one stiffness is wrong
    path = tmp_path / "kinds.yaml"
    path.write_text(TEXT)
    return path


def read(path: Path | None) -> Any:
    import pyarrow.parquet as parquet  # type: ignore[import-not-found,import-untyped,unused-ignore]

    assert path is not None
    return parquet.read_table(path)


def test_columns_have_the_types_of_their_values(path: Path, tmp_path: Path) -> None:
    plan = load_sweep(path)
    result = run_sweep(plan, tmp_path / "out")
    found = read(result.parquet)
    assert {name: str(found.schema.field(name).type) for name in found.column_names} == {
        "id": "string",
        "case": "string",
        "seed": "int64",
        "name": "string",
        "simulation.hand.cart.reference": "string",
        "coupling.pairs.cart.matched_master": "bool",
        "coupling.pairs.cart.stiffness": "int64",
        "coupling.pairs.cart.position_scale": "double",
        "outcome": "string",
        "cycles": "int64",
        "stable": "double",
        "growth_rate": "double",
        "peak_amplitude": "double",
    }
    rows = found.to_pylist()
    assert len(rows) == len(plan.points) == 16
    for number, (row, cells) in enumerate(zip(rows, result.rows, strict=True)):
        point_id = plan.points.point_id(number)
        assert (row["id"], row["case"]) == (point_id.id, point_id.case)
        for key in plan.keys:
            if key == "simulation.hand.cart.reference":
                assert json.loads(row[key]) == point_id.values[key]
            else:
                assert row[key] == point_id.values.get(key), key
        refused = point_id.values.get("coupling.pairs.cart.stiffness") == -1
        assert row["outcome"].startswith("refused: " if refused else "finished")
        assert row["cycles"] == (0 if refused else 30)
        for name in plan.sweep.measures:
            if refused:
                assert row[name] is None  # nothing was simulated
            else:
                assert row[name].hex() == float(cells[name]).hex()
    assert any(row["growth_rate"] is not None and math.isnan(row["growth_rate"]) for row in rows)


def test_a_file_says_where_it_is_from(path: Path, tmp_path: Path) -> None:
    result = run_sweep(load_sweep(path), tmp_path / "out")
    about = {
        key.decode(): text.decode() for key, text in read(result.parquet).schema.metadata.items()
    }
    assert about["tautwave.version"] == __version__
    assert about["tautwave.rig"] == str(RIG)
    reported = json.loads(about["tautwave.sweep"])
    assert reported["grid"]["seed"] == [1, 2]
    assert reported["cases"]["position"]["columns"]["coupling.pairs.cart.stiffness"] == [500, -1]
    assert json.loads(about["tautwave.varied"])[0] == "seed"
    assert json.loads(about["tautwave.measures"]) == ["stable", "growth_rate", "peak_amplitude"]


def test_a_resumed_sweep_has_the_same_file(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run_sweep(load_sweep(path), tmp_path / "whole")
    assert whole.parquet is not None
    real, left = sweep_module.simulate_point, [5]

    def stopped(*arguments: Any) -> Any:
        if left[0] == 0:
            raise KeyboardInterrupt
        left[0] -= 1
        return real(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(sweep_module, "simulate_point", stopped)
        first = run_sweep(load_sweep(path), tmp_path / "out")
    assert first.interrupted
    assert first.parquet is None
    assert not (tmp_path / "out/points.parquet").exists()
    table = tmp_path / "out/points.csv"
    lines = table.read_text().splitlines(keepends=True)
    table.write_text(lines[0] + "".join(reversed(lines[1:])))  # as a pool may have left it
    second = run_sweep(load_sweep(path), tmp_path / "out")
    assert second.resumed == 5
    assert second.parquet is not None
    assert second.parquet.read_bytes() == whole.parquet.read_bytes()
    assert not list((tmp_path / "out").glob("*.part"))


def test_no_type_is_guessed_from_the_first_rows(tmp_path: Path) -> None:
    """A reader that guesses takes the whole numbers of a first megabyte for a type."""
    table = tmp_path / "points.csv"
    count = 40_000
    with table.open("w", newline="") as file:
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(["id", "case", "key", "outcome", "cycles", "peak_amplitude"])
        for at in range(count - 1):
            lines.writerow([f"{at:016x}", "", "5", "finished", "10000", "" if at < 9 else "0.0"])
        lines.writerow([f"{count:016x}", "last", "5.5", "refused: a, b", "0", "1e-300"])
    assert table.stat().st_size > 1_500_000
    types = {"id": "string", "case": "string", "key": "double", "outcome": "string"}
    types |= {"cycles": "int64", "peak_amplitude": "double"}
    found = read(write_parquet(table, types, {"a": "b"}))
    assert found.num_rows == count
    assert found.slice(count - 1).to_pylist() == [
        {
            "id": f"{count:016x}",
            "case": "last",
            "key": 5.5,
            "outcome": "refused: a, b",
            "cycles": 0,
            "peak_amplitude": 1e-300,
        }
    ]
    assert found["peak_amplitude"].null_count == 9


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1, 2], "int64"),
        ([1, 2.5], "double"),
        ([1.0], "double"),
        ([2**63], "string"),
        ([True, False], "bool"),
        ([True, 1], "string"),
        (["a"], "string"),
        ([None, 1.0], "string"),
        ([[1.0]], "string"),
    ],
)
def test_a_type_holds_all_values_of_a_key(values: list[Any], expected: str) -> None:
    assert type_of(values) == expected


def test_without_pyarrow_a_sentence_says_what_to_install(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        assert name == "pyarrow"

    find: Callable[[str], None] = missing
    monkeypatch.setattr(sweep_parquet, "find_spec", find)
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["sweep", str(path), "--out", str(out), "--jobs", "1"])
    assert done.exit_code == 0, done.output
    assert "No Parquet file: it requires pyarrow (pip install 'tautwave[parquet]')." in done.stdout
    assert (out / "points.csv").is_file()
    assert not (out / "points.parquet").exists()


def test_all_columns_have_a_type(path: Path) -> None:
    plan = load_sweep(path)
    header = sweep_module.table_header(plan)
    assert list(column_types(plan, header)) == header
