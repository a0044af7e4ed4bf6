"""Run the stages of an acceptance in rising risk; one that is not good ends it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, load_rig, resolved_yaml
from tautwave.errors import ConfigError, DriverError, SafetyStop
from tautwave.files import make_directory, write_text
from tautwave.reading import digest_of
from tautwave.rig import bus_ways, real_buses
from tautwave.rig.ways import Way
from tautwave.session.acceptance import guides
from tautwave.session.acceptance.accepted import NEEDED, keep_accepted
from tautwave.session.acceptance.document import TRAFFIC, Check, write_sealed
from tautwave.session.acceptance.ladder import SEEN, touches
from tautwave.session.acceptance.motion import motions
from tautwave.session.checking import bus_budgets
from tautwave.session.guided.control import GuidedControl
from tautwave.session.guided.running import (
    Conversation,
    Guided,
    Ways,
    ask_without_devices,
    run_guided,
)
from tautwave.session.running import run as run_rig
from tautwave.traffic import Traffic, recorded

STAGES = (
    "identity", "hand", "limits", "noise", "watchdog", "touch", "motion", "delay", "effort",
    "gentle", "full",
)  # fmt: skip
"""In rising risk: nothing has torque in the first three, nothing is commanded up to the fifth."""

GENTLE = 0.1
TRAFFIC_S = 1.0
"""How much of each stage's traffic is kept, after its first cycle and before its end."""


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


class Accepted(NamedTuple):
    """The sealed document, its checks, and the error of a device refused in the first stage."""

    document: Path
    checks: list[Check]
    refused: DriverError | SafetyStop | None


def accept(asked: Acceptance, talk: Conversation, *, out: Path, ways: Ways) -> Accepted:
    """Lead a person through the stages and seal what was found.

    Raises
    ------
    TautwaveError
        The rig is refused, no device could be asked anything, or none answers.
    """
    rig = load_rig(asked.rig)
    unknown = [name for name in asked.axes if name not in rig.axes]
    if unknown:
        raise ConfigError(f"accept: no axis {unknown[0]!r}; axes: {', '.join(rig.axes)}")
    if asked.keys is not None:
        from tautwave.sites.certificates import identity_files

        identity_files(asked.keys, asked.site)  # not only at the end of the day
    checks: list[Check] = []
    said: dict[str, Mapping[str, str]] = {}
    notes: dict[str, list[str]] = {}
    ended = ""
    refused: DriverError | SafetyStop | None = None
    for stage in asked.stages:
        talk.say(f"-- {stage}: {SEEN[stage]}")
        try:
            with recorded(TRAFFIC_S) as traffic:
                found = list(_stage(stage, rig, asked, talk, out / stage, ways, said, notes))
        except (DriverError, SafetyStop) as err:
            if not checks:
                if not traffic.events:
                    raise
                refused = err
                make_directory(out / stage)
                if not (out / stage / "rig.yaml").exists():
                    write_text(out / stage / "rig.yaml", resolved_yaml(rig))
            found = [Check(stage, rig.name, {"said": str(err)}, "no fault and no stop", False)]
        _keep_traffic(out / stage, traffic)
        for check in found:
            numbers = ", ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in check.measured.items()
            )
            verdict = "good" if check.good else f"FAILED, expected {check.expected}"
            line = ": ".join(filter(None, (f"{check.stage} {check.what}", numbers, verdict)))
            talk.say(f"  {line}")
        checks += found
        if not all(check.good for check in found):
            ended = stage
            break
    content: dict[str, Any] = {
        "rig": rig.name,
        "rig_sha256": digest_of(asked.rig),
        "version": version("tautwave"),
        "by": asked.by,
        "sealed_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "stages": list(asked.stages),
        "ended_at": ended,
        "accepted": not ended,
        "machine": dict(asked.machine),
        "clock": ways.clock,
        "buses": _buses(rig, ways),
        "devices": {name: dict(one) for name, one in said.items()},
        "notes": notes,
        "checks": [{**check._asdict(), "measured": _plain(check.measured)} for check in checks],
    }
    document = write_sealed(out, content, asked.keys, asked.site)
    real = real_buses(bus_ways(rig, clock=ways.clock, simulate=ways.simulate, attach=ways.attach))
    devices = {name: said[name] for name in asked.axes if name in said}
    devices = {name: one for name, one in devices.items() if rig.axes[name].bus in real}
    if devices and not ended and set(NEEDED) <= set(asked.stages):
        kept = keep_accepted(asked.rig, devices, asked.by, document)
        talk.say(f"{kept}: what a run on these devices compares")
    return Accepted(document, checks, refused)


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


def _keep_traffic(folder: Path, traffic: Traffic) -> None:
    """Write the traffic of a stage, from which `tautwave replay-bus` plays its devices."""
    if traffic.events and folder.is_dir():
        write_text(folder / TRAFFIC, "".join(f"{one.line()}\n" for one in traffic.events))


def _plain(measured: Mapping[str, float | str]) -> dict[str, float | str | None]:
    """Return numbers for JSON, which has none that is not finite."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in measured.items()
    }


def _stage(
    stage: str,
    rig: Rig,
    asked: Acceptance,
    talk: Conversation,
    out: Path,
    ways: Ways,
    said: dict[str, Mapping[str, str]],
    notes: dict[str, list[str]],
) -> Iterator[Check]:
    """Run a stage and yield its checks; what devices report is put into `said` and `notes`."""
    if stage in ("gentle", "full"):
        yield from _coupled(stage, asked, talk, out, ways)
        return
    if stage == "watchdog":
        yield from _watchdog(rig, talk, out, ways)
        return
    made: Mapping[str, Callable[[GuidedControl], Any]] = {
        "identity": lambda control: control.ask("are these your devices? Press Enter"),
        "hand": lambda control: guides.sign_and_scale(rig, asked.axes, control),
        "limits": lambda control: guides.ranges(rig, asked.axes, control),
        "noise": lambda control: guides.noise(rig, asked.axes, control),
        "touch": lambda control: touches(rig, asked.axes, control),
        "motion": lambda control: motions(rig, asked.axes, control),
        "delay": lambda control: guides.delays(rig, asked.axes, control),
        "effort": lambda control: guides.efforts(rig, asked.axes, control),
    }
    free = stage in ("identity", "hand", "limits")
    done = run_guided(rig, made[stage], talk, out=out, torque=not free, guarded=not free, ways=ways)
    said.update(done.identities)
    notes[stage] = done.notes
    if stage == "identity":
        yield from _identity(asked, done, talk)
        return
    yield from done.result


def _identity(asked: Acceptance, done: Guided, talk: Conversation) -> Iterator[Check]:
    for note in done.notes:
        talk.say(f"  {note}")
    for name in asked.axes:
        told = dict(done.identities.get(name, {}))
        yield Check("identity", name, dict(told), "opened, and compared with the rig", True)


def _watchdog(rig: Rig, talk: Conversation, out: Path, ways: Ways) -> Iterator[Check]:
    """The loss of a bus is noticed, and the devices have stopped by themselves."""
    sentence = ""
    try:
        run_guided(
            rig, guides.unplugging, talk, out=out / "unplugged", torque=True, guarded=True,
            ways=ways,
        )  # fmt: skip
    except DriverError as err:
        sentence = str(err)
    lost: dict[str, float | str] = {"said": sentence or "nothing was lost"}
    yield Check("watchdog", "loss", lost, "the loss is noticed", bool(sentence))
    if not sentence:
        return
    ask_without_devices(talk, "plug it in again; does every axis move freely? Press Enter")
    back: dict[str, float | str]
    try:
        again = run_guided(
            rig, guides.coming_back, talk, out=out / "back", torque=False, guarded=False, ways=ways
        )
    except DriverError as err:
        back = {"devices": "not back", "said": str(err)}
    else:
        tripped = [note for note in again.notes if "watchdog" in note]
        back = {"devices": "back", "said": "; ".join(tripped) or "nothing"}
    good = back["devices"] == "back"
    yield Check("watchdog", "back", back, "all devices come back", good)


def _coupled(
    stage: str, asked: Acceptance, talk: Conversation, out: Path, ways: Ways
) -> Iterator[Check]:
    """Walls and coupling: at a tenth of every effort limit, then as the rig has it."""
    keys = [f"duration_s={asked.run_s}"]
    if stage == "gentle":
        rig = load_rig(asked.rig, choose=False)
        keys += [
            f"{side}.axes.{name}.effort_limit={GENTLE * axis.effort_limit}"
            for side in ("master", "slave")
            for name, axis in getattr(rig, side).axes.items()
        ]
    rig = load_rig(asked.rig, keys, choose=False)
    if rig.operate is not None:
        rig = load_rig(asked.rig, [*keys, "operate.start=engaged"], choose=False)
    talk.say(f"  the rig engages for {asked.run_s:g} s: hold the master loosely")
    result = run_rig(
        rig, out=out, clock=ways.clock, simulate=ways.simulate, attach=ways.attach,
        allow_unwatched=ways.allow_unwatched, configure=ways.configure, warn=talk.say,
        accepting=True,
    )  # fmt: skip
    energy = result.summary.energy_j
    numbers: dict[str, float | str] = {
        "exit_code": float(result.exit_code),
        "outcome": result.why,
    }
    books = {"residual": energy.residual, "generated": energy.generated}
    numbers |= {key: value for key, value in books.items() if value is not None}
    for pair, found in result.summary.pairs.items():
        if found.position_error is not None and found.position_error.rms is not None:  # it engaged
            numbers[f"{pair}.position_error_rms"] = found.position_error.rms
    yield Check(stage, rig.name, numbers, "a run that ends well", result.exit_code == 0)
