"""Devices without a watchdog are named before they move, those not known to be off afterwards."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tautwave import registry
from tautwave.config import load_rig
from tautwave.config.keys.calibration import AxisCalibration
from tautwave.errors import ConfigError, DeviceFault
from tautwave.laws.servo.follower import FollowerParams
from tautwave.rig import build_rig
from tautwave.rig.calibrated import CalibratedDriver
from tautwave.runtime.carrying.driver import CarryingDriver
from tautwave.runtime.following import FollowingDriver
from tautwave.session.identification.identifying import identify_device
from tautwave.session.running import RunResult, run
from tautwave.summary.ending import last_line
from tautwave.types import CommandDelay, Fault
from tautwave.wrapper import DriverWrapper
from tests.commands import keep_in_one_process

CONFIGS = Path(__file__).parents[2] / "configs"

SERVO = ("bench-dynamixel-sim", "buses.servos.options.simulator")
CAN = ("bench-canopen-virtual", "buses.can.options.simulator")
MODBUS = ("bench-modbus-rtu-sim", "buses.arm.options.simulator")
DSY = (
    "buses.arm.options.devices=[{unit: 1, profile: dsy-rs, rated_torque: 0.64, "
    "counts_per_revolution: 10000, gear_ratio: 4}]"
)


def moved(tmp_path: Path, name: str, *keys: str, **more: Any) -> tuple[RunResult, list[str]]:
    said: list[str] = []
    result = run(
        load_rig(CONFIGS / f"{name}.yaml", list(keys)),
        out=tmp_path / "out",
        clock="fake",
        duration_s=0.2,
        warn=said.append,
        **more,
    )
    return result, said


@pytest.mark.parametrize(
    ("name", "keys", "axes"),
    [
        ("bench-1dof-loopback", (), {}),
        pytest.param(SERVO[0], (), {}, marks=pytest.mark.slow),
        pytest.param(CAN[0], (), {}, marks=pytest.mark.slow),
        pytest.param(MODBUS[0], (), {}, marks=pytest.mark.slow),
        (
            SERVO[0],
            (f"{SERVO[1]}={{servos: {{1: {{firmware: 37}}}}}}",),
            {"master.lever": "its firmware 37 has no bus watchdog"},
        ),
        pytest.param(
            CAN[0],
            (f"{CAN[1]}={{nodes: {{2: {{abort_option: false}}}}}}",),
            {"slave.lever": "has no 6007:00 abort connection option"},
            marks=pytest.mark.slow,
        ),
        pytest.param(
            MODBUS[0],
            (DSY,),
            {"slave.lever": "it has no comm-loss timeout"},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_warning_names_whom_no_watchdog_stops_and_nobody_else(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    keys: tuple[str, ...],
    axes: dict[str, str],
) -> None:
    keep_in_one_process(monkeypatch)
    result, said = moved(tmp_path, name, *keys, allow_unwatched=True)
    assert result.exit_code == 0, result.summary.outcome
    assert len(said) == len(axes)
    for sentence, (axis, why) in zip(said, axes.items(), strict=True):
        assert sentence.startswith(f"UNWATCHED: {axis} (")
        assert "keeps following its last command" in sentence
        assert why in sentence
        assert "emergency stop" in sentence
    found = {
        axis: why for bus in result.summary.buses.values() for axis, why in
        bus.unwatched.items()
    }  # fmt: skip
    assert list(found) == list(axes)
    watched = {a for bus in result.summary.buses.values() for a in bus.watchdog_s}
    assert not watched & set(axes)


def test_they_are_named_before_any_is_enabled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tautwave_drivers.dynamixel.driver import DynamixelDriver

    keep_in_one_process(monkeypatch)
    order: list[str] = []
    step = DynamixelDriver.enable_step

    def enable_step(driver: DynamixelDriver) -> bool:
        order.append("enable")
        return step(driver)

    monkeypatch.setattr(DynamixelDriver, "enable_step", enable_step)
    run(
        load_rig(
            CONFIGS / f"{SERVO[0]}.yaml", [f"{SERVO[1]}={{servos: {{1: {{firmware: 37}}}}}}"]
        ),
        out=tmp_path / "out", clock="fake", duration_s=0.1, allow_unwatched=True,
        warn=order.append,
    )  # fmt: skip
    assert order[0].startswith("UNWATCHED")
    assert "enable" in order


GONE = {
    SERVO[0]: f"{SERVO[1]}={{faults: {{events: [{{kind: remove, at_s: 0.19, id: 2}}]}}}}",
    CAN[0]: f"{CAN[1]}={{nodes: {{2: {{silent_at_s: 0.19}}}}}}",
    MODBUS[0]: f"{MODBUS[1]}={{faults: {{events: [{{kind: request_lost, at_s: 0.16, "
    "times: 100000}]}}",
}


@pytest.mark.parametrize(
    "name",
    [SERVO[0], *(pytest.param(name, marks=pytest.mark.slow) for name in (CAN[0], MODBUS[0]))],
)
def test_a_device_that_does_not_confirm_to_be_off_ends_the_run_with_5(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Its last samples are missing, too few for the loop to stop: the run itself completes."""
    keep_in_one_process(monkeypatch)
    result, _ = moved(tmp_path, name, GONE[name], "loop.missing_limit=100", allow_uncertified=True)
    ended = result.summary.outcome
    assert (result.exit_code, ended.kind, ended.axis) == (5, "fault", "slave.lever")
    assert ended.sentence.startswith("completed, 0.2 s; slave.lever may still be enabled (")
    assert "its own time-out of 0." in ended.sentence
    said = last_line("rig", result.summary, result.exit_code).splitlines()
    assert said[0] == "completed, 0.2 s"
    assert said[-1].startswith("slave.lever may still be enabled (")
    assert "; ".join(said) == ended.sentence
    unconfirmed = [bus.unconfirmed for bus in result.summary.buses.values()]
    assert [list(axes) for axes in unconfirmed if axes] == [["slave.lever"]]
    written = json.loads((result.directory / "summary.json").read_text())
    assert written["outcome"]["sentence"] == ended.sentence


def test_it_comes_after_what_stopped_the_run_and_no_power_is_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    quirks = "{servos: {2: {firmware: 37}}, faults: {events: [{kind: remove, at_s: 0.1, id: 2}]}}"
    result, _ = moved(tmp_path, SERVO[0], f"{SERVO[1]}={quirks}", allow_unwatched=True)
    sentence = result.summary.outcome.sentence
    assert result.exit_code == 5
    assert sentence.startswith("slave.lever on bus")
    assert sentence.endswith("nothing stops it by itself; cut its power")
    assert "stopped safely" not in sentence


HANDED = ("enable_step", "request", "disable", "close")


class Behind(SimpleNamespace):
    command_delay = CommandDelay(0, 0.0)

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


@pytest.mark.parametrize(
    "wrap",
    [
        DriverWrapper,
        lambda driver: CalibratedDriver(driver, ["slave.a"], [AxisCalibration()]),
        lambda driver: FollowingDriver(
            driver, ["slave.a"], [FollowerParams(0.01, 2.0, 10.0, -10.0, 10.0)]
        ),
        lambda driver: CarryingDriver(driver, [None], 1_000_000),
    ],
)
def test_what_is_wrapped_around_a_driver_hands_it_on_as_it_is_now(wrap: Any) -> None:
    behind = Behind(watchdog_s={"slave.a": 0.1}, unwatched={}, unconfirmed={})
    driver = wrap(behind)
    assert (driver.watchdog_s, driver.unwatched, driver.unconfirmed) == ({"slave.a": 0.1}, {}, {})
    behind.watchdog_s, behind.unwatched = {}, {"slave.a": "goes on"}
    behind.unconfirmed = {"slave.a": "no answer"}
    assert driver.watchdog_s == {}
    assert driver.unwatched == {"slave.a": "goes on"}
    assert driver.unconfirmed == {"slave.a": "no answer"}


def test_an_error_in_a_wrapper_is_not_answered_by_the_driver_behind() -> None:
    class Wrong(DriverWrapper):
        @property
        def unconfirmed(self) -> dict[str, str]:
            return self._names_it_wrong  # type: ignore[no-any-return]

    with pytest.raises(AttributeError, match="_names_it_wrong"):
        _ = Wrong(
            SimpleNamespace(command_delay=None, **dict.fromkeys(HANDED), unconfirmed={})
        ).unconfirmed


def test_a_tip_stops_with_the_last_of_its_joints_if_all_do() -> None:
    rig = load_rig(CONFIGS / "arms" / "planar.yaml")
    driver = next(bus.driver for bus in build_rig(rig, clock="fake").buses)
    inner: Any = driver
    while "_joints" not in vars(inner):
        inner = inner._driver
    assert dict(driver.watchdog_s) == {}  # its joints are in this process
    names = [joint.name for joint in inner._joints]
    inner._driver.watchdog_s = {name: 0.1 + 0.1 * number for number, name in enumerate(names)}
    assert set(driver.watchdog_s.values()) == {0.1 * len(names)}
    assert not set(driver.watchdog_s) & set(names)
    inner._driver.unconfirmed = {names[0]: "no answer"}
    assert driver.unconfirmed == {names[0]: "no answer"}


def test_an_identification_ends_with_what_may_still_be_enabled(tmp_path: Path) -> None:
    rig = load_rig(CONFIGS / f"{SERVO[0]}.yaml", ["loop.missing_limit=100000", GONE[SERVO[0]]])
    with pytest.raises(DeviceFault, match=r"slave\.lever may still be enabled \("):
        identify_device(
            rig, axis="master.lever", out=tmp_path / "out", clock="fake", duration_s=0.2
        )


def test_a_driver_that_does_not_say_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    plugin = registry.load_driver("loopback")
    old = plugin._replace(make=lambda *_: SimpleNamespace(command_delay=CommandDelay(0, 0.0)))
    monkeypatch.setattr("tautwave.rig.assembly.load_driver", lambda name: old)
    with pytest.raises(ConfigError, match="does not say watchdog_s, unwatched, unconfirmed"):
        build_rig(load_rig(CONFIGS / "bench-1dof-loopback.yaml"), clock="fake")


@pytest.mark.slow
def test_what_a_driver_warns_of_is_said_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sentence = "unit 2: target_torque 0 -> 3: another master or the panel writes to it"
    begun: list[bool] = []

    def changed(clock: Any, clients: Any, before: Any, since_ns: int) -> list[Fault]:
        begun.append(any(station.on for station in clients))
        return [Fault("slave.lever", sentence, False)]

    monkeypatch.setattr("tautwave_drivers.modbus.driver.changed_by_others", changed)
    result, said = moved(tmp_path, MODBUS[0])
    assert result.exit_code == 0
    assert said == [sentence]
    assert begun == [False]
    faults = json.loads((tmp_path / "out" / "summary.json").read_text())["faults"]
    assert any(sentence in fault["text"] for fault in faults)
