"""How a run is, for `/diagnostics`: its state, certificate, loop, pairs and link."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.runtime.operate.states import STATES
from tautwave.runtime.tap import Live
from tautwave.summary.model import certified_severity
from tautwave.view.ros.messages import DiagnosticStatus, KeyValue

OK, WARN, ERROR, STALE = range(4)
BOOKS = re.compile(r"(?P<pair>.+)\.(?P<element>[^.]+)\.dissipated")


def statuses(
    live: Live, rows: Sequence[Sequence[float]], missed: int, news: Sequence[Any], dead_man: str
) -> list[DiagnosticStatus]:
    """Return the statuses of the rows since the last ones, STALE if none came.

    Parameters
    ----------
    live : Live
        What the run says of itself.
    rows : sequence of sequence of float
        Oldest first.
    missed : int
        Rows so far that the exporter did not see; the recording has them.
    news : sequence
        The newest entries of the run's journal, each with its number.
    dead_man : str
        How the topic's dead-man is, '' without one.
    """
    statuses_now = [_certificate(live.facts.get("certificate") or {})]
    if not rows:
        statuses_now.append(_status(STALE, "run", "no new rows", {}))
    else:
        row = dict(zip(live.columns, rows[-1], strict=True))
        statuses_now.append(_run(row, missed, [entry for _, entry in news], dead_man))
        statuses_now.append(_loop(live, rows))
        statuses_now += [_pair(name, row) for name in live.facts.get("units", {})]
        if "link.silence_s" in row:
            statuses_now.append(_link(row))
    for status in statuses_now:
        status.name = f"{live.facts.get('rig', 'rig')}: {status.name}"
        status.hardware_id = str(live.facts.get("rig", ""))
    return statuses_now


def ended(live: Live, news: Sequence[Any]) -> list[DiagnosticStatus]:
    """Return the last status of a run: why it ended, if not as it was meant to."""
    last = news[-1][1] if news else {}
    fault = last.get("state") == "ended"
    name = live.facts.get("rig", "rig")
    text = str(last["text"]) if fault else "the run has ended"
    status = _status(ERROR if fault else STALE, "run", text, {})
    status.name, status.hardware_id = f"{name}: run", str(name)
    return [status]


def _status(level: int, name: str, message: str, values: Mapping[str, object]) -> DiagnosticStatus:
    pairs = [KeyValue(key, _text(value)) for key, value in values.items()]
    return DiagnosticStatus(level, name, message, "", pairs)


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _certificate(facts: Mapping[str, Any]) -> DiagnosticStatus:
    state = str(facts.get("state", "not evaluated"))
    severity = certified_severity(facts.get("passed"), state)
    level = {"ok": OK, "bad": ERROR}.get(severity, WARN)
    sentences = [] if severity == "ok" else facts.get("sentences", [])
    values = {"require": facts.get("require", "")} | {f"{k}": s for k, s in enumerate(sentences, 1)}
    return _status(level, "certificate", state, values)


def _run(
    row: Mapping[str, float], missed: int, entries: Sequence[Mapping[str, Any]], dead_man: str
) -> DiagnosticStatus:
    state = row.get("operation.state")
    word = "engaged" if state is None else STATES[int(state)]
    last = entries[-1] if entries else {}
    fault = last.get("word") == "fault"
    event = f"{last['word']}: {last['text']}" if last.get("text") else ""
    values = {
        "time_s": row["time_s"],
        "state": word,
        "episode": round(row.get("operation.episode", 0.0)),
        "rows_not_seen": missed,
        "journal": event,
    }
    if dead_man:
        values["dead_man"] = dead_man
    return _status(ERROR if fault else OK, "run", f"{word}; {event}" if fault else word, values)


def _loop(live: Live, rows: Sequence[Sequence[float]]) -> DiagnosticStatus:
    at = {name: k for k, name in enumerate(live.columns)}
    late_us = max(row[at["lateness_us"]] for row in rows)
    skipped = sum(round(row[at["skipped_slots"]]) for row in rows)
    lost = {
        name.removesuffix(".valid"): sum(not row[k] for row in rows)
        for name, k in at.items()
        if name.endswith(".valid")
    }
    lost = {name: count for name, count in lost.items() if count}
    values = {"rate_hz": live.rate_hz, "lateness_max_us": late_us, "skipped_slots": skipped}
    values |= {f"cycles_without_sample {name}": count for name, count in lost.items()}
    message = f"{skipped} slots skipped" if skipped else "in time"
    return _status(WARN if skipped else OK, "loop", message, values)


def _pair(name: str, row: Mapping[str, float]) -> DiagnosticStatus:
    """Return a pair's errors, and what its elements turned into heat, by their own books."""
    values: dict[str, object] = {
        key: row[f"{name}.{key}"]
        for key in ("position_error", "effort_error")
        if f"{name}.{key}" in row
    }
    for column, value in row.items():
        match = BOOKS.fullmatch(column)
        if match and match["pair"] == name:
            values[f"{match['element']}.dissipated_j"] = value
    error = row.get(f"{name}.position_error", math.nan)
    return _status(OK, name, f"tracking error {error:.3g}", values)


def _link(row: Mapping[str, float]) -> DiagnosticStatus:
    holding = bool(row.get("link.holding"))
    values = {name: value for name, value in row.items() if name.startswith("link.")}
    message = "holding: nothing from the other site" if holding else "the other site is heard"
    return _status(WARN if holding else OK, "link", message, values)
