"""How long a person waits: import, `check` cold and warm, compiling, before and after a motion.

Every figure is of processes of their own, in turns; the median counts. CPU is that of the process
and its children. Cold: nothing of Python's or numba's is cached.
"""

from __future__ import annotations

import json
import os
import pty
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import click

from tautwave.bench.result import Suite, Table, Value
from tautwave.cli.options import json_option
from tautwave.cli.terminal.measured import print_suites
from tautwave.config.shipped import find_example

RIGS = ("bench-1dof-loopback", "bench-2axis-loopback", "scene-net", "arms/six-seven")
DRAWN_S = 600.0
MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"
STAMPED = """
import json, sys, time
from tautwave.runtime.loop import Loop
from tautwave.cli import main
where = sys.argv.pop()
run = Loop.run
def stamped(self):
    began = time.monotonic()
    try:
        return run(self)
    finally:
        with open(where, "w") as file:
            json.dump([began, time.monotonic()], file)
Loop.run = stamped
main(prog_name="tautwave")  # with the arguments of the process, as on a terminal
"""
"""A run that leaves the times at which its motion began and ended in the file named last."""


class Spent(NamedTuple):
    """What a process took [s]."""

    cpu_s: float
    wall_s: float


def spent(words: Sequence[str], folder: Path, **variables: str) -> Spent:
    """Run Python with these arguments; refuse one that did not do its work."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    wall = time.monotonic() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 3):
        raise click.ClickException(done.stderr.strip() or done.stdout.strip())
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(cpu, wall)


def median(rounds: int, measure: Callable[[], Spent]) -> Spent:
    """Return the medians of several rounds."""
    found = [measure() for _ in range(rounds)]
    return Spent(*(statistics.median(column) for column in zip(*found, strict=True)))


def waits(rig: Path, folder: Path, number: int) -> tuple[float, float, float]:
    """Return the time before a run's motion, from its end to the prompt, and to the report [s].

    On a terminal: there the report is drawn after the prompt.
    """
    stamps, out = folder / f"stamps-{number}.json", folder / f"run-{number}"
    words = ("run", str(rig), "--clock", "fake", "--duration", "1", "--quiet", "--out", str(out))
    main, side = pty.openpty()
    began = time.monotonic()
    with (
        open(main, "rb", buffering=0) as terminal,
        subprocess.Popen(
            [sys.executable, "-c", STAMPED, *words, str(stamps)],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=side,
            stderr=side,
        ) as run,
    ):
        os.close(side)
        printed = b""
        with suppress(OSError):  # of a terminal whose other end was closed
            while said := terminal.read(65536):
                printed += said
        run.wait()
        ended = time.monotonic()
    if run.returncode not in (0, 3):
        raise click.ClickException(printed.decode(errors="replace").strip())
    while not (out / "report.html").exists():
        if time.monotonic() > ended + DRAWN_S:
            raise click.ClickException(f"{rig}: no report within {DRAWN_S:g} s")
        time.sleep(0.01)
    drawn = time.monotonic()
    first, last = json.loads(stamps.read_text())
    return first - began, ended - last, drawn - last


def measure(names: Sequence[str], rounds: int, *, compiling: bool) -> Suite:
    """Measure the waiting for each rig."""
    rows: list[list[Value]] = []
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        loaded = median(rounds, lambda: spent(("-c", "import tautwave.cli"), folder))
        for name in names:
            rig = find_example(f"{name}.yaml").path
            check = ("-c", MAIN, "check", str(rig))
            fresh = {"PYTHONPYCACHEPREFIX": str(folder / "none"), "PYTHONDONTWRITEBYTECODE": "1"}
            cold = spent(check, folder, **fresh)
            warm = median(rounds, lambda check=check: spent(check, folder))
            pairs = [waits(rig, folder, number) for number in range(rounds)]
            times = [statistics.median(side) for side in zip(*pairs, strict=True)]
            row: list[Value] = [name, loaded.cpu_s, cold.cpu_s, warm.cpu_s, *times]
            rows.append([*row, *(_compiled(rig, folder) if compiling else (None, None))])
            for number in range(rounds):
                subprocess.run(["rm", "-rf", str(folder / f"run-{number}")], check=True)
    columns = ("rig", "import_s", "check_cold_s", "check_s", "before_s", "after_s", "report_s")
    table = Table(
        "Waiting",
        "CPU time of import and `check`, with and without compiled bytecode; wall time of a run of "
        "1 s on the fake clock, on a terminal, before its motion, from its end to the prompt "
        "and to the report; CPU time of its first "
        f"compiled simulation and of the next; medians of {rounds}",
        (*columns, "compile_cold_s", "compile_warm_s"),
        rows,
    )
    return Suite("waiting", [table], [])


def _compiled(rig: Path, folder: Path) -> tuple[float | None, float | None]:
    """Return the CPU time of a compiled simulation with and without numba's cache, if it can be."""
    simulated = (
        "import sys; from tautwave import load_rig, simulate; "
        "simulate(load_rig(sys.argv[1]), duration_s=0.01, engine='compiled')"
    )
    with tempfile.TemporaryDirectory(dir=folder) as cache:
        try:
            cold, warm = (
                spent(("-c", simulated, str(rig)), folder, NUMBA_CACHE_DIR=cache).cpu_s
                for _ in range(2)
            )
        except click.ClickException:
            return None, None
    return cold, warm


@click.command(short_help="What a person waits for: import, check, compiling, before and after.")
@click.option("--rig", "names", multiple=True, help="An example's name; may be repeated.")
@click.option("--rounds", type=click.IntRange(1), default=3, show_default=True)
@click.option("--compiling", is_flag=True, help="Compile too: half a minute for each rig.")
@json_option
def waiting(names: tuple[str, ...], rounds: int, compiling: bool, as_json: bool) -> None:
    """Measure what a person waits for: import, check, before and after a run's motion.

    \b
    Example:
        python -m tests.lab waiting --rig bench-1dof-loopback --compiling
    """
    print_suites([measure(names or RIGS, rounds, compiling=compiling)], as_json)
