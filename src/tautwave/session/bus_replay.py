"""Recorded traffic of a bus plays the devices for a driver: a report becomes a test in a minute."""

from __future__ import annotations

import json
import struct
import tempfile
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.config import Rig, bus_spec, load_rig
from tautwave.config.guard import read_guarded
from tautwave.errors import ConfigError, TautwaveError
from tautwave.registry import load_driver
from tautwave.session.acceptance.shared import PATH, SERIAL, read_shared
from tautwave.traffic import BYTES, LEAVING, Event, parse_lines
from tautwave.types import SAFE_COMMAND

HEADER = b"\xff\xff\xfd\x00"
"""Of a packet of Dynamixel's protocol 2.0."""
SDO_REQUESTS, MIT_REGISTERS = range(0x600, 0x680), 0x7FF
NMT = 0
ENABLE_STEPS, MAX_CYCLES = 5000, 20_000
MAX_BYTES = 1 << 26
"""Of a file of traffic."""
LATEST_NS = 50_000_000
"""What comes later after a request is no answer to it."""


def sent_by_hosts(can_id: int) -> bool:
    """Return whether a CANopen host sends frames with this id: NMT, SYNC, RPDOs, SDO requests."""
    return can_id in (NMT, 0x80) or can_id in SDO_REQUESTS or (can_id >> 7) in (4, 6, 8, 10)


def key_of(can_id: int, data: bytes) -> tuple[Any, ...]:
    """Return what a request asks for, whatever values it carries."""
    if can_id != BYTES:
        if can_id in SDO_REQUESTS or can_id == MIT_REGISTERS:
            return can_id, data[:4]
        return (can_id, data) if can_id == NMT else (can_id,)
    if data.startswith(HEADER):
        packets = []
        while data.startswith(HEADER) and len(data) >= 10:
            size = 7 + int.from_bytes(data[5:7], "little")
            packets.append((data[4], data[7], data[8:12]))
            data = data[size:]
        return tuple(packets)
    if (
        len(data) >= 8
        and data[2:4] == b"\0\0"
        and len(data) == 6 + int.from_bytes(data[4:6], "big")
    ):
        return "tcp", data[6:10]
    return "rtu", data[:4]


class _Exchange(NamedTuple):
    key: tuple[Any, ...]
    sent: bytes
    answers: list[tuple[int, int, bytes]]
    counts: bool


class Player:
    """A port behind which recorded traffic answers, in the order in which it was recorded.

    A request is answered as the next one like it was: first one with the same bytes, else one that
    asks for the same; where none is left, as the last one. `unknown` counts those that the
    recording has none of.
    """

    def __init__(self, events: Sequence[Event], clock: FakeClock) -> None:
        self._clock = clock
        self._coming: list[tuple[int, int, bytes]] = []
        self._waiting: dict[tuple[Any, ...], deque[_Exchange]] = {}
        self._last: dict[tuple[Any, ...], _Exchange] = {}
        self.unknown: Counter[str] = Counter()
        self.left = 0
        """Requests that were recorded before the devices were switched off, and not made yet."""
        leaving = max((k for k, one in enumerate(events) if one.bus == LEAVING), default=None)
        at_ns, answers = 0, self._coming
        for number, event in enumerate(events):
            if event.bus == LEAVING:
                continue
            if event.out:
                counts = leaving is None or number < leaving
                one = _Exchange(key_of(event.can_id, event.data), event.data, [], counts)
                self._waiting.setdefault(one.key, deque()).append(one)
                at_ns, answers = event.at_ns, one.answers
                self.left += counts
            elif answers is self._coming or event.at_ns - at_ns <= LATEST_NS:
                delay_ns = max(0, event.at_ns - at_ns) if answers is not self._coming else 0
                answers.append((delay_ns, event.can_id, event.data))

    def _ask(self, can_id: int, data: bytes) -> None:
        key = key_of(can_id, data)
        waiting = self._waiting.get(key, deque())
        one = next((each for each in waiting if each.sent == data), None)
        if one is None:
            one = waiting[0] if waiting else self._last.get(key)
        if one is None:
            name = data.hex().upper() if can_id == BYTES else f"{can_id:X}#{data.hex().upper()}"
            self.unknown[name] += 1
            return
        while waiting and waiting[0] is not one:
            self._last[key] = waiting.popleft()
            self.left -= self._last[key].counts
        if waiting:
            self.left -= waiting.popleft().counts
        self._last[key] = one
        now = self._clock.now_ns()
        for delay_ns, answer_id, answer in one.answers:
            body = answer
            if key[0] == "tcp" and len(answer) > 2:  # as each server does
                body = struct.pack(">H", int.from_bytes(data[:2], "big")) + answer[2:]
            self._coming.append((now + delay_ns, answer_id, body))

    # -- the port -------------------------------------------------------------------------

    def port(self, endpoint: str) -> Player:
        """Return a connection."""
        return self

    def write(self, data: bytes) -> None:
        """Take a request's bytes."""
        self._ask(BYTES, bytes(data))

    def read(self) -> bytes:
        """Return what has come."""
        return b"".join(data for _, _, data in self._due(len(self._coming)))

    def send(self, can_id: int, data: bytes) -> bool:
        """Take a frame."""
        self._ask(can_id, bytes(data))
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame that has come."""
        due = self._due(1)
        return (due[0][1], due[0][2], due[0][0]) if due else None

    def _due(self, count: int) -> list[tuple[int, int, bytes]]:
        now = self._clock.now_ns()
        due = sorted((one for one in self._coming if one[0] <= now), key=lambda one: one[0])[:count]
        for one in due:
            self._coming.remove(one)
        return due

    def next_event_ns(self) -> int | None:
        """Return when something comes [ns]."""
        return min((at for at, _, _ in self._coming), default=None)

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""

    def readable(self) -> bool:
        """Return whether something has come."""
        return any(at <= self._clock.now_ns() for at, _, _ in self._coming)

    def close(self) -> None:
        """Nothing to close."""


class Replayed(NamedTuple):
    """What a driver made of recorded traffic.

    `said`: why it ended early, '' if it did not; `enabled`: whether it got so far; `cycles`, and
    `samples` valid in them; `unknown` requests that the recording has no answer to, by their bytes.
    """

    bus: str
    said: str
    enabled: bool
    cycles: int
    samples: int
    faults: list[str]
    notes: list[str]
    unknown: dict[str, int]


def replay_bus(rig: Rig, bus: str, events: Sequence[Event]) -> Replayed:
    """Have a bus' driver open, enable and run on recorded traffic, with zero commands.

    The clock is a fake one: no device is opened and nothing is waited for.

    Raises
    ------
    ConfigError
        The bus' options are wrong.
    """
    clock = FakeClock(1_000_000_000)
    player = Player(events, clock)
    plugin = load_driver(rig.buses[bus].driver)
    spec = bus_spec(rig, bus)._replace(allow_unwatched=True)
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
        while enabled and player.left and cycles < MAX_CYCLES and not reason:
            began, left = clock.now_ns(), player.left
            driver.request()
            states = driver.read(began + spec.period_ns * 8 // 10)
            faults_now = list(driver.faults())
            faults += [fault.text for fault in faults_now]
            reason = next((fault.text for fault in faults_now if fault.fatal), "")
            samples += sum(state.valid for state in states)
            driver.write([SAFE_COMMAND] * len(states))
            clock.sleep_until(began + spec.period_ns)
            cycles += 1
            if player.left == left:
                break
    except TautwaveError as err:
        reason = str(err)
    finally:
        unknown = dict(player.unknown)
        driver.close()
    notes = [str(note) for note in getattr(driver, "notes", ())]
    return Replayed(bus, reason, enabled, cycles, samples, faults, notes, unknown)


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
