"""Single-point mutations of the sources, each given to the tests that execute its line.

    python -m tests.mutants map                     # once: which test executes which line (minutes)
    python -m tests.mutants run --seed 12 --count 300 --out mutants.jsonl

A mutant is one change in one place: a comparison, an operator, a constant, a condition, a statement
left out. Folders take turns, so that a small floor gets as many as a large one. A mutant is killed
when a test fails or hangs. Survivors are printed with file, line and change; one that changes
nothing a test could see is written down in `tests/mutants-equivalent.txt` with the reason. The map
needs `pytest-cov` (extra dev). Mutants live in a copy; the checkout is never touched.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
TREES = ("src", "drivers", "sim")
MAP = ROOT / ".mutants" / "coverage"
BUDGET_S = 60.0
"""Tests beyond this much time of their own are left out, the slowest first."""

COMPARE = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
BINARY = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "+",
    ast.BitAnd: "|", ast.BitOr: "&", ast.LShift: ">>", ast.RShift: "<<",
}  # fmt: skip


class Mutant(NamedTuple):
    """One change: `new` in place of the characters from `start` to `end` of a file."""

    path: str
    line: int
    start: int
    end: int
    new: str
    what: str


def mutants_of(path: str, text: str) -> Iterator[Mutant]:
    """Yield every single-point mutation of a source text that a run could see.

    Annotations, docstrings, messages of exceptions and what only type checkers read are left alone.
    """
    tree = ast.parse(text)
    data = text.encode()
    starts = [0]
    for row in data.split(b"\n"):
        starts.append(starts[-1] + len(row) + 1)
    skipped: set[ast.AST] = set()

    def at(line: int, column: int) -> int:
        return starts[line - 1] + column

    def change(node: ast.expr | ast.stmt, new: str, what: str) -> Mutant:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = at(node.lineno, node.col_offset)
        end = at(node.end_lineno, node.end_col_offset)
        return Mutant(path, node.lineno, start, end, new, what)

    def source(node: ast.expr) -> str:
        one = change(node, "", "")
        return data[one.start : one.end].decode()

    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in source(node.test):
            skipped.update(ast.walk(node))
        if isinstance(node, ast.Raise):
            skipped.update(ast.walk(node))
        for field in ("annotation", "returns"):
            if getattr(node, field, None) is not None:
                skipped.update(ast.walk(getattr(node, field)))
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            new = COMPARE[type(node.ops[0])]
            left, right = source(node.left), source(node.comparators[0])
            yield change(node, f"({left}) {new} ({right})", f"comparison becomes {new}")
        elif isinstance(node, ast.BinOp) and type(node.op) in BINARY:
            new = BINARY[type(node.op)]
            yield change(
                node, f"(({source(node.left)}) {new} ({source(node.right)}))", f"becomes {new}"
            )
        elif isinstance(node, ast.BoolOp):
            new = " or " if isinstance(node.op, ast.And) else " and "
            parts = new.join(f"({source(value)})" for value in node.values)
            yield change(node, f"({parts})", f"becomes{new.rstrip()}")
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield change(node, f"({source(node.operand)})", "sign or not is left out")
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, bool):
                yield change(node, str(not node.value), "constant is inverted")
            elif isinstance(node.value, int):
                yield change(node, str(node.value + 1), "constant is one more")
            elif isinstance(node.value, float):
                yield change(node, repr(1.1 * node.value + 0.01), "constant is a tenth more")
        elif isinstance(node, ast.If | ast.While | ast.IfExp):
            yield change(node.test, f"(not ({source(node.test)}))", "condition is negated")
        elif isinstance(node, ast.AugAssign) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        ):
            yield change(node, "pass", "statement is left out")


def drawn(seed: int, count: int) -> list[Mutant]:
    """Return mutants, folder after folder in turn, each module and place as likely as another."""
    chance = random.Random(seed)
    folders: dict[str, list[str]] = {}
    for path in sorted(path for tree in TREES for path in (ROOT / tree).rglob("*.py")):
        where = path.relative_to(ROOT)
        if path.name != "__init__.py":
            folders.setdefault("/".join(where.parts[:-1][:3]), []).append(str(where))
    every: dict[str, list[Mutant]] = {}
    chosen: dict[Mutant, None] = {}  # in order, none twice
    for turn in range(20 * count):
        path = chance.choice(folders[sorted(folders)[turn % len(folders)]])
        if path not in every:
            every[path] = list(mutants_of(path, (ROOT / path).read_text(encoding="utf-8")))
        if every[path]:
            chosen[chance.choice(every[path])] = None
        if len(chosen) == count:
            break
    return list(chosen)


def make_map(tests: list[str]) -> int:
    """Run the tests (default: all) once; keep which executes which line, and their times."""
    MAP.parent.mkdir(exist_ok=True)
    environment = os.environ | {"COVERAGE_FILE": str(MAP)}
    command = [sys.executable, "-m", "pytest", "-q", "--cov-context=test", "--cov-report="]
    command += [f"--cov={tree}" for tree in TREES]
    command += [f"--junit-xml={MAP.with_name('times.xml')}", "-o", "junit_duration_report=call"]
    return subprocess.run([*command, *tests], cwd=ROOT, env=environment, check=False).returncode


def times() -> dict[str, float]:
    """Return how long each test took [s]."""
    from xml.etree import ElementTree

    found = {}
    for case in ElementTree.parse(MAP.with_name("times.xml")).iter("testcase"):
        name = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"
        found[name] = float(case.get("time", 0.0))
    return found


def tests_of(mutant: Mutant, took: dict[str, float]) -> list[str]:
    """Return the tests that execute a mutant's line, the quickest first, within the budget."""
    query = (
        "select c.context, l.numbits from line_bits l join file f on f.id = l.file_id "
        "join context c on c.id = l.context_id where f.path = ?"
    )
    with sqlite3.connect(f"file:{MAP}?mode=ro", uri=True) as store:
        rows = store.execute(query, (str(ROOT / mutant.path),)).fetchall()
    at, bit = divmod(mutant.line, 8)
    names = {
        context.split("|")[0]
        for context, bits in rows
        if context and at < len(bits) and bits[at] & 1 << bit
    }
    if not names:  # executed at import or in a child process: whoever executes the module at all
        names = {context.split("|")[0] for context, _ in rows if context}
    taken, sum_s = [], 0.0
    for name in sorted(names, key=lambda name: took.get(name, 1.0)):
        sum_s += took.get(name, 1.0)
        if taken and sum_s > BUDGET_S:
            break
        taken.append(name)
    return taken


def judge(mutant: Mutant, tests: list[str], copy: Path) -> str:
    """Return `killed`, `survived` or `no test` of one mutant."""
    if not tests:
        return "no test"
    path = copy / mutant.path
    kept = path.read_bytes()
    path.write_bytes(kept[: mutant.start] + mutant.new.encode() + kept[mutant.end :])
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(str(copy / tree) for tree in TREES),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider"]
    try:
        done = subprocess.run(
            [*command, *tests],
            cwd=copy,
            env=environment,
            capture_output=True,
            timeout=6 * BUDGET_S,
            check=False,
        )
        return "survived" if done.returncode == 0 else "killed"
    except subprocess.TimeoutExpired:
        return "killed"
    finally:
        path.write_bytes(kept)


def run(seed: int, count: int, out: Path, only: str) -> int:
    """Judge mutants, a line of JSON each; what `out` holds already is not judged again."""
    done = {}
    if out.exists():
        for line in out.read_text(encoding="utf-8").splitlines():
            one = json.loads(line)
            done[tuple(one["mutant"])] = one["verdict"]
    took = times()
    with tempfile.TemporaryDirectory() as room, out.open("a", encoding="utf-8") as kept:
        copy = Path(room) / "tree"
        ignore = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".mutants", ".mypy_cache")
        shutil.copytree(ROOT, copy, ignore=ignore)
        for mutant in drawn(seed, count):
            if tuple(mutant) in done or not mutant.path.startswith(only):
                continue
            began = time.monotonic()
            verdict = judge(mutant, tests_of(mutant, took), copy)
            done[tuple(mutant)] = verdict
            spent = time.monotonic() - began
            kept.write(json.dumps({"mutant": mutant, "verdict": verdict, "s": spent}) + "\n")
            kept.flush()
            if verdict != "killed":
                print(f"{verdict}: {mutant.path}:{mutant.line}: {mutant.what}", flush=True)
    killed = sum(verdict == "killed" for verdict in done.values())
    print(f"{killed} of {len(done)} killed ({killed / max(1, len(done)):.0%})")
    return 0


def main() -> int:
    """Read the command line."""
    form = argparse.RawTextHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("what", choices=("map", "run"))
    parser.add_argument("tests", nargs="*", help="map: only these tests")
    parser.add_argument("--only", default="", help="run: mutants of paths that begin so")
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"))
    given = parser.parse_args()
    if given.what == "map":
        return make_map(given.tests)
    return run(given.seed, given.count, given.out, given.only)


if __name__ == "__main__":
    sys.exit(main())
