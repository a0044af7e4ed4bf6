"""The plugin keeps LeRobot's contract, without torch; `nightly.sh` runs LeRobot's own commands.

The stand-in has what the plugin imports: base classes with the abstract names of lerobot 0.4.4 and
0.6.1, registries, errors.
"""

from __future__ import annotations

import abc
import importlib
import itertools
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import pytest

from tautwave.errors import ConfigError, RecordingError

ROOT = Path(__file__).parents[2]
HOME = ROOT / "drivers" / "lerobot_robot_tautwave"
RIG = ROOT / "configs" / "bench-2axis-loopback.yaml"
COMMON = ["is_connected", "is_calibrated", "connect", "calibrate", "configure", "disconnect"]
ABSTRACT = {
    "Robot": [*COMMON, "observation_features", "action_features", "get_observation", "send_action"],
    "Teleoperator": [
        *COMMON, "action_features", "feedback_features", "get_action", "send_feedback",
    ],
}  # fmt: skip
"""Of the base classes, in both versions."""


class Session:
    """A run that gives rows at once: column k of row n is n + k / 64."""

    begun: ClassVar[list[Session]] = []
    age = 0.0
    standing = "engaged"
    gone = False

    def __init__(self, rig: Any, *, out: Path, options: list[str]) -> None:
        self.directory, self.rig, self.options = out, rig, options
        self.calls: list[str] = []
        self._number = itertools.count()
        self.newest: dict[str, float] = {}
        self.begun.append(self)

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.calls.append("stop")

    def engage(self) -> None:
        self.calls.append("engage")

    def wait_for(self, state: str, timeout_s: float) -> bool:
        return state == "engaged"

    @property
    def state(self) -> str:
        return self.standing

    def age_s(self, row: dict[str, float]) -> float:
        return self.age + 0.001 * (row["time_s"] > 0.0)

    def lead(self, positions: dict[str, float]) -> None:
        if self.gone:
            raise RecordingError("the run has ended")
        self.calls.append("lead")
        self.led = positions

    def row(self, *, whole: bool) -> dict[str, float]:
        assert whole  # a sample that is missing is no observation
        if (number := next(self._number)) > 90:
            raise RecordingError("the run has ended")
        leaves = ("position", "velocity", "commanded")
        names = ["time_s"] + [
            f"{side}.{axis}.{leaf}"
            for side in ("master", "slave") for axis in ("wrist", "slide") for leaf in leaves
        ]  # fmt: skip
        self.newest = {name: number + k / 64.0 for k, name in enumerate(names)} | {
            f"{axis}.position_error": -0.25 for axis in ("wrist", "slide")
        }
        return self.newest


def _base(name: str, config: type) -> type:
    """Return a base class with the abstract names of LeRobot's."""

    def begin(self: Any, config: Any) -> None:
        self.id = config.id

    members: dict[str, Any] = {
        one: abc.abstractmethod(lambda self: None) for one in ABSTRACT[name]
    } | {"__init__": begin, "config": config}
    return abc.ABCMeta(name, (abc.ABC,), members)


@dataclass(kw_only=True)
class _Config:
    id: str | None = None
    calibration_dir: Path | None = None
    known: ClassVar[dict[str, type]] = {}

    @classmethod
    def register_subclass(cls, name: str) -> Any:
        def register(config: type) -> type:
            cls.known[name] = config
            return config

        return register


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    parts = {
        "lerobot": {},
        "lerobot.robots": {"Robot": _base("Robot", _Config), "RobotConfig": _Config},
        "lerobot.teleoperators": {
            "Teleoperator": _base("Teleoperator", _Config), "TeleoperatorConfig": _Config,
        },
        "lerobot.utils": {},
        "lerobot.utils.errors": {
            "DeviceNotConnectedError": type("DeviceNotConnectedError", (ConnectionError,), {})
        },
    }  # fmt: skip
    for name, content in parts.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(HOME))
    found = importlib.import_module("lerobot_robot_tautwave")
    site = importlib.import_module("lerobot_robot_tautwave.site")
    monkeypatch.setattr(site, "Session", Session)
    monkeypatch.setattr(Session, "begun", [])
    yield found
    for name in [one for one in sys.modules if one.startswith("lerobot_robot_tautwave")]:
        del sys.modules[name]


def devices(plugin: ModuleType) -> tuple[Any, Any]:
    slave = plugin.TautwaveSlave(plugin.TautwaveSlaveConfig(rig=str(RIG)))
    master = plugin.TautwaveMaster(plugin.TautwaveMasterConfig(rig=str(RIG)))
    return slave, master


def test_both_are_found_by_their_names(plugin: ModuleType) -> None:
    assert {"tautwave_slave", "tautwave_master"} <= set(_Config.known)
    for one in devices(plugin):
        name = type(one.config).__name__
        assert vars(plugin)[name.removesuffix("Config")] is type(one)  # how LeRobot finds it
        assert one.name in _Config.known


def test_either_alone_engages_the_run_unless_a_person_shall(plugin: ModuleType) -> None:
    for kind in ("Slave", "Master"):
        made, settings = (vars(plugin)[f"Tautwave{kind}{end}"] for end in ("", "Config"))
        for wish, calls in (({}, ["engage"]), ({"engage": False}, [])):
            one = made(settings(rig=str(RIG), **wish))
            one.connect()
            assert Session.begun[-1].calls == calls, (kind, wish)
            one.disconnect()


@pytest.mark.parametrize("allowed", [False, True])
def test_devices_without_a_watchdog_run_only_where_that_is_allowed(
    plugin: ModuleType, allowed: bool
) -> None:
    rig = str(RIG.parent / "bench-feetech-sim.yaml")
    for kind in ("Slave", "Master"):
        config = getattr(plugin, f"Tautwave{kind}Config")(rig=rig, allow_unwatched=allowed)
        one = getattr(plugin, f"Tautwave{kind}")(config)
        one.connect()
        assert Session.begun[-1].options == ["--allow-unwatched"] * allowed
        one.disconnect()


def test_settings_are_given_by_name(plugin: ModuleType) -> None:
    """As LeRobot's own, whose first is `id`: a rig by position would become it elsewhere."""
    for kind in ("Slave", "Master"):
        with pytest.raises(TypeError, match="positional"):
            vars(plugin)[f"Tautwave{kind}Config"](str(RIG))


def test_features_are_the_keys_that_come(plugin: ModuleType) -> None:
    slave, master = devices(plugin)
    assert not slave.is_connected
    slave.connect(calibrate=False)
    master.connect()
    assert slave.is_connected
    assert slave.is_calibrated
    assert master.is_connected
    seen, led = slave.get_observation(), master.get_action()
    assert list(seen) == list(slave.observation_features)
    assert list(led) == list(master.action_features) == list(slave.action_features)
    for features in (slave.observation_features, master.action_features):
        assert all(kind is float for kind in features.values())  # LeRobot asks with `is`
    assert list(seen) == [
        "wrist.pos", "wrist.vel", "wrist.torque", "slide.pos", "slide.vel", "slide.force",
    ]  # fmt: skip
    assert slave.cameras == {}
    assert master.feedback_features == {}
    assert not hasattr(master, "enable_torque")  # else LeRobot drives the master
    master.disconnect()
    slave.disconnect()


def test_action_and_observation_are_of_one_row_and_one_run(plugin: ModuleType) -> None:
    slave, master = devices(plugin)
    slave.connect()
    master.connect()
    (session,) = Session.begun
    assert session.calls == ["engage"]
    for number in range(4):
        assert int(slave.get_observation()["wrist.pos"]) == number
        assert int(master.get_action()["wrist.pos"]) == number
    slave.disconnect()
    assert session.calls == ["engage"]
    assert int(master.get_action()["wrist.pos"]) == 4
    master.disconnect()
    assert session.calls == ["engage", "stop"]
    again, _ = devices(plugin)
    again.connect()
    assert len(Session.begun) == 2
    again.disconnect()


def test_what_the_master_did_not_give_is_refused(plugin: ModuleType) -> None:
    slave, master = devices(plugin)
    slave.connect()
    master.connect()
    with pytest.raises(ConfigError, match="sent none"):
        slave.send_action({"wrist.pos": 0.0})
    slave.get_observation()
    action = master.get_action()
    assert slave.send_action(dict(action)) == action
    rounded = {name: value * (1.0 + 6e-8) for name, value in action.items()}  # float32
    assert slave.send_action(rounded) == rounded
    with pytest.raises(ConfigError, match="driven by hand"):
        slave.send_action(action | {"slide.pos": action["slide.pos"] + 0.001})
    slave.disconnect()
    master.disconnect()


def test_a_policy_leads_virtual_hands_of_its_own(
    plugin: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = plugin.TautwaveSlaveConfig(rig=str(RIG), drive="policy", fps=25.0)
    slave = plugin.TautwaveSlave(config)
    with pytest.raises(ConfigError, match="omit --teleop"):
        plugin.TautwaveMaster(plugin.TautwaveMasterConfig(rig=str(RIG)))
    assert list(slave.action_features) == ["wrist.pos", "slide.pos"]
    action = {"wrist.pos": 0.25, "slide.pos": -0.5}
    lost = sys.modules["lerobot.utils.errors"].DeviceNotConnectedError
    with pytest.raises(lost):
        slave.send_action(action)
    slave.connect()
    (session,) = Session.begun
    hand = session.rig.simulation.hand["wrist"]
    assert hand.reference.type == "policy"
    assert hand.reference.fps == 25.0
    slave.get_observation()
    assert slave.send_action(action) == action
    assert session.calls[1:] == ["lead"]
    # Actions are in the slave's coordinates; the hands are at the master, wherever it engaged.
    for pair, ratio, wish in (("wrist", -1.0, 0.25), ("slide", 2.0, -0.5)):
        ours, theirs = (session.newest[f"{side}.{pair}.position"] for side in ("master", "slave"))
        offset = theirs - ratio * (ours - session.newest[f"{pair}.position_error"])
        assert session.led[pair] == pytest.approx((wish - offset) / ratio, abs=1e-12)
    with pytest.raises(ConfigError, match=r"the rig has wrist\.pos"):
        slave.send_action({"elbow.pos": 0.0})
    monkeypatch.setattr(Session, "standing", "holding")
    with pytest.raises(lost, match="holding, not engaged"):
        slave.send_action(action)
    monkeypatch.setattr(Session, "standing", "engaged")
    monkeypatch.setattr(Session, "gone", True)  # between the look and the action
    with pytest.raises(lost, match="the run has ended"):
        slave.send_action(action)
    assert len(session.calls) == 2
    slave.disconnect()


def test_a_device_that_has_not_joined_gets_no_row_of_the_other_s_run(plugin: ModuleType) -> None:
    slave, master = devices(plugin)
    lost = sys.modules["lerobot.utils.errors"].DeviceNotConnectedError
    slave.connect()
    slave.get_observation()
    with pytest.raises(lost) as caught:
        master.get_action()
    assert str(caught.value) == f"tautwave_master of {RIG} is not connected"
    master.connect()
    assert int(master.get_action()["wrist.pos"]) == 0  # of the row that the slave has seen
    slave.disconnect()
    with pytest.raises(lost) as caught:
        slave.get_observation()
    assert str(caught.value) == f"tautwave_slave of {RIG} is not connected"
    master.disconnect()


def test_lerobot_s_own_part_of_a_device_is_set_up(plugin: ModuleType) -> None:
    for kind in ("Slave", "Master"):
        made, settings = (vars(plugin)[f"Tautwave{kind}{end}"] for end in ("", "Config"))
        assert made(settings(rig=str(RIG), id="left")).id == "left"


def test_a_row_that_is_old_is_no_measurement(
    plugin: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    slave, _ = devices(plugin)
    lost = sys.modules["lerobot.utils.errors"].DeviceNotConnectedError
    with pytest.raises(lost, match="not connected"):
        slave.get_observation()
    slave, master = devices(plugin)
    slave.connect()
    master.connect()
    slave.get_observation()
    monkeypatch.setattr(Session, "age", 0.06)  # also the first look after a long frame
    with pytest.raises(lost, match=r"no new row for 0\.06. s"):
        slave.get_observation()
    with pytest.raises(lost, match="no new row"):  # nor is the row that the other has seen
        master.get_action()
    slave.disconnect()
    master.disconnect()


def test_the_distribution_has_a_name_that_lerobot_looks_for(tmp_path: Path) -> None:
    assert tomllib.loads((HOME / "pyproject.toml").read_text())["project"]["name"] == (
        "lerobot_robot_tautwave"
    )
    build = "import hatchling.build as b, sys; print(b.build_wheel(sys.argv[1]))"
    words = [sys.executable, "-c", build, str(tmp_path)]
    subprocess.run(words, cwd=HOME, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:
        (meta,) = [one for one in packed.namelist() if one.endswith("METADATA")]
        assert "\nName: lerobot_robot_tautwave\n" in packed.read(meta).decode()
