"""Habits of the source that no linter knows, each shown to notice a planted breach."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("src/tautwave", "src/tautwave_scenes", "drivers/tautwave_drivers", "sim/tautwave_sim")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
PURE = sorted(
    path for floor in ("laws", "models") for path in (ROOT / "src/tautwave" / floor).rglob("*.py")
)
PURE_IMPORTS = {"__future__", "math", "typing", "tautwave.types"}
MAX_MODULE = 700  # lines
MAX_FOLDER = 25  # modules beside each other


def found_in(paths: Sequence[Path], look: Callable[[str], Any]) -> dict[str, Any]:
    """Return what `look` finds in each file, by path, where it finds anything."""
    found = {str(path.relative_to(ROOT)): look(path.read_text()) for path in paths}
    return {path: what for path, what in found.items() if what}


def imported(source: str) -> Iterator[str]:
    """Modules that `source` imports, also inside functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module or ""


def impure(source: str) -> set[str]:
    """Imports that a law or a model may not have."""
    return {
        name
        for name in imported(source)
        if name not in PURE_IMPORTS and not name.startswith(("tautwave.laws", "tautwave.models"))
    }


def vague_parts(source: str) -> list[str]:
    """Public functions without a docstring; the module if no docstring in it names a unit."""
    tree = ast.parse(source)
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    documented = [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    texts = [ast.get_docstring(node) or "" for node in (tree, *documented)]
    found = [f.name for f in functions if f.name[0] != "_" and not ast.get_docstring(f)]
    if functions and not re.search(r"\[[^\]]+\]|\bunits?\b|\bSI\b", "\n".join(texts)):
        found.append("units")
    return found


def test_laws_and_models_import_only_arithmetic() -> None:
    assert not found_in(PURE, impure)


@pytest.mark.parametrize(
    "line", ["import os", "def f():\n    from numpy import pi", "import numba"]
)
def test_a_planted_import_is_noticed(line: str) -> None:
    assert impure(line)


def test_laws_and_models_are_documented_with_units() -> None:
    assert not found_in(PURE, vague_parts)


def test_planted_vagueness_is_noticed() -> None:
    assert vague_parts('def wall(x):\n    """Force of the wall."""') == ["units"]
    assert vague_parts('"""In SI units."""\ndef wall(x):\n    return x') == ["wall"]
    assert not vague_parts('def wall(x):\n    """Force of the wall [N]."""')


TESTS = sorted((ROOT / "tests").rglob("*.py"))


def excess_lines(source: str) -> int:
    return max(0, len(source.splitlines()) - MAX_MODULE)


def test_modules_stay_readable() -> None:
    assert not found_in([*SOURCES, *TESTS], excess_lines)


def test_a_planted_long_module_is_noticed() -> None:
    assert excess_lines("pass\n" * (MAX_MODULE + 1))
    assert not excess_lines("pass\n" * MAX_MODULE)


MOST_ARGUMENTS = 8
FULL_OF_FLOATS = {
    "port_close": "a law of the cycle: plain floats, by name",
    "_step_control": "an entry from C: the address of each array",
    "_step_devices": "an entry from C: the address of each array",
}


def crowded(source: str) -> list[str]:
    """Functions with more arguments than a caller keeps in order; options by name do not count."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            given = node.args
            named = zip(given.kwonlyargs, given.kw_defaults, strict=True)
            required = [one for one, default in named if default is None]
            all_of = [*given.posonlyargs, *given.args, *required]
            own = [one for one in all_of if one.arg not in ("self", "cls")]
            if len(own) > MOST_ARGUMENTS:
                found.append(node.name)
    return found


def test_functions_of_the_cycle_take_few_arguments() -> None:
    rooms = ("controller", "couplings", "simulation", "laws")
    paths = sorted(p for room in rooms for p in (ROOT / "src/tautwave" / room).rglob("*.py"))
    found = {name for names in found_in(paths, crowded).values() for name in names}
    assert found == set(FULL_OF_FLOATS)


def test_a_planted_crowd_of_arguments_is_noticed() -> None:
    eight = "a, b, c, d, e, f, g, h"
    assert crowded(f"def exchange({eight}, i): pass") == ["exchange"]
    assert crowded(f"def exchange({eight}, *, i): pass") == ["exchange"]
    assert not crowded(f"class Pair:\n    def exchange(self, {eight}, *, i=0): pass")


def test_nothing_but_the_version_is_taken_from_the_public_face() -> None:
    """`from tautwave import run` inside the package would be an import upwards that nobody sees."""
    modules = {path.stem for path in (ROOT / "src/tautwave").iterdir()}
    taken = {
        f"{path.relative_to(ROOT)}: {alias.name}"
        for path in SOURCES
        if re.search(r"from\s+tautwave\s+import", text := path.read_text())
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and node.module == "tautwave"
        for alias in node.names
        if alias.name not in modules | {"__version__"}
    }
    assert not taken


def test_every_lint_exception_has_its_reason() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    ignores = text.partition("[tool.ruff.lint]")[2].partition("[tool.mypy]")[0]
    for line in ignores.splitlines():
        if re.match(r'\s+"[A-Z]+\d+",', line) or re.match(r'"\S+" = \["[A-Z]', line):
            assert "#" in line, f"no reason beside: {line}"


def hears_all_groups(source: str) -> bool:
    """Whether it opens what may be a bus of UDP multicast, and hears other groups on it."""
    opened = re.findall(r"can\.Bus\((?![^)]*(?:virtual|socketcan)\b)", source)
    return bool(opened) and "only_its_group(" not in source


def test_whoever_opens_a_multicast_bus_keeps_to_its_group() -> None:
    found = found_in([*SOURCES, *sorted((ROOT / "tests").rglob("*.py"))], hears_all_groups)
    without_it, unheard = "sim/tautwave_sim/wire/can_served.py", "canopen/test_on_the_wire.py"
    assert set(found) == {without_it, f"tests/drivers/{unheard}"}


def test_a_planted_listener_to_all_groups_is_noticed() -> None:
    assert hears_all_groups('bus = can.Bus(interface="udp_' + 'multicast", channel=one)')


def full_folders(folders: dict[str, int]) -> list[str]:
    """Folders with more modules beside each other than one takes in at a glance."""
    return sorted(folder for folder, modules in folders.items() if modules > MAX_FOLDER)


def test_no_folder_has_more_modules_than_one_takes_in() -> None:
    modules = [path for path in SOURCES if path.name not in {"__init__.py", "__main__.py"}]
    assert not full_folders(Counter(str(path.parent.relative_to(ROOT)) for path in modules))


def test_a_planted_full_folder_is_noticed() -> None:
    assert full_folders({"src/a": MAX_FOLDER, "src/b": MAX_FOLDER + 1}) == ["src/b"]


MERGED = re.compile(r"---- \w|^ +.*[.;] \w+ : (?:str|int|float|bool|sequence|[A-Z]\w+)\b", re.M)


def merged_entries(source: str) -> list[str]:
    """Lines of docstrings in which the next entry of a section has run into a sentence."""
    if not MERGED.search(source):
        return []
    docs = [
        ast.get_docstring(node) or ""
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node)
    ]
    return [line for doc in docs for line in doc.splitlines() if MERGED.search(line)]


def test_entries_of_a_docstring_have_lines_of_their_own() -> None:
    assert not found_in(SOURCES, merged_entries)


def test_planted_merged_entries_are_noticed() -> None:
    planted = 'def f():\n    """It.\n\n    a : int\n        One. b : int Two.\n    """'
    assert merged_entries(planted) == ["    One. b : int Two."]
    assert merged_entries('class A:\n    """It.\n\n    Parameters ---------- a : int\n    """')
