"""The driver before a server that says something else than it was asked, or not yet."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tautwave.errors import BusTimeout, ConfigError, DriverError
from tautwave.types import AxisCommand
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.options import match_devices
from tautwave_drivers.modbus.station import ROUND, Unwrapper
from tests.drivers.modbus.parts import bus_of, device, options_of, spec
from tests.drivers.modbus.test_foreign import Rig, assert_off, cut_power_at, rig
from tests.foreign.modbus_drive import POSITION, Drive, crc16
from tests.rigs.running import run_rig
from tests.rigs.test_modbus_rows import one_rate_tree

MS = 1_000_000
Spoil = Callable[[bytes], bytes]


def of_unit(unit: int) -> Spoil:
    return lambda frame: frame[:6] + bytes((unit,)) + frame[7:]


def numbered(change: Callable[[int], int]) -> Spoil:
    def spoil(frame: bytes) -> bytes:
        number = change(int.from_bytes(frame[:2], "big")) & 0xFFFF
        return number.to_bytes(2, "big") + frame[2:]

    return spoil


def again(body: bytes) -> bytes:
    return body + crc16(body)


def as_exception(code: int) -> Spoil:
    def spoil(frame: bytes) -> bytes:
        return frame[:5] + b"\x03" + frame[6:7] + bytes((frame[7] | 0x80, code))

    return spoil


TCP: dict[str, tuple[Spoil, str]] = {
    "unit 0": (of_unit(0), "of unit 0 instead of 1; set unit: 0"),
    "unit 255": (of_unit(255), "of unit 255 instead of 1; set unit: 255"),
    "id 0": (numbered(lambda _: 0), "with another transaction id; the server has to return"),
    "id less 300": (numbered(lambda one: one - 300), "with another transaction id"),
    "id less 1": (numbered(lambda one: one - 1), ""),
    "id swapped": (numbered(lambda one: one << 8 | one >> 8), "with another transaction id"),
    "function": (
        lambda frame: frame[:7] + b"\x14" + frame[8:],
        "to function code 20 instead of 3; is another master",
    ),
    "length": (
        lambda frame: frame[:5] + bytes((frame[5] + 2,)) + frame[6:] + b"\0\0",
        "of another length or address than asked for",
    ),
    "header 1 too long": (
        lambda frame: frame[:5] + bytes((frame[5] + 1,)) + frame[6:],
        "shorter than their Modbus TCP header says; does the server count",
    ),
    "header 1 too short": (
        lambda frame: frame[:5] + bytes((frame[5] - 1,)) + frame[6:],
        "of another length",
    ),
    "serial frames": (lambda frame: again(frame[6:]), "no Modbus TCP frames.* link: rtu"),
}
RTU: dict[str, tuple[Spoil, str]] = {
    "unit": (lambda frame: again(b"\x07" + frame[1:-2]), "of unit 7 instead of 1"),
    "crc": (
        lambda frame: frame[:-1] + bytes((frame[-1] ^ 0x55,)),
        "with a wrong CRC; check baud, parity",
    ),
    "function": (
        lambda frame: again(frame[:1] + b"\x04\x02\x00\x07"),
        "to function code 4 instead of 3",
    ),
    "noise": (lambda frame: b"\xf8\x00\xfc" * 3, "no RTU frames; check baud"),
}
KINDS = [(True, kind) for kind in TCP] + [(False, kind) for kind in RTU]


@pytest.mark.parametrize(("tcp", "kind"), KINDS)
def test_wrong_answers_at_bring_up_are_counted_and_named(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, kind: str
) -> None:
    made = rig(monkeypatch, Drive(), tcp=tcp)
    made.line.spoil, words = (TCP if tcp else RTU)[kind]
    pattern = (
        rf"no answer at sim: \d+ answers, all {words}" if words else "requests that were given"
    )
    with pytest.raises(BusTimeout, match=pattern):
        made.driver.open()
    made.driver.close()
    assert_off(made)


def run_until_unseen(made: Rig, cycles: int = 12) -> None:
    for _ in range(cycles):
        began = made.clock.now_ns()
        made.driver.request()
        [state] = made.driver.read(began + made.period_ns * 8 // 10)
        assert not state.valid
        made.driver.faults()
        made.clock.sleep_until(began + made.period_ns)


@pytest.mark.parametrize(("tcp", "kind"), KINDS)
def test_wrong_answers_in_a_run_are_counted_and_named(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, kind: str
) -> None:
    made = rig(monkeypatch, Drive(), tcp=tcp)
    made.enable()
    made.run(5)
    assert made.driver.misses == {}
    made.line.spoil, words = (TCP if tcp else RTU)[kind]
    words = words.replace("instead of 3", "instead of 16")
    run_until_unseen(made)
    pattern = rf"\d+ answers, all {words}" if words else "requests that were given up before"
    assert re.search(pattern, made.driver.misses["slave.a1"])
    made.line.spoil = bytes
    made.run(30)
    assert made.driver.misses == {}, "the drive is heard again"
    made.driver.close()
    assert_off(made)


def test_silence_is_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    made = rig(monkeypatch, Drive())
    made.enable()
    made.line.cut = True
    run_until_unseen(made)
    assert made.driver.misses == {}
    made.driver.close()


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("code", [10, 11])
def test_a_gateway_without_a_drive_behind_it_is_no_silent_drive(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, code: int
) -> None:
    made = rig(monkeypatch, Drive(), tcp=tcp)
    made.enable()
    made.run(5)
    made.line.refuse = lambda pdu: code
    run_until_unseen(made)
    assert f"(exception {code:02X})" in made.driver.misses["slave.a1"]
    assert "gateway's serial side" in made.driver.misses["slave.a1"]
    made.driver.close()


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("code", [10, 11])
def test_a_gateway_without_a_drive_at_bring_up_tells_what_to_check(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, code: int
) -> None:
    whole = rig(monkeypatch, Drive(), tcp=tcp)
    whole.enable()
    told = 0
    for number in range(0, whole.line.requests, 3):
        made = rig(monkeypatch, Drive(), tcp=tcp)

        def refuse(pdu: bytes, made: Rig = made, at: int = number) -> int:
            return code if made.line.requests > at else 0

        made.line.refuse = refuse
        try:
            made.enable()
        except DriverError as err:
            assert f"(exception {code:02X})" in str(err)  # noqa: PT017
            assert "the gateway was reached, but not the drive: check its unit id" in str(err)  # noqa: PT017
            told += 1
        made.driver.close()
    assert told > 5


# -- not yet -------------------------------------------------------------------------------


@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("code", [5, 6])
@pytest.mark.parametrize("times", [1, 7, 20])
def test_a_drive_that_needs_time_is_asked_again_at_each_request_of_bring_up(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, code: int, times: int
) -> None:
    whole = rig(monkeypatch, Drive(), tcp=tcp)
    whole.enable()
    for number in range(0, whole.line.requests, 3 if times == 1 else 9):
        made = rig(monkeypatch, Drive(), tcp=tcp)
        left = [times]

        def refuse(pdu: bytes, made: Rig = made, left: list[int] = left, at: int = number) -> int:
            if made.line.requests <= at or not left[0]:
                return 0
            left[0] -= 1
            return code

        made.line.refuse = refuse
        made.enable()
        made.line.refuse = lambda pdu: 0
        made.run(5)
        made.driver.close()
        assert_off(made)


def test_a_drive_that_is_busy_for_ever_ends_bring_up(monkeypatch: pytest.MonkeyPatch) -> None:
    made = rig(monkeypatch, Drive())
    made.line.refuse = lambda pdu: 6
    with pytest.raises(DriverError, match=r"device busy \(exception 06\)"):
        made.driver.open()


@pytest.mark.parametrize("code", [5, 6])
def test_a_drive_that_is_busy_when_it_is_left_is_not_asked_for_long(
    monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    """Each request keeps its own time-out fed, which alone can stop it."""
    made = rig(monkeypatch, Drive(), Drive())
    made.enable()
    made.run()
    made.line.refuse = lambda pdu: code
    began = made.clock.now_ns()
    made.driver.close()
    assert made.clock.now_ns() - began < 2_000_000_000
    assert len(made.driver.unconfirmed) == 2


# -- units ---------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [0, 1, 247, 248, 255])
def test_a_tcp_server_may_have_any_unit(monkeypatch: pytest.MonkeyPatch, unit: int) -> None:
    made = rig(monkeypatch, Drive(), first=unit)
    made.enable()
    made.run()
    made.driver.close()
    assert made.line.drives[unit].position > 0.1
    assert_off(made)


def test_serial_frames_may_go_to_a_server(monkeypatch: pytest.MonkeyPatch) -> None:
    made = rig(monkeypatch, Drive(), tcp=False, endpoint="tcp://10.0.0.5:4001")
    made.enable()
    made.run()
    made.driver.close()
    assert made.line.drives[1].position > 0.1


# -- what was set, after a gap -------------------------------------------------------------


@pytest.mark.parametrize("functions", [(3, 16), (3, 6, 16, 23)])
@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("rate_hz", [20.0, 50.0, 100.0])
def test_a_drive_that_comes_on_by_itself_has_forgotten_and_is_not_seen(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, functions: tuple[int, ...], rate_hz: float
) -> None:
    made = rig(monkeypatch, Drive(), tcp=tcp, functions=functions, rate_hz=rate_hz)
    made.enable()
    made.run(5)
    drive = made.line.drives[1]
    drive.eager = True
    drive.cut_power(made.clock.now_ns(), 200 * MS)
    told = ""
    for _ in range(40):
        began = made.clock.now_ns()
        made.driver.request()
        [state] = made.driver.read(began + made.period_ns * 8 // 10)
        assert not state.valid
        fatal = [fault.text for fault in made.driver.faults() if fault.fatal]
        if fatal:
            told = fatal[0]
            break
        made.clock.sleep_until(began + made.period_ns)
    assert "comm_timeout reads 0 instead of 300: it was switched off and on" in told
    made.driver.close()
    assert_off(made)


@pytest.mark.parametrize("functions", [(3, 16), (3, 6, 16, 23)])
@pytest.mark.parametrize("tcp", [True, False])
@pytest.mark.parametrize("span_ms", [0, 15])
@pytest.mark.parametrize("dip", [0, 1])
def test_a_dip_between_two_exchanges_is_noticed_though_no_answer_is_missing(
    monkeypatch: pytest.MonkeyPatch,
    tcp: bool,
    functions: tuple[int, ...],
    span_ms: int,
    dip: int,
) -> None:
    made = rig(monkeypatch, Drive(), Drive(), tcp=tcp, functions=functions, rate_hz=25.0)
    made.enable()
    made.run(7)
    for one in made.line.drives.values():
        one.eager = True
    began, told = made.clock.now_ns(), ""
    made.line.drives[1 + dip].cut_power(began, span_ms * MS)
    for _ in range(25):
        before = made.clock.now_ns()
        made.clock.sleep_until(before + 16 * MS)  # it is back before it is asked
        made.driver.request()
        states = made.driver.read(before + made.period_ns * 8 // 10)
        assert all(state.valid for state in states)
        told = told or next((one.text for one in made.driver.faults() if one.fatal), "")
        made.driver.write([AxisCommand(0.2, 0.0)] * 2)
        if told:
            break
        made.clock.sleep_until(before + made.period_ns)
    assert re.search(rf"^unit {1 + dip} \w+ reads 0 instead of \d+: it was switched off and", told)
    assert made.clock.now_ns() - began < 400 * MS
    made.driver.close()
    assert_off(made)


def test_reading_back_takes_no_time_that_a_cycle_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a rate that leaves none, `check` says what is not noticed; at the next lower one it is."""
    said = {}
    for rate_hz in (35.0, 70.0):
        axes = [spec(unit) for unit in (1, 2)]
        options = plugin.options.model_validate(
            options_of(axes, "generic", link="rtu", baud=115_200, comm_timeout_s=0.3)
        )
        bus = bus_of(axes, rate_hz)
        assert plugin.budget(options, bus).greatest_rate_hz > rate_hz
        assert plugin.foreseen is not None
        said[rate_hz] = list(plugin.foreseen(options, bus))
        late = [0]
        made = rig(monkeypatch, Drive(), Drive(), tcp=False, rate_hz=rate_hz)
        made.enable()
        for _ in range(40):
            began = made.clock.now_ns()
            made.driver.request()
            made.driver.read(began + made.period_ns * 8 // 10)
            late.append(made.clock.now_ns() - began - made.period_ns * 8 // 10)
            made.driver.write([AxisCommand(0.0, 0.0)] * 2)
            made.clock.sleep_until(began + made.period_ns)
        assert max(late) <= 0
        made.driver.close()
    assert said[35.0] == []
    assert [one.split(":")[0] for one in said[70.0]] == [
        "a drive that loses its power for less than a cycle and enables itself again would not be "
        "noticed"
    ]


@pytest.mark.parametrize("functions", [(3, 16), (3, 6, 16, 23)])
def test_a_drive_that_forgot_nothing_is_seen_again_and_no_cycle_asks_more_than_others(
    monkeypatch: pytest.MonkeyPatch, functions: tuple[int, ...]
) -> None:
    made = rig(monkeypatch, Drive(), functions=functions)
    made.enable()
    made.run(5)
    made.line.cut = True
    run_until_unseen(made, 5)
    made.line.cut = False
    valid, asked = [], []
    for _ in range(20):
        began, before = made.clock.now_ns(), made.line.requests
        made.driver.request()
        [state] = made.driver.read(began + made.period_ns * 8 // 10)
        asked.append(made.line.requests - before)
        valid.append(state.valid)
        assert not made.driver.faults()
        made.clock.sleep_until(began + made.period_ns)
    assert not valid[0]
    assert valid[-1]
    usual = min(asked)
    assert max(asked) <= usual + 1  # a register of those that a power cycle resets, now and then
    assert sum(one > usual for one in asked) <= 4
    made.driver.close()


@pytest.mark.parametrize("number", [40, 50])
def test_a_dip_on_a_line_is_told(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    made = rig(monkeypatch, Drive(), tcp=False)
    made.enable()
    cut_power_at(made, made.line.requests + number, 5)
    told = ""
    for _ in range(60):
        began = made.clock.now_ns()
        made.driver.request()
        made.driver.read(began + made.period_ns * 8 // 10)
        told = told or next((one.text for one in made.driver.faults() if one.fatal), "")
        made.clock.sleep_until(began + made.period_ns)
    assert "switched itself off" in told
    made.driver.close()


# -- positions of 16 bits ------------------------------------------------------------------

U16 = "{address: 5, type: u16, access: r, unit: counts}"


@pytest.fixture
def narrow(tmp_path: Path) -> str:
    from importlib.resources import files

    text = files("tautwave_drivers.modbus").joinpath("profiles/generic.yaml").read_text("utf-8")
    [line] = [one for one in text.splitlines() if one.startswith("  position:  ")]
    path = tmp_path / "narrow.yaml"
    path.write_text(text.replace(line, f"  position: {U16}"))
    return str(path)


@pytest.mark.parametrize("start", [-3.0, -1.0, 0.0, 2.9])
def test_a_position_of_16_bits_is_followed_over_its_end(
    monkeypatch: pytest.MonkeyPatch, narrow: str, start: float
) -> None:
    made = rig(monkeypatch, Drive(), profile=narrow)
    drive = made.line.drives[1]
    drive.position = start
    drive.advance(made.clock.now_ns())
    made.enable()
    for cycle in range(60):
        began = made.clock.now_ns()
        made.driver.request()
        [state] = made.driver.read(began + made.period_ns * 8 // 10)
        assert state.position == pytest.approx(drive.position, abs=0.02)
        drive.position = start + 4.0 * math.sin(0.05 * cycle)  # within the velocity limit
        made.clock.sleep_until(began + made.period_ns)
    assert drive.words[POSITION] in (0, 0xFFFF)
    made.driver.close()


def test_a_position_of_16_bits_that_may_have_come_round_is_not_guessed() -> None:
    made = Unwrapper(-30_000.0, 30_000.0, 100_000.0)
    assert made.take(100, 0) == 100
    assert made.take(ROUND - 100, 300 * MS) == -100
    assert made.take(0, 700 * MS) is None


@pytest.mark.parametrize("low", [-40_000, -1, 0, 70_000])
def test_rounds_against_their_definition(low: int) -> None:
    """Where it begins is in the range; from then on it follows, whatever it passes."""
    for begin in range(low, low + 60_000, 7001):
        made = Unwrapper(float(low), low + 60_000.0, 1e6)
        true, now = begin, 0
        for step in (0, 30_000, 30_000, 30_000, -5, -32_000, -32_000, -32_000, 17):
            true, now = true + step, now + MS
            for signed in (0, ROUND // 2):  # as u16 and as i16
                shown = (true + signed) % ROUND - signed
                again = Unwrapper(float(low), low + 60_000.0, 1e6)
                if step == 0:
                    assert again.take(shown, 0) == begin
            assert made.take(true % ROUND, now) == true


@pytest.mark.parametrize(
    ("ends", "velocity", "words"),
    [
        ((-7.0, 7.0), 3.0, r"16 bits, which come round after 6\.283 rad, within position_range"),
        ((-math.inf, math.inf), 3.0, "within position_range"),
        ((-3.0, 3.0), 100.0, "a wrap could be mistaken; lower velocity_limit to 61.6"),
    ],
)
def test_a_position_of_16_bits_that_cannot_be_followed_is_refused_by_check(
    narrow: str, ends: tuple[float, float], velocity: float, words: str
) -> None:
    axis = spec(1)._replace(position_range=ends, velocity_limit=velocity)
    block = options_of([axis], "generic", devices=[device(1) | {"profile": narrow}])
    with pytest.raises(ConfigError, match=words):
        match_devices(plugin.options.model_validate(block), bus_of([axis], 50.0))


@pytest.mark.slow
def test_the_last_line_of_a_run_has_what_came_instead_of_samples() -> None:
    event = {"kind": "wrong_unit", "at_s": 0.1, "unit": 2, "times": 1000}
    data = one_rate_tree("generic")
    data["buses"]["arm"]["options"]["simulator"] = {"faults": {"events": [event]}}
    said = str(run_rig(data, raises=False, duration_s=0.5).result.error)
    assert re.search(r"slave\.\w+ on bus 'arm': no sample in \d+ cycles in a row: \d+ answer", said)
    assert "all of unit 3 instead of 2; set unit: 3" in said
