"""Devices served elsewhere, and endpoints that are opened, with real processes on every bus."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.errors import DriverError
from tautwave.recordings.recording import read_recording
from tautwave.session.registration import (
    RUN,
    SIM,
    Server,
    began,
    directory,
    find_server,
    registered,
)
from tests.commands import AT_200_HZ, END_STOPS, keep_in_one_process, tautwave

pytestmark = pytest.mark.realtime

CONFIGS = Path(__file__).parents[2] / "configs"
MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"
GROUP = f"239.74.{os.getpid() >> 8 & 0xFF}.{os.getpid() & 0xFF}"
"""A multicast group that no other test of this machine has."""
UDP = ("--set", "buses.can.options.interface=udp_multicast",
       "--set", f"buses.can.options.channel={GROUP}")  # fmt: skip


PATIENT = ("--duration", "0.4", "--set", "loop.missing_limit=500",
           "--set", "loop.overrun_limit=5000",
           *(word for key in END_STOPS for word in ("--set", key)))  # fmt: skip
"""What this machine does beside it is not what is tested."""


def finished(reported: Any, summary: Any) -> bool:
    """Whether a run came to its end; 3: a busy machine lost samples, which spoils certificates."""
    assert reported.exit_code in (0, 3), reported.output
    return bool(summary["outcome"]["kind"] == "finished")


def config(name: str) -> str:
    return str(CONFIGS / f"{name}.yaml")


@contextmanager
def sim(*words: str, lines: int = 1) -> Iterator[tuple[subprocess.Popen[str], list[Any]]]:
    """`tautwave sim` with what it announces."""
    command = [sys.executable, "-c", MAIN, "sim", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        try:
            assert child.stdout is not None
            yield child, [json.loads(child.stdout.readline()) for _ in range(lines)]
        finally:
            child.terminate()
            child.communicate(timeout=60)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Run the command in this process; give exit code, output, and the summary if there is one."""
    keep_in_one_process(monkeypatch)
    count = iter(range(99))

    def once(*words: str) -> Any:
        out = tmp_path / f"run{next(count)}"
        reported = tautwave("run", *words, *PATIENT, "--out", out, cwd=tmp_path)
        path = out / "summary.json"
        summary = json.loads(path.read_text()) if path.exists() else None
        return reported, summary, out

    return once


def set_words(**options: object) -> list[str]:
    """`--set` of options of a bus, `BUS__OPTION=value`."""
    words = []
    for key, value in options.items():
        bus, _, option = key.partition("__")
        words += ["--set", f"buses.{bus}.options.{option}={value}"]
    return words


@pytest.mark.slow
def test_servos_are_found_by_themselves_and_opened_where_they_are_named(run: Any) -> None:
    rig = config("bench-dynamixel-sim")
    with sim(rig) as (child, (line,)):
        reported, summary, _ = run(rig, "--attach")
        assert finished(reported, summary)
        where = f"simulated elsewhere, at {line['endpoint']} (process {child.pid})"
        assert reported.stdout.splitlines()[0] == f"bus servos  {where}"
        bus = summary["buses"]["servos"]
        assert (bus["way"], bus["endpoint"]) == ("simulated elsewhere", line["endpoint"])
        assert summary["cycles"] > 50

        # The same pseudo-terminal as a named port is opened, whatever the rig could simulate.
        named = set_words(servos__port=line["endpoint"])
        reported, summary, out = run(rig, *named)
        assert finished(reported, summary)
        assert reported.stdout.splitlines()[0] == f"bus servos  hardware at {line['endpoint']}"
        assert summary["buses"]["servos"]["way"] == "hardware"
        assert load_rig(out / "rig.yaml").simulation is None
        columns = read_recording(out / "recording.mcap").columns
        assert not any(name.startswith("true.") for name in columns)

        reported, summary, _ = run(rig, *named, *set_words(servos__baud=3000000))
        assert reported.exit_code == 5
        assert "no answer at 3000000 baud" in reported.stderr
        servos = "[{id: 9, model: XM430-W350}, {id: 2, model: XM430-W350}]"
        words = [*set_words(servos__servos=servos), "--set", "master.axes.lever.id=9"]
        reported, summary, _ = run(rig, "--attach", *words)
        assert reported.exit_code == 5
        assert "servo 9" in reported.stderr


@pytest.mark.slow
def test_identify_shakes_what_is_served_elsewhere_and_what_is_named(tmp_path: Path) -> None:
    rig = config("bench-dynamixel-sim")
    words = ("--axis", "master.lever", *PATIENT[2:], "--duration", "0.6", "--out")
    with sim(rig) as (child, (line,)):
        where = line["endpoint"]
        for out, more, way in (
            ("served", ["--attach"], f"simulated elsewhere, at {where} (process {child.pid})"),
            ("named", set_words(servos__port=where), f"hardware at {where}"),
        ):
            reported = tautwave("identify", rig, *more, *words, out, cwd=tmp_path)
            # So short a time, with a hand that holds it, may not be enough to tell its parameters.
            assert reported.exit_code in (0, 2, 6), reported.output
            assert reported.exit_code == 0 or "and cannot be identified" in reported.stderr
            assert reported.stdout.splitlines()[0] == f"bus servos  {way}"
            assert "simulated hand and environment were removed" not in reported.stdout
            recorded = read_recording(tmp_path / out)
            assert len(recorded.time_s) > 20


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("link", ["tcp", "rtu"])
def test_modbus_drives_are_found_by_themselves_and_opened_where_they_are_named(
    run: Any, link: str
) -> None:
    rig = config(f"bench-modbus-{link}-sim")
    slow = ("--set", "rate_hz=400", "--set", "coupling.pairs.lever.wave_filter_hz=4",
            "--allow-uncertified")  # fmt: skip
    # A served drive may answer late.
    with sim(rig, *slow[:-1]) as (_, (line,)):
        reported, summary, _ = run(rig, "--attach", *slow)
        assert finished(reported, summary)
        bus = summary["buses"]["arm"]
        assert (bus["way"], bus["endpoint"]) == ("simulated elsewhere", line["endpoint"])
        assert summary["buses"]["hand"]["way"] == "simulated here"

        # A simulated master with a named drive: the truth of the master alone is recorded.
        named = (*slow, *set_words(arm__endpoint=line["endpoint"]))
        reported, summary, out = run(rig, *named)
        assert finished(reported, summary)
        assert summary["buses"]["arm"]["way"] == "hardware"
        columns = read_recording(out / "recording.mcap").columns
        true = {name.split(".")[1] for name in columns if name.startswith("true.")}
        assert true == {"master"}

        units = load_rig(rig).buses["arm"].options["devices"]
        given = [{k: v for k, v in {**one, "unit": 9}.items() if v is not None} for one in units]
        words = [*set_words(arm__devices=json.dumps(given)), "--set", "slave.axes.lever.id=9"]
        reported, summary, _ = run(rig, *named, *words)
        assert reported.exit_code == 5
        assert "unit 9" in reported.stderr


@pytest.mark.nightly
@pytest.mark.slow
def test_drives_on_a_shared_can_interface_have_one_server(run: Any) -> None:
    rig = config("bench-canopen-vcan")
    with sim(rig, *UDP) as (child, _):
        reported, summary, _ = run(rig, *UDP, "--attach", "--set", "rate_hz=100",
                               "--allow-uncertified")  # fmt: skip
        assert finished(reported, summary)
        bus = summary["buses"]["can"]
        assert bus["way"] == "simulated elsewhere"
        assert bus["endpoint"] == f"udp_multicast:{GROUP}"
        # A run that served the same nodes there too would talk over them.
        reported, summary, _ = run(rig, *UDP)
        assert reported.exit_code == 5
        assert f"served by process {child.pid} (tautwave sim)" in reported.stderr
        assert summary is None
    reported, summary, _ = run(rig, *UDP, "--set", "rate_hz=100", "--allow-uncertified")
    assert finished(reported, summary)
    assert summary["buses"]["can"]["where"] == "served by this run"
    assert not list(directory().glob("*.json"))


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "bench-modbus-tcp-sim",
            ("--set", "rate_hz=400", "--set", "coupling.pairs.lever.wave_filter_hz=4"),
        ),
        ("bench-canopen-vcan", (*UDP, "--set", "rate_hz=100")),
    ],
)
def test_a_second_run_is_refused_and_the_first_goes_on(
    run: Any, tmp_path: Path, name: str, words: tuple[str, ...]
) -> None:
    rig, slow = config(name), (*words, "--allow-uncertified", "--attach")
    with sim(rig, *words), begun(rig, *slow, cwd=tmp_path) as first:
        reported, summary, _ = run(rig, *slow)
        assert reported.exit_code == 5
        assert f"has a master on this machine, process {first.pid} (" in reported.stderr
        assert summary is None
        assert first.poll() is None


@pytest.mark.vcan
@pytest.mark.timeout(240)
def test_drives_on_vcan_are_attached_to_and_served(run: Any) -> None:
    rig = config("bench-canopen-vcan")
    with sim(rig):
        reported, summary, _ = run(rig, "--attach", *AT_200_HZ)
        assert finished(reported, summary)
        assert summary["buses"]["can"]["endpoint"] == "socketcan:vcan0"
        assert summary["buses"]["can"]["way"] == "simulated elsewhere"
    reported, summary, _ = run(rig, *AT_200_HZ)
    assert finished(reported, summary)
    assert summary["buses"]["can"]["words"] == (
        "simulated here, served by this run at socketcan:vcan0"
    )


@pytest.mark.vcan
@pytest.mark.timeout(280)
def test_after_a_run_on_vcan_was_killed_the_next_one_comes_up(run: Any, tmp_path: Path) -> None:
    """Drives that were left enabled, and those of the killed run itself."""
    rig = config("bench-canopen-vcan")
    with sim(rig):
        kill_a_run(rig, "--attach", *AT_200_HZ, cwd=tmp_path)
        reported, summary, _ = run(rig, "--attach", *AT_200_HZ)
        assert finished(reported, summary)
    kill_a_run(rig, *AT_200_HZ, cwd=tmp_path)
    reported, summary, _ = run(rig, *AT_200_HZ)
    assert finished(reported, summary)


@contextmanager
def begun(*words: str, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    """Give a run whose motors move; it is killed after the block."""
    command = [sys.executable, "-c", MAIN, "run", *words, "--duration", "60", *PATIENT[2:]]
    with subprocess.Popen(
        command, cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stderr is not None
        try:
            said = ""
            for line in child.stderr:
                said += line
                if "running" in line:
                    break
            else:
                pytest.fail(f"it did not run: {said}")
            yield child
        finally:
            child.kill()


def kill_a_run(*words: str, cwd: Path) -> None:
    """Kill a run with SIGKILL once its motors move."""
    with begun(*words, cwd=cwd):
        pass


@pytest.mark.slow
def test_a_real_master_leads_a_simulated_slave(run: Any) -> None:
    rig = config("bench-mixed-sim")
    with sim(rig) as (_, (line,)):
        reported, summary, out = run(rig, *set_words(hand__port=line["endpoint"]))
        assert finished(reported, summary)
    assert [bus["words"] for bus in summary["buses"].values()] == [
        f"hardware at {line['endpoint']}",
        "simulated here, in memory",
    ]
    assert "error" not in summary.get("precision", {})
    columns = read_recording(out / "recording.mcap").columns
    true = {name.split(".")[1] for name in columns if name.startswith("true.")}
    assert true == {"slave"}


@pytest.mark.slow
def test_what_names_hardware_is_served_and_attached_to_on_request_only(
    run: Any, tmp_path: Path
) -> None:
    rig = config("bench-dynamixel-sim")
    hard = set_words(servos__port="/dev/ttyNONE")
    reported = tautwave("sim", rig, *hard, cwd=tmp_path)
    assert reported.exit_code == 2
    assert "bus servos at /dev/ttyNONE" in reported.stderr
    with sim(rig, *hard, "--simulate") as (child, (line,)):
        reported, summary, _ = run(rig, *hard, "--attach", "--simulate", "servos")
        assert finished(reported, summary)
        bus = summary["buses"]["servos"]
        assert (bus["endpoint"], bus["forced"]) == (line["endpoint"], True)
        reported, summary, _ = run(rig, *hard)
        assert reported.exit_code == 5
        assert "/dev/ttyNONE: no such device" in reported.stderr
        child.send_signal(signal.SIGINT)
        _, said = child.communicate(timeout=60)
    assert f"process {child.pid} until Ctrl-C" in said
    assert "--simulate servos --attach" in said


@pytest.mark.slow
def test_a_second_server_is_refused_and_a_dead_one_is_known(run: Any, tmp_path: Path) -> None:
    rig = config("bench-dynamixel-sim")
    reported, summary, _ = run(rig, "--attach")
    assert reported.exit_code == 5
    assert reported.stderr.count("\n") == 1
    assert f"start `tautwave sim {rig}`" in reported.stderr
    with sim(rig) as (child, _):
        reported = tautwave("sim", rig, cwd=tmp_path)
        assert reported.exit_code == 5
        assert f"process {child.pid} (tautwave sim) already serves its devices" in reported.stderr
        child.kill()
        child.wait()
        (left,) = directory().glob("*.json")
        reported, summary, _ = run(rig, "--attach")
        assert reported.exit_code == 5
        assert (
            f"process {child.pid} (tautwave sim) served its devices and has ended"
            in reported.stderr
        )
        assert summary is None
        assert not left.exists()


def test_what_a_killed_server_left_does_not_keep_the_next_from_serving() -> None:
    rig = load_rig(config("bench-dynamixel-sim"))
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    for pid, start in ((dead.pid, 1), (os.getpid(), (began(os.getpid()) or 0) - 1)):
        with registered(rig, SIM, ["socketcan:vcan9"]):
            (path,) = directory().glob("*.json")
            keys = json.loads(path.read_text())
        path.write_text(json.dumps({**keys, "pid": pid, "began": start}))
        with registered(rig, SIM, ["socketcan:vcan9"]):
            found = find_server(rig)
            assert isinstance(found, Server)
            assert found.pid == os.getpid()
        assert not list(directory().glob("*.json"))


def test_another_file_of_the_same_name_is_another_rig(tmp_path: Path) -> None:
    path = Path(config("bench-dynamixel-sim"))
    copy = tmp_path / path.name
    copy.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    link = tmp_path / "link.yaml"
    link.symlink_to(path)
    with registered(load_rig(path), SIM, []):
        assert find_server(load_rig(copy)) is None
        assert find_server(load_rig(link)) is not None
        with registered(load_rig(copy), SIM, []):
            assert find_server(load_rig(copy)) is not None


def test_two_runs_do_not_serve_on_one_endpoint_and_rigs_without_one_do_not_mind() -> None:
    rig = load_rig(config("bench-canopen-vcan"))
    other = rig.model_copy(update={"name": "another"})
    with registered(rig, RUN, ["socketcan:vcan9"]):
        with (
            pytest.raises(
                DriverError, match=r"socketcan:vcan9 is already served by process \d+ \(tautwave"
            ),
            registered(other, RUN, ["socketcan:vcan9"]),
        ):
            pass
        with registered(rig, RUN, []), registered(rig, SIM, ["socketcan:vcan8"]):
            pass


def test_registrations_are_private(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    rig = load_rig(config("bench-dynamixel-sim"))
    with registered(rig, SIM, []):
        (path,) = directory().glob("*.json")
        assert path.parent == directory()
        assert directory().stat().st_mode & 0o777 == 0o700
    directory().chmod(0o777)
    with pytest.raises(DriverError, match="should be a directory accessible only to you"):
        directory()
