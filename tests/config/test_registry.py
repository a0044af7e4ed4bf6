"""Entry points: unknown names list the known ones, and a broken plugin is loud."""

from __future__ import annotations

import subprocess
import sys
from importlib import metadata
from importlib.metadata import Distribution, EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import pytest

from tautwave import registry
from tautwave.config import load_rig, parse_rig
from tautwave.errors import ConfigError
from tests.config import plugins

ROOT = Path(__file__).parents[2]


def test_load() -> None:
    assert registry.load_driver("loopback") is plugins.loopback


def test_names() -> None:
    assert registry.driver_names() == ["acme", "halfway", "loopback", "number", "open"]


def test_unknown_driver() -> None:
    with pytest.raises(ConfigError) as caught:
        registry.load_driver("akme")
    assert str(caught.value) == (
        "unknown driver 'akme'; did you mean 'acme'? "
        "Installed: acme, halfway, loopback, number, open"
    )


def test_unknown_simulator() -> None:
    with pytest.raises(ConfigError, match=r"unknown simulator 'zzz'\. Installed: acme"):
        registry.load_simulator("zzz")


def test_a_driver_is_no_simulator() -> None:
    with pytest.raises(ConfigError, match="is not a SimulatorPlugin but of type DriverPlugin"):
        registry.load_simulator("loopback")


def test_none_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "entry_points", lambda: EntryPoints([]))
    with pytest.raises(ConfigError, match="none is installed"):
        registry.load_driver("loopback")


def test_missing_extra_is_named_and_the_cause_kept() -> None:
    with pytest.raises(ConfigError, match=r"pip install 'tautwave\[halfway\]'") as caught:
        registry.load_driver("halfway")
    assert isinstance(caught.value.__cause__, ModuleNotFoundError)


def test_what_is_installed_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A check of a rig looked through all entry points a hundred times, a network's a thousand."""
    asked: list[str] = []

    class Points(EntryPoints):
        def select(self, **wanted: Any) -> EntryPoints:
            asked.append(wanted["group"])
            return super().select(**wanted)

    points = Points([EntryPoint("wave", "tautwave.couplings.wave:plugin", registry.COUPLINGS)])
    monkeypatch.setattr(registry, "entry_points", lambda: points)
    for _ in range(3):
        registry.load_coupling("wave")
        registry.driver_names()
    assert sorted(asked) == [registry.COUPLINGS, registry.DRIVERS]


@pytest.mark.installed
def test_entry_points_are_those_that_importlib_finds() -> None:
    """Files of packages that name no group of ours are not parsed: half of the time."""
    groups = (registry.DRIVERS, registry.SIMULATORS, registry.COUPLINGS, registry.CONTROLS)
    for group in groups:
        wanted = {(point.name, point.value) for point in metadata.entry_points(group=group)}
        assert {
            (one.name, one.value) for one in registry.entry_points().select(group=group)
        } == wanted


class _Foreign(Distribution):
    def read_text(self, filename: str) -> str | None:
        return "Name: acme-teleop\nVersion: 2.1\nProvides-Extra: usb\n"

    def locate_file(self, path: Any) -> Any:
        return path


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("usb", r"pip install 'acme-teleop\[usb\]'"), ("can", r"pip install --upgrade acme-teleop")],
)
def test_remedy_for_a_third_party(name: str, remedy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint(name, "no_such_module:plugin", registry.DRIVERS)
    vars(point)["dist"] = _Foreign()
    monkeypatch.setattr(registry, "entry_points", lambda: EntryPoints([point]))
    with pytest.raises(ConfigError, match=remedy):
        registry.load_driver(name)
    [entry] = registry.list_drivers()
    assert (entry.package, entry.version) == ("acme-teleop", "2.1")


def test_list_survives_broken_plugins() -> None:
    found = {entry.name: entry for entry in registry.list_drivers()}
    assert found["acme"].missing == ("acme_sdk",)
    assert found["acme"].hardware
    assert found["loopback"].missing == ()
    assert not found["loopback"].hardware
    assert "ModuleNotFoundError" in found["halfway"].missing[0]
    assert "is not a DriverPlugin" in found["number"].missing[0]


@pytest.mark.installed
def test_our_own_loopback_is_installed() -> None:
    assert not registry.load_driver("loopback").hardware
    assert registry.load_simulator("loopback").options is registry.load_driver("loopback").options


def test_a_law_that_does_not_load_says_why_with_its_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def points() -> EntryPoints:
        return EntryPoints([EntryPoint("broken", "no_such_module:plugin", registry.COUPLINGS)])

    monkeypatch.setattr(registry, "entry_points", points)
    rig = tmp_path / "rig.yaml"
    rig.write_text("name: bench\ncoupling:\n  law: broken\n  pairs: {}\n")
    with pytest.raises(ConfigError, match=r"rig.yaml:3: coupling.law: coupling 'broken' .*import"):
        load_rig(rig)


@pytest.mark.installed
def test_naming_a_law_imports_nothing_of_it() -> None:
    code = (
        "import sys; from tautwave import registry; registry.load_coupling('wave');"
        "print([name for name in sys.modules if name.startswith('tautwave.couplings.wave.')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.installed
def test_keys_of_other_laws_that_say_nothing_are_read() -> None:
    path = ROOT / "configs" / "bench-1dof-loopback.yaml"
    text = path.read_text().replace(
        "wave_impedance:", "stiffness: null\n      damping: null\n      wave_impedance:"
    )
    assert "stiffness: null" in text
    assert parse_rig(text, path).coupling == load_rig(path).coupling
