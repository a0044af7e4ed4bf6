"""`tautwave doctor` on machines made of files: what it finds, what that costs, what mends it."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.config import parse_rig
from tautwave.session.doctor import machine, wires
from tautwave.session.doctor.examining import examine
from tautwave.session.doctor.finding import BARS, COSTS, GOOD, UNKNOWN, Finding
from tautwave_drivers import adapter

CLOCK = "sys/devices/system/clocksource/clocksource0"
CPU = "sys/devices/system/cpu"
RIG = (Path(__file__).parents[2] / "configs" / "epos4-pair.yaml").read_text()


def put(root: Path, path: str, text: str) -> Path:
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_text(text + "\n")
    return root


def test_a_real_time_kernel_is_recognized_by_its_file_or_its_version(tmp_path: Path) -> None:
    put(tmp_path, "etc/os-release", 'NAME="x"\nID=debian')
    found = machine.kernel(tmp_path, "#1 SMP PREEMPT_DYNAMIC")
    assert found.state == COSTS
    assert "linux-image-rt" in found.command
    assert machine.kernel(tmp_path, "#1 SMP PREEMPT_RT Debian").state == GOOD
    assert machine.kernel(put(tmp_path, "sys/kernel/realtime", "1"), "#1 SMP").state == GOOD


@pytest.mark.parametrize(
    ("runtime", "state"), [("950000", GOOD), ("-1", COSTS), ("500000", COSTS), ("", UNKNOWN)]
)
def test_throttling_is_neither_off_nor_tight(tmp_path: Path, runtime: str, state: str) -> None:
    put(tmp_path, "proc/sys/kernel/sched_rt_runtime_us", runtime)
    found = machine.throttling(put(tmp_path, "proc/sys/kernel/sched_rt_period_us", "1000000"))
    assert found.state == state
    assert ("sysctl" in found.command) == (state == COSTS)


def test_a_refused_priority_has_the_line_for_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    found = machine.priority(50)
    assert found.state == COSTS
    assert "rtprio 99" in found.command
    assert machine.priority(0).state == GOOD


def test_locked_memory_needs_a_limit_or_root() -> None:
    assert machine.memory(True, 64 * 1024, False).state == COSTS
    assert "memlock unlimited" in machine.memory(True, 64 * 1024, False).command
    assert machine.memory(True, resource.RLIM_INFINITY, False).state == GOOD
    assert machine.memory(True, 64 * 1024, True).state == GOOD
    assert machine.memory(False, 64 * 1024, False).state == GOOD


def test_one_slow_core_is_enough(tmp_path: Path) -> None:
    assert machine.governor(tmp_path).found == "no frequency scaling"
    put(tmp_path, f"{CPU}/cpu0/cpufreq/scaling_governor", "performance")
    assert machine.governor(tmp_path).state == GOOD
    put(tmp_path, f"{CPU}/cpu1/cpufreq/scaling_governor", "powersave")
    assert machine.governor(tmp_path).state == COSTS
    assert machine.cores(1).state == COSTS
    assert machine.cores(2).state == GOOD


def test_a_slow_clock_is_exchanged_only_where_there_is_a_faster_one(tmp_path: Path) -> None:
    assert machine.clock(tmp_path).state == UNKNOWN
    put(tmp_path, f"{CLOCK}/current_clocksource", "hpet")
    assert machine.clock(tmp_path).command == "the processor has no faster one"
    put(tmp_path, f"{CLOCK}/available_clocksource", "hpet tsc acpi_pm")
    assert machine.clock(tmp_path).command == f"echo tsc | sudo tee /{CLOCK}/current_clocksource"
    assert machine.clock(put(tmp_path, f"{CLOCK}/current_clocksource", "tsc")).state == GOOD


def test_a_serial_port_is_there_open_and_quick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (gone,) = wires.serial_port("/dev/ttyUSB0", tmp_path)
    assert (gone.state, gone.found) == (BARS, "is not there")
    put(tmp_path, "dev/ttyUSB0", "")
    timer = "sys/bus/usb-serial/devices/ttyUSB0/latency_timer"
    (slow,) = wires.serial_port("/dev/ttyUSB0", put(tmp_path, timer, "16"))
    assert slow.state == COSTS
    assert slow.command == f"echo 1 | sudo tee /{timer}"
    (quick,) = wires.serial_port("/dev/ttyUSB0", put(tmp_path, timer, "1"))
    assert quick.state == GOOD
    link = tmp_path / "dev/serial/by-id/usb-FTDI_FT232R-if00-port0"
    link.parent.mkdir(parents=True)
    link.symlink_to("../../ttyUSB0")
    put(tmp_path, timer, "5")
    for port in ("/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"):
        (named,) = wires.serial_port(port, tmp_path)
        monkeypatch.setattr(adapter, "SYSFS", tmp_path / "sys")
        of_the_driver = adapter.adapter_of(f"{tmp_path}{port}")
        assert named.found == f"latency timer {1e3 * (of_the_driver.found_s or 0.0):g} ms"
    put(tmp_path, timer, "1")
    monkeypatch.setattr(os, "access", lambda *_: False)
    barred, _ = wires.serial_port("/dev/ttyUSB0", tmp_path)
    assert barred.state == BARS
    assert barred.command.startswith("sudo usermod -aG ")
    assert wires.serial_ports(tmp_path) == ["/dev/ttyUSB0"]


def can(root: Path, flags: str = "0x1", queue: str = "100") -> Path:
    put(root, "sys/class/net/can0/type", "280")
    put(root, "sys/class/net/can0/flags", flags)
    return put(root, "sys/class/net/can0/tx_queue_len", queue)


def details(bitrate: int = 1_000_000, state: str = "ERROR-ACTIVE") -> wires.Links:
    info = {"bittiming": {"bitrate": bitrate}, "state": state}
    return lambda _: {"linkinfo": {"info_data": info}}


@pytest.mark.parametrize(
    ("flags", "queue", "links", "state", "said"),
    [
        ("0x1", "100", details(), GOOD, "up, 1000000 bit/s"),
        ("0x1", "100", lambda _: {}, GOOD, "up"),
        ("0x0", "100", details(), BARS, "down"),
        ("0x1", "100", details(500_000), BARS, "500000 bit/s, but the rig states 1000000"),
        ("0x1", "100", details(state="BUS-OFF"), BARS, "state BUS-OFF"),
        ("0x1", "10", details(), COSTS, "queue of 10 frames"),
    ],
)
def test_a_can_interface_is_up_at_the_rigs_rate_with_room(
    tmp_path: Path, flags: str, queue: str, links: wires.Links, state: str, said: str
) -> None:
    found = list(wires.can_interface("can0", can(tmp_path, flags, queue), 1_000_000, links))
    worst = [one for one in found if one.state == state]
    assert [one.found for one in worst] == [said]
    assert all("sudo ip link set can0" in one.command for one in worst if state != GOOD)


def test_a_rig_is_examined_on_its_own_buses_only(tmp_path: Path) -> None:
    put(can(tmp_path), "dev/ttyUSB7", "")

    def about(findings: list[Finding]) -> set[str]:
        return {one.what for one in findings if one.what.startswith(("can", "/dev"))}

    assert about(examine(None, tmp_path, details())) == {"can0", "/dev/ttyUSB7"}
    rig = parse_rig(RIG, choose=False)
    assert about(examine(rig, tmp_path, details())) == {"can0"}
    wrong = [one for one in examine(rig, tmp_path, details(250_000)) if one.state == BARS]
    assert [one.what for one in wrong] == ["can0"]


@pytest.mark.parametrize("channel", ["/dev/ttyUSB7", "/dev/ttyUSB7@115200"])
def test_a_can_adapter_on_a_serial_port_is_examined_as_one(tmp_path: Path, channel: str) -> None:
    timer = "sys/bus/usb-serial/devices/ttyUSB7/latency_timer"
    put(put(tmp_path, "dev/ttyUSB7", ""), timer, "16")
    text = RIG.replace("interface: socketcan", "interface: slcan")
    rig = parse_rig(text.replace("channel: can0", f"channel: {channel}"), choose=False)
    (slow,) = [one for one in examine(rig, tmp_path, details()) if one.what == "/dev/ttyUSB7"]
    assert slow.command == f"echo 1 | sudo tee /{timer}"


def test_the_command_says_what_bars_a_run_by_its_exit_code(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(RIG.replace("channel: can0", "channel: can77"))
    done = CliRunner().invoke(main, ["doctor", str(path), "--json"])
    assert done.exit_code == 5
    (barred,) = [one for one in json.loads(done.output) if one["state"] == "bars"]
    assert barred["what"] == "can77"
    done = CliRunner().invoke(main, ["doctor", str(path)])
    assert "fix: plug in the adapter" in done.output
    assert max(map(len, done.output.splitlines())) <= 100


def test_no_ip_command_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert wires.link_details("can0") == {}


@pytest.mark.parametrize(
    ("printed", "code", "found"),
    [
        ('[{"ifname": "can0"}]', 0, {"ifname": "can0"}),
        ('[{"ifname": "can0"}, {"ifname": "can1"}]', 0, {"ifname": "can0"}),
        ('[{"ifname": "can0"}]', 1, {}),
        ("[]", 0, {}),
        ('{"ifname": "can0"}', 0, {}),
        ("[4]", 0, {}),
        ('Object "details" is unknown', 0, {}),
        ("", 0, {}),
    ],
)
def test_what_ip_prints_of_an_interface_is_its_first_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, printed: str, code: int, found: Any
) -> None:
    command = tmp_path / "ip"
    script = f"echo \"$*\" > '{tmp_path}/asked'\necho '{printed}'\nexit {code}\n"
    command.write_text(f"#!/bin/sh\n{script}")
    command.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert wires.link_details("can0") == found
    assert (tmp_path / "asked").read_text() == "-details -json link show can0\n"


def test_what_mends_an_interface_is_the_whole_command(tmp_path: Path) -> None:
    up = "sudo ip link set can0 up type can bitrate"
    down = "sudo ip link set can0 down"

    def mended(rate: int | None, links: wires.Links, flags: str = "0x1") -> list[str]:
        found = wires.can_interface("can0", can(tmp_path, flags), rate, links)
        return [one.command for one in found if one.state != GOOD]

    def nothing(_: str) -> dict[str, Any]:
        return {}

    assert mended(500_000, nothing, "0x0") == [f"{up} 500000"]
    assert mended(None, details(250_000), "0x0") == [f"{up} 250000"]
    assert mended(None, nothing, "0x1002") == [f"{up} 1000000"]
    assert mended(None, details(250_000)) == []
    assert mended(500_000, details(250_000)) == [f"{down}; {up} 500000"]
    for state in ("ERROR-PASSIVE", "BUS-OFF"):
        assert mended(500_000, details(500_000, state)) == [f"{down}; {up} 500000 restart-ms 100"]
    (tmp_path / "sys/class/net/vcan3").mkdir()
    put(tmp_path, "sys/class/net/vcan3/flags", "0x0")
    barred, unknown = wires.can_interface("vcan3", tmp_path, 500_000, nothing)
    assert barred == Finding("vcan3", BARS, "down", "no frame passes", "sudo ip link set vcan3 up")
    assert unknown == Finding("vcan3", UNKNOWN, "queue length: not reported by the kernel")
    (gone,) = wires.can_interface("can9", tmp_path, None, nothing)
    assert gone == Finding(
        "can9",
        BARS,
        "is not there",
        "the run cannot open it",
        "plug in the adapter and load its driver; `ip link` lists the interfaces present",
    )


@pytest.mark.parametrize(
    ("waiting", "state", "said"),
    [
        (0, GOOD, ""),
        (1, COSTS, "transmit queue not empty, frames waiting: 1"),
        (99, COSTS, "transmit queue not empty, frames waiting: 99"),
        (100, BARS, "transmit queue full, frames waiting: 100"),
        (140, BARS, "transmit queue full, frames waiting: 140"),
    ],
)
def test_a_transmit_queue_that_is_full_is_named(
    tmp_path: Path, waiting: int, state: str, said: str
) -> None:
    known = {**details()("can0"), "queue": {"kind": "pfifo_fast", "qlen": waiting}}
    found = list(wires.can_interface("can0", can(tmp_path), 1_000_000, lambda _: known))
    assert found[0] == Finding("can0", GOOD, "up, 1000000 bit/s")
    assert [(one.state, one.found) for one in found[1:]] == ([(state, said)] if waiting else [])
    down = "sudo ip link set can0 down; sudo ip link set can0 up type can bitrate 1000000"
    assert all(one.command.startswith(down) for one in found[1:])


def test_what_waits_is_what_tc_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    printed = {"ip": '[{"ifname": "can0"}]', "tc": '[{"kind": "pfifo_fast", "qlen": 10}]'}
    for name, text in printed.items():
        command = tmp_path / name
        command.write_text(f"#!/bin/sh\necho \"$*\" > '{tmp_path}/{name}.asked'\necho '{text}'\n")
        command.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    queue = {"kind": "pfifo_fast", "qlen": 10}
    assert wires.link_details("can0") == {"ifname": "can0", "queue": queue}
    assert (tmp_path / "tc.asked").read_text() == "-statistics -json qdisc show dev can0\n"


@pytest.mark.parametrize(("frames", "costs"), [("19", True), ("20", False)])
def test_a_queue_holds_two_cycles_of_six_axes(tmp_path: Path, frames: str, costs: bool) -> None:
    found = list(wires.can_interface("can0", can(tmp_path, queue=frames), None, details()))
    queue = Finding(
        "can0",
        COSTS,
        f"queue of {frames} frames",
        "frames beyond that in one cycle are lost",
        "sudo ip link set can0 txqueuelen 100",
    )
    assert found == [Finding("can0", GOOD, "up, 1000000 bit/s"), *([queue] * costs)]


def test_only_can_interfaces_and_usb_serial_ports_are_listed(tmp_path: Path) -> None:
    put(can(tmp_path), "sys/class/net/eth0/type", "1")
    put(tmp_path, "sys/class/net/can10/type", "280")
    assert wires.can_interfaces(tmp_path) == ["can0", "can10"]
    for name in ("ttyUSB1", "ttyACM0", "ttyS0", "ttyUSB0"):
        put(tmp_path, f"dev/{name}", "")
    assert wires.serial_ports(tmp_path) == ["/dev/ttyACM0", "/dev/ttyUSB0", "/dev/ttyUSB1"]
    (found,) = wires.serial_port("/dev/ttyACM0", tmp_path)
    assert found == Finding("/dev/ttyACM0", GOOD, "no latency timer")
