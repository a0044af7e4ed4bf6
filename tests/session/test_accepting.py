"""The first day with real drives: each stage measures what it says, and the end is sealed.

`python -m tests.session.test_accepting servos cia402 modbus` walks all of it with each kind.
"""

from __future__ import annotations

import json
import math
import re
import socket
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.session.acceptance.document import FILE, content_digest, verify
from tautwave.session.acceptance.ladder import STAGES
from tautwave.sites.certificates import make_authority
from tests.rigs.running import Tree
from tests.runtime.test_device_faults import servo_tree
from tests.session.newcomers import HEARTBEATS, Newcomer, Talk, served
from tests.session.test_calibrating import BENCH
from tests.session.test_newcomers import EDS, own_drive, settle

pytestmark = pytest.mark.realtime

WAY = "[[0, 0], [1, 0], [2, 0.2], [3, 0.2], [4, -0.49], [5, 0.49], [6, 0], [99, 0]]"


def bench(folder: Path, environment: Tree | None = None) -> Path:
    """Write the bench without walls, its hand on a way of its own, and nothing else to touch."""
    data: Tree = yaml.safe_load(BENCH.read_text())
    for key in ("wall_master", "wall_slave"):
        del data["coupling"]["pairs"]["lever"][key]
    data["simulation"]["hand"]["lever"]["reference"]["waypoints"] = json.loads(WAY)
    data["simulation"]["environment"] = {"lever": environment or {"type": "free"}}
    for side in ("master", "slave"):
        data[side]["axes"]["lever"]["position_range"] = [-0.5, 0.5]
    return written(folder, data)


def written(folder: Path, data: Tree) -> Path:
    path = folder / "rig.yaml"
    text = json.dumps(data)  # YAML, too
    path.write_text(text)
    return path


def accept(rig: Path, stages: str, answers: str, *options: str) -> Any:
    (rig.parent / "answers.txt").write_text(answers)
    words = ["accept", str(rig), "--by", "a person", "--stages", stages, "--clock", "fake"]
    words += ["--script", str(rig.parent / "answers.txt"), "--out", str(rig.parent / "out")]
    return CliRunner().invoke(main, [*words, *options])


def checks(rig: Path) -> dict[tuple[str, str], dict[str, Any]]:
    content = json.loads((rig.parent / "out" / FILE).read_text())
    return {(one["stage"], one["what"]): one for one in content["checks"]}


@pytest.mark.slow
def test_a_wrong_scale_ends_the_day_before_anything_gets_torque(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    done = accept(rig, "hand,noise", "2 20\n", "--axis", "master.lever")
    assert done.exit_code == 6
    assert "scale master.lever" in done.output
    assert "NOT accepted by a person" in done.output
    assert "FAILED, expected 1 within 0.05" in done.output
    assert not (tmp_path / "out" / "noise").exists()
    assert json.loads((tmp_path / "out" / FILE).read_text())["ended_at"] == "hand"
    assert checks(rig)["scale", "master.lever"]["measured"]["known_rad"] == math.radians(20.0)
    assert verify(tmp_path / "out" / FILE).wrong == []


@pytest.mark.slow
def test_noise_delay_and_effort_are_measured_under_torque(tmp_path: Path) -> None:
    scale = {"type": "spring", "stiffness": 8.0, "position": 0.0}
    rig = bench(tmp_path, environment=scale)
    answers = "0.1\n0.1\n0.1\n0.1 0.11\n0.1\n0.1 0.3\n"
    done = accept(rig, "noise,delay,effort", answers, "--axis", "slave.lever")
    assert done.exit_code == 6  # the scale read 0.3 of 0.22 N m
    found = checks(rig)
    assert found["noise", "slave.lever"]["good"]
    delay = found["delay", "slave.lever"]["measured"]
    assert 0.0 < delay["answered_after_s"] < 0.02
    assert delay["moved"] > 0.0
    assert found["effort", "slave.lever"]["measured"]["ratio"] == pytest.approx(0.3 / 0.22)


@pytest.mark.slow
def test_a_motion_both_ways_is_small_and_nothing_is_kept_of_simulated_devices(
    tmp_path: Path,
) -> None:
    rig = bench(tmp_path)
    done = accept(rig, "identity,motion", "0.1\n0.1\n", "--axis", "slave.lever")
    assert done.exit_code == 0, done.output
    for way in ("forward", "back"):
        moved = checks(rig)["motion", f"slave.lever {way}"]["measured"]["moved"]
        assert math.radians(0.5) < moved < math.radians(5.0)
    assert not list(tmp_path.glob("*.accepted.json"))


@pytest.mark.slow
def test_an_axis_that_takes_velocity_is_driven_both_ways(tmp_path: Path) -> None:
    data = yaml.safe_load(BENCH.with_name("bench-admittance-loopback.yaml").read_text())
    data["simulation"]["environment"] = {"lever": {"type": "free"}}
    rig = written(tmp_path, data)
    done = accept(rig, "identity,motion", "0.1\n0.1\n", "--axis", "slave.lever")
    assert done.exit_code == 0, done.output
    for way in ("forward", "back"):
        found = checks(rig)["motion", f"slave.lever {way}"]["measured"]
        assert math.radians(0.5) < found["moved"] < math.radians(5.0)
        assert found["ratio"] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("truth", "wrong"),
    [
        ("{}", ""),
        ("{effort_sensor: {noise: 0.001, offset: 0.1}}", "sensor offset"),
        pytest.param(
            "{effort_sensor: {noise: 0.001, scale: 2.0}}", "sensor scale", marks=pytest.mark.slow
        ),
    ],
)
def test_an_effort_sensor_is_compared_with_the_motor_before_anything_is_coupled(
    tmp_path: Path, truth: str, wrong: str
) -> None:
    rig = bench(tmp_path, environment={"type": "spring", "stiffness": 8.0, "position": 0.0})
    data = yaml.safe_load(rig.read_text())
    data["slave"]["axes"]["lever"]["effort_sensor"] = {"quantum": 1e-4, "noise": 1e-3}
    data["simulation"]["axes"]["slave.lever"] |= yaml.safe_load(truth)
    written(tmp_path, data)
    answers = "0.1\n0.1\n0.1 0.11\n0.1\n0.1 0.22\n"
    accept(rig, "noise,effort", answers, "--axis", "slave.lever")
    bad = [what for (_, what), check in checks(rig).items() if not check["good"]]
    assert bad == ([f"slave.lever {wrong}"] if wrong else [])
    assert any(what.endswith("sensor offset") for _, what in checks(rig))


def test_a_cable_that_was_not_pulled_is_no_pass(tmp_path: Path) -> None:
    rig = written(tmp_path, servo_tree())
    done = accept(rig, "watchdog", "0.1\n")
    assert done.exit_code == 6
    assert checks(rig)["watchdog", "loss"]["measured"]["said"] == "nothing was lost"


@pytest.mark.parametrize("by", ["", "  "])
def test_nobody_accepts_nothing(tmp_path: Path, by: str) -> None:
    done = CliRunner().invoke(main, ["accept", str(tmp_path / "rig.yaml"), "--by", by])
    assert done.exit_code == 2
    assert "--by is missing: who performs the acceptance?" in done.output


@pytest.mark.parametrize("text", ["", "[]", '{"seal": 3}', '{"seal": {"sha256": 5}, "files": [1]}'])
def test_what_is_no_acceptance_is_said(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE).write_text(text)
    done = CliRunner().invoke(main, ["accept", str(tmp_path / FILE), "--verify"])
    assert done.exit_code == 2
    assert "is not an acceptance.json written by `tautwave accept`" in done.output


@pytest.mark.slow
def test_what_was_sealed_is_verified_to_the_byte(tmp_path: Path) -> None:
    make_authority(tmp_path / "keys", ["lab", "clinic"])
    make_authority(tmp_path / "others", ["lab", "clinic"])
    rig = bench(tmp_path)
    missing = accept(rig, "identity", "0.1\n", "--keys", str(tmp_path), "--site", "lab")
    assert "missing; make them with: tautwave keys init" in missing.output
    keys = ["--keys", str(tmp_path / "keys")]
    done = accept(rig, "identity", "0.1\n", *keys, "--site", "lab")
    assert done.exit_code == 0, done.output
    assert "accepted by a person, signed with the key of site lab" in done.output
    path = tmp_path / "out" / FILE
    assert verify(path, tmp_path / "keys") == ([], "lab")
    done = CliRunner().invoke(main, ["accept", str(path), "--verify", *keys])
    assert (
        done.output == f"{path}: unchanged since it was sealed, signed with the key of site lab\n"
    )
    text = path.read_text()
    for was, now in (('"accepted": true', '"accepted": false'), ("a person", "someone else")):
        path.write_text(text.replace(was, now))
        assert verify(path).wrong == [f"{path}: was changed after it was sealed"]
    changed = json.loads(text.replace("a person", "someone else"))
    changed["seal"]["sha256"] = content_digest(changed)
    path.write_text(json.dumps(changed))  # sealed anew, by whoever may write here
    assert verify(path).wrong == []
    (wrong,) = verify(path, tmp_path / "keys").wrong
    assert "the signature does not match the certificate's key" in wrong
    changed = json.loads(text)
    changed["sealed_utc"] = "2001-01-01T00:00:00+00:00"
    del changed["seal"]["signature"]
    path.write_text(json.dumps(changed))
    assert "sealed, but not signed" in verify(path, tmp_path / "keys").wrong[-1]
    changed["seal"] |= {"signature": 3}
    path.write_text(json.dumps(changed))
    assert "its signature cannot be read" in verify(path, tmp_path / "keys").wrong[-1]
    path.write_text(text)
    assert "was not issued by" in verify(path, tmp_path / "others").wrong[0]
    assert "not an authority's certificate" in verify(path, tmp_path).wrong[0]
    recording = tmp_path / "out" / "identity" / "recording.mcap"
    recording.write_bytes(recording.read_bytes() + b"x")
    done = CliRunner().invoke(main, ["accept", str(path), "--verify"])
    assert done.exit_code == 2
    assert "differs from the file that was sealed" in done.output
    recording.unlink()
    assert verify(path).wrong == [f"{recording}: is gone"]


# -- all of it, against served devices ------------------------------------------------------------

KNOWN_RAD = 0.3


class Drives(NamedTuple):
    """Served devices, their ids, and how their rig is written and settled."""

    served: Sequence[str]
    ids: tuple[int, int]
    new: Sequence[str]
    changes: Sequence[tuple[str, str]]
    rate_hz: int = 200


def servos(folder: Path) -> Drives:
    cable = str(folder / "cable")
    bus = f"dynamixel --port {cable} --baud 1000000 --protocol 2.0 --ids 1,11"
    return Drives(
        ("dynamixel", "--model", "XM430-W350", "--ids", "1,11", "--link", cable),
        (1, 11),
        ("--bus", bus, "--master", "1", "--slave", "11"),
        [("      baud: 1000000", "      watchdog_s: 2.0\n      baud: 1000000")],
    )


def cia402(folder: Path) -> Drives:
    place = ("--interface", "udp_multicast", "--channel", "239.74.163.82")
    (folder / "drive.eds").write_text(EDS.format(vendor=0, product=0))
    return Drives(
        ("canopen", *place, "--inertia", "6e-4", "--damping", "3e-3"),
        (1, 2),
        ("--eds", "drive.eds"),
        [("socketcan", "udp_multicast"), ("can0", place[-1]), HEARTBEATS],
    )


def modbus(folder: Path) -> Drives:
    (folder / "my-drive.yaml").write_text(own_drive())
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        here = f"127.0.0.1:{free.getsockname()[1]}"
    body = ("--inertia", "0.006", "--damping", "0.03")
    return Drives(
        ("modbus", "--profile", "my-drive.yaml", "--tcp", here, "--units", "1,2", *body),
        (1, 2),
        ("--profile", "my-drive.yaml"),
        [("192.168.1.20:502", here)],
        100,
    )


def whole_day(folder: Path, drives: Drives) -> dict[str, Any]:
    """Walk all stages by typed answers and hands; return the sealed document.

    The cable is pulled by ending the devices.
    """
    me = Newcomer(folder)
    rig = folder / "drives.yaml"
    with served(folder, *drives.served) as (hands, _):
        me.does("new", rig.name, *drives.new)
        settle(rig, *drives.changes)
        text = rig.read_text()
        for pattern, value in (
            (r"rate_hz: .*", f"rate_hz: {drives.rate_hz}"),
            (r"missing_limit: \d+, overrun_limit: \d+", "missing_limit: 400, overrun_limit: 400"),
            (
                r"position_range: .*?]",
                "position_range: [-0.4, 0.4]\n    mechanical_range: [-0.5, 0.5]",
            ),
        ):
            text, count = re.subn(pattern, value, text)
            assert count, pattern
        rig.write_text(text)
        words = ("accept", rig.name, "--by", "a person", "--run-s", "0.5", "--configure",
                 "--keys", "keys", "--out", "runs/accept")  # fmt: skip
        me.does("keys", "init", "keys")
        with me.talks(*words) as talk:
            no_torque(talk, hands, drives.ids)
            talk.hears("unplug the bus cable now")
            hands.child.kill()
            hands.child.wait()
            talk.hears("plug it in again")
            with served(folder, *drives.served) as (hands, _):
                talk.types()
                with_torque(talk, hands, drives.ids)
                talk.hears("acceptance.json: ")
    content: dict[str, Any] = json.loads((folder / "runs" / "accept" / FILE).read_text())
    return content


def judge(folder: Path, content: dict[str, Any]) -> None:
    """Look at every stage's numbers."""
    assert content["accepted"], content["checks"]
    ran = {Path(name).parts[0] for name in content["files"]}
    assert ran == set(STAGES)
    found = {(one["stage"], one["what"]): one["measured"] for one in content["checks"]}
    for axis in ("master.j1", "slave.j1"):
        assert found["scale", axis]["ratio"] == pytest.approx(1.0, abs=0.03)
        assert 0.0 < found["delay", axis]["answered_after_s"] < 0.3
        assert found["limits", axis]["highest"] > 0.45
    (name,) = [what for stage, what in found if stage == "full"]
    limits = []
    for stage in ("gentle", "full"):
        assert found[stage, name]["exit_code"] == 0.0
        ran = yaml.safe_load((folder / "runs" / "accept" / stage / "rig.yaml").read_text())
        limits.append(ran["slave"]["axes"]["j1"]["effort_limit"])
    assert limits[0] == pytest.approx(0.1 * limits[1])
    assert not (folder / "drives.accepted.json").exists()  # of software, not of hardware
    assert found["watchdog", "loss"]["said"] != "nothing was lost"
    document = folder / "runs" / "accept" / FILE
    assert verify(document, folder / "keys") == ([], "master")


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(300)
def test_a_whole_day_with_served_drives(tmp_path: Path) -> None:
    judge(tmp_path, whole_day(tmp_path, cia402(tmp_path)))


def no_torque(talk: Talk, hands: Talk, ids: tuple[int, int]) -> None:
    talk.hears("are these your devices")
    talk.types()
    for one in ids:
        talk.hears("a known angle and hold it")
        hands.types(f"{one} {KNOWN_RAD} 0.1")
        time.sleep(0.4)
        talk.types(f"{math.degrees(KNOWN_RAD):.3f}")
    both = ",".join(str(one) for one in ids)
    talk.hears("to both ends")
    for end in (0.5, -0.5, 0.0):
        hands.types(f"{both} {end} 0.1")
        time.sleep(0.4)
    talk.types()
    talk.hears("take your hands off")
    hands.types(f"{both} free")
    talk.types()
    talk.hears("their watchdogs armed")
    talk.types()


def with_torque(talk: Talk, hands: Talk, ids: tuple[int, int]) -> None:
    for _ in ids:
        talk.hears("hold it loosely")
        talk.types()
        talk.hears("which way did it go")
        talk.types("+")
    talk.hears("is moved both ways")
    talk.types()
    talk.hears("gets a tenth")
    talk.types()
    for _ in range(4):
        asked = talk.hears("it pulls with")
        hands.types(f"{ids[0]},{ids[1]} 0 0.1")  # the scale holds it
        talk.types()
        talk.hears("scale reading in")
        talk.types(re.search(r"pulls with ([\d.]+)", asked)[1])  # type: ignore[index]


if __name__ == "__main__":
    for kind in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as name:
            place = Path(name)
            day = whole_day(
                place, {"servos": servos, "cia402": cia402, "modbus": modbus}[kind](place)
            )
            judge(place, day)
            print(f"{kind}: {len(day['checks'])} checks good, in {len(day['stages'])} stages")
