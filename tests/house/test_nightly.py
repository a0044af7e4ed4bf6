"""What nightly runs is there: it would be missed a night later only."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
from pathlib import Path

from tests.lab.__main__ import lab

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / ".ci" / "nightly"


def test_nightly_is_a_script_whose_programs_and_tests_are_there() -> None:
    subprocess.run(["bash", "-n", str(SCRIPT)], check=True)
    text = SCRIPT.read_text()
    modules = re.findall(r'"\$python" -m ([\w.]+)', text)
    assert {"tests.lab", "pytest", "tests.drivers.canopen.public_files"} <= set(modules)
    for name in modules:
        assert importlib.util.find_spec(name) is not None, name
    files = re.findall(r"\btests/[\w/]+\.py", text)
    assert files
    for name in files:
        assert (ROOT / name).is_file(), name


def test_each_option_that_nightly_gives_is_taken() -> None:
    for line in re.findall(r"-m tests\.lab (.*)", SCRIPT.read_text()):
        name, *words = line.split()
        taken = {one for each in lab.commands[name].params for one in each.opts}
        assert {word for word in words if word.startswith("--")} <= taken, line


NOT_DEFAULT = {"slow", "nightly", "hardware", "vcan"}


def marks_of_tests(path: Path) -> list[set[str]]:
    """Return what each test of a file is marked with, by its decorators and `pytestmark`."""
    tree = ast.parse(path.read_text("utf-8"))
    named = {
        target.id: _attributes(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    return [
        named.get("pytestmark", set()).union(
            *(_attributes(one) for one in node.decorator_list),
            *(named.get(one.id, set()) for one in node.decorator_list if isinstance(one, ast.Name)),
        )
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]


def _attributes(node: ast.expr) -> set[str]:
    return {one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}


def test_beside_nightly_tests_there_is_a_default_one() -> None:
    """In their file, or in those that its docstring names after `By default`."""
    alone = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        text = path.read_text("utf-8")
        if "mark.nightly" not in text or path == Path(__file__):
            continue
        marks = marks_of_tests(path)
        text = ast.get_docstring(ast.parse(text)) or ""
        others = re.findall(r"`(tests/[\w/]+\.py)`", text.partition("By default")[2])
        for each in others:
            assert (ROOT / each).is_file(), f"{path.name}: {each}"
            marks += marks_of_tests(ROOT / each)
        if all(each & NOT_DEFAULT for each in marks):
            alone.append(str(path.relative_to(ROOT)))
    assert not alone
