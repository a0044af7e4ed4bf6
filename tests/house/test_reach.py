"""Every module of the analysis is reached from a command, and no modules import in a circle."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("tautwave", "tautwave_scenes", "tautwave_drivers", "tautwave_sim")
ROOTS = (
    *("tautwave.cli", "tautwave.certificate.__main__", "tautwave.report.__main__"),
    *("tautwave.couplings", "tautwave_scenes"),
)
"""Commands, the processes that they start, and what they load by name."""

Edges = dict[str, frozenset[str]]


@cache
def edges() -> Edges:
    """Return what every module imports directly, lazily or for types too."""
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    return {m: frozenset(graph.find_modules_directly_imported_by(m)) for m in graph.modules}


def reached(imports: Edges, roots: Iterable[str]) -> set[str]:
    """Return all modules under or above the roots, and what they import."""
    todo = [m for m in imports if any(m == r or m.startswith(f"{r}.") for r in roots)]
    seen: set[str] = set()
    while todo:
        module = todo.pop()
        if module in seen:
            continue
        seen.add(module)
        todo += imports[module]
        if "." in module:
            todo.append(module.rpartition(".")[0])
    return seen


def circles(imports: Edges) -> Iterator[frozenset[str]]:
    """Yield the sets of modules that reach each other."""
    left = dict(imports)
    while left:
        # What imports nothing that is left, or is imported by nothing left, is in no circle.
        wanted = frozenset().union(*left.values())
        gone = [
            m for m, reported in left.items() if not (reported & left.keys()) or m not in wanted
        ]
        if gone:
            for module in gone:
                del left[module]
            continue
        for module in list(left):
            if module not in left:
                continue
            there = behind(left, left[module])
            if module in there:
                ring = frozenset(m for m in there if module in behind(left, left[m]))
                yield ring
                for one in ring:
                    del left[one]
            else:
                del left[module]


def behind(imports: Edges, starts: Iterable[str]) -> set[str]:
    """Return the starts and all that they lead to."""
    seen: set[str] = set()
    todo = list(starts)
    while todo:
        module = todo.pop()
        if module not in seen and module in imports:
            seen.add(module)
            todo += imports[module]
    return seen


def test_every_module_of_the_analysis_is_reached_from_a_command() -> None:
    found = reached(edges(), ROOTS)
    assert "tautwave.analysis.ports.sampled_loop" in found
    analysis = {m for m in edges() if m.startswith("tautwave.analysis.")}
    assert sorted(analysis - found) == []


def defined_and_named(sources: Iterable[str]) -> tuple[set[str], set[str]]:
    """Return public functions of modules, and all names that stand anywhere but in a `def`."""
    defined: set[str] = set()
    named: set[str] = set()
    for source in sources:
        tree = ast.parse(source)
        functions = (n for n in tree.body if isinstance(n, ast.FunctionDef))
        defined |= {n.name for n in functions if not n.decorator_list}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name):
                named.add(node.id)
            elif isinstance(node, ast.Attribute):
                named.add(node.attr)
            elif isinstance(node, ast.alias) and node.asname:
                named.add(node.name)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                named.add(node.value.rpartition(":")[2])  # module:function
    return {name for name in defined if name[0] != "_"}, named


@pytest.mark.slow
def test_every_function_is_named_by_a_source() -> None:
    """Suites for authors are named by whoever has parts."""
    sources = [
        path for folder in ("src", "drivers", "sim") for path in (ROOT / folder).rglob("*.py")
    ]
    texts = [path.read_text() for path in sources if "testing" not in path.parts]
    entries = re.findall(r":(\w+)\"", (ROOT / "pyproject.toml").read_text())
    defined, named = defined_and_named(texts)
    assert defined - named - set(entries) == set()


def test_a_planted_function_nobody_names_is_seen() -> None:
    defined, named = defined_and_named(["def f():\n    g()", "def g(): pass", "LOADED = 'm:h'"])
    assert defined - named == {"f"}
    assert "h" in named


def test_no_modules_import_in_a_circle() -> None:
    assert [sorted(ring) for ring in circles(edges())] == []


def test_a_planted_circle_and_an_orphan_are_seen() -> None:
    planted = {
        "p": frozenset(), "p.a": frozenset({"p.b", "p.d"}), "p.b": frozenset({"p.c"}),
        "p.c": frozenset({"p.a"}), "p.d": frozenset({"p.e"}), "p.e": frozenset[str](),
        "p.f": frozenset({"p.a"}),
    }  # fmt: skip
    assert list(circles(planted)) == [frozenset({"p.a", "p.b", "p.c"})]
    assert reached(planted, ["p.d"]) == {"p", "p.d", "p.e"}
