"""`tautwave new --urdf` on files like those that people bring, simulated and with devices."""

from __future__ import annotations

import re
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.registry import load_driver
from tautwave.session.new import surveying
from tautwave.session.new.surveying import surveyor
from tests.session.public_arms import PUBLIC_ARMS, PublicArm, gripper, link, robot, serial

NAMES = [one.like for one in PUBLIC_ARMS]
STATED = (0.5, 1.5)
"""[N m, rad/s] Limits of a weak arm's file."""
TRACKED = 10e-3
"""[rad | m] A newcomer's two arms track within this, rms."""


def new(folder: Path, *words: str) -> Any:
    with chdir(folder):
        return CliRunner().invoke(main, ["new", "rig.yaml", *words])


def written(folder: Path, arm: PublicArm, *more: str) -> Path:
    (folder / "arm.urdf").write_text(arm.text)
    base = ["--base", arm.base] if arm.base else []
    done = new(folder, "--urdf", "arm.urdf", "--tip", arm.tip, *base, *more)
    assert done.exit_code == 0, done.output
    return folder / "rig.yaml"


@pytest.mark.sparse(3)
@pytest.mark.parametrize("arm", PUBLIC_ARMS, ids=NAMES)
def test_one_command_writes_a_rig_of_two_arms(arm: PublicArm, tmp_path: Path) -> None:
    rig = load_rig(written(tmp_path, arm))
    assert len(rig.coupling.pairs) == arm.joints
    assert not any("finger" in name for name in rig.coupling.pairs)


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("arm", PUBLIC_ARMS, ids=NAMES)
def test_what_new_wrote_is_certified_and_tracks(arm: PublicArm, tmp_path: Path) -> None:
    path = written(tmp_path, arm)
    rig = load_rig(path, ["duration_s=2.5"])
    assert certify(rig).passed
    run = simulate(rig)
    assert run.error is None
    for pair in rig.coupling.pairs:
        moved = np.ptp(run[f"slave.{pair}.position"])
        error = run[f"{pair}.position_error"]
        assert moved > 1e-3, pair
        assert float(np.sqrt(np.nanmean(np.square(error)))) <= TRACKED, pair


@pytest.mark.parametrize(
    ("old", "parts", "said"),
    [
        ("</robot>", '<xacro:include filename="$(find arm)/hand.xacro"/></robot>', "xacro:include"),
        ("</robot>", '<xacro:arm prefix="left" parent="base"/></robot>', "xacro:arm"),
        ("</robot>", link("${prefix}_tool") + "</robot>", "'${prefix}_tool'"),
        ("</robot>", link("$(arg name)/tool") + "</robot>", "'$(arg name)/tool'"),
        ('upper="2"', 'upper="${pi}"', "upper of <limit>, '${pi}'"),
        ('mass value="0.3"', 'mass value="${m}"', "value of <mass>, '${m}'"),
    ],
)
def test_what_xacro_still_has_to_expand_is_refused(
    old: str, parts: str, said: str, tmp_path: Path
) -> None:
    head = 'xmlns:xacro="http://ros.org/wiki/xacro"'
    text = robot(link("base"), serial("arm", "base", ("revolute",) * 2), head=head)
    (tmp_path / "arm.urdf").write_text(text.replace(old, parts))
    done = new(tmp_path, "--urdf", "arm.urdf", "--tip", "arm2")
    assert done.exit_code != 0
    assert said in done.output
    assert re.search(r"arm\.urdf:\d+: .*`xacro FILE -o arm\.urdf`", done.output)


# -- with the devices of a bus ----------------------------------------------------------------


def arm_of(count: int) -> PublicArm:
    text = robot(
        link("base"), serial("arm", "base", ("revolute",) * count), gripper("arm", f"arm{count}")
    )
    return PublicArm("", text, f"arm{count}", count)


BUSES = {
    "dynamixel": "dynamixel --port /dev/ttyUSB0 --baud 1000000",
    "mit": "mit --interface virtual --channel test",
    "canopen": "canopen --interface virtual --channel test",
}


ROWS: dict[str, dict[str, Any]] = {
    "dynamixel": {"model": "XM430-W350", "firmware": 52, "protocol": 2.0, "baud": 1_000_000},
    "mit": {"p_max": 12.5, "v_max": 30.0, "t_max": 10.0, "firmware": 1, "errors": "none"},
    "canopen": {
        "device": "drive", "vendor": "0x1", "product": "0x2", "rated_torque": 640,
        "increments": 20_000, "revolutions": 1, "gear_motor": 5, "gear_shaft": 1, "max_speed": 300,
    },
}  # fmt: skip


def found(monkeypatch: pytest.MonkeyPatch, driver: str) -> None:
    """Eight devices in place of those that a scan of the driver finds."""
    rows = [
        ROWS[driver] | {"id": number, "node": number, "feedback_id": number + 16}
        for number in range(1, 9)
    ]
    plugin = load_driver(driver)

    def survey(places: Any, _: object) -> Any:
        return surveyor(driver, plugin).propose(places[0].options, rows), []

    monkeypatch.setattr(surveying, "survey", survey)


@pytest.mark.parametrize("driver", BUSES)
def test_devices_take_names_and_limits_of_the_file(
    driver: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The URDF's limits are 0.5 N m and 1.5 rad/s: less than any of these drives has."""
    found(monkeypatch, driver)
    arm = arm_of(4)
    weak = arm.text.replace('effort="20" velocity="3"', 'effort="0.5" velocity="1.5"')
    arm = arm._replace(text=weak.replace('mass value="0.', 'mass value="0.00'))
    path = written(tmp_path, arm, "--bus", BUSES[driver], "--master", "1-4", "--slave", "5-8")
    text = path.read_text()
    assert f"driver: {driver}" in text
    for name, master, slave in (("arm_joint1", 1, 5), ("arm_joint4", 4, 8)):
        assert f"{name}: {{id: {master}" in text
        assert f"{name}: {{id: {slave}" in text
    assert text.count("position_range: [-2.0, 2.0]") == 2
    rig = load_rig(path, choose=False)
    assert list(rig.master.axes) == [f"arm_joint{number}" for number in range(1, 5)]
    for axis in (*rig.master.axes.values(), *rig.slave.axes.values()):
        assert axis.effort_limit is not None
        assert axis.velocity_limit is not None
        assert axis.effort_limit <= STATED[0]
        assert axis.velocity_limit <= STATED[1]
    assert text.count("arm.urdf") == 2


def test_as_many_devices_as_joints_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found(monkeypatch, "dynamixel")
    (tmp_path / "arm.urdf").write_text(arm_of(3).text)
    done = new(
        tmp_path, "--urdf", "arm.urdf", "--tip", "arm3", "--bus", BUSES["dynamixel"],
        "--master", "1-4", "--slave", "5-8",
    )  # fmt: skip
    assert done.exit_code != 0
    assert "4 devices for the 3 joints of arm.urdf, from base to tip: arm_joint1" in done.output
