"""Files that a bus' options name: found beside the rig file, wherever the command is given."""

from __future__ import annotations

from contextlib import chdir
from importlib.resources import files
from pathlib import Path

import pytest
import yaml

from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError

CONFIGS = Path(__file__).parents[3] / "configs"
GENERIC = files("tautwave_drivers.modbus").joinpath("profiles/generic.yaml").read_text("utf-8")


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A rig in a folder of its own, with a profile beside it."""
    keys = yaml.safe_load((CONFIGS / "bench-modbus-tcp-sim.yaml").read_text())
    keys["buses"]["arm"]["options"]["devices"][0]["profile"] = "./mine.yaml"
    folder = tmp_path / "rig"
    folder.mkdir()
    (folder / "mine.yaml").write_text(GENERIC)
    (folder / "rig.yaml").write_text(yaml.safe_dump(keys))
    return folder / "rig.yaml"


def profile(rig: Rig) -> str:
    found: str = rig.buses["arm"].options["devices"][0]["profile"]
    return found


def test_a_profile_is_found_beside_the_rig_file_from_anywhere(rig: Path, tmp_path: Path) -> None:
    whole = str(rig.parent / "mine.yaml")
    with chdir(tmp_path):
        assert profile(load_rig("rig/rig.yaml")) == whole
        words = "buses.arm.options.devices.0.profile="
        (tmp_path / "here.yaml").write_text(GENERIC)
        here = load_rig("rig/rig.yaml", [words + "here.yaml"])
        assert profile(here) == str(tmp_path / "here.yaml")
        assert profile(load_rig("rig/rig.yaml", [words + "mine.yaml"])) == whole
        assert profile(load_rig("rig/rig.yaml", [words + "generic"])) == "generic"


def test_a_profile_that_is_not_there_is_named_with_its_whole_path(rig: Path) -> None:
    (rig.parent / "mine.yaml").unlink()
    with chdir(rig.parent), pytest.raises(ConfigError) as caught:
        load_rig("rig.yaml")
    assert f"{rig.parent}/mine.yaml: no such file" in str(caught.value)


def test_an_eds_is_found_beside_the_rig_file_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text((CONFIGS / "bench-canopen-virtual.yaml").read_text())
    word = "buses.can.options.nodes.0.eds=drive.eds"
    with pytest.raises(ConfigError, match=f"master.lever: {tmp_path}/drive.eds: no such file"):
        load_rig(path, [word])
    (tmp_path / "drive.eds").write_text("")
    with pytest.raises(ConfigError, match=f"{tmp_path}/drive.eds: not an EDS or DCF file"):
        load_rig(path, [word])
