"""Files of ten families of drives: each makes a rig that is checked and run, or is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tests.commands import keep_in_one_process, tautwave
from tests.foreign.eds_files import FAMILIES

DRIVES = [name for name, family in FAMILIES.items() if not family.refused]


def made(name: str, path: Path) -> str:
    """Make a rig of a family's file; return what was said, with the rig's comments."""
    (path / "drive.eds").write_bytes(FAMILIES[name].make())
    done = tautwave("new", "r.yaml", "--eds", "drive.eds", cwd=path)
    assert done.exit_code == (2 if FAMILIES[name].refused else 0), done.output
    return done.output + ((path / "r.yaml").read_text() if done.exit_code == 0 else "")


@pytest.mark.parametrize("name", FAMILIES)
def test_a_rig_is_made_of_the_file_or_it_is_said_why_not(name: str, tmp_path: Path) -> None:
    family = FAMILIES[name]
    text = made(name, tmp_path)
    for sentence in (*family.said, family.refused):
        assert sentence in text
    assert "Traceback" not in text
    assert (tmp_path / "r.yaml").exists() == (not family.refused)
    if family.refused:
        assert all("drive.eds" in line for line in text.strip().splitlines()), text
        return
    assert "a run refuses the drive" not in text
    (first, second) = load_rig(tmp_path / "r.yaml", choose=False).buses["can"].options["nodes"]
    assert (first["id"], second["id"]) == (1, 2)
    expected = {"tenths of degrees": 3600, "no motor yet": 4096}.get(name, 8192)
    assert first["counts_per_revolution"] == expected
    assert first["rated_torque"] == pytest.approx(0.1 if name == "no motor yet" else 0.64)
    assert f"vendor: 0x{first['identity']['vendor']:X}" in text


@pytest.mark.slow
@pytest.mark.parametrize("name", DRIVES)
def test_the_rig_is_checked_and_run_without_an_edit(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    family = FAMILIES[name]
    made(name, tmp_path)
    done = tautwave("check", "r.yaml", cwd=tmp_path)
    assert done.exit_code == 0, done.output
    words = " ".join(done.output.split())
    for sentence in family.said:
        assert "TODO" in sentence or sentence in words, done.output
    run = ["run", "r.yaml", "--simulate", "--set", "simulation={}", "--clock", "fake"]
    done = tautwave(*run, "--duration", "0.2", "--out", "out", *family.needs, cwd=tmp_path)
    assert done.exit_code == 0, done.output
