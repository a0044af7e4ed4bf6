"""Nobody's file reaches a parser past the reader of rig files or the guard.

YAML goes through `tautwave.config.text.yaml12` (unique keys, YAML 1.2, no aliases, bounded depth),
what a library parses through `tautwave.config.guard` (size, depth, encoding). What may be parsed
without is listed here, with the reason.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("src/tautwave", "src/tautwave_scenes", "drivers/tautwave_drivers", "sim/tautwave_sim")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))

MODULES = {"yaml", "ruamel", "configparser", "xml", "lxml", "tomllib", "pickle", "marshal",
           "shelve", "plistlib", "dbm"}  # fmt: skip
"""Whose import is a parser of files."""
CALLS = {"json.load", "json.loads", "json.JSONDecoder", "numpy.load", "numpy.loadtxt",
         "numpy.genfromtxt", "canopen.import_od", "canopen.objectdictionary.import_od"}  # fmt: skip
METHODS = {"import_od", "import_eds", "import_epf", "add_node", "safe_load"}
"""Of whatever object: canopen parses files in all of the first four."""

SUSPECT = re.compile(
    rf"\b(?:{'|'.join(MODULES | METHODS | {call.rpartition('.')[2] for call in CALLS})})\b"
)
"""What stands in the text of every reading: a file without it need not be parsed."""

ALLOWED = {
    "src/tautwave/config/text/yaml12.py": {"yaml": 4},  # the reader: PyYAML's events only
    "src/tautwave/config/guard.py": {"json.loads": 1},  # the guard
    "src/tautwave/config/inputs/urdf_text.py": {"xml": 1},  # behind the guard; no document types
    "src/tautwave/sweep/points.py": {"pickle": 1},  # what it pickled itself, in memory
    "src/tautwave/sweep/cluster.py": {"pickle": 1},  # its own, sent as Dask sends all else
    "src/tautwave/motion.py": {"json.loads": 1},  # what it wrote itself, as a key of its cache
    "src/tautwave/runtime/mcap_writer.py": {"json.loads": 1},  # from its parent, over a pipe
    "src/tautwave/runtime/recorder.py": {"json.loads": 1},  # from its child, over a pipe
    "src/tautwave/session/serving.py": {"json.loads": 1},  # the same
    "src/tautwave/session/certified.py": {"json.loads": 1},  # the same
    "src/tautwave/bench/live/child.py": {"json.loads": 1},  # the same
    "src/tautwave/bench/sites/ends.py": {"json.load": 1},  # from its parent, over a pipe
    "src/tautwave/bench/sites/suite.py": {"json.loads": 1},  # from its child, over a pipe
    "src/tautwave/session/sites/desk_line.py": {"json.loads": 1},  # the same
    "src/tautwave/sites/desk.py": {"json.load": 1, "json.loads": 1},  # from its parent
    # Depth is caught there: a recording is read where no rig file is, and stays light.
    "src/tautwave/recordings/recording.py": {"json.loads": 3},
    "src/tautwave/recordings/readers/lerobot.py": {"json.loads": 1},
    "src/tautwave/recordings/readers/arrays.py": {"numpy.load": 1},  # without pickles
    # A dictionary, not a path, is what a node is made of.
    "drivers/tautwave_drivers/canopen/network.py": {"add_node": 1},
}


def readings(source: str) -> Counter[str]:
    """Count what in `source` parses, by the whole names under which it was imported."""
    if not SUSPECT.search(source):
        return Counter()
    tree = ast.parse(source)
    names: dict[str, str] = {}
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names[alias.asname or alias.name.split(".")[0]] = (
                    alias.name if alias.asname else alias.name.split(".")[0]
                )
                found[alias.name.split(".")[0]] += alias.name.split(".")[0] in MODULES
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                names[alias.asname or alias.name] = f"{node.module}.{alias.name}"
            found[node.module.split(".")[0]] += node.module.split(".")[0] in MODULES
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute | ast.Name):
            continue
        whole = dotted(node, names)
        if whole in CALLS:
            found[whole] += 1
        elif isinstance(node, ast.Attribute) and node.attr in METHODS:
            found[node.attr] += 1
    return +found


def dotted(node: ast.expr, names: dict[str, str]) -> str:
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value, names)}.{node.attr}"
    return names.get(node.id, "") if isinstance(node, ast.Name) else ""


def test_files_are_read_through_reader_or_guard() -> None:
    """What is allowed has to be there, too: an entry that nobody needs any more is a hole."""
    found = {str(path.relative_to(ROOT)): readings(path.read_text()) for path in SOURCES}
    assert {path: counted for path, counted in found.items() if counted} == ALLOWED


@pytest.mark.parametrize(
    "line",
    [
        "import yaml",
        "def f():\n    from yaml import safe_load",
        "import json\njson.loads(text)",
        "import json as j\nj.load(file)",
        "from json import loads as read\nread(text)",
        "import json\nparse = json.loads",
        "import xml.etree.ElementTree as ET",
        "from xml.etree import ElementTree",
        "from configparser import RawConfigParser",
        "import tomllib",
        "import canopen\ncanopen.import_od(path)",
        "from canopen import import_od\nimport_od(path)",
        "network.add_node(1, 'drive.eds')",
        "import numpy as np\nnp.load(path)",
    ],
)
def test_a_planted_reading_is_noticed(line: str) -> None:
    assert readings(line)


@pytest.mark.parametrize(
    "line", ["import json\njson.dumps(1)", "from tautwave.config.text.yaml12 import parse_yaml"]
)
def test_what_parses_nothing_is_not(line: str) -> None:
    assert not readings(line)


UNGUARDED = {
    "src/tautwave/bench/live/bridges.py": "its own run",
    "src/tautwave/bench/live/loop.py": "the kernel",
    "src/tautwave/bench/live/viewed.py": "its own run",
    "src/tautwave/bench/result.py": "the kernel",
    "src/tautwave/bench/sites/runs.py": "its own runs",
    "src/tautwave/cli/rigs/new.py": "a shipped example",
    "src/tautwave/cli/terminal/streams.py": "a standard stream",
    "src/tautwave/config/shipped.py": "shipped examples",
    "src/tautwave/registry.py": "what is installed",
    "src/tautwave/report/run/parts.py": "what the report has just drawn",
    "src/tautwave/latency_timer.py": "the kernel",
    "src/tautwave/session/bus_locks.py": "the kernel",
    "src/tautwave/session/calibration/file.py": "files that loading the rig has read",
    "src/tautwave/session/doctor/machine.py": "the kernel",
    "src/tautwave/session/doctor/wires.py": "the kernel",
    "src/tautwave/session/operator.py": "its own run",
    "src/tautwave/session/registration.py": "the kernel",
    "src/tautwave/simulation/kernel/compiled.py": "our own modules",
    "src/tautwave/view/server.py": "our own page",
    "src/tautwave/view/watched.py": "the kernel",
    "src/tautwave_scenes/rig/network.py": "sounds that loading the rig has read",
    "drivers/tautwave_drivers/can/places.py": "the kernel",
    "drivers/tautwave_drivers/can/raw.py": "the kernel",
    "drivers/tautwave_drivers/adapter.py": "the kernel",
    "drivers/tautwave_drivers/modbus/profile.py": "shipped profiles",
    "sim/tautwave_sim/modbus/families.py": "shipped tables",
}
"""Where something is read whole without `tautwave.reading` or the guard, and what it is."""


def reads_whole(source: str) -> bool:
    """Return whether a file is read whole, or opened to be read, by Python's own means."""
    if not re.search(r"\.read_(?:text|bytes)\(|(?<![.\w])open\(", source):
        return False
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        if isinstance(node.func, ast.Attribute) and node.func.attr in ("read_text", "read_bytes"):
            return True
        if isinstance(node.func, ast.Name) and node.func.id == "open":
            mode = node.args[1] if len(node.args) > 1 else ast.Constant("r")
            if not isinstance(mode, ast.Constant) or "r" in str(mode.value):
                return True
    return False


def test_what_a_user_names_is_not_read_whole_unguarded() -> None:
    found = {str(path.relative_to(ROOT)) for path in SOURCES if reads_whole(path.read_text())}
    assert found == set(UNGUARDED)


@pytest.mark.parametrize(
    ("line", "found"),
    [("Path(name).read_text()", True), ("open(name)", True), ("open(name, 'rb')", True),
     ("open(name, 'w')", False), ("read_file(name, 10)", False)],
)  # fmt: skip
def test_a_planted_reading_of_a_whole_file_is_noticed(line: str, found: bool) -> None:
    assert reads_whole(line) is found
