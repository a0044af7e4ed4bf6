"""Every wrong rig file in `wrong/` says exactly what its header expects.

`# expect: ` lines are the complete list of problems, in order; `# set: ` lines are `--set`
arguments.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError, TautwaveError

WRONG = sorted((Path(__file__).parent / "wrong").glob("*.yaml"))


def _header(path: Path, key: str) -> list[str]:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    start = f"# {key}: "
    return [line.removeprefix(start) for line in lines if line.startswith(start)]


@pytest.mark.parametrize("path", WRONG, ids=lambda path: path.stem)
def test_wrong_file_says_all_that_is_wrong(path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(path, _header(path, "set"))
    said = [problem.replace(str(path), path.name) for problem in caught.value.problems]
    expected = _header(path, "expect")
    assert expected
    assert said == expected
    assert str(caught.value) == "\n".join(caught.value.problems)
    assert all(len(problem.splitlines()) == 1 for problem in said)


def test_the_corpus_is_a_corpus() -> None:
    assert len(WRONG) >= 100
    many = [path for path in WRONG if len(_header(path, "expect")) > 3]
    assert len(many) >= 5


def test_config_error_ends_in_exit_code_2() -> None:
    assert issubclass(ConfigError, TautwaveError)
    assert ConfigError("x").exit_code == 2


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: no such file$"):
        load_rig(tmp_path / "nowhere.yaml")
    for name in ("planar", "planar.yaml"):
        with pytest.raises(ConfigError, match="`tautwave example arms/planar` copies it here"):
            load_rig(tmp_path / name)


def test_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="a directory, not a rig file"):
        load_rig(tmp_path)


def test_too_large_file(tmp_path: Path) -> None:
    path = tmp_path / "recording.txt"
    path.write_bytes(b"0.0,0.0\n" * 100_000)
    with pytest.raises(ConfigError, match="larger than 256 KiB, so not a rig file"):
        load_rig(path)


def test_impossible_path() -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        load_rig("a\0b")
