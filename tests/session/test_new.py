"""`tautwave new`: from devices, an EDS, a profile or an example to a rig file that is read."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.contracts import no_progress
from tautwave.errors import ConfigError
from tautwave.session.new.choosing import halves, select
from tautwave.session.new.surveying import Place, survey
from tautwave.types import FoundBus, FoundDevice
from tautwave_drivers.canopen import plugin as canopen
from tautwave_drivers.canopen.scan import ScanOptions as CanScan
from tautwave_drivers.dynamixel import plugin as dynamixel
from tautwave_drivers.dynamixel.scan import ScanOptions
from tautwave_drivers.modbus import plugin as modbus
from tautwave_drivers.modbus.scan import ScanOptions as ModbusScan
from tests.commands import end_stops

pytestmark = pytest.mark.realtime

EDS = """\
[DeviceInfo]
VendorName=a vendor
VendorNumber=0x000000FB
ProductNumber=0x60500000
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
[OptionalObjects]
SupportedObjects=1
1=0x6076
[6076]
ParameterName=Motor rated torque
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=104000
"""
SHIFT = """
0.5 engage
2.0 episode pick red
2.5 episode success
2.6 clutch
2.8 engage
4.5 episode place red
5.0 episode failed
5.5 stop
"""
PROFILES = Path(sys.modules["tautwave_drivers"].__file__ or "").parent / "modbus/profiles"


def new(*arguments: str, typed: str = "") -> Result:
    return CliRunner().invoke(main, ["new", *arguments], input=typed)


def row(number: int, model: str = "XL330-M077", **keys: Any) -> dict[str, Any]:
    found = {"id": number, "model": model, "firmware": 52, "protocol": 2.0, "baud": 1_000_000}
    return found | keys


def bus(name: str, *ids: int) -> FoundBus:
    devices = [FoundDevice(number, "servo", {"id": number}, {}) for number in ids]
    return FoundBus(name, "dynamixel", {}, "servos", devices)


def test_an_eds_becomes_a_rig_that_is_read(tmp_path: Path) -> None:
    (tmp_path / "drive.eds").write_text(EDS)
    path = tmp_path / "drives.yaml"
    done = new(str(path), "--eds", str(tmp_path / "drive.eds"), "--master", "1,3", "--slave", "2,4")
    assert done.exit_code == 0, done.output
    assert "TODO" in done.output
    assert done.output.endswith(f"next: tautwave check {path}, then tautwave accept {path}\n")
    rig = load_rig(path, choose=False)
    nodes = rig.buses["can"].options["nodes"]
    assert [node["id"] for node in nodes] == [1, 3, 2, 4]
    assert {node["identity"]["vendor"] for node in nodes} == {0xFB}
    assert nodes[0]["rated_torque"] == pytest.approx(0.104)  # uN m, as this vendor writes it
    assert rig.master.axes["j2"].id == 3
    text = path.read_text()
    assert "counts_per_revolution is a guess: TODO" in text
    assert "rated_torque [N m] is a guess" not in text


def test_a_profile_becomes_a_rig_that_is_read(tmp_path: Path) -> None:
    path = tmp_path / "drives.yaml"
    profile = tmp_path / "mine.yaml"
    profile.write_text((PROFILES / "dsy-rs.yaml").read_text())
    done = new(str(path), "--profile", str(profile), "--joints", "lever")
    assert done.exit_code == 0, done.output
    rig = load_rig(path, choose=False)
    assert list(rig.coupling.pairs) == ["lever"]
    assert [one["unit"] for one in rig.buses["drives"].options["devices"]] == [1, 2]


def test_an_example_is_copied_under_its_new_name(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    done = new(str(path), "--from", "bench-1dof-loopback")
    assert done.exit_code == 0
    assert done.output.endswith(f"next: tautwave check {path}\n")
    assert load_rig(path).name == "mine"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("there.yaml",), "already exists and is not overwritten"),
        (("rig.txt",), "must end in .yaml"),
        (("a.yaml", "--bus", "dynamixel --prt x"), "no such option --prt; did you mean --port"),
        (("a.yaml", "--bus", "loopback"), "does not support scanning"),
        (("a.yaml", "--eds", "none.eds"), "none.eds: no such file"),
        (("a.yaml", "--profile", "none.yaml"), "none.yaml: no such file"),
        (("a.yaml", "--from", "bench-1dof"), "there is no example 'bench-1dof'"),
        (("a.yaml", "--eds", "a.eds", "--from", "b"), "mutually exclusive"),
    ],
)
def test_bad_input_is_one_sentence(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.yaml").write_text("mine")
    done = new(*arguments)
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())
    assert Path("there.yaml").read_text() == "mine"


def test_devices_are_selected_by_bus_and_id() -> None:
    arm, hand = bus("arm", 1, 2, 3), bus("hand", 1, 2, 3)
    chosen = select("arm:3,1 hand", [arm, hand], "--master")
    assert [(one.bus.name, one.device.id) for one in chosen] == [
        ("arm", 3), ("arm", 1), ("hand", 1), ("hand", 2), ("hand", 3),
    ]  # fmt: skip
    assert [one.device.id for one in select("1-2", [arm], "--master")] == [1, 2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1-2", "buses: arm, hand; write BUS:IDS"),
        ("leg:1", "no bus 'leg'"),
        ("arm:7", "bus arm has no device 7; it has 1-3"),
        ("arm:1 arm:1", "arm:1 is named twice"),
        ("arm:3-1", "the lower one first"),
        ("arm:x", "write ids like 1-6"),
        ("", "lists no devices"),
    ],
)
def test_a_wrong_selection_says_what_there_is(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        select(text, [bus("arm", 1, 2, 3), bus("hand", 1, 2, 3)], "--master")


def test_a_guess_cuts_one_bus_in_the_middle_and_takes_two_alike_as_sides() -> None:
    assert halves([bus("arm", 1, 2, 3, 4)]) == ("1-2", "3-4")
    assert halves([bus("arm", 1, 5)]) == ("1", "5")
    assert halves([bus("hand", 1, 2), bus("arm", 1, 2)]) == ("hand", "arm")
    assert halves([bus("hand", 1, 2), bus("arm", 1)]) == ("", "")


def test_what_a_rig_cannot_drive_is_left_out_and_said() -> None:
    assert dynamixel.survey is not None
    rows = [
        row(1, current_limit=0.1, velocity_limit=5.0),
        row(2, "XL430-W250"),
        row(3, baud=57_600),
        row(4, velocity_limit=40.0),
        {"id": 9, "model": "AX-12A", "protocol": 1.0, "baud": 1_000_000},
    ]
    (found,) = dynamixel.survey.propose(ScanOptions(port="/dev/none"), rows)
    assert [device.id for device in found.devices] == [1, 4]
    first, last = (device.axis for device in found.devices)
    assert first["velocity_limit"].value == 5.0
    assert last["velocity_limit"].value == 15.0
    assert first["effort_limit"].value == pytest.approx(0.1 * 0.215 / 1.47, rel=0.05)
    assert last["effort_limit"].value == pytest.approx(0.043)
    said = "\n".join(found.notes)
    assert "id 2, XL430-W250, has no current control" in said
    assert "id 3 responds at 57600 baud only" in said
    assert "id 9, AX-12A" in said
    assert not dynamixel.survey.propose(ScanOptions(port="/dev/none"), rows[1:2])


def test_a_drives_own_numbers_are_taken() -> None:
    assert canopen.survey is not None
    drive = {
        "node": 5, "device": "drive", "vendor": "0x1", "product": "0x2", "rated_torque": 640,
        "increments": 20_000, "revolutions": 2, "gear_motor": 5, "gear_shaft": 1, "max_speed": 3000,
    }  # fmt: skip
    silent = {"node": 6, "device": "present, but no SDO response"}
    (found,) = canopen.survey.propose(CanScan(), [drive, silent])
    (device,) = found.devices
    assert device.options["rated_torque"] == pytest.approx(0.64)
    assert device.options["counts_per_revolution"] == 10_000
    assert device.options["gear_ratio"] == 5.0
    assert device.axis["effort_limit"].value == pytest.approx(3.2)
    assert device.axis["velocity_limit"].value == pytest.approx(62.8)  # 3000 rpm behind the gear
    assert any("node 6 sends" in note for note in found.notes)
    assert not any("guess" in note for note in found.notes)


def test_modbus_drives_of_known_profiles_are_taken_and_others_named() -> None:
    assert modbus.survey is not None
    rows = [
        {"endpoint": "tcp://one:502", "unit": 1, "profile": "dsy-rs"},
        {"endpoint": "tcp://two:502", "unit": 7, "profile": "dsy-rs"},
        {"endpoint": "tcp://two:502", "unit": 8, "profile": None},
        {"endpoint": "tcp://two:502", "unit": None},
    ]
    (found,) = modbus.survey.propose(ModbusScan(), rows)
    assert [device.id for device in found.devices] == [1, 7]
    assert ["endpoint" in device.options for device in found.devices] == [False, True]
    left_out = [note for note in found.notes if "left out" in note]
    assert len(left_out) == 1
    assert left_out[0].startswith("tcp://two:502, unit 8, fits no profile")
    assert not modbus.survey.propose(ModbusScan(), rows[2:])


def test_a_line_that_does_not_open_is_reported_beside_those_that_do(tmp_path: Path) -> None:
    gone = Place("dynamixel", ScanOptions(port=str(tmp_path / "none"), protocol=2.0))
    found, without = survey([gone], no_progress)
    assert found == []
    assert [str(tmp_path / "none") in sentence for sentence in without] == [True]


def test_each_line_that_does_not_open_is_told_before_nothing_is_found(tmp_path: Path) -> None:
    ports = [str(tmp_path / name) for name in ("one", "two")]
    done = new(
        str(tmp_path / "arms.yaml"),
        *(word for port in ports for word in ("--bus", f"dynamixel --port {port}")),
    )
    assert done.exit_code == 2
    *said, last = [line for line in done.stderr.splitlines() if line]
    assert said == [
        f"{port}: no such device; plug in the adapter, or correct its path" for port in ports
    ]
    assert last == (
        "new: found no device that a rig can drive; are the devices powered? "
        "`tautwave scan DRIVER --help` lists the options of a scan"
    )


@contextmanager
def served(*options: str) -> Iterator[str]:
    command = [sys.executable, "-c", "from tautwave.cli import main; main()", "sim"]
    child = subprocess.Popen([*command, *options], stdout=subprocess.PIPE)
    try:
        assert child.stdout is not None
        yield str(json.loads(child.stdout.readline())["endpoint"])
    finally:
        child.terminate()
        child.communicate(timeout=60)


@pytest.mark.nightly
@pytest.mark.slow
def test_two_served_arms_are_found_checked_operated_and_exported(tmp_path: Path) -> None:
    path = tmp_path / "arms.yaml"
    with ExitStack() as arms:
        ports = [
            arms.enter_context(served("dynamixel", "--model", model, "--ids", "1,2,3,4,5,6"))
            for model in ("XL330-M077", "XM430-W350")
        ]
        buses = [
            f"{name}=dynamixel --port {port} --baud 1000000 --protocol 2.0"
            for name, port in zip(("leader", "follower"), ports, strict=True)
        ]
        done = new(
            str(path), "--bus", buses[0], "--bus", buses[1], "--master", "leader",
            "--slave", "follower",
        )  # fmt: skip
        assert done.exit_code == 0, done.output
        checked = CliRunner().invoke(main, ["check", str(path)])
        assert checked.exit_code == 0, checked.output
        # Both arms are simulated beside the run, on a machine that does other things too.
        slow = ["rate_hz=100", "loop.missing_limit=100", "loop.overrun_limit=100"]
        slow += end_stops(*(f"j{number}" for number in range(1, 7)))
        (tmp_path / "shift.txt").write_text(SHIFT)
        out = tmp_path / "shift"
        ran = CliRunner().invoke(
            main,
            ["run", str(path), "--configure", "--quiet", "--out", str(out), "--commands",
             str(tmp_path / "shift.txt"), *(word for key in slow for word in ("--set", key))],
        )  # fmt: skip
        # Answers that were late count against the certificate; here they tell of the machine.
        late = "what this run measured invalidates its certificate" in ran.output
        assert ran.exit_code == (3 if late else 0), ran.output
    exported = CliRunner().invoke(main, ["export", str(out)])
    names = [Path(line).name for line in exported.output.split()]
    assert names == ["001-pick.csv", "002-place.csv", "episodes.csv"]
    operation = json.loads((out / "summary.json").read_text())["operation"]
    assert operation["engagements"] == 2
    assert [entry["state"] for entry in operation["journal"] if entry["word"] == "aligned"] == [
        "engaged", "engaged",
    ]  # fmt: skip
    rig = load_rig(path, choose=False)
    assert len(rig.coupling.pairs) == 6
    assert rig.rate_hz == 300.0
    assert rig.operate is not None


@pytest.mark.slow
def test_a_served_modbus_drive_is_recognised_by_its_own_profile(tmp_path: Path) -> None:
    profile = tmp_path / "mine.yaml"
    profile.write_text((PROFILES / "dsy-rs.yaml").read_text().replace("dsy-rs", "mine", 1))
    serving = ("modbus", "--profile", str(profile), "--units", "1,2", "--tcp", "127.0.0.1:0")
    with served(*serving) as endpoint:
        scan = f"modbus --endpoint {endpoint} --units 1,2 --profiles {profile}"
        path = tmp_path / "drives.yaml"
        done = new(str(path), "--bus", scan, "--master", "1", "--slave", "2")
        assert done.exit_code == 0, done.output
    devices = load_rig(path, choose=False).buses["drives"].options["devices"]
    assert [(one["unit"], one["profile"]) for one in devices] == [
        (1, str(profile)), (2, str(profile)),
    ]  # fmt: skip
