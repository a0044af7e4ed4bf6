"""One distribution, typed packages, and entry points that lead somewhere."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from collections import Counter
from importlib.metadata import entry_points, packages_distributions, version
from pathlib import Path

import pytest

import tautwave
from tautwave.contracts import ControlPlugin, CouplingPlugin, DriverPlugin, SimulatorPlugin

ROOT = Path(__file__).parents[2]
PACKAGES = ("tautwave", "tautwave_scenes", "tautwave_drivers", "tautwave_sim")
KNOWN = packages_distributions()
TOP_LEVEL = {"src", "drivers", "sim", "configs", "tests", "docs", "pyproject.toml", "README.md"}
TOP_LEVEL |= {"LICENSE", "CHANGELOG.md", "CONTRIBUTING.md"}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_version_is_the_installed_one() -> None:
    assert version("tautwave") == tautwave.__version__


def test_the_changelog_begins_with_this_version() -> None:
    heading = re.search(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heading is not None
    when = re.fullmatch(rf"\[{re.escape(tautwave.__version__)}\] - (\S+)", heading[1])
    assert when is not None, heading[1]
    assert when[1] == "unreleased" or re.fullmatch(r"\d{4}-\d{2}-\d{2}", when[1])


def test_no_line_of_the_changelog_begins_as_another() -> None:
    """Git unites both sides of it, so a line that two branches changed stands there twice."""
    lines = (ROOT / "CHANGELOG.md").read_text().splitlines()
    beginnings = Counter(line[:45] for line in lines if len(line) >= 45)
    assert {text for text, count in beginnings.items() if count > 1} == set()


def test_released_sections_of_the_changelog_can_be_read() -> None:
    """The section of 0.2.0 once had 340 lines and 62 kB: nobody reads that before an upgrade."""
    _, *released = (ROOT / "CHANGELOG.md").read_text().split("\n## ")[1:]
    assert released, "no released section"
    for section in released:
        heading, *lines = section.splitlines()
        assert len(lines) <= 125, heading
        assert [line for line in lines if len(line) > 170] == [], heading


def test_nothing_else_lies_on_the_top_level() -> None:
    """A redirect gone wrong was committed once as a file with a sentence for a name."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode:
        pytest.skip("not a git checkout")
    there = {name.partition("/")[0] for name in listed.stdout.split("\0") if name}
    assert {name for name in there - TOP_LEVEL if not name.startswith(".")} == set()


@pytest.mark.parametrize("package", PACKAGES)
def test_each_package_is_typed(package: str) -> None:
    module = importlib.import_module(package)
    assert module.__file__ is not None
    assert (Path(module.__file__).parent / "py.typed").is_file()


@pytest.mark.parametrize(
    ("group", "kind"),
    [
        ("tautwave.drivers", DriverPlugin),
        ("tautwave.simulators", SimulatorPlugin),
        ("tautwave.couplings", CouplingPlugin),
        ("tautwave.controls", ControlPlugin),
    ],
)
def test_each_entry_point_is_a_plugin(group: str, kind: type) -> None:
    names = {
        point.name
        for point in entry_points(group=group)
        if point.dist is not None and point.dist.name == "tautwave"
    }
    assert names == set(PROJECT["entry-points"][group])
    for name in names:
        (point,) = entry_points(group=group, name=name)
        assert isinstance(point.load(), kind)


def test_all_holds_every_run_time_extra() -> None:
    extras = PROJECT["optional-dependencies"]
    (spelled,) = extras["all"]
    named = set(re.findall(r"\w+", spelled.partition("[")[2]))
    # sound: a way out where the system has no player; it needs PortAudio of the system.
    # mujoco: for a world of one's own.
    others = {"all", "test", "peers", "dev", "docs", "bench", "sound", "mujoco"}
    assert named == set(extras) - others


@pytest.mark.parametrize("name", tautwave.__all__)
def test_each_public_name_is_there(name: str) -> None:
    assert getattr(tautwave, name) is not None
    assert name in dir(tautwave)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'rnu'"):
        _ = tautwave.rnu


def test_importing_tautwave_imports_nothing_heavy() -> None:
    heavy = {"numpy", "pydantic", "yaml", "rich", "click", "mcap", "matplotlib", "scipy", "numba"}
    code = "import sys, tautwave; print(*{m.partition('.')[0] for m in sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not heavy & set(done.stdout.split())


SOURCES = {"src": (), "sim": (), "drivers/tautwave_drivers": (),
           **{f"drivers/tautwave_drivers/{name}": (name,)
              for name in ("canopen", "dynamixel", "modbus")}}  # fmt: skip
"""Folders, and the only extras that their modules may import, if not any."""


def declared(extras: tuple[str, ...]) -> set[str]:
    """Return the names of the distributions that these extras bring, or all of run time."""
    listed = PROJECT["optional-dependencies"]
    wanted = extras or tuple(set(listed) - {"all", "dev", "docs"})
    lines = [*PROJECT["dependencies"], *(line for name in wanted for line in listed[name])]
    return {re.split(r"[^\w.-]", line)[0].lower().replace("_", "-") for line in lines}


IMPORT = re.compile(r"""^\s*(?:import|from)\ (\w+)|import_module\("(\w+)""", re.MULTILINE)


def imported(folder: str) -> set[str]:
    """Return the top names of all that the modules of a folder import, anywhere in them."""
    texts = [path.read_text() for path in (ROOT / folder).rglob("*.py")]
    names = {one[1] or one[2] for text in texts for one in IMPORT.finditer(text)}
    own = {*PACKAGES, *sys.stdlib_module_names}
    return {name for name in names if name in KNOWN} - own


@pytest.mark.parametrize(("folder", "extras"), SOURCES.items())
def test_what_is_imported_is_declared(folder: str, extras: tuple[str, ...]) -> None:
    brought = declared(extras)
    for name in imported(folder):
        makers = {one.lower().replace("_", "-") for one in KNOWN[name]}
        assert makers & brought, f"{folder} imports {name}, of {makers}, which nothing declares"


def test_what_is_installed_imports_no_tests() -> None:
    for package in ("src", "drivers", "sim"):
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            for node in ast.walk(ast.parse(text)) if "tests" in text else ():
                names = (
                    [node.module or ""]
                    if isinstance(node, ast.ImportFrom) and node.level == 0
                    else [alias.name for alias in node.names]
                    if isinstance(node, ast.Import)
                    else []
                )
                assert not any(name.split(".")[0] == "tests" for name in names), path
