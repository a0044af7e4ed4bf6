"""Files that were handed on: each is read, and its traffic plays the devices for our drivers."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tautwave.clock import FakeClock
from tautwave.errors import ConfigError
from tautwave.session import bus_replay
from tautwave.session.acceptance.shared import KEEP, read_shared
from tautwave.session.bus_player import Player, key_of, sent_by_hosts
from tautwave.session.bus_replay import (
    Replayed,
    read_traffic,
    replay_bus,
    shared_rig,
)
from tautwave.traffic import BYTES, EXTENDED, LEAVING, RUNNING, Event, Traffic, parse_lines
from tests.commands import tautwave
from tests.reports import rates
from tests.reports.make import WALKS, make, shipped
from tests.reports.table import NONE, PAGE, page, reports

HERE, CONFIGS = Path(__file__).parent / "foreign", Path(__file__).parents[2] / "configs"
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
    axes = sum(axis.bus == found.bus for axis in shared_rig(read_shared(path).rig).axes.values())
    assert found.samples == axes * found.cycles, found.notes
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


def line(text: str) -> Event:
    return parse_lines([text], "t", sent_by_hosts)[0]


def player(*lines: str) -> tuple[Player, FakeClock]:
    clock = FakeClock(1_000_000_000)
    return Player([line(one) for one in lines], clock), clock


def heard(port: Player, clock: FakeClock, can_id: int, text: str) -> list[str]:
    """Send a frame; return what comes within 5 ms."""
    port.send(can_id, bytes.fromhex(text))
    clock.sleep_until(clock.now_ns() + 5_000_000)
    found = iter(port.receive, None)
    return [f"{frame[0]:X}#{frame[1].hex().upper()}" for frame in found]


CYCLE = (
    "1.000 can > 080#", "1.000 can > 77F#05", "1.000 can > 601#4077600000000000",
    "1.000 can < 701#05", "1.0002 can < 181#0102", "1.001 can > 201#0000",
    "1.001 can < 581#4B77600007000000",
)  # fmt: skip


def test_what_is_under_way_together_comes_with_its_own_request() -> None:
    """An SDO and a heartbeat of the host between a SYNC and its answers: none is swapped."""
    port, clock = player(*CYCLE)
    assert heard(port, clock, 0x77F, "05") == []
    assert heard(port, clock, 0x80, "") == ["701#05", "181#0102"]
    assert heard(port, clock, 0x201, "0000") == []
    assert heard(port, clock, 0x601, "4077600000000000") == ["581#4B77600007000000"]
    port, clock = player("0.9 can > 080#", "1.0 can > 000#8101", "1.01 can < 701#00")
    assert heard(port, clock, 0, "8101") == []
    clock.sleep_until(clock.now_ns() + 10_000_000)
    assert port.receive() is not None  # it booted, which no SYNC asked for


def test_an_object_that_was_not_recorded_does_not_exist_or_has_what_was_written() -> None:
    port, clock = player("1.0 can > 601#2B17100014000000", "1.0 can < 581#6017100000000000", *CYCLE)
    assert heard(port, clock, 0x601, "4018100100000000") == ["581#8018100100000206"]
    assert heard(port, clock, 0x601, "4017100000000000") == ["581#8017100000000206"]
    assert heard(port, clock, 0x601, "2B17100014000000") == ["581#6017100000000000"]
    assert heard(port, clock, 0x601, "4017100000000000") == ["581#4B17100014000000"]
    assert heard(port, clock, 0x601, "2B07600002000000") == ["581#8007600000000206"]
    assert sum(port.unknown.values()) == 4


def test_a_register_that_was_not_recorded_is_no_address() -> None:
    port, _ = player("1.0 line > 0001000000060103000A0001", "1.0 line < 00010000000501030200AA")
    port.write(bytes.fromhex("0009000000060103000A0001"))
    assert port.read() == bytes.fromhex("00090000000501030200AA")
    port.write(bytes.fromhex("000A000000060103000B0001"))
    assert port.read() == bytes.fromhex("000A00000003018302")
    assert sum(port.unknown.values()) == 1
    port.write(bytes.fromhex("0103000B0001F5C8"))  # RTU: whatever its checksum, it stays silent
    assert port.read() == b""


def test_the_request_that_the_end_cut_off_is_not_played() -> None:
    port, clock = player("1.0 c > 080#", "1.001 c < 181#01", "1.01 c > 080#", "1.0 * leaving")
    assert port.left == 1
    assert heard(port, clock, 0x80, "") == heard(port, clock, 0x80, "") == ["181#01"]


def test_an_open_that_takes_long_is_kept_whole_and_a_gap_cuts_no_exchange() -> None:
    traffic = Traffic(1.0)
    for k in range(30):  # 3 s until the devices are on
        traffic.add(line(f"{k / 10} a > {k:02X}"))
        traffic.add(line(f"{k / 10 + 0.05} a < {k:02X}"))
    traffic.add(Event(3_000_000_000, RUNNING, True, BYTES, b""))
    for k in range(30, 100):
        traffic.add(line(f"{k / 10} a > {k:02X}"))
        traffic.add(line(f"{k / 10 + 0.06} b < {k:02X}"))
        traffic.add(line(f"{k / 10 + 0.05} a < {k:02X}"))
    kept = [one for one in traffic.events if one.bus == "a"]
    asked = [one.data[0] for one in kept if one.out]
    assert asked == [one.data[0] for one in kept if not one.out]
    assert asked[:30] == list(range(30))
    assert 39 <= asked.index(91) <= 41
    assert [one.at_ns for one in traffic.events] == sorted(one.at_ns for one in traffic.events)
    lines = [one.line() for one in traffic.events]
    assert "# 3.000000 running" in lines
    assert len(parse_lines(lines, "t", sent_by_hosts)) == len(lines) - 1


def test_protocol_1_is_told_by_address_and_count_not_by_values() -> None:
    read, other = bytes.fromhex("FFFF0104020005F3"), bytes.fromhex("FFFF010402280AC6")
    assert key_of(BYTES, read) != key_of(BYTES, other)
    write, again = bytes.fromhex("FFFF01050328010000CD")[:9], bytes.fromhex("FFFF0105032802CC00")
    assert key_of(BYTES, write) == key_of(BYTES, again)
    assert key_of(BYTES, read + other) == (*key_of(BYTES, read), *key_of(BYTES, other))


def test_devices_without_a_watchdog_are_refused_where_they_were() -> None:
    """The recording ends there, or it goes on: then they were allowed."""
    path = path_of("simulated-dynamixel-scale")
    events, rig = read_traffic(path)
    assert not replay_bus(shared_rig(rig), "bus1", events).said
    end = max(at for at, one in enumerate(events) if one.bus == LEAVING)
    sent = [at for at, one in enumerate(events[:end]) if one.out and one.bus != LEAVING]
    _, left = bus_replay._played(shared_rig(rig), "bus1", events, allow_unwatched=False)
    refused = events[: sent[-left]]
    found = replay_bus(shared_rig(rig), "bus1", refused)
    assert "--allow-unwatched" in found.said
    assert not found.enabled


# -- captures of other hosts ------------------------------------------------------------------

FOREIGN = {
    "modbus-pymodbus-drives": ("bench-modbus-tcp-sim", "arm", ""),
    "modbus-pymodbus-polls": ("bench-modbus-tcp-sim", "arm", "rated_torque cannot be read"),
    "canopen-remote-node": ("bench-canopen-virtual", "can", "does not read 1000:00 device type"),
}
"""By file: rig, bus, and why the driver ends: what that host never asked for."""


@pytest.mark.parametrize("name", FOREIGN)
def test_a_capture_of_another_host_is_played_as_far_as_it_goes(name: str, tmp_path: Path) -> None:
    rig, bus, said = FOREIGN[name]
    words = [str(HERE / f"{name}.log"), "--rig", str(CONFIGS / f"{rig}.yaml"), "--bus", bus]
    done = tautwave("replay-bus", *words, cwd=tmp_path)
    assert said in done.output
    assert done.exit_code == (5 if said else 0), done.output
    if said:
        assert "was recorded with another host, other settings or another version" in done.output
        assert "requests are not in the recording, such as" in done.output
    else:
        assert "enabled, 61 cycles, 61 valid samples" in done.output
        assert "another host" not in done.output


def test_every_capture_of_another_host_is_played() -> None:
    assert {path.stem for path in HERE.glob("*.log")} == set(FOREIGN)
    for path in HERE.glob("*.log"):
        assert path.read_text().startswith("# made by python -m tests.reports.foreign_hosts with ")


def test_registers_are_known_from_other_blocks_and_counts_tell_requests_apart() -> None:
    port, _ = player(
        "1.0 line > 0001000000060103000A0003", "1.0 line < 000100000009010306000100020003"
    )
    port.write(bytes.fromhex("0002000000060103000B0002"))
    assert port.read() == bytes.fromhex("00020000000701030400020003")
    port.write(bytes.fromhex("0003000000060103000C0002"))  # one of them is not known
    assert port.read() == bytes.fromhex("000300000003018302")
    assert key_of(BYTES, b"\x01\x03\0\x0a\0\x01") != key_of(BYTES, b"\x01\x03\0\x0a\0\x02")


@pytest.mark.parametrize(
    ("text", "out", "data"),
    [
        ("(1.5) can0 601#4018100100000000 R", True, "4018100100000000"),
        ("(1.5) can0 581#4318100100000000 T", False, "4318100100000000"),
        ("(1.5) can0 705#R", True, ""),
        ("(1.5) can0 705#05 R", False, "05"),
    ],
)
def test_lines_of_python_can_are_read_and_remote_frames_too(
    text: str, out: bool, data: str
) -> None:
    found = line(text)
    assert (found.out, found.data.hex().upper()) == (out, data)


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
    traffic.add(Event(0, RUNNING, True, BYTES, b""))
    for k in range(100):
        traffic.add(Event(k * 100_000_000, "b", True, BYTES, bytes((k,))))
    kept = [one.data[0] for one in traffic.events if one.bus == "b"]
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


HEALTHY = {
    "bench-canopen-virtual": 1, "bench-mit-virtual": 1, "bench-dynamixel-sim": 1,
    "bench-modbus-rtu-sim": 1, "bench-modbus-tcp-sim": 1, "bench-mixed-sim": 2, "three-bus-sim": 3,
}  # fmt: skip
"""Shipped rigs of every protocol, with how many buses; three of them serve one every nth cycle."""


@pytest.mark.slow
@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_day_is_played_without_a_sample_missing(name: str, tmp_path: Path) -> None:
    data = shipped(name)
    axis = f"slave.{next(iter(data['slave']['axes']))}"
    (tmp_path / "rig.yaml").write_text(json.dumps(data))
    (tmp_path / "answers.txt").write_text("0.1\n" * 2)
    words = ["accept", "rig.yaml", "--by", "tests", "--clock", "fake", "--axis", axis]
    words += ["--script", "answers.txt", "--stages", "identity,motion", "--share", "day.json"]
    done = tautwave(*words, cwd=tmp_path)
    assert done.exit_code == 0, done.output
    for stage in ("identity", "motion"):
        events, tree = read_traffic(tmp_path / "day.json", stage)
        rig = shared_rig(tree)
        buses = sorted({one.bus for one in events if one.bus in rig.buses})
        assert len(buses) == HEALTHY[name]
        for bus in buses:
            found = replay_bus(rig, bus, [one for one in events if one.bus in (bus, LEAVING)])
            axes = sum(axis.bus == bus for axis in rig.axes.values())
            assert (found.said, found.enabled) == ("", True)
            assert found.samples == axes * found.cycles
            assert found.cycles > 10
            assert not found.unknown
            assert not [note for note in found.notes if "missing" in note]


@pytest.mark.slow
@pytest.mark.realtime
def test_other_hosts_still_make_such_captures(tmp_path: Path) -> None:
    foreign_hosts = pytest.importorskip("tests.reports.foreign_hosts")
    for name, maker in foreign_hosts.MAKERS.items():
        maker(tmp_path / name, tmp_path)
        events, rig = read_traffic(tmp_path / name)
        assert rig == {}
        assert {one.out for one in events} == {True, False}


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("name", WALKS)
def test_a_walk_with_a_simulator_ends_in_a_file_that_is_played(name: str, tmp_path: Path) -> None:
    found = replayed(make(name, tmp_path))
    assert found.said == OUTCOMES[name][0]
    assert found.enabled
