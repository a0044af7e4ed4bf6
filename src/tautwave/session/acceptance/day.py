"""What an acceptance has so far: kept after every stage, believed again of the same rig only."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, load_rig
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError, DeviceFault
from tautwave.reading import digest_of, read_file
from tautwave.rig import bus_ways
from tautwave.rig.ways import Way
from tautwave.session.acceptance.document import FILE, LARGEST, Check, verify, write_sealed
from tautwave.session.acceptance.ladder import COUPLED
from tautwave.session.checking import bus_budgets
from tautwave.session.guided.running import Ways

BETWEEN = frozenset({"coupling", "operate", "duration_s"})
"""Blocks of a rig that no stage before the coupled ones depends on."""


class Acceptance(NamedTuple):
    """What is to be accepted: a rig file, its axes, stages, the length of the runs [s], who.

    `keys` is the folder with the key of `site` that signs, None: sealed only; `machine`, what this
    one is.
    """

    rig: Path
    axes: Sequence[str]
    stages: Sequence[str]
    run_s: float
    by: str
    keys: Path | None = None
    site: str = ""
    machine: Mapping[str, Any] = {}


class Day:
    """The stages so far, each with its last try; earlier tries are kept beside."""

    def __init__(self, asked: Acceptance, rig: Rig, out: Path, ways: Ways) -> None:
        self.asked, self.rig, self.out, self.ways = asked, rig, out, ways
        self.checks: dict[str, list[Check]] = {}
        self.earlier: list[Check] = []
        self.tries: dict[str, int] = {}
        self.devices: dict[str, Mapping[str, str]] = {}
        self.notes: dict[str, list[str]] = {}
        self.unwatched: set[str] = set()

    def passed(self, stage: str) -> bool:
        """Return whether a stage was good the last time."""
        checks = self.checks.get(stage)
        return checks is not None and all(check.good for check in checks)

    @property
    def left(self) -> list[str]:
        """Stages that are wanted and have not been passed."""
        return [stage for stage in self.asked.stages if not self.passed(stage)]

    def folder(self, stage: str) -> Path:
        """Return where the last try of a stage is kept."""
        return self.out / _folder(stage, self.tries.get(stage, 1))

    def begin(self, stage: str) -> Path:
        """Begin a stage, once more if it was tried; return its folder."""
        self.forget(stage)
        self.tries[stage] = self.tries.get(stage, 0) + 1
        while self.folder(stage).exists():  # it was interrupted
            self.tries[stage] += 1
        return self.folder(stage)

    def forget(self, stage: str) -> None:
        """Mark a stage to be done again."""
        self.earlier += self.checks.pop(stage, [])

    def seal(self) -> Path:
        """Write the document; return its path.

        Raises
        ------
        ConfigError
            There is no such key to sign with.
        """
        asked, left = self.asked, self.left
        content: dict[str, Any] = {
            "rig": self.rig.name,
            "rig_sha256": digest_of(asked.rig),
            "resolved_sha256": _digest(self.rig),
            "uncoupled_sha256": _digest(self.rig, BETWEEN),
            "version": version("tautwave"),
            "by": asked.by,
            "sealed_utc": datetime.now(UTC).isoformat(timespec="seconds"),
            "axes": list(asked.axes),
            "stages": list(asked.stages),
            "ended_at": left[0] if left else "",
            "accepted": not left,
            "machine": dict(asked.machine),
            "clock": self.ways.clock,
            "buses": _buses(self.rig, self.ways),
            "devices": {name: dict(one) for name, one in self.devices.items()},
            "unwatched": sorted(self.unwatched),
            "notes": self.notes,
            "tries": self.tries,
            "folders": {stage: self.folder(stage).name for stage in self.tries},
            "counts": {stage: len(checks) for stage, checks in self.checks.items()},
            "checks": [_plain(one) for checks in self.checks.values() for one in checks],
            "earlier": [_plain(one) for one in self.earlier],
        }
        return write_sealed(self.out, content, asked.keys, asked.site)

    def resume(self, redo: Sequence[str]) -> list[str]:
        """Take over what `out` has of this rig; `redo` are stages to do again.

        Where no stage was passed, nothing rests on rig, axes or devices, and all may have changed.

        Returns
        -------
        list of str
            Stages that were passed with another coupling, which are done again, too.

        Raises
        ------
        ConfigError
            It has none, was changed since, or is of another rig, other axes or another version.
        """
        begun(self.out)
        path = self.out / FILE
        content = parse_json(read_file(path, LARGEST).decode())
        checks = iter(content["checks"])
        for stage, count in content["counts"].items():
            self.checks[stage] = [Check(**next(checks)) for _ in range(count)]
        self.earlier = [Check(**one) for one in content["earlier"]]
        self.tries = content["tries"]
        if not any(map(self.passed, list(self.checks))):
            for stage in list(self.checks):
                self.forget(stage)
            return []
        kept = {
            "version": version("tautwave"),
            "axes": list(self.asked.axes),
            "uncoupled_sha256": _digest(self.rig, BETWEEN),
        }
        names = ("tautwave", "the axes", "more of the rig than its coupling")
        for (key, now), what in zip(kept.items(), names, strict=True):
            if content.get(key) != now:
                raise ConfigError(
                    f"{path}: cannot be resumed: {what} changed since; begin anew, without --resume"
                )
        self.notes = content["notes"]
        self.devices, self.unwatched = content["devices"], set(content["unwatched"])
        changed = content["resolved_sha256"] != _digest(self.rig)
        again = [stage for stage in self.checks if stage in COUPLED and changed]
        for stage in (*again, *redo):
            self.forget(stage)
        return again

    def compare(self, devices: Mapping[str, Mapping[str, str]]) -> None:
        """Compare devices with those of the stages that were passed before.

        Raises
        ------
        DeviceFault
            One is another, or has other settings.
        """
        changes = [
            f"{name}: {key} was {before}, now {devices.get(name, {}).get(key, 'not given')}"
            for name, known in self.devices.items()
            for key, before in known.items()
            if devices.get(name, {}).get(key) != before
        ]
        if changes:
            raise DeviceFault(
                f"not the devices of {self.out}: {'; '.join(changes)}; put them back, or begin "
                "anew, without --resume"
            )


class Begun(NamedTuple):
    """Rig, devices and stages of an acceptance that was begun."""

    by: str
    axes: list[str]
    stages: list[str]


def begun(out: Path) -> Begun:
    """Return what the acceptance in a directory is of.

    Raises
    ------
    ConfigError
        There is none, or it cannot be resumed: it is damaged, or of a version that could not.
    """
    path = out / FILE
    if not path.is_file():
        raise ConfigError(
            f"{out}: there is no {FILE} to resume; name the directory of an acceptance, or begin "
            "without --resume"
        )
    wrong = verify(path).wrong
    if wrong:
        raise ConfigError("\n".join([*wrong, "begin anew, without --resume"]))
    content = parse_json(read_file(path, LARGEST).decode())
    if "counts" not in content:
        raise ConfigError(
            f"{path}: was written by a tautwave that does not resume; begin anew, without --resume"
        )
    return Begun(content["by"], content["axes"], content["stages"])


def load_accepted(asked: Acceptance) -> Rig:
    """Return the rig that is to be accepted.

    Raises
    ------
    ConfigError
        It is refused, has no such axis, or there is no key to sign with.
    """
    rig = load_rig(asked.rig)
    unknown = [name for name in asked.axes if name not in rig.axes]
    if unknown:
        raise ConfigError(f"accept: no axis {unknown[0]!r}; axes: {', '.join(rig.axes)}")
    if asked.keys is not None:
        from tautwave.sites.certificates import identity_files

        identity_files(asked.keys, asked.site)  # not only at the end of the day
    return rig


def _digest(rig: Rig, without: frozenset[str] = frozenset()) -> str:
    """Return the SHA-256 of a rig with every default, without some blocks."""
    content = rig.model_dump(mode="json", exclude=set(without))
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _folder(stage: str, count: int) -> str:
    return stage if count == 1 else f"{stage}-{count}"


def _buses(rig: Rig, ways: Ways) -> dict[str, dict[str, Any]]:
    """Return by bus what it is driven by, at which rate, and what `check` says of its time."""
    taken = bus_ways(rig, clock=ways.clock, simulate=ways.simulate, attach=ways.attach)
    budgets = bus_budgets(rig)
    return {
        name: {
            "driver": bus.driver,
            "way": taken[name].way.value,
            "simulated": taken[name].way is not Way.HARDWARE,
            "rate_hz": rig.rate_hz / bus.divisor,
            "needs_ms": 1e3 * budgets[name].time_s if name in budgets else None,
            "how": budgets[name].arithmetic if name in budgets else "",
        }
        for name, bus in rig.buses.items()
    }


def _plain(check: Check) -> dict[str, Any]:
    """Return a check for JSON, which has finite numbers only."""
    measured = {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in check.measured.items()
    }
    return {**check._asdict(), "measured": measured}
