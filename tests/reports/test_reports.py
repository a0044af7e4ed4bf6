"""Files that were handed on: each is read, and its traffic plays the devices for our drivers."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tautwave.errors import ConfigError
from tautwave.session.acceptance.shared import KEEP, read_shared
from tautwave.session.bus_replay import (
    Replayed,
    key_of,
    read_traffic,
    replay_bus,
    sent_by_hosts,
    shared_rig,
)
from tautwave.traffic import BYTES, EXTENDED, LEAVING, Event, Traffic, parse_lines
from tests.commands import tautwave
from tests.reports import rates
from tests.reports.make import WALKS, make
from tests.reports.table import NONE, PAGE, page, reports

OUTCOMES = {
    "simulated-canopen": ("", "6076:00 rated torque"),
    "simulated-dynamixel-scale": ("", "XM430-W350, firmware 37"),
    "simulated-modbus": ("", "after 0.1 s without a request it goes into fault"),
}
"""By file: why the driver ends early ('': it does not), and words of its notes."""


def path_of(name: str) -> Path:
    return next(path for path in reports() if path.stem == name)


def replayed(
    path: Path, change: Callable[[Event], Event] = lambda one: one, stage: str | None = None
) -> Replayed:
    events, rig = read_traffic(path, stage)
    bus = next(one.bus for one in events if one.bus != LEAVING)
    return replay_bus(shared_rig(rig), bus, [change(one) for one in events])


@pytest.mark.parametrize("path", reports(), ids=lambda path: path.stem)
def test_a_report_is_played_to_its_outcome(path: Path) -> None:
    said, note = OUTCOMES[path.stem]
    found = replayed(path)
    assert said in found.said
    assert bool(said) == bool(found.said)
    assert any(note in one for one in found.notes), found.notes
    assert found.enabled
    assert found.cycles > 50
    assert found.samples > found.cycles
    assert not found.unknown


@pytest.mark.parametrize("path", reports(), ids=lambda path: path.stem)
def test_a_report_names_nobody(path: Path) -> None:
    found = read_shared(path)
    assert set(found.left_out) == set(KEEP)
    assert not found.by
    sent = [line for one in found.stages.values() for line in one.get("traffic", ())]
    assert not re.search(r"#43181004(?!0{8})", "\n".join(sent))
    if path.stem.startswith("simulated-"):
        assert found.simulated


def test_the_broken_one_shows_its_faults_at_a_glance() -> None:
    """A scale that is twice what it should be, and a servo without a watchdog."""
    found = read_shared(path_of("simulated-dynamixel-scale"))
    assert (found.accepted, found.ended_at) == (False, "hand")
    (wrong,) = [check for check in found.checks if not check["good"]]
    assert (wrong["stage"], wrong["what"]) == ("scale", "master.axis1")
    assert wrong["measured"]["ratio"] == pytest.approx(1.91, abs=0.02)
    watched = [note for note in found.notes["hand"] if "stops after" in note]
    assert [note.split()[0] for note in watched] == ["slave.axis1"]
    assert found.devices["master.axis1"]["firmware"] == "37"


def test_what_was_recorded_otherwise_is_told_as_on_the_bench() -> None:
    """Another rated torque in the recording: the driver refuses it, as it would the drive."""
    rated = bytes.fromhex("43766000")

    def other(one: Event) -> Event:
        hit = not one.out and one.data[:4] == rated
        return one._replace(data=rated + (777).to_bytes(4, "little")) if hit else one

    found = replayed(path_of("simulated-canopen"), other)
    assert "6076:00 motor rated torque is 777" in found.said
    assert not found.enabled

    def silent(one: Event) -> Event:
        return one._replace(bus=LEAVING) if not one.out else one

    found = replayed(path_of("simulated-modbus"), silent)
    assert "no answer" in found.said


def test_a_request_that_was_not_recorded_is_counted() -> None:
    def other(one: Event) -> Event:
        return one._replace(data=b"\x00" * len(one.data)) if one.out else one

    found = replayed(path_of("simulated-dynamixel-scale"), other)
    assert found.unknown
    assert "no answer" in found.said


# -- lines of traffic ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "event",
    [
        Event(120_000, "line", True, BYTES, b"\xff\xff\xfd\x00"),
        Event(0, "can1", False, 0x581, b"\x4f"),
        Event(7_000_000_000, "can1", True, 0x12345 | EXTENDED, b""),
        Event(5_000, LEAVING, True, BYTES, b""),
    ],
)
def test_a_line_is_read_back(event: Event) -> None:
    if event.can_id == BYTES or event.data:
        assert parse_lines([event.line()], "t", sent_by_hosts) == [event]
    assert parse_lines(["", "# a comment", event.line()], "t", sent_by_hosts)[0].bus == event.bus


def test_a_candump_log_is_read_and_its_directions_told_by_the_ids() -> None:
    lines = [
        "(1436509052.249713) vcan0 000#0102", "(1436509052.25) vcan0 601#4018100100000000",
        "(1436509052.26) vcan0 581#4318100100000000", "(1436509052.27) vcan0 080#",
        "(1436509052.28) vcan0 181#500212", "(1436509052.29) vcan0 201#0F00",
    ]  # fmt: skip
    found = parse_lines(lines, "log", sent_by_hosts)
    assert [one.out for one in found] == [True, True, False, True, False, True]
    assert found[0].data == b"\x01\x02"
    assert {one.bus for one in found} == {"vcan0"}


@pytest.mark.parametrize("line", ["1.0 line", "x line > 00", "1.0 line > 0", "1 a b c d"])
def test_what_is_no_line_is_named(line: str) -> None:
    with pytest.raises(ConfigError, match=r"^t:2: '.*' is no line of traffic: TIME BUS > HEX"):
        parse_lines(["# first", line], "t", sent_by_hosts)


def test_the_first_and_the_last_second_are_kept() -> None:
    traffic = Traffic(1.0)
    for k in range(100):
        traffic.add(Event(k * 100_000_000, "b", True, BYTES, bytes((k,))))
    kept = [one.data[0] for one in traffic.events]
    assert kept == [*range(11), *range(89, 100)]


def test_requests_are_alike_where_they_ask_for_the_same() -> None:
    assert key_of(0x601, bytes.fromhex("2340100001000000")) == key_of(
        0x601, bytes.fromhex("2340100002000000")
    )
    assert key_of(0x601, b"\x40\x18\x10\x01") != key_of(0x602, b"\x40\x18\x10\x01")
    first = bytes.fromhex("000100000006010300020004")
    again = bytes.fromhex("00ff00000006010300020004")
    assert key_of(BYTES, first) == key_of(BYTES, again)
    assert key_of(BYTES, first) != key_of(BYTES, first[:7] + b"\x10" + first[8:])


# -- the command, and the page ------------------------------------------------------------------


def test_the_command_says_what_the_driver_made_of_it(tmp_path: Path) -> None:
    name = "simulated-modbus"
    done = tautwave("replay-bus", str(path_of(name)), cwd=tmp_path)
    assert done.exit_code == 0, done.output
    assert "bus bus1: enabled, " in done.output
    (tmp_path / "log.txt").write_text("1.0 line > 00\n")
    for words, said in (
        (["log.txt"], "log.txt: has no rig; name the one whose bus this is with --rig"),
        ([str(path_of(name)), "--stage", "full"], "has no traffic of a stage 'full'"),
        ([str(path_of(name)), "--bus", "x"], "the rig has bus1; choose with --bus"),
        (["nothing.log"], "no such file"),
    ):
        done = tautwave("replay-bus", *words, cwd=tmp_path)
        assert done.exit_code == 2, done.output
        assert said in done.output


def test_the_page_is_made_of_the_files() -> None:
    """`python -m tests.reports.table --write` writes it anew."""
    assert PAGE.read_text() == page()
    real = [path for path in reports() if not read_shared(path).simulated]
    assert (NONE in page()) == (not real)
    assert set(OUTCOMES) == {path.stem for path in reports()}


def test_the_page_of_rates_is_made_of_the_budgets_and_the_files() -> None:
    """`python -m tests.reports.rates --write` writes it anew."""
    assert rates.PAGE.read_text() == rates.page()
    assert len(list(rates.bus_rows())) == len(rates.CASES)
    real = [path for path in reports() if read_shared(path).clock == "real"]
    assert (rates.NOBODY in rates.page()) == (not real)


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("name", WALKS)
def test_a_walk_with_a_simulator_ends_in_a_file_that_is_played(name: str, tmp_path: Path) -> None:
    found = replayed(make(name, tmp_path))
    assert found.said == OUTCOMES[name][0]
    assert found.enabled
