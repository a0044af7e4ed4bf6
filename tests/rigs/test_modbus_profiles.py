"""A copy of a shipped profile, named by its path, is the shipped one: in memory and over a wire."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.types import AxisCommand
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.profile import Profile, Register, Role, load_profile
from tests.rigs.running import Run, run_rig
from tests.rigs.test_modbus_rows import (
    TCP,
    admittance_tree,
    allow_unwatched,
    one_rate_tree,
    tree_of,
)
from tests.sim.modbus.served import served

pytestmark = pytest.mark.realtime

FOLDER = Path(__file__).parents[2] / "drivers" / "tautwave_drivers" / "modbus" / "profiles"


def copied(tmp_path: Path, name: str) -> str:
    return str(shutil.copyfile(FOLDER / f"{name}.yaml", tmp_path / f"my-{name}.yaml"))


def same(one: Run, other: Run) -> list[str]:
    """Columns that differ, but for those of this machine's time."""
    assert one.columns == other.columns
    return [
        name
        for name in one.columns
        if name not in ("lateness_us", "compute_us")
        and not np.array_equal(one[name], other[name], equal_nan=True)
    ]


@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_a_copy_of_generic_gives_the_same_rows(tmp_path: Path, causality: str) -> None:
    runs = []
    for profile in ("generic", copied(tmp_path, "generic")):
        data = tree_of(TCP) if causality == "impedance" else admittance_tree()
        for one in data["buses"]["arm"]["options"]["devices"]:
            one["profile"] = profile
        runs.append(run_rig(data, duration_s=1.0))
    assert same(*runs) == []
    assert np.ptp(runs[0]["slave.lever.position"]) > 0.01


@pytest.mark.parametrize("name", ["dsy-rs", "cia402"])
def test_a_copy_of_the_others_gives_the_same_rows_too(tmp_path: Path, name: str) -> None:
    runs = []
    for profile in (name, copied(tmp_path, name)):
        data = one_rate_tree(profile, rated_torque=1.0)
        runs.append(run_rig(data, duration_s=1.0, change=allow_unwatched))
    assert same(*runs) == []


@pytest.mark.slow
def test_a_copy_of_generic_runs_over_tcp_as_the_name_does(tmp_path: Path) -> None:
    notes = [driven(profile) for profile in ("generic", copied(tmp_path, "generic"))]
    assert notes[0] == notes[1]


def driven(profile: str) -> list[str]:
    """Bring up a drive in a process of its own, turn it, leave it; what the driver notes."""
    axis = AxisSpec("slave.a", 1, "rotary", "impedance", 1.0, 100.0, (-1e3, 1e3))
    bus = BusSpec("arm", (axis,), 100.0)
    clock = MonotonicClock()
    with served("--profile", profile) as reported:
        device = {"unit": 1, "profile": profile, "rated_torque": 1.0}
        options = {"endpoint": reported["endpoint"], "devices": [device]}
        driver = plugin.make(plugin.options.model_validate(options), bus, clock, None)
        driver.open()
        while not driver.enable_step():
            clock.sleep_until(clock.now_ns() + 1_000_000)
        positions = []
        for _ in range(20):
            driver.request()
            (state,) = driver.read(clock.now_ns() + 100_000_000)
            assert state.valid
            positions.append(state.position)
            driver.write([AxisCommand(0.2, 0.0)])
            clock.sleep_until(clock.now_ns() + 10_000_000)
        driver.close()
        assert positions[-1] > positions[0] + 0.1
        assert list(driver.faults()) == []
        # But for how long things took, and what no profile says: how a drive is delivered.
        changing = r"[\d.]+ ms \(measured\)|version of the table \d+|torque_limit \d+"
        return [re.sub(changing, "", note) for note in driver.notes]


# -- what generic.yaml explains ----------------------------------------------------------------


def comments(text: str) -> str:
    return "\n".join(found for found in re.findall(r"#(.*)$", text, re.MULTILINE))


def explained(text: str, key: str) -> bool:
    """Whether a key of the top stands in the file with its comment: above, or beside it."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if not re.match(rf"(# )?{key}:( |$)", line):
            continue
        above = lines[number - 1] if number else ""
        if "#" in line[1:] or (above.startswith("#") and not re.match(r"# \w+:", above)):
            return True
    return False


def inner_models(kind: Any) -> set[type[BaseModel]]:
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        below = (inner_models(one.annotation) for one in kind.model_fields.values())
        return {kind}.union(*below)
    return set().union(*(inner_models(part) for part in getattr(kind, "__args__", ())))


def unexplained(text: str) -> list[str]:
    """Keys of a profile that generic.yaml does not explain."""
    found = [key for key in Profile.model_fields if not explained(text, key)]
    words = set(re.findall(r"\w+", comments(text)))
    for model in inner_models(Profile) - {Profile}:
        keys = {field.alias or name for name, field in model.model_fields.items()}
        found += sorted(f"{model.__name__}.{key}" for key in keys - words)
    found += [
        f"register {key}" for key in Register.model_fields if not re.search(f"#   {key} +", text)
    ]
    roles = re.search(r"^roles:\n((?:  .*\n)+)", text, re.MULTILINE)
    assert roles is not None
    found += [f"roles.{one}" for one in Role.__args__ if f" {one}: " not in roles[1]]
    return found


GENERIC = (FOLDER / "generic.yaml").read_text("utf-8")


def test_generic_explains_every_key() -> None:
    assert unexplained(GENERIC) == []


@pytest.mark.parametrize(
    ("cut", "key"),
    [
        (r"# For the reader only.*\n.*\n", "object_address"),
        (r"# Sentences for users.*\n", "caveats"),
        (r"#   lasting .*\n", "register lasting"),
        (r"  # mode_display.*\n", "roles.mode_display"),
        (r"(?s)# TCP: how many.*?outstanding: 1\n", "outstanding"),
    ],
)
def test_a_key_without_its_comment_is_noticed(cut: str, key: str) -> None:
    assert key in unexplained(re.sub(cut, "", GENERIC, count=1))


def test_examples_that_stand_commented_out_are_right(tmp_path: Path) -> None:
    """Each is put in its place; those of other machines and registers change those too."""
    text = GENERIC.replace("settings: []\n# settings:", "settings:").replace(
        "# object_address:", "object_address:"
    )
    text = text.replace("  control:         {", "  acceleration_time: {address: 50}\n  control: {")
    path = tmp_path / "more.yaml"
    path.write_text(text)
    profile = load_profile(str(path))
    assert profile.object_address is not None
    assert profile.settings[0].mask == 0xFFFF
