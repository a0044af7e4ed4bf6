"""What may be handed on of an acceptance: all numbers, nobody's names unless asked for."""

from __future__ import annotations

import json
import re
import socket
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from tautwave.cli import main
from tautwave.cli.rigs import accept as command
from tautwave.errors import ConfigError
from tautwave.session.acceptance import shared as module
from tautwave.session.acceptance.document import FILE, TRAFFIC, verify, write_sealed
from tautwave.session.acceptance.shared import KEEP, SERIAL, Shared, read_shared, shared, text_of
from tautwave.session.bus_replay import read_traffic, shared_rig
from tests.reports.make import old_servo, shipped
from tests.session.test_accepting import accept, bench, written
from tests.session.test_newcomers import EDS

HOST = socket.gethostname()
FILE_OF_ANNA = "/home/anna/x y.eds"
RIG = """
name: annas-bench
rate_hz: 500
buses:
  can:
    driver: canopen
    options:
      interface: socketcan
      channel: can0
      nodes: [{id: 1, eds: /home/anna/files/drive 3.eds, rated_torque: 1.0}]
  arm: {driver: modbus, options: {endpoint: tcp://192.168.7.20:502, files: ../anna/p.yaml}}
master: {axes: {elbow-of-anna: {bus: can, id: 1}}}
slave: {axes: {elbow-of-anna: {bus: arm, id: 1}}}
coupling: {pairs: {elbow-of-anna: {}}}
simulation: {hand: {elbow-of-anna: {mass: 0.1}}}
"""
SECRETS = {
    "names": ["annas-bench", "elbow-of-anna", "A. Person"],
    "serial": ["SN-4711-X", "0x4D2E"],
    "paths": ["/home/anna", "drive 3.eds", "../anna"],
    "hosts": ["192.168.7.20", *([HOST] if len(HOST) > 2 else [])],
}


def made(folder: Path, **changed: Any) -> Path:
    """An acceptance of two devices with all that may not be handed on."""
    stage = folder / "identity"
    stage.mkdir(parents=True)
    (stage / "rig.yaml").write_text(RIG)
    axis = "master.elbow-of-anna"
    note = f"{axis} (node 1): serial 0x4D2E, at tcp://192.168.7.20:502, from {HOST}: {FILE_OF_ANNA}"
    content: dict[str, Any] = {
        "rig": "annas-bench", "rig_sha256": "0", "version": "0.2.0", "by": "A. Person",
        "sealed_utc": "2026-11-28T23:01:23+00:00", "stages": ["identity"], "ended_at": "identity",
        "accepted": False,
        "buses": {
            "can": {"driver": "canopen", "way": "hardware", "simulated": False, "rate_hz": 500.0,
                    "needs_ms": 0.6, "how": "2 drives on bus can"},
        },
        "devices": {axis: {"firmware": "1.2", "serial": "0x4D2E", "hardware_serial": "SN-4711-X"}},
        "notes": {"identity": [note, "bus can: it can be read"]},
        "checks": [{"stage": "identity", "what": axis, "measured": {"serial": "0x4D2E", "at": 0.25},
                    "expected": "opened", "good": False}],
    } | changed  # fmt: skip
    return write_sealed(folder, content, None, "")


def test_nothing_that_names_anybody_is_handed_on(tmp_path: Path) -> None:
    found = shared(made(tmp_path))
    text = text_of(found)
    for secret in (one for some in SECRETS.values() for one in some):
        assert secret not in text, secret
    assert found.left_out == [*KEEP]
    assert (found.day, found.by, found.simulated, found.accepted) == (
        "2026-11-28",
        "",
        False,
        False,
    )
    assert found.devices["master.axis1"]["firmware"] == "1.2"
    assert found.checks[0]["measured"] == {"serial": "<serial>", "at": 0.25}
    assert found.notes["identity"][1] == "bus bus1: it can be read"
    assert found.rig["buses"]["bus1"]["options"]["interface"] == "socketcan"
    assert found.rig["master"]["axes"] == {"axis1": {"bus": "bus1", "id": 1}}
    assert "hand" in found.rig["simulation"]
    assert found.buses["bus1"]["how"] == "2 drives on bus bus1"


@pytest.mark.parametrize("keep", KEEP)
def test_what_is_asked_for_is_kept_and_nothing_else(tmp_path: Path, keep: str) -> None:
    text = text_of(shared(made(tmp_path), [keep]))
    for kind, secrets in SECRETS.items():
        for secret in secrets:
            if kind == keep:
                assert secret in text, secret
            elif kind != "names" or keep != "paths":
                assert secret not in text, secret


def test_the_file_is_read_back_and_fits_its_schema(tmp_path: Path) -> None:
    found = shared(made(tmp_path))
    target = tmp_path / "drives.json"
    module.write_shared(target, found)
    assert read_shared(target) == found
    schema = Shared.model_json_schema()
    Draft202012Validator(schema).validate(json.loads(target.read_text()))
    for text in ("", "[]", "{}", '{"format": "another"}'):
        target.write_text(text)
        with pytest.raises(ConfigError, match="is no file of `tautwave accept --share`"):
            read_shared(target)


def test_an_acceptance_that_was_changed_is_not_handed_on(tmp_path: Path) -> None:
    path = made(tmp_path)
    path.write_text(path.read_text().replace("0.25", "0.75"))
    with pytest.raises(ConfigError, match="was changed after it was sealed"):
        shared(tmp_path)


def test_it_is_printed_in_full_before_it_is_written(tmp_path: Path) -> None:
    path, target = made(tmp_path), tmp_path / "drives.json"
    done = CliRunner().invoke(main, ["accept", str(path), "--share", str(target)])
    assert done.exit_code == 0, done.output
    assert target.read_text() in done.output
    assert f"{target}: as printed above; nothing is sent anywhere" in done.output
    done = CliRunner().invoke(
        main, ["accept", str(path), "--share", str(target), "--share-with", "names,address"]
    )
    assert done.exit_code == 2
    assert "--share-with: 'address' is not one of names, serial, paths, hosts" in done.output
    assert command.KEEP == KEEP


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("from lab-pc.uni-bonn.de:502", "from <host>:502"),
        ("no answer of lab-pc:502", "no answer of <host>:502"),
        ("it is lab.acme.com, not here", "it is <host>, not here"),
        ("tcp://user:pw@host:502/x", "tcp://<host>:502/x"),
        ("tcp://joe:p@ss@host", "tcp://<host>"),
        ("tcp://[fe80::1%eth0]:502", "tcp://<host>:502"),
        ("at fe80::1:2 and 2001:db8:0:1:2:3:4:5", "at <host> and <host>"),
        ("at ::ffff:10.0.0.7, down", "at <host>, down"),
        ("MAC 00:1A:2b:3C:4D:5E, 00-1A-2B-3C-4D-5E", "MAC <host>, <host>"),
        ("ask joe.b@acme.de", "ask <host>"),
        ("at 10.0.0.7:502.", "at <host>:502."),
        ("/dev/serial/by-id/usb-FTDI_USB-RS422_FT4N-if00-port0 is gone", "<path>"),
        ("usb-FTDI_USB_FT4N-if00", "usb-FTDI_USB_<serial>-if00"),
        ("/home/joe/a (old) 'x', #2/b c.eds: bad", "<path>: bad"),
        ("'/home/joe/it, (b)#c' is bad", "'<path>' is bad"),
        ("read (/opt/acme/x.eds)", "read (<path>)"),
        ("~joe/x.eds and C:\\Users\\joe (b)\\x", "<path> and <path>"),
        ("drives-of-joe.eds:12: no such", "<path>:12: no such"),
        ("in joe/files/p,2.yaml, line 3", "in <path>, line 3"),
    ],
)
def test_what_names_a_person_or_a_place_is_left_out_of_text(text: str, left: str) -> None:
    assert module._Cleaner({}, set(), []).text(text) == left


@pytest.mark.parametrize(
    "text",
    [
        "607C:00=0 6091:01=1 A000:01 is 12, 1.78 N m/A, 12.0 V, 25 degC, +-20 %",
        "master.axis1 (node 1): modes PP, 0x0250: 1/2 and/or 3 / 4; 12:30:01",
        "Linux-6.18.44-fc-v669-x86_64-with-glibc2.36",
        "torque constant is the stall slope (docs/en/dxl/x/xm430-w350)",
        "master.axis1 (bus bus1, servo 1): current limit(38) 3.209 A (read)",
    ],
)
def test_what_names_nobody_stays(text: str) -> None:
    assert module._Cleaner({}, set(), []).text(text) == text


def test_values_of_keys_that_may_name_somebody_are_left_out() -> None:
    rig = {
        "inertia": {"value": 1.0, "source": "weighed by Joe at Acme Bonn"},
        "damping": {"value": 1.0, "source": "identified"},
        "options": {"endpoint": "labpc", "eds": "drive of joe (2).eds"},
        "other": {"endpoint": "sim", "channel": "can0"},
    }
    left = module._Cleaner({}, set(), []).tree(rig)
    assert left["inertia"]["source"] == "<source>"
    assert left["damping"] == rig["damping"]
    assert left["options"] == {"endpoint": "<host>", "eds": "<path>"}
    assert left["other"] == rig["other"]
    assert module._Cleaner({}, set(), KEEP).tree(rig) == rig


NUMBER, TOLD = 987654321, "0x3ADE68B1"
"""One serial number, as a rig and as a drive writes it."""


@pytest.mark.parametrize(
    ("value", "left"),
    [
        ({"identity": {"serial": NUMBER}}, {"identity": {"serial": SERIAL}}),
        ({"serial_number": "A-1"}, {"serial_number": SERIAL}),
        ({"serials": [1, 2.0]}, {"serials": [SERIAL, SERIAL]}),
        ({"serial": None, "has_serial": True}, {"serial": None, "has_serial": True}),
        (
            {"said": "1018:04 serial number is 0x12, but the rig expects 0x3; check"},
            {"said": f"1018:04 serial number is {SERIAL}, but the rig expects {SERIAL}; check"},
        ),
        ({"said": f"drive {NUMBER}, {TOLD}"}, {"said": f"drive {SERIAL}, {SERIAL}"}),
        ({"said": "serial ports found: none"}, {"said": "serial ports found: none"}),
    ],
)
def test_a_serial_number_is_left_out_however_it_is_written(
    value: dict[str, Any], left: dict[str, Any]
) -> None:
    known = set(module._serials({"serial": NUMBER}))
    assert module._Cleaner({}, known, []).tree(value) == left
    assert module._Cleaner({}, known, ["serial"]).tree(value) == value


@pytest.mark.parametrize(
    ("lines", "left"),
    [
        (["> 601#4018100400000000", "< 581#43181004B168DE3A"], [0, "< 581#4318100400000000"]),
        (["< 581#4318100100000012"], [0]),
        (["< 181#43181004B168DE3A"], [0]),
        (
            ["< 581#4118100404000000", "> 601#6000000000000000", "< 581#07B168DE3A000000",
             "< 581#0712345678000000"],
            [0, 1, "< 581#0700000000000000", 3],
        ),
        (
            ["> 7FF#0100330F00000000", "< 011#0100330FB168DE3A", "< 011#0100550FB168DE3A"],
            [0, "< 011#0100330F00000000", 2],
        ),
        (["< 011#0100330FB168DE3A"], [0]),  # nobody asked: a position
        (["> FFFFFD0043181004B168DE3A"], [0]),
    ],
)  # fmt: skip
def test_a_serial_number_in_traffic_is_zero(lines: list[str], left: list[int | str]) -> None:
    lines = [f"0.1 can {one}" for one in lines]
    wanted = [lines[one] if isinstance(one, int) else f"0.1 can {one}" for one in left]
    assert module._Cleaner({}, set(), []).lines(lines) == wanted
    assert module._Cleaner({}, set(), ["serial"]).lines(lines) == lines


def test_of_long_traffic_of_a_bus_the_first_and_the_last_lines_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_LINES", 3)
    path = made(tmp_path)
    lines = [f"0.{k:02d} can {'><'[k % 2]} {k:02X}" for k in range(40)]
    (path.parent / "identity" / TRAFFIC).write_text("\n".join(lines))
    left = shared(path, KEEP).stages["identity"]["traffic"]
    assert left == [*lines[:2], *lines[38:]]  # no exchange is cut


def test_a_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    path, target = made(tmp_path), tmp_path / "thesis.txt"
    target.write_text("mine")
    for rig in (path, tmp_path / "none.yaml"):
        done = CliRunner().invoke(main, ["accept", str(rig), "--share", str(target)])
        assert done.exit_code == 2
        assert f"{target} already exists and is not overwritten" in done.output
    assert target.read_text() == "mine"


@pytest.mark.slow
def test_a_device_that_is_refused_in_the_first_stage_leaves_a_file(tmp_path: Path) -> None:
    rig, target = written(tmp_path, old_servo()), tmp_path / "drives.json"
    done = accept(rig, "identity,hand", "", "--share", str(target))
    assert done.exit_code == 5, done.output
    assert done.output.rstrip().endswith("update it, or run with --allow-unwatched")
    found = read_shared(target)
    assert (found.accepted, found.ended_at, list(found.stages)) == (False, "identity", ["identity"])
    (check,) = found.checks
    assert not check["good"]
    assert "firmware 37 has no bus watchdog" in check["measured"]["said"]
    events, rig_of = read_traffic(target)
    bus = next(iter(rig_of["buses"]))
    assert [one for one in events if one.bus == bus and not one.out]
    assert shared_rig(rig_of).buses.keys() == {bus}
    assert verify(tmp_path / "out" / FILE).wrong == []


@pytest.mark.slow
def test_a_scale_unlike_the_drives_own_file_leaves_a_file_that_names_nobody(tmp_path: Path) -> None:
    data, target = shipped("bench-canopen-virtual"), tmp_path / "drives.json"
    eds = EDS.format(vendor="0xFB", product="0x60500000")
    (tmp_path / "joe drive.eds").write_text(re.sub(r"DefaultValue=\d+", "DefaultValue=777", eds))
    for node in data["buses"]["can"]["options"]["nodes"]:
        node["eds"] = "joe drive.eds"
        node["identity"]["serial"] = NUMBER
    done = accept(written(tmp_path, data), "identity,hand", "", "--share", str(target))
    assert done.exit_code == 5, done.output
    text, sent = target.read_text(), bytes.fromhex(TOLD[2:])[::-1].hex().upper()
    for secret in (str(NUMBER), TOLD, sent, "joe"):
        assert secret not in text
    assert "4318100400000000" in text
    (check,) = read_shared(target).checks
    assert "motor rated torque is 777" in check["measured"]["said"]


@pytest.mark.parametrize("lines", [3, [3], "0.1 a > FF", {"0.1 a > FF": 1}])
def test_traffic_that_is_no_lines_is_refused_in_a_sentence(tmp_path: Path, lines: Any) -> None:
    target = tmp_path / "drives.json"
    found = shared(made(tmp_path / "made"))
    target.write_text(text_of(found.model_copy(update={"stages": {"hand": {"traffic": lines}}})))
    with pytest.raises(ConfigError, match="traffic of stage 'hand' is no list of lines of text"):
        read_traffic(target)


@pytest.mark.slow
@pytest.mark.realtime
def test_a_walk_ends_in_a_file_that_shows_its_fault_at_a_glance(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    target = tmp_path / "drives.json"
    done = accept(rig, "identity,hand,motion", "0.1\n2 300\n", "--axis", "master.lever",
                  "--share", str(target))  # fmt: skip
    assert done.exit_code == 6, done.output
    found = read_shared(target)
    assert (found.simulated, found.accepted, found.ended_at) == (True, False, "hand")
    assert [check["what"] for check in found.checks if not check["good"]] == ["master.axis1"]
    stage = found.stages["hand"]
    assert stage["columns"][0] == "time_s"
    assert 50 <= len(stage["last"]) <= module.MAX_ROWS + 1
    assert stage["last"][-1][0] - stage["last"][0][0] == pytest.approx(module.SPAN_S, rel=0.1)
    assert stage["times_us"]["lateness_us"]["max"] == 0.0
    assert not re.search(r"\blever\b", target.read_text())
