"""Entry points: unknown names list the known ones, and a broken plugin is loud."""

from __future__ import annotations

from importlib.metadata import Distribution, EntryPoint
from typing import Any

import pytest

from tautwave import registry
from tautwave.errors import ConfigError
from tests.config import plugins


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
    with pytest.raises(ConfigError, match="is no SimulatorPlugin but of type DriverPlugin"):
        registry.load_simulator("loopback")


def test_none_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "entry_points", lambda group: [])
    with pytest.raises(ConfigError, match="none is installed"):
        registry.load_driver("loopback")


def test_missing_extra_is_named_and_the_cause_kept() -> None:
    with pytest.raises(ConfigError, match=r"pip install 'tautwave\[halfway\]'") as caught:
        registry.load_driver("halfway")
    assert isinstance(caught.value.__cause__, ModuleNotFoundError)


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
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])
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
    assert "is no DriverPlugin" in found["number"].missing[0]


@pytest.mark.installed
def test_our_own_loopback_is_installed() -> None:
    assert not registry.load_driver("loopback").hardware
    assert registry.load_simulator("loopback").options is registry.load_driver("loopback").options
