"""A third party's profile, simulated from its own file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.errors import ConfigError
from tests.sim.modbus.masters import Bench, words, write_many

# After the map of the UUMotor SVD48V (5100 mode, 5300 start/stop, 5304 rpm, 530C position), with a
# torque in N m that it has not and the low word first.
PROFILE = """
family: my-drive
source: a test
functions: [3, 6, 16]
word_order: low_first
counts_per_revolution: 4096
registers:
  mode: {address: 0x5100, lasting: true}
  start: {address: 0x5300}
  speed: {address: 0x5304, type: i16, unit: rpm}
  torque: {address: 0x5308, type: i16, scale: 0.01, unit: N m}
  timeout: {address: 0x5200, scale: 0.01, unit: s}
  keep: {address: 0x5201}
  limit: {address: 0x5202, scale: 0.01, unit: N m}
  model: {address: 0x5000, access: r}
  running: {address: 0x5400, access: r}
  rpm: {address: 0x5410, type: i16, access: r, unit: rpm}
  alarm: {address: 0x5401, access: r}
  position: {address: 0x5418, type: i32, access: r, unit: counts}
roles:
  position: position
  velocity: rpm
  command_effort: torque
  command_velocity: speed
  mode: mode
  status: running
  fault: alarm
modes: {effort: 2, velocity: 1}
states:
  enabled: {mask: 1, value: 1}
  fault: {mask: 0x80, value: 0x80}
eeprom_off: {register: keep, value: 1}
identity: {register: model, value: 48}
comm_loss: {register: timeout, reaction: it lets go}
enable:
  - {write: start, value: 1}
  - {wait: running, mask: 1, value: 1}
disable:
  - {write: start, value: 0}
fault_reset:
  - {write: start, value: 0}
  - {write: start, value: 2}
faults: {17: too hot, 3: too much current}
limits: {effort: [limit]}
"""

ENABLE = """enable:
  - {write: start, value: 1}
  - {wait: running, mask: 1, value: 1}
"""


@pytest.fixture
def profile(tmp_path: Path) -> str:
    path = tmp_path / "my-drive.yaml"
    path.write_text(PROFILE)
    return str(path)


def test_it_is_switched_on_moved_and_reset_as_its_profile_says(profile: str) -> None:
    bench = Bench("rtu", profile, faults={"events": [{"kind": "drive_fault", "nth": 10}]})
    assert bench.number("model") == 48
    bench.set("mode", 2)
    assert bench.number("running") == 0
    bench.set("start", 1)
    assert bench.number("running") == 1
    bench.set("torque", 50)
    assert bench.drive().motor.axis._command == pytest.approx(0.5)
    bench.set("limit", 30)
    assert bench.drive().motor.axis._command == pytest.approx(0.3)
    bench.wait(0.05)
    low, high = words(bench.ask(b"\3\x54\x18\0\2"))
    assert high == 0
    assert low == bench.drive().motor.position_counts > 0
    bench.set("timeout", 0)
    assert bench.number("running") == 0x80
    assert bench.number("alarm") == 17
    bench.set("start", 0)
    assert bench.number("running") == 0x80
    bench.set("start", 2)
    assert bench.number("running") == 0
    assert bench.number("alarm") == 0


def test_its_watchdog_and_its_eeprom(profile: str) -> None:
    bench = Bench("tcp", profile)
    bench.set("timeout", 10)
    for value in (1, 2):
        bench.set("mode", value)
    bench.set("keep", 1)
    bench.set("mode", 1)
    assert bench.drive().wear == {"mode": 2}
    bench.set("start", 1)
    bench.wait(0.09)
    assert bench.number("running") == 1
    bench.wait(0.11)
    assert bench.number("running") == 0x80


def test_velocity_in_rpm(profile: str) -> None:
    bench = Bench("tcp", profile, causality="admittance")
    bench.set("mode", 1)
    bench.set("start", 1)
    bench.ask(write_many(0x5304, 60))
    bench.wait(0.05)
    assert bench.number("rpm") == 60
    assert bench.drive().motor.axis.physics.v == pytest.approx(6.283185307)


def test_torque_in_amperes(tmp_path: Path) -> None:
    path = tmp_path / "amperes.yaml"
    path.write_text(PROFILE.replace("unit: N m", "unit: A"))
    bench = Bench("tcp", str(path), device={"torque_constant": 0.2, "gear_ratio": 3.0})
    bench.set("mode", 2)
    bench.set("start", 1)
    bench.set("torque", 50)
    assert bench.drive().motor.axis._command == pytest.approx(0.5 * 0.2 * 3.0)


@pytest.mark.parametrize(
    ("wrong", "right", "said"),
    [
        ("unit: N m", "unit: V", "11: registers.torque.unit: rated, N m, N, A can be simulated"),
        ("unit: rpm", "unit: V", "10: registers.speed.unit: rpm, or counts/s with scale 1, can"),
        ("  position: position\n", "", "20: roles: position is missing; every profile needs it"),
        ("modes:", "machine: cia402\nmodes:", "20: roles: control is missing; machine: cia402 n"),
        ("functions: [3, 6, 16]", "functions: [3]", "4: functions: one that reads (3 or 4) and"),
        (ENABLE, "enable: []\n", "2: enable, disable and states are required"),
        ("- {wait: running, ", "- {", "37: enable.1: should have either write or wait"),
        ("registers:", "regster:", "7: regster: unknown key 'regster'; did you mean 'registers'?"),
    ],
)
def test_what_cannot_be_simulated_is_named(
    tmp_path: Path, wrong: str, right: str, said: str
) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(PROFILE.replace(wrong, right))
    with pytest.raises(ConfigError) as caught:
        Bench("tcp", str(path))
    assert f"{path}:{said}" in str(caught.value)


def test_a_profile_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: no such file"):
        Bench("tcp", str(tmp_path / "none.yaml"))


def test_words_between_registers_read_as_0_where_the_profile_says_so(tmp_path: Path) -> None:
    """The driver reads across such gaps, to save requests."""
    path = tmp_path / "gaps.yaml"
    path.write_text(PROFILE + "gaps: readable\n")
    assert words(Bench("tcp", str(path)).ask(b"\3\x54\x02\0\2")) == [0, 0]


def test_a_cia402_profile_of_other_addresses(tmp_path: Path) -> None:
    # Kinco FD3, CD3 and FD5P: 6040h at 3100h, 6041h at 3200h, 60FFh at 6F00h, low word first.
    path = tmp_path / "kinco.yaml"
    path.write_text(
        """
family: kinco
source: Kinco FD5P manual, 10.2.3; addresses of mode and position are made up here
functions: [3, 6, 16]
word_order: low_first
machine: cia402
registers:
  controlword: {address: 0x3100}
  statusword: {address: 0x3200, access: r}
  mode: {address: 0x3500, type: i16}
  mode_display: {address: 0x3501, type: i16, access: r}
  position: {address: 0x3700, type: i32, access: r, unit: counts}
  target_velocity: {address: 0x6F00, type: i32, unit: counts/s}
roles:
  position: position
  command_velocity: target_velocity
  mode: mode
  mode_display: mode_display
  status: statusword
  control: controlword
modes: {velocity: 3}
"""
    )
    bench = Bench("rtu", str(path), causality="admittance")
    bench.set("mode", 3)
    bench.set("controlword", 6)
    assert bench.bytes_back(bytes.fromhex("01 06 3100 000F C732")) == bytes.fromhex(
        "01 06 3100 000F C732"
    )
    assert bench.number("statusword") & 0x6F == 0x27
    assert bench.number("mode_display") == 3
    got = bench.bytes_back(bytes.fromhex("01 10 6F00 0002 04 5555 0008 1A47"))
    assert got[:6] == bytes.fromhex("01 10 6F00 0002")
    assert bench.drive().motor.setpoint == 0x00085555
