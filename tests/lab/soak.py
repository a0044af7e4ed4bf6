"""A long run with everything beside it and random faults, and many short runs: what stays, grows.

The long one is a pair at 1 kHz on the real clock with a synthetic camera, every bridge that is
installed, and a pair of two sites on this machine beside it. Faults are drawn from a list by a seed
and never touch the run itself: it has to account for each of its rows, whatever they do.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import click

from tautwave.bench.live.bridges import CLI, beside, cameras_beside, installed
from tautwave.bench.live.viewed import SETS
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.bench.rigs import ONE_PAIR
from tautwave.bench.sites.runs import grown, run_sites
from tautwave.cli.options import json_option
from tautwave.cli.terminal.measured import print_suites
from tautwave.config import resolved_yaml
from tautwave.runtime.tap import LIVE
from tautwave.session.running import run as run_rig
from tests.lab.kept import append_option, append_suites
from tests.lab.strangers.crowd import KINDS

FAULT_S = 5.0
"""Mean time between two faults [s]."""
BEGIN_S, PAGE_S = 120.0, 60.0
SETTLED = 0.2
"""Share of the time after which memory is expected to stay."""
LINK_HZ = 1000.0
LINK_SHARE = 0.8
"""Of the time, in which the two sites run."""
SHORT_S = 0.1
WARM = 3
"""Short runs after which nothing more is loaded for the first time."""
MEGABYTE = 1e6


class Held(NamedTuple):
    """What processes hold: memory [MB], descriptors, threads, children."""

    memory_mb: float
    descriptors: int
    threads: int
    children: int


def held(pid: int) -> Held:
    """Return what a process holds, its children's memory not counted."""
    root = Path(f"/proc/{pid}")
    tasks = list(root.glob("task/*"))
    children = [one for task in tasks for one in (task / "children").read_text().split()]
    pages = int((root / "statm").read_text().split()[1])
    memory = pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
    return Held(memory, len(list((root / "fd").iterdir())), len(tasks), len(children))


class Leftovers:
    """Temporary files and shared memories that appear while it is there, and stay.

    All processes that are started meanwhile put their temporary files into its folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir()
        self._shared = self._of_us()

    def _of_us(self) -> set[str]:
        return {one.name for one in Path("/dev/shm").glob("*tautwave*")}

    def __enter__(self) -> Leftovers:
        os.environ["TMPDIR"] = str(self._folder)
        return self

    def __exit__(self, *exc: object) -> None:
        del os.environ["TMPDIR"]

    def count(self) -> int:
        """Return how many there are."""
        return len(list(self._folder.iterdir())) + len(self._of_us() - self._shared)


# -- one long run -----------------------------------------------------------------------------


class Beside(NamedTuple):
    """What faults may do something to: a run's directory, its page and viewers, and where."""

    out: Path
    page: str
    viewers: Sequence[int]
    folder: Path
    keys: Path
    draw: random.Random


def stop_a_viewer(it: Beside) -> None:
    """Stop one for two seconds, as a suspended terminal does."""
    viewer = it.draw.choice(it.viewers)
    os.kill(viewer, signal.SIGSTOP)
    time.sleep(2.0)
    os.kill(viewer, signal.SIGCONT)


def open_pages(it: Beside) -> None:
    """Open five pages, and close them without a word."""
    from websockets.sync.client import connect

    where = urlsplit(it.page).netloc
    pages = [
        connect(f"ws://{where}/live", origin=f"http://{where}", compression=None, max_size=None)  # type: ignore[arg-type]
        for _ in range(5)
    ]
    for page in pages:
        page.recv(30.0)
        page.socket.close()


def look(it: Beside) -> None:
    """Look from a terminal."""
    _tautwave("view", str(it.out), "--json")


def export(it: Beside) -> None:
    """Export what there is of the recording."""
    out = it.folder / "export"
    _tautwave("export", str(it.out), "--to", "csv", "--out", str(out))
    rmtree(out)


def strangers_come(it: Beside) -> None:
    """Have ten strangers at the page for three seconds."""
    port = str(urlsplit(it.page).port)
    kind = it.draw.choice(sorted(KINDS))
    words = [port, kind, "10", "own", str(it.keys)]
    crowd = subprocess.Popen(
        [sys.executable, "-m", "tests.lab.strangers.crowd", *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        assert crowd.stdout is not None
        if crowd.stdout.readline() != b"here\n":
            raise RuntimeError("the strangers did not come")
        time.sleep(3.0)
    finally:
        crowd.kill()
        crowd.communicate()


def load(it: Beside) -> None:
    """Keep a core busy for two seconds, at normal priority."""
    code = "import time\nend = time.monotonic() + 2\nwhile time.monotonic() < end: pass"
    subprocess.run([sys.executable, "-c", code], check=True)


FAULTS: Sequence[Callable[[Beside], None]] = (
    stop_a_viewer, open_pages, look, export, strangers_come, load,
)  # fmt: skip


def _tautwave(*words: str) -> None:
    done = subprocess.run([*CLI, *words], capture_output=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.decode(errors="replace").strip()[-200:])


@contextmanager
def _running(folder: Path, minutes: float) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """Give a run that has begun, and its directory."""
    out, rig = folder / "run", folder / "rig.yaml"
    rig.write_text(resolved_yaml(ONE_PAIR.load()), encoding="utf-8")
    sets = [word for one in SETS for word in ("--set", one)]
    words = ("run", str(rig), *sets, "--duration", str(60.0 * minutes), "--out", str(out))
    run = subprocess.Popen([*CLI, *words, "--quiet"], stdout=subprocess.DEVNULL)
    try:
        until = time.monotonic() + BEGIN_S
        while not (out / LIVE).exists():
            if run.poll() is not None or time.monotonic() > until:
                raise click.ClickException("the run did not begin")
            time.sleep(0.1)
        yield run, out
    finally:
        run.kill()
        run.wait()


class _Sites(threading.Thread):
    """Two sites that run beside, and what they measured."""

    def __init__(self, minutes: float) -> None:
        super().__init__()
        self._seconds = 60.0 * minutes * LINK_SHARE
        self.found: list[dict[str, Any]] = []
        self.why = ""

    def run(self) -> None:
        """Run them to their end."""
        try:
            self.found = run_sites(self._seconds, LINK_HZ)
        except Exception as err:  # noqa: BLE001  what failed is a result
            self.why = str(err)


def _faulted(
    it: Beside, run: subprocess.Popen[bytes], server: int
) -> Iterator[tuple[str, str, Held, Held]]:
    """Yield each fault, what went wrong with it, and what the run and its page's server held.

    That was before it, when what the last one left behind has had its time to go.
    """
    while run.poll() is None:
        pause = min(it.draw.expovariate(1.0 / FAULT_S), 4.0 * FAULT_S)
        with suppress(subprocess.TimeoutExpired):
            run.wait(pause)
            return
        try:
            both = held(run.pid), held(server)
        except OSError:  # it has just ended
            return
        if not both[1].memory_mb or not (it.out / LIVE).exists():  # it no longer moves
            return
        fault = it.draw.choice(FAULTS)
        why = ""
        try:
            fault(it)
        except Exception as err:  # noqa: BLE001  what failed is a result
            why = f"{type(err).__name__}: {err}"
        if why and not (it.out / LIVE).exists():  # the run ended meanwhile, which is no fault's
            return
        yield fault.__name__, why, *both


def long(minutes: float, seed: int, *, link: bool, tell: Callable[[str], None]) -> Suite:
    """Let a run go on for so long with all that is beside it."""
    from tautwave.sites.certificates import make_authority

    counts: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    samples: list[tuple[float, Held, Held]] = []
    with tempfile.TemporaryDirectory(prefix="tautwave-soak-") as text:
        folder = Path(text)
        (folder / "files").mkdir()
        make_authority(folder / "keys", ["master", "slave"])
        sites = _Sites(minutes) if link else None
        with Leftovers(folder / "temporary") as leftovers:
            if sites is not None:
                sites.start()
            with _running(folder, minutes) as (run, out), beside(out, installed()) as bridges:
                viewers = [pid for some in bridges.values() for pid in some]
                viewers += cameras_beside(run.pid)
                page = _page_of(bridges["page"][0])
                it = Beside(out, page, viewers, folder / "files", folder / "keys",
                            random.Random(seed))  # fmt: skip
                begun = time.monotonic()
                for name, why, *both in _faulted(it, run, bridges["page"][0]):
                    counts[name] += 1
                    failed[name] += bool(why)
                    if why:
                        tell(f"{name}: {why}")
                    samples.append((time.monotonic() - begun, both[0], both[1]))
                code = run.wait()
            if sites is not None:
                sites.join()
            summary = json.loads((out / "summary.json").read_text())
            left = leftovers.count()
    return _long_suite(minutes, code, summary, samples, counts, failed, left, sites)


def _page_of(server: int) -> str:
    """Return the address at which a page's server listens, once it does."""
    until = time.monotonic() + PAGE_S
    while time.monotonic() < until:
        sockets = {
            link.readlink().name
            for link in Path(f"/proc/{server}/fd").iterdir()
            if link.readlink().name.startswith("socket:")
        }
        for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                return f"http://127.0.0.1:{int(fields[1].rpartition(':')[2], 16)}/"
        time.sleep(0.1)
    raise click.ClickException("the page is not served")


def _growth(samples: Sequence[tuple[float, Held, Held]], whose: int) -> tuple[float, int]:
    """Return by how much memory [MB] and descriptors grew once all had settled."""
    last = samples[-1][0]
    settled = [one for one in samples if one[0] >= SETTLED * last] or samples
    first, end = settled[0][whose], settled[-1][whose]
    assert isinstance(first, Held)
    assert isinstance(end, Held)
    return end.memory_mb - first.memory_mb, end.descriptors - first.descriptors


def _long_suite(
    minutes: float,
    code: int,
    summary: dict[str, Any],
    samples: Sequence[tuple[float, Held, Held]],
    counts: Counter[str],
    failed: Counter[str],
    left: int,
    sites: _Sites | None,
) -> Suite:
    if not samples:
        raise click.ClickException("the run was too short for a single fault; give more minutes")
    kept, books = summary["recording"], summary["energy_j"]
    run_mb, run_descriptors = _growth(samples, 1)
    page_mb, page_descriptors = _growth(samples, 2)
    hours = minutes / 60.0
    faults = Table(
        "Faults",
        "what was done beside the run, and how often it failed",
        ("fault", "count", "failed"),
        [(fault.__name__, counts[fault.__name__], failed[fault.__name__]) for fault in FAULTS],
    )
    shown = samples[:: max(1, len(samples) // 12)]
    over = Table(
        "Held",
        "memory of the run's process and of its page's server, and their descriptors",
        ("at_s", "run_mb", "run_fd", "page_mb", "page_fd"),
        [(round(at, 1), run.memory_mb, run.descriptors, page.memory_mb, page.descriptors)
         for at, run, page in shown],
    )  # fmt: skip
    account = Table(
        "Books per hour",
        f"of a run of {minutes:g} minutes that ended with {code}: {summary['outcome']['sentence']}",
        ("what", "per_hour"),
        [("cycles", summary["cycles"] / hours), ("missed_cycles", summary["missed_cycles"] / hours),
         *((f"{key}_j", float(books[key]) / hours)
           for key in ("gross_flow", "residual", "generated", "sensing_gap", "motors_net")),
         ("bytes", kept["bytes"] / hours)],
    )  # fmt: skip
    goals = [
        Goal("cycles that are not in the recording", 0.0, "",
             float(summary["cycles"] - kept["rows_written"])),
        Goal("rows dropped", 0.0, "", float(kept["rows_dropped"])),
        Goal("memory the run gained", 5.0, "MB", run_mb),
        Goal("descriptors the run gained", 0.0, "", float(run_descriptors)),
        Goal("memory the page's server gained", 20.0, "MB", page_mb),
        Goal("descriptors the page's server gained", 16.0, "", float(page_descriptors)),
        Goal("residual over gross flow", 1e-9, "",
             abs(books["residual"]) / max(books["gross_flow"], 1e-12)),
        Goal("faults that failed", 0.0, "", float(failed.total())),
        Goal("temporary files and shared memories left", 0.0, "", float(left)),
    ]  # fmt: skip
    if sites is not None:
        goals += _sites_goals(sites)
    return Suite("soak", [faults, over, account], goals)


def _sites_goals(sites: _Sites) -> list[Goal]:
    why = sites.why
    grew = max((grown(one["memory"]) for one in sites.found), default=None)
    dropped = sum(one["dropped"] for one in sites.found) if sites.found else None
    return [
        Goal("memory a site gained", 5.0, "MB", grew, why_not=why),
        Goal("rows dropped at the sites", 0.0, "", dropped, why_not=why),
    ]


# -- many short ones --------------------------------------------------------------------------


def short(runs: int, tell: Callable[[str], None]) -> Suite:
    """Run so many short ones in this process, each with its certificate and summary."""
    rig = ONE_PAIR.load()
    rows: list[Sequence[Value]] = []
    before: Held | None = None
    codes: Counter[int] = Counter()
    with tempfile.TemporaryDirectory(prefix="tautwave-soak-") as text:
        folder = Path(text)
        now = held(os.getpid())
        with Leftovers(folder / "temporary") as leftovers:
            for number in range(1, runs + 1):
                out = folder / "run"
                done = run_rig(rig, out=out, clock="fake", duration_s=SHORT_S)
                codes[done.exit_code] += 1
                rmtree(out)
                now = held(os.getpid())
                if number == min(WARM, runs):
                    before = now
                if number % max(1, runs // 10) == 0:
                    rows.append((number, *now, leftovers.count()))
                    tell(f"{number} short runs")
            left = leftovers.count()
    assert before is not None
    table = Table(
        "Short runs",
        f"what the process holds after runs of {SHORT_S:g} s; their exit codes: {dict(codes)}",
        ("runs", "memory_mb", "descriptors", "threads", "children", "left"),
        rows,
    )
    after = runs - min(WARM, runs)
    goals = [
        Goal("short runs that did not end with 0", 0.0, "", float(runs - codes[0])),
        Goal("memory gained per thousand runs", 50.0, "MB",
             1000.0 * (now.memory_mb - before.memory_mb) / after if after else None,
             why_not="too few runs"),
        Goal("descriptors gained", 0.0, "", float(now.descriptors - before.descriptors)),
        Goal("threads gained", 0.0, "", float(now.threads - before.threads)),
        Goal("processes left", 0.0, "", float(now.children)),
        Goal("temporary files and shared memories left", 0.0, "", float(left)),
    ]  # fmt: skip
    return Suite("short runs", [table], goals)


@click.command("soak", short_help="A long run under faults, and many short ones: what grows.")
@click.option("--minutes", type=click.FloatRange(0.0), default=60.0, show_default=True,
              help="Length of the long run; 0: none.")  # fmt: skip
@click.option("--runs", type=click.IntRange(0), default=1000, show_default=True,
              help="Short runs; 0: none.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the faults.")
@click.option("--link/--no-link", default=True, show_default=True,
              help="Have two sites run beside the long run.")  # fmt: skip
@append_option
@json_option
def soak(
    minutes: float, runs: int, seed: int, link: bool, append: Path | None, as_json: bool
) -> None:
    """Let a run go on with page, exports, camera and link under random faults; then run many.

    \b
    Examples:
        python -m tests.lab soak --append nightly.jsonl
        python -m tests.lab soak --minutes 2 --runs 20 --no-link
    """

    def tell(what: str) -> None:
        click.echo(what, err=True)

    suites = []
    if minutes:
        suites.append(long(minutes, seed, link=link, tell=tell))
        append_suites(append, suites)  # hours are kept, also if what follows is stopped
    if runs:
        suites.append(short(runs, tell))
        append_suites(append, suites[-1:])
    print_suites(suites, as_json)
