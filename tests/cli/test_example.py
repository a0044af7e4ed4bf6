"""`tautwave example`: what is shipped is listed, copied whole, and never over a user's file."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from tautwave.config import load_rig, shipped

Cli = Callable[..., Result]
CONFIGS = Path(__file__).parents[2] / "configs"
NAMES = sorted(
    path.relative_to(CONFIGS).with_suffix("").as_posix() for path in CONFIGS.glob("**/*.yaml")
)


def test_every_shipped_file_is_listed_with_a_sentence(tautwave_cli: Cli) -> None:
    listed = json.loads(tautwave_cli("example", "--json").output)
    assert sorted(entry["name"] for entry in listed) == NAMES
    for entry in listed:
        assert entry["summary"].endswith((".", "?")), entry
    table = tautwave_cli("example").output
    assert all(name in table for name in NAMES)


@pytest.mark.sparse(4)
@pytest.mark.parametrize("name", NAMES)
def test_a_copy_holds_all_that_the_file_names(tautwave_cli: Cli, name: str) -> None:
    done = tautwave_cli("example", name)
    assert done.exit_code == 0, done.output
    copied = done.output.split()
    for line in copied:
        assert Path(line).read_bytes() == (CONFIGS / line).read_bytes()
    rigs = [line for line in copied if line.endswith(".yaml") and not line.startswith("sweeps/")]
    assert rigs
    for rig in rigs:
        load_rig(rig)


def test_a_scene_comes_with_its_sound(tautwave_cli: Cli) -> None:
    done = tautwave_cli("example", "scene-granular.yaml", "--out", "new/folder")
    assert done.output.split() == [
        "new/folder/scene-granular.yaml",
        "new/folder/sounds/rattle.wav",
    ]


def test_an_unknown_name_is_a_sentence(tautwave_cli: Cli) -> None:
    done = tautwave_cli("example", "bench-1dof-lopback")
    assert done.exit_code == 2
    assert "did you mean 'bench-1dof-loopback'?" in done.output
    assert "`tautwave example` lists all" in done.output
    assert not os.listdir()


@pytest.mark.parametrize("name", ["", "..", "../pyproject", "/etc/passwd"])
def test_a_path_is_no_name(tautwave_cli: Cli, name: str) -> None:
    assert tautwave_cli("example", name).exit_code == 2
    assert not os.listdir()


def test_what_is_there_is_never_replaced(tautwave_cli: Cli) -> None:
    Path("bench-1dof-loopback.yaml").write_text("mine")
    done = tautwave_cli("example", "sweeps/many-walls")
    assert done.exit_code == 2
    assert "bench-1dof-loopback.yaml: already exists" in done.output
    assert "--out" in done.output
    assert os.listdir() == ["bench-1dof-loopback.yaml"]
    assert Path("bench-1dof-loopback.yaml").read_text() == "mine"


def test_the_same_file_twice_is_no_mistake(tautwave_cli: Cli) -> None:
    assert tautwave_cli("example", "bench-1dof-loopback").exit_code == 0
    done = tautwave_cli("example", "sweeps/many-walls", "--json")
    assert json.loads(done.output) == [
        {"path": "sweeps/many-walls.yaml", "written": True},
        {"path": "bench-1dof-loopback.yaml", "written": False},
    ]


def test_a_folder_that_cannot_be_made_is_a_sentence(tautwave_cli: Cli) -> None:
    Path("file").write_text("")
    done = tautwave_cli("example", "bench-1dof-loopback", "--out", "file/below")
    assert done.exit_code == 2
    assert done.output.startswith("file/below: cannot be")


def test_a_full_disk_ends_with_7_and_leaves_no_half_file(
    tautwave_cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    done = tautwave_cli("example", "bench-1dof-loopback")
    assert done.exit_code == 7
    assert "bench-1dof-loopback.yaml: cannot be written: No space left" in done.output
    assert not os.listdir()


def test_out_without_a_name_is_a_usage_error(tautwave_cli: Cli) -> None:
    assert tautwave_cli("example", "--out", "x").exit_code == 2


def test_an_installation_without_them_says_so(
    tautwave_cli: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    shipped.shipped_folder.cache_clear()
    monkeypatch.setattr(shipped, "SHIPPED", tmp_path / "none")
    monkeypatch.setattr(shipped, "CHECKOUT", tmp_path / "none")
    done = tautwave_cli("example")
    shipped.shipped_folder.cache_clear()
    assert done.exit_code == 2
    assert "reinstall tautwave" in done.output
