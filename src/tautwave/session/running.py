"""`run`: build, record, loop, and report, whatever happens on the way."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, resolved_yaml
from tautwave.errors import BusBudgetError, NotCertifiedError, RecordingError, TautwaveError
from tautwave.rig import Assembly, build_rig, served_buses
from tautwave.runtime.loop import Loop, LoopResult
from tautwave.runtime.machine import quiet_collector, realtime
from tautwave.runtime.recorder import Recorder, RecorderStats
from tautwave.session.certified import (
    certificate_of,
    certified_rig,
    refuse_uncertified,
    summary_block,
)
from tautwave.session.checking import bus_budgets, over_budget, require_drivers
from tautwave.session.facts import pair_facts
from tautwave.session.plan import left_out, rig_plan
from tautwave.session.serving import served

REPORT_TIMEOUT_S = 600.0


class Moved(NamedTuple):
    """What is left of a loop that has run."""

    loop: Loop
    result: LoopResult
    stats: RecorderStats
    sentences: list[str]
    wall_time_s: float


class RunResult(NamedTuple):
    """A run that ended, well or not: its summary, where it is kept, and the exit code."""

    summary: dict[str, Any]
    directory: Path
    exit_code: int


def run(
    rig: Rig,
    *,
    out: Path | str,
    clock: str = "real",
    duration_s: float | None = None,
    command: str = "",
    allow_uncertified: bool = False,
    allow_unwatched: bool = False,
    configure: bool = False,
    attach: bool = False,
    progress: Callable[[float, str], None] | None = None,
) -> RunResult:
    """Run a rig and leave a run directory behind.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    out : Path
        Directory of the run; made if needed.
    clock : str
        `real`, or `fake` to run as fast as it computes.
    duration_s : float, optional
        Length [s]; the rig's own if not given.
    command : str
        How the run was asked for; kept in the summary.
    allow_uncertified : bool
        Move motors without a certificate.
    allow_unwatched, configure : bool
        Handed to drivers that have a watchdog or settings of their own.
    attach : bool
        Use simulated devices that are served already (`tautwave sim RIG`), instead of starting
        them with the run.
    progress : callable, optional
        Called now and then with the share done and a word.

    Raises
    ------
    TautwaveError
        Nothing has moved: the rig is refused, or the run directory cannot be written. What goes
        wrong later is in the result, not raised.
    """
    require_drivers(rig)
    problems = over_budget(rig, bus_budgets(rig))
    if problems:
        raise BusBudgetError("\n".join(problems))
    certificate = certificate_of(rig)
    if not allow_uncertified:
        refuse_uncertified(rig, certificate)
    rig = certified_rig(rig, certificate)
    engine = None
    if rig.scene is not None:
        from tautwave.session.scene_pace import choose_engine, use_engine

        if progress is not None and clock == "real":
            progress(0.0, "measuring the scene")
        engine = choose_engine(rig, clock)
        if progress is not None:
            for sentence in engine.warnings():
                progress(0.0, sentence)
    directory = Path(out)
    started = datetime.now(UTC)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        text = _kept_text(rig, directory)
        (directory / "rig.yaml").write_text(text, encoding="utf-8")
    except OSError as err:
        raise RecordingError(
            f"{directory}: the run's directory cannot be written: {err.strerror}"
        ) from err
    elsewhere = served_buses(rig) if clock == "real" and not attach else ()
    with served(rig, elsewhere) as found:
        assembly = build_rig(
            rig,
            clock=clock,
            duration_s=duration_s,
            endpoints={bus: line.get("options", {}) for bus, line in found.items()},
            allow_unwatched=allow_unwatched,
            configure=configure,
        )
        if engine is not None:
            use_engine(assembly, engine.name)
        moved = _move(rig, clock, directory, text, assembly, progress)
    if progress is not None:
        progress(1.0, "reporting")
    loop, result = moved.loop, moved.result
    outcome, exit_code = _outcome(result, assembly)
    summary = {
        "rig": rig.name,
        "version": version("tautwave"),
        "outcome": outcome,
        "started_utc": started.isoformat(timespec="seconds"),
        "command": command,
        "clock": clock,
        "asked_s": rig.duration_s if duration_s is None else duration_s,
        "duration_s": (result.cycles + result.missed_cycles) * rig.period_s,
        "rate_hz": rig.rate_hz,
        "cycles": result.cycles,
        "missed_cycles": result.missed_cycles,
        "wall_time_s": moved.wall_time_s,
        "period_us": loop.period.summary(),
        "lateness_us": loop.lateness.summary(),
        "compute_us": loop.compute.summary(),
        "realtime": [*moved.sentences, *(engine.sentences if engine is not None else ())],
        "axes": _axes(assembly, result),
        "faults": [fault.text for fault in result.faults],
        "certificate": summary_block(certificate, allow_uncertified),
        "left_out": left_out(rig_plan(rig, clock=clock)),
        "recording": _recording(moved.stats),
        "buses": _buses(assembly),
        "pairs": _pairs(rig, assembly),
    }
    if assembly.scene is not None:
        summary["scene"] = {
            "engine": "python" if engine is None else engine.name,
            "elements": assembly.scene.model.elements(),
        }
    return _report(directory, summary, exit_code)


def _kept_text(rig: Rig, directory: Path) -> str:
    """Return the rig.yaml of a run; the sounds it names lie beside it."""
    if rig.scene is not None:
        from tautwave.rig.scene import keep_sounds

        rig = keep_sounds(rig, directory)
    return resolved_yaml(rig)


def _move(
    rig: Rig,
    clock: str,
    directory: Path,
    text: str,
    assembly: Assembly,
    progress: Callable[[float, str], None] | None,
) -> Moved:
    """Run the loop of a built rig with its recorder beside it."""
    recorder = Recorder(
        directory / "recording.mcap",
        assembly.columns,
        metadata={"version": version("tautwave"), "rig": rig.name, "clock": clock},
        attachments={"rig.yaml": text.encode()},
        rows=rig.loop.ring_rows,
        lossless=clock == "fake",
        rate_hz=rig.rate_hz,
    )
    recorder.start()
    loop = Loop(
        assembly.clock,
        assembly.settings,
        assembly.buses,
        assembly.pairs,
        assembly.sources,
        recorder,
        progress,
    )
    began = time.perf_counter()
    with loop_conditions(rig, clock) as sentences, quiet_collector(), interrupts(loop):
        result = loop.run()
    wall_time_s = time.perf_counter() - began
    for simulator in assembly.simulators:
        simulator.close()
    return Moved(loop, result, recorder.close(), sentences, wall_time_s)


@contextmanager
def loop_conditions(rig: Rig, clock: str) -> Iterator[list[str]]:
    """Ask for real-time conditions on the real clock; a fake one needs none."""
    if clock != "real":
        yield ["fake clock: computing takes no time, so lateness and compute time are 0"]
        return
    keys = rig.loop
    with realtime(keys.fifo_priority, keys.cpu, keys.lock_memory) as sentences:
        yield sentences


@contextmanager
def interrupts(loop: Loop) -> Iterator[None]:
    """Let Ctrl-C and SIGTERM ask the loop to stop, inside the block."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {
        number: signal.signal(number, lambda *_: loop.stop())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _outcome(result: LoopResult, assembly: Assembly) -> tuple[dict[str, str], int]:
    """Return kind and sentence of how the run ended, and the exit code."""
    error = result.error
    seconds = (result.cycles + result.missed_cycles) * assembly.settings.period_ns * 1e-9
    if error is None:
        if result.interrupted:
            return {"kind": "interrupted", "sentence": f"stopped by the user at {seconds:g} s"}, 0
        return {"kind": "finished", "sentence": f"ran its {seconds:g} s to the end"}, 0
    if isinstance(error, KeyboardInterrupt):
        return {"kind": "interrupted", "sentence": f"stopped by the user at {seconds:g} s"}, 0
    if isinstance(error, TautwaveError):
        kind = "safety_stop" if error.exit_code == 6 else "fault"
        return {"kind": kind, "sentence": str(error)}, error.exit_code
    where = error.__traceback__
    while where is not None and where.tb_next is not None:
        where = where.tb_next
    place = ""
    if where is not None:
        place = f" ({Path(where.tb_frame.f_code.co_filename).name}:{where.tb_lineno})"
    sentence = f"{type(error).__name__}: {error}{place}; the axes were made safe"
    return {"kind": "fault", "sentence": sentence}, 5


def _axes(assembly: Assembly, result: LoopResult) -> dict[str, dict[str, Any]]:
    names = [name for bus in assembly.buses for name in bus.axes]
    return {
        name: {
            "lost": result.lost[index],
            "late": result.late[index],
            "faults": [fault.text for fault in result.faults if fault.axis == name],
        }
        for index, name in enumerate(names)
    }


def _recording(stats: RecorderStats) -> dict[str, Any]:
    return {
        "rows_written": stats.rows_written,
        "rows_dropped": stats.rows_dropped,
        "bytes": stats.bytes,
        "error": stats.error,
    }


def _buses(assembly: Assembly) -> dict[str, dict[str, Any]]:
    return {
        bus.name: {
            "command_delay": bus.driver.command_delay._asdict(),
            "notes": list(getattr(bus.driver, "notes", ())),
        }
        for bus in assembly.buses
    }


def _pairs(rig: Rig, assembly: Assembly) -> dict[str, dict[str, Any]]:
    delays = {name: bus.driver.command_delay for bus in assembly.buses for name in bus.axes}
    return {
        name: {"kind": rig.master.axes[name].kind, **pair_facts(rig, name, delays)._asdict()}
        for name in rig.coupling.pairs
    }


def _written(value: Any) -> Any:
    """Return what JSON can hold: None for what is no finite number."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _written(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_written(one) for one in value]
    return value


def _report(directory: Path, summary: dict[str, Any], exit_code: int) -> RunResult:
    """Write the summary, then let another process add what the recording tells and draw it.

    NumPy arrays of an hour and matplotlib stay out of the process that moved the motors.
    """
    path = directory / "summary.json"
    summary = _written(summary)
    path.write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    reason = _complete(directory)
    if not reason:
        summary = json.loads(path.read_text(encoding="utf-8"))
    else:
        summary["report_error"] = f"the report could not be written: {reason}"
        path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    after = summary["certificate"].get("after_run", {})
    if exit_code == 0 and after.get("invalidated"):
        exit_code = NotCertifiedError.exit_code
    return RunResult(summary, directory, exit_code)


def _complete(directory: Path) -> str:
    """Have the run's report written; return why it could not be, else ''."""
    command = [sys.executable, "-m", "tautwave.report", str(directory)]
    again = f"`tautwave report {directory}` writes it"
    try:
        child = subprocess.run(
            command, capture_output=True, text=True, timeout=REPORT_TIMEOUT_S, check=False
        )
    except KeyboardInterrupt:
        return f"interrupted; {again}"
    except subprocess.TimeoutExpired:
        return f"it took over {REPORT_TIMEOUT_S:g} s; {again}"
    if child.returncode == 0:
        return ""
    return (child.stderr.strip().splitlines()[-1:] or ["no reason given"])[0]
