"""Single-point mutations of the sources, each given to the tests that execute its line.

    python -m tests.mutants map                     # once: which test executes which line (minutes)
    python -m tests.mutants run --seed 12 --count 300 --out mutants.jsonl
    python -m tests.mutants run --anywhere --seed 12 --count 60 --out sample.jsonl

A mutant is one change in one place: a comparison, an operator, a constant, a condition, a statement
left out. Folders take turns, so that a small floor gets as many as a large one, and draw with
random numbers of their own: an edit in one floor changes no other's mutants. With `--anywhere` each
place in `src` is as likely as another: a sample that says which share of all is killed.

A mutant is killed when a test fails or hangs. Survivors are printed with file, line and change; one
that changes nothing a test could see is written down in `tests/mutants-equivalent.txt` with the
reason. A run that was stopped continues (`--out` holds what is judged); `--from` and `--only`
choose a part. The map needs `pytest-cov` (extra dev). Mutants live in a copy of the checkout.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from itertools import islice, zip_longest
from pathlib import Path

import pytest

from tests.mutations import Mutant, mutants_of

ROOT = Path(__file__).parents[1]
TREES = ("src", "drivers", "sim")
MAP = ROOT / ".mutants" / "coverage"
MARKED = "not (hardware or vcan or nightly or realtime and slow)"  # of tests
QUIETLY = ("-p", "no:cacheprovider", "--timeout=600")
EQUIVALENT = ROOT / "tests" / "mutants-equivalent.txt"
BUDGET_S = 60.0
"""Tests beyond this much time of their own are left out, the slowest first."""
COMPILE_S = 150.0
"""Beside four times its tests' own time, what a mutant may compute: the kernel may compile anew."""
LIBRARIES = ("matplotlib.figure", "numba", "pydantic", "rich.console", "scipy.signal", "yaml")
"""Imported once and not by every child."""


def drawn(seed: int, count: int) -> list[Mutant]:
    """Return mutants, folder after folder in turn, each module and place as likely as another.

    Each folder has random numbers of its own: an edit in one changes the draw of no other.
    """
    folders: dict[str, list[str]] = {}
    for path in sorted(path for tree in TREES for path in (ROOT / tree).rglob("*.py")):
        where = path.relative_to(ROOT)
        if path.name != "__init__.py":
            folders.setdefault("/".join(where.parts[:-1][:3]), []).append(str(where))
    draws = [draw(f"{seed} {name}", folders[name]) for name in sorted(folders)]
    turns = (mutant for turn in zip_longest(*draws) for mutant in turn if mutant is not None)
    return list(islice(turns, count))


def sample(seed: int, count: int) -> list[Mutant]:
    """Return mutants of `src`, each place in it as likely as another."""
    paths = sorted(path.relative_to(ROOT) for path in (ROOT / "src").rglob("*.py"))
    texts = {str(path): (ROOT / path).read_text(encoding="utf-8") for path in paths}
    every = [one for path, text in texts.items() for one in mutants_of(path, text)]
    return random.Random(seed).sample(every, count)


def draw(seed: str, paths: list[str]) -> Iterator[Mutant]:
    """Yield mutants of these files, none twice, until there are hardly new ones."""
    chance = random.Random(seed)
    every: dict[str, list[Mutant]] = {}
    chosen: set[Mutant] = set()
    for _ in range(1000):
        path = chance.choice(paths)
        if path not in every:
            every[path] = list(mutants_of(path, (ROOT / path).read_text(encoding="utf-8")))
        one = chance.choice(every[path]) if every[path] else None
        if one is not None and one not in chosen:
            chosen.add(one)
            yield one


def make_map(tests: list[str], marked: str) -> int:
    """Run the tests (default: all) once; keep which executes which line, and their times."""
    MAP.parent.mkdir(exist_ok=True)
    environment = os.environ | {"COVERAGE_FILE": str(MAP)}
    command = [sys.executable, "-m", "pytest", "-q", "-m", marked, "--cov-report="]
    command += ["--cov-context=test", *(f"--cov={tree}" for tree in TREES)]
    command += [f"--junit-xml={MAP.with_name('times.xml')}", "-o", "junit_duration_report=call"]
    return subprocess.run([*command, *tests], cwd=ROOT, env=environment, check=False).returncode


def times() -> dict[str, float]:
    """Return how long each test that passed took [s]."""
    from xml.etree import ElementTree

    found = {}
    for case in ElementTree.parse(MAP.with_name("times.xml")).iter("testcase"):
        if any(case.find(how) is not None for how in ("failure", "error", "skipped")):
            continue  # what fails anyway, or is not run, shows nothing
        *where, last = case.get("classname", "").split(".")
        file, of = (where, f"::{last}") if last[:1].isupper() else ([*where, last], "")
        found[f"{'/'.join(file)}.py{of}::{case.get('name')}"] = float(case.get("time", 0.0))
    return found


@cache
def _executed(folder: Path) -> list[tuple[str, str, bytes]]:
    """Return path, test and lines as bits for all modules of a folder."""
    query = (
        "select f.path, c.context, l.numbits from line_bits l join file f on f.id = l.file_id "
        "join context c on c.id = l.context_id where f.path like ? and c.context != ''"
    )
    with sqlite3.connect(f"file:{MAP}?mode=ro", uri=True) as store:
        rows = store.execute(query, (f"{folder}/%.py",)).fetchall()
    return [
        (path, context.split("|")[0], bits)
        for path, context, bits in rows
        if Path(path).parent == folder
    ]


def _naming(path: str, took: dict[str, float]) -> tuple[set[str], set[str]]:
    """Return the tests that name a module, in their files or parameters, or its package."""
    *package, module = Path(path).with_suffix("").parts
    names = ".".join((*package[1:], module)), ".".join(package[-2:])
    found = [{test for test in took if name in _text(test.partition("::")[0])} for name in names]
    found[0] |= {test for test in took if f"[{'/'.join((*package[1:], module))}]" in test}
    return found[0], found[1]


@cache
def _text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def tests_of(mutant: Mutant, took: dict[str, float]) -> list[str]:
    """Return the tests that execute a mutant's line, within the budget, its own floor's first.

    What runs at import is nobody's own, whoever imported it first: it gets the tests that name its
    module or package, after them those that execute anything of it, or of its folder.
    """
    at, bit = divmod(mutant.line, 8)
    path = str(ROOT / mutant.path)
    called = any(
        node.body[0].lineno <= mutant.line <= (node.end_lineno or 0)
        for node in ast.walk(ast.parse((ROOT / mutant.path).read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    )
    line: set[str] = set()
    module: set[str] = set()
    folder: set[str] = set()
    for where, name, bits in _executed(Path(path).parent):
        if name in took:
            folder.add(name)
            if where == path:
                module.add(name)
                if called and at < len(bits) and bits[at] & 1 << bit:
                    line.add(name)
    taken: dict[str, float] = {}
    for names in (line,) if line else (*_naming(mutant.path, took), module, folder):
        for name in sorted(names - set(taken), key=lambda name: (took[name], name)):
            if taken and sum(taken.values()) + took[name] > BUDGET_S:
                break
            taken[name] = took[name]
    rooms = Path(mutant.path).parts
    return sorted(taken, key=lambda name: name.split("/")[1] not in rooms)  # stable


class Judge:
    """A copy of the checkout in which one file at a time is changed and tests run.

    Each mutant's tests run in a child that finds the large libraries imported already.
    """

    def __init__(self, room: Path) -> None:
        self._copy = room / "tree"
        self._judged = 0
        ignore = shutil.ignore_patterns(".git", ".venv", "__pycache__", ".mutants", ".mypy_cache")
        for stale in (self._copy, room / "bytecode" / self._copy.relative_to("/")):
            shutil.rmtree(stale, ignore_errors=True)
        shutil.copytree(ROOT, self._copy, ignore=ignore)
        (room / "shared").unlink(missing_ok=True)
        if (ROOT.parent / "shared").exists():
            (room / "shared").symlink_to(ROOT.parent / "shared")
        trees = [str(self._copy / tree) for tree in TREES]
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        os.environ |= {
            "PYTHONPATH": os.pathsep.join(trees),
            "PYTHONPYCACHEPREFIX": str(room / "bytecode"),
            "NUMBA_CACHE_DIR": str(room / "numba"),
            "OPENBLAS_NUM_THREADS": "1",
        }
        sys.path[:0] = [str(self._copy), *trees]
        sys.dont_write_bytecode, sys.pycache_prefix = False, str(room / "bytecode")
        for name in LIBRARIES:
            importlib.import_module(name)
        for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
            del sys.modules[name]  # the children import the copy's

    def check(self, tests: list[str]) -> None:
        """Run tests on unchanged sources: where these do not pass, everything looks killed.

        Raises
        ------
        SystemExit
            They do not.
        """
        if status := self._run(tests, COMPILE_S):
            raise SystemExit(f"{tests[0]}: does not pass on unchanged sources (pytest: {status})")

    def judge(self, mutant: Mutant, tests: list[str], limit_s: float) -> str:
        """Return `survived`, `killed (how pytest ended)` or `no test`."""
        if not tests:
            return "no test"
        path = self._copy / mutant.path
        kept, stamp = path.read_bytes(), path.stat()
        path.write_bytes(kept[: mutant.start] + mutant.new.encode() + kept[mutant.end :])
        self._judged += 1
        os.utime(path, (self._judged, self._judged))  # bytecode is looked up by whole seconds
        try:
            status = self._run(tests, limit_s)
            return f"killed ({status})" if status else "survived"
        finally:
            path.write_bytes(kept)
            os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))

    def _run(self, tests: list[str], limit_s: float) -> int:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                os.setsid()
                os.chdir(self._copy)
                nowhere = os.open(os.devnull, os.O_RDWR)
                for stream in range(3):
                    os.dup2(nowhere, stream)
                resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(limit_s) + 5))
                code = pytest.main(["-x", "-q", "-n0", "-m", MARKED, *QUIETLY, *tests])
            finally:
                os._exit(code)
        end = time.monotonic() + 10.0 * limit_s
        while True:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                break
            if time.monotonic() > end:
                os.killpg(child, signal.SIGKILL)
            time.sleep(0.05)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # servers whose test was cut short
        return os.waitstatus_to_exitcode(status)


def line_of(mutant: Mutant) -> str:
    """Return the text of a mutant's line."""
    return _text(mutant.path).splitlines()[mutant.line - 1].strip()


def equivalents() -> set[tuple[str, str, str]]:
    """Return path, change and line of what is known to change nothing, whose reason is given."""
    found = set()
    for entry in EQUIVALENT.read_text(encoding="utf-8").split("\n\n")[1:]:
        where, line, *reason = entry.strip().splitlines()
        assert reason, f"{where}: no reason"
        path, _, what = where.partition(": ")
        found.add((path, what, line.strip()))
    return found


def run(mutants: list[Mutant], out: Path, only: tuple[str, ...], first: int) -> int:
    """Judge mutants, a line of JSON each; what `out` holds as killed is not judged again."""
    done = {}
    if out.exists():
        for line in out.read_text(encoding="utf-8").splitlines():
            one = json.loads(line)
            done[tuple(one["mutant"])] = one["verdict"]  # the last word counts
    took, equivalent = times(), equivalents()
    with out.open("a", encoding="utf-8") as kept:
        judge = Judge(MAP.with_name("room"))
        judge.check([min(took, key=lambda name: took[name])])
        for mutant in mutants[first:]:
            judged = done.get(tuple(mutant), "").startswith("killed")
            if judged or not mutant.path.startswith(only):
                continue
            began = time.monotonic()
            tests = tests_of(mutant, took)
            limit_s = COMPILE_S + 4.0 * sum(took[name] for name in tests)
            verdict = judge.judge(mutant, tests, limit_s)
            if verdict == "survived" and (mutant.path, mutant.what, line_of(mutant)) in equivalent:
                verdict = "equivalent"
            done[tuple(mutant)] = verdict
            spent = time.monotonic() - began
            line = {"mutant": mutant, "verdict": verdict, "tests": len(tests), "s": spent}
            kept.write(json.dumps(line) + "\n")
            kept.flush()
            if verdict in ("survived", "no test"):
                print(f"{verdict}: {mutant.path}:{mutant.line}: {mutant.what}", flush=True)
    counted = Counter(verdict.split()[0] for verdict in done.values())
    able = len(done) - counted["equivalent"]
    share = counted["killed"] / max(1, able)
    print(f"{dict(counted)}: {share:.1%} of the {able} that change anything are killed")
    return 0


def main() -> int:
    """Read the command line."""
    form = argparse.RawTextHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("what", choices=("map", "run"))
    parser.add_argument("tests", nargs="*", help="map: only these tests")
    parser.add_argument("--marked", default=MARKED, help="map: tests of this marker expression")
    parser.add_argument("--anywhere", action="store_true", help="run: each place of src alike")
    parser.add_argument("--only", nargs="+", default=[""], help="run: of paths that begin so")
    parser.add_argument("--from", type=int, default=0, dest="first", help="run: leave out so many")
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"))
    given = parser.parse_args()
    if given.what == "map":
        return make_map(given.tests, given.marked)
    mutants = (sample if given.anywhere else drawn)(given.seed, given.count)
    return run(mutants, given.out, tuple(given.only), given.first)


if __name__ == "__main__":
    sys.exit(main())
