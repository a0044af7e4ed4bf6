"""Recorded traffic of a bus plays the devices for a driver: a report becomes a test in a minute."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.config import Rig, bus_spec, load_rig
from tautwave.config.guard import read_guarded
from tautwave.errors import ConfigError, TautwaveError
from tautwave.registry import load_driver
from tautwave.session.acceptance.shared import PATH, SERIAL, read_shared
from tautwave.session.bus_player import Player, sent_by_hosts
from tautwave.traffic import Event, parse_lines
from tautwave.types import SAFE_COMMAND

ENABLE_STEPS, MAX_CYCLES = 5000, 20_000
MAX_BYTES = 1 << 26
"""Of a file of traffic."""

ALLOW = "--allow-unwatched"
STRAYED = (
    "; here the host that was recorded commanded more than the zero of this replay, which a device "
    "that reports its goal contradicts: play an earlier stage (--stage)"
)


class Replayed(NamedTuple):
    """What a driver made of recorded traffic.

    `said`: why it ended early, '' if it did not; `enabled`: whether it got so far; `cycles`, and
    `samples` valid in them; `unknown` requests that the recording has no answer to, by their bytes,
    of all that were `asked`.
    """

    bus: str
    said: str
    enabled: bool
    cycles: int
    samples: int
    faults: list[str]
    notes: list[str]
    unknown: dict[str, int]
    asked: int = 0


def replay_bus(rig: Rig, bus: str, events: Sequence[Event]) -> Replayed:
    """Let a bus' driver open, enable and run on recorded traffic, with zero commands.

    The clock is a fake one: no device is opened and nothing is waited for. Devices without a
    watchdog are refused where they were then: where the recording ends with that.

    Raises
    ------
    ConfigError
        The bus' options are wrong.
    """
    replayed, left = _played(rig, bus, events, allow_unwatched=False)
    if ALLOW in replayed.said and left:
        replayed, _ = _played(rig, bus, events, allow_unwatched=True)
    return replayed


def _played(
    rig: Rig, bus: str, events: Sequence[Event], *, allow_unwatched: bool
) -> tuple[Replayed, int]:
    """Return what a driver made of traffic, and how many requests it did not come to."""
    clock = FakeClock(1_000_000_000)
    player = Player(events, clock)
    plugin = load_driver(rig.buses[bus].driver)
    spec = bus_spec(rig, bus)._replace(allow_unwatched=allow_unwatched)
    options = plugin.options.model_validate(rig.buses[bus].options)
    driver = plugin.make(options, spec, clock, player)
    reason, enabled, cycles, samples = "", False, 0, 0
    faults: list[str] = []
    try:
        driver.open()
        for _ in range(ENABLE_STEPS):
            enabled = driver.enable_step()
            if enabled:
                break
            clock.sleep_until(clock.now_ns() + spec.period_ns)
        player.strayed = False
        while enabled and player.left and cycles < MAX_CYCLES and not reason:
            began, left = clock.now_ns(), player.left
            driver.request()
            states = driver.read(began + spec.period_ns * 8 // 10)
            faults_now = list(driver.faults())
            faults += [fault.text for fault in faults_now]
            reason = next((fault.text for fault in faults_now if fault.fatal), "")
            if reason and player.strayed:
                reason += STRAYED
            samples += sum(state.valid for state in states)
            driver.write([SAFE_COMMAND] * len(states))
            clock.sleep_until(began + spec.period_ns)
            cycles += 1
            if player.left == left:
                break
    except TautwaveError as err:
        reason = str(err)
    finally:
        unknown, asked = dict(player.unknown), player.asked
        driver.close()
    notes = [str(note) for note in getattr(driver, "notes", ())]
    return Replayed(
        bus, reason, enabled, cycles, samples, faults, notes, unknown, asked
    ), player.left


def read_traffic(path: Path, stage: str | None = None) -> tuple[list[Event], dict[str, Any]]:
    """Return the events of a file, and the rig that it brings, {} without one.

    Raises
    ------
    ConfigError
        It cannot be read, or has no traffic.
    """
    text = read_guarded(path, "traffic", MAX_BYTES)
    if not text.lstrip().startswith("{"):
        events = parse_lines(text.splitlines(), str(path), sent_by_hosts)
        rig: dict[str, Any] = {}
    else:
        accepted = read_shared(path)
        having = [name for name, one in accepted.stages.items() if one.get("traffic")]
        if stage is not None and stage not in having:
            raise ConfigError(
                f"{path}: has no traffic of a stage {stage!r}; of {', '.join(having) or 'none'}"
            )
        chosen = stage or (having[-1] if having else "")
        lines = accepted.stages[chosen]["traffic"] if chosen else []
        if not (isinstance(lines, list) and all(isinstance(line, str) for line in lines)):
            raise ConfigError(f"{path}: traffic of stage {chosen!r} is no list of lines of text")
        events, rig = parse_lines(lines, str(path), sent_by_hosts), accepted.rig
    if not events:
        raise ConfigError(f"{path}: has no traffic")
    return events, rig


def shared_rig(rig: Mapping[str, Any], name: str = "shared") -> Rig:
    """Return the rig of a shared file, without what was left out of it.

    Raises
    ------
    ConfigError
        It is none that can run.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.yaml"
        path.write_text(json.dumps(_whole(rig)))
        return load_rig(path, choose=False)


def _whole(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _whole(one) for key, one in value.items() if not _left_out(one)}
    return [_whole(one) for one in value] if isinstance(value, list) else value


def _left_out(value: Any) -> bool:
    return isinstance(value, str) and (SERIAL in value or PATH in value)
