"""Run the trials of a protocol, one run each, and keep the study's table."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, load_rig
from tautwave.config.guard import parse_json
from tautwave.errors import (
    ConfigError,
    DriverError,
    NotCertifiedError,
    SafetyStop,
    TautwaveError,
    WritingError,
)
from tautwave.files import make_directory, write_text
from tautwave.reading import read_file
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.commands import EPISODE, Order
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.session.running import RunResult
from tautwave.session.running import run as run_rig
from tautwave.session.trials.protocol import Protocol, Trial, trials_of

TABLE, PROTOCOL = "trials.csv", "protocol.json"
FIRST = ("participant", "trial", "condition", "repetition", "task", "started_utc", "outcome")
MEASURES = ("position_error", "effort_error")
ENDS = {3: NotCertifiedError, 5: DriverError, 6: SafetyStop, 7: WritingError}
"""Errors of a trial's run that ended with these exit codes."""

LARGEST = 1 << 20
"""Bytes of a protocol that was kept."""
SPARE_S = 30.0
"""Beyond a trial, for engaging and ending it."""


class Study(NamedTuple):
    """A protocol, who takes part, where its table goes, and how devices are reached."""

    protocol: Protocol
    participant: str
    folder: Path
    out: Path
    ways: Mapping[str, Any]


class TrialSource:
    """Engages, begins the trial's episode once engaged, ends it after its time, and the run."""

    def __init__(self, trial: Trial, task: str, trial_s: float) -> None:
        self._name = f"{trial.number:03d}-{trial.condition}"
        self._task = task
        self._length_ns = round(1e9 * trial_s)
        self._control: OperatedControl | None = None
        self._begun_ns = -1
        self._asked = self._over = False

    def sees(self, control: OperatedControl) -> None:
        """Watch this rig's states."""
        self._control = control

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return what the trial needs now."""
        if self._control is None or self._over:
            return ()
        state = self._control.standing.state
        if not self._asked:
            self._asked = True
            return (Order(st.ENGAGE, "", "trial"),)
        if self._begun_ns < 0:
            if state == st.ENGAGED:
                self._begun_ns = now_ns
                return (Order(EPISODE, f"{self._name} {self._task}".strip(), "trial"),)
            self._over = state == st.HOLDING
        elif not self._control.journal.running or state == st.HOLDING:
            self._over = True
        elif now_ns - self._begun_ns >= self._length_ns:
            self._over = True
            return (Order(EPISODE, "", "trial"), Order(st.STOP, "", "trial"))
        return (Order(st.STOP, "", "trial"),) if self._over else ()


def run_study(
    study: Study,
    ready: Callable[[Trial, bool], None],
    judge: Callable[[Trial], bool | None],
    live: Callable[[Rig], Any],
) -> Path:
    """Run what is left of a study; return its table, which grows by a row a trial.

    Parameters
    ----------
    ready : callable
        Returns when a trial may begin; True: after a break.
    judge : callable
        Says whether a trial was a success, None: not said.
    live : callable
        Returns a context with the live sources of commands of a rig.

    Raises
    ------
    TautwaveError
        A condition is refused, or its run ended in a fault: the study may be resumed.
    """
    protocol = study.protocol
    rigs = {name: _rig_of(study, name) for name in protocol.conditions}
    make_directory(study.out)
    rows = _read(study.out / TABLE)
    _keep_protocol(study)
    done = {int(row["trial"]) for row in rows if row["participant"] == study.participant}
    for trial in trials_of(protocol, study.participant):
        if trial.number in done:
            continue
        before = trial.number - 1
        ready(trial, bool(protocol.break_every and before and before % protocol.break_every == 0))
        rig = rigs[trial.condition]
        source = TrialSource(trial, protocol.task, protocol.trial_s)
        place = _free(study.out, f"{study.participant}-{trial.number:03d}-{trial.condition}")
        with live(rig) as sources:
            result = run_rig(rig, out=place, scripts=[source], live=sources, **study.ways)
        rows.append(_row(study, trial, result, judge(trial) if protocol.ask else None))
        _write(study.out / TABLE, rows)
        if result.exit_code:
            raise ENDS.get(result.exit_code, TautwaveError)(
                f"trial {trial.number}: {result.why}; it is in the table, and the same command "
                "continues after it"
            )
    return study.out / TABLE


def _keep_protocol(study: Study) -> None:
    """Keep the protocol beside the table, and refuse to go on by another one."""
    path = study.out / PROTOCOL
    keys = study.protocol.model_dump(mode="json")
    if not path.exists():
        write_text(path, json.dumps(keys, indent=2) + "\n")
        return
    try:
        before = parse_json(read_file(path, LARGEST).decode())
        changed = [key for key, value in keys.items() if before[key] != value]
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise ConfigError(f"{path}: is not a study protocol; give another --out") from err
    if changed:
        raise ConfigError(
            f"trials: {', '.join(changed)} changed since this study began ({path}); restore the "
            "original, or start a new study with another --out"
        )


def _free(out: Path, name: str) -> Path:
    """Return a directory for a trial; one that was cut short stays where it is."""
    tries = (out / (f"{name}-{count}" if count else name) for count in range(1000))
    return next(path for path in tries if not path.exists())


def _rig_of(study: Study, condition: str) -> Rig:
    """Return the rig of a condition; all of them are checked before the first trial."""
    changes = study.protocol.conditions[condition]
    keys = [f"{key}={json.dumps(value)}" for key, value in changes.items()]
    keys.append(f"duration_s={study.protocol.trial_s + SPARE_S}")
    rig = load_rig(study.folder / study.protocol.rig, keys)
    if rig.operate is None:
        raise ConfigError(f"trials: {study.protocol.rig} has no `operate` block; add operate: {{}}")
    return rig


def _row(study: Study, trial: Trial, result: RunResult, success: bool | None) -> dict[str, Any]:
    summary = result.summary
    episodes = () if summary.operation is None else summary.operation.episodes
    one = episodes[0] if episodes else None
    succeeded = one.success if success is None and one is not None else success
    row: dict[str, Any] = {
        "participant": study.participant,
        "trial": trial.number,
        "condition": trial.condition,
        "repetition": trial.repetition,
        "task": study.protocol.task,
        "started_utc": summary.started_utc,
        "outcome": summary.outcome.kind,
        "success": "" if succeeded is None else str(bool(succeeded)).lower(),
        "seconds": 0.0 if one is None else round(one.end_s - one.begin_s, 6),
    }
    for pair, figures in summary.pairs.items():
        for measure in MEASURES:
            size = getattr(figures, measure)
            if size is not None:
                row |= {
                    f"{pair}.{measure}.{what}": value for what, value in size if value is not None
                }
    row["run"] = result.directory.name
    return row


def _read(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            table = csv.DictReader(stream)
            rows: list[dict[str, Any]] = list(table)
        if set(FIRST) <= set(table.fieldnames or ()) and all(int(row["trial"]) for row in rows):
            return rows
    except (ValueError, TypeError, csv.Error):
        pass
    raise ConfigError(f"{path}: is not a table of trials; give another --out")


def _write(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    names = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_text(path, text.getvalue())
