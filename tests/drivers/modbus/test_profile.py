"""Profiles: those that are shipped, somebody's own, and what is wrong with a file, in sentences."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from tautwave.errors import ConfigError
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.options import ModbusOptions, host_port, match_devices, scale_of
from tautwave_drivers.modbus.profile import SHIPPED, Register, load_profile, parse_profile
from tests.drivers.modbus.parts import bench, bus_of, device, options_of, spec

FOLDER = Path(__file__).parents[3] / "drivers" / "tautwave_drivers" / "modbus" / "profiles"


def generic() -> dict[str, Any]:
    data: dict[str, Any] = yaml.safe_load((FOLDER / "generic.yaml").read_text("utf-8"))
    return data


def problems(data: dict[str, Any]) -> str:
    with pytest.raises(ConfigError) as found:
        parse_profile(yaml.safe_dump(data), "mine.yaml")
    return "\n".join(found.value.problems)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_profiles_name_their_source_and_can_be_coupled(name: str) -> None:
    profile = load_profile(name)
    assert profile.family == name
    assert len(profile.source) > 20
    for causality in ("impedance", "admittance"):
        axes = [spec(1, causality)]
        found = match_devices(ModbusOptions.model_validate(options_of(axes, name)), bus_of(axes))
        assert found[0].most >= 1


def test_addresses_of_the_cia_402_family_follow_from_the_objects() -> None:
    registers = load_profile("cia402").registers
    for name, index in {
        "controlword": 0x6040, "statusword": 0x6041, "mode": 0x6060, "mode_display": 0x6061,
        "position": 0x6064, "velocity": 0x606C, "target_torque": 0x6071, "torque": 0x6077,
        "target_velocity": 0x60FF, "error_code": 0x603F, "maximum_torque": 0x6072,
        "rated_torque": 0x6076, "abort_option": 0x6007,
    }.items():  # fmt: skip
        assert registers[name].address == 0x6000 + (index & 0xFFF) * 0x10


def test_addresses_of_the_dsy_rs_are_those_of_its_manual() -> None:
    registers = load_profile("dsy-rs").registers
    for name, group, number in (
        ("control_mode", 0, 0), ("speed_command", 5, 3), ("torque_command", 6, 5),
        ("forward_torque_limit", 6, 8), ("backward_torque_limit", 6, 9), ("eeprom", 10, 4),
        ("fault_reset", 11, 1), ("emergency_stop", 11, 13), ("servo_status", 18, 0),
        ("motor_speed", 18, 1), ("internal_torque", 18, 4), ("absolute_position", 18, 7),
    ):  # fmt: skip
        assert registers[name].address == group * 256 + number


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"famly": "x"}, "mine.yaml:26: famly: unknown key 'famly'; did you mean 'family'?"),
        ({"functions": [3, 7, 16]}, "1, 2, 3, 4, 5, 6, 15, 16 or 23 (got 7)"),
        ({"functions": [3]}, "one that reads (3 or 4) and one that writes (6, 16)"),
        ({"roles": {"position": "positon"}}, "roles.position: there is no register 'positon'"),
        ({"enable": []}, "enable, disable and states are required"),
        ({"modes": {"effort": 2}}, "modes: velocity is missing"),
        ({"enable": [{"value": 1}]}, "enable.0: needs either write or wait"),
        ({"identity": {"register": "name"}}, "identity.register: there is no register 'name'"),
        ({"machine": "cia402"}, "roles: mode_display missing; machine: cia402 needs them"),
        ({"source": ""}, "source: String should have at least 1 character"),
    ],
)
def test_mistakes_are_reported_with_file_and_key(change: dict[str, Any], sentence: str) -> None:
    assert sentence in problems(generic() | change)


@pytest.mark.parametrize(
    ("key", "where"),
    [
        ("enable", "enable.0.value"),
        ("settings", "settings.0.value"),
        ("identity", "identity.value"),
        ("eeprom_off", "eeprom_off.value"),
        ("modes", "modes.effort"),
    ],
)
@pytest.mark.parametrize(("value", "kind", "holds"), [
    (300000, "u16", "0 to 65535"),
    (-1, "u16", "0 to 65535"),
    (0xFFFF, "i16", "-32768 to 32767"),
])  # fmt: skip
def test_a_value_that_its_register_cannot_hold_is_refused(
    key: str, where: str, value: int, kind: str, holds: str
) -> None:
    """On the line it would be held at the end of its type: another value than the one given."""
    data = generic()
    one = {"register": "own", "value": value}
    data["registers"]["own"] = {"address": 0x900, "type": kind}
    if key == "modes":
        data["roles"]["mode"] = "own"
        data["modes"] = {"effort": value, "velocity": 0}
    elif key == "enable":
        data[key] = [{"write": "own", "value": value}]
    else:
        data[key] = [one] if key == "settings" else one
    assert f"{where}: own holds {holds} as {kind} (got {value})" in problems(data)


def test_a_state_that_no_status_can_show_is_refused() -> None:
    data = generic()
    data["states"]["fault"] = {"mask": 0x8, "value": 0x10}
    found = problems(data)
    assert "states.fault: no status can show this: value 0x10 has bits outside mask 0x8" in found


@pytest.mark.parametrize(("kind", "last"), [("u16", 0xFFFF), ("i32", 0xFFFE)])
def test_a_register_ends_at_the_last_address(kind: str, last: int) -> None:
    assert Register.model_validate({"address": last, "type": kind}).address == last
    if kind == "i32":
        with pytest.raises(ValidationError, match="0xffff is the last address"):
            Register.model_validate({"address": last + 1, "type": kind})


def test_a_wrong_register_is_reported_with_its_name() -> None:
    data = generic()
    data["registers"]["torque"]["address"] = 70000
    assert "mine.yaml:134: registers.torque.address: " in problems(data)


def test_commands_that_would_wear_an_eeprom_are_refused() -> None:
    data = generic()
    data["registers"]["target_torque"]["lasting"] = True
    parse_profile(yaml.safe_dump(data), "mine.yaml")  # it says how to keep them out
    del data["eeprom_off"]
    assert "each cycle would wear the drive's EEPROM" in problems(data)


def test_text_that_is_not_yaml_and_files_that_are_not_there() -> None:
    with pytest.raises(ConfigError, match=r"mine.yaml:1:5: YAML syntax: "):
        parse_profile("a: [", "mine.yaml")
    with pytest.raises(ConfigError, match=r"mine.yaml:1: a profile must be a mapping .* a number"):
        parse_profile("7", "mine.yaml")
    with pytest.raises(ConfigError, match=r"no profile 'dsyrs'; use one of generic, dsy-rs"):
        load_profile("dsyrs")
    with pytest.raises(ConfigError, match=r"/nowhere.yaml: no such file"):
        load_profile("/nowhere.yaml")


def refused(axes: list[Any], **more: Any) -> str:
    block = ModbusOptions.model_validate(options_of(axes, "generic", **more))
    with pytest.raises(ConfigError) as found:
        match_devices(block, bus_of(axes))
    return "\n".join(found.value.problems)


def test_a_drive_that_takes_positions_only_is_refused_with_a_sentence(tmp_path: Path) -> None:
    data = generic()
    for role in ("command_effort", "command_velocity"):
        del data["roles"][role]
    path = tmp_path / "positioner.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    reported = refused([spec(1)], devices=[device(1) | {"profile": str(path)}])
    assert "takes positions only" in reported
    assert "neither an impedance nor an admittance port" in reported


def test_a_drive_that_measures_no_torque_is_no_admittance_port(tmp_path: Path) -> None:
    data = generic()
    del data["roles"]["effort"]
    path = tmp_path / "blind.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    reported = refused([spec(1, "admittance")], devices=[device(1) | {"profile": str(path)}])
    assert "does not measure torque or current" in reported


def test_what_has_to_be_known_of_a_drive_is_asked_for() -> None:
    assert "rated_torque [N m] is required" in refused([spec(1)], devices=[{"unit": 1}])
    assert "options.devices lists units 1" in refused([spec(2)], devices=[device(1)])
    assert "listed twice" in refused([spec(1)], devices=[device(1), device(1)])
    linear = spec(1)._replace(kind="linear")
    assert "feed [m per turn" in refused([linear])
    assert "feed is for linear axes" in refused([spec(1)], devices=[device(1, feed=0.01)])
    assert "should be tcp://HOST:PORT" in refused([spec(1)], endpoint="10.0.0.7:502")
    for unit in (0, 248, 255):
        found = refused([spec(unit)], devices=[device(unit)], link="rtu", endpoint="tcp://a:1")
        assert f"unit {unit} is for a TCP server" in found
    tiny = spec(1, effort=1e-5)
    assert "less than one count" in refused([tiny])


def positions(data: dict[str, Any]) -> None:
    del data["roles"]["command_velocity"]


def velocities(data: dict[str, Any]) -> None:
    del data["roles"]["command_effort"]


def unsigned(data: dict[str, Any]) -> None:
    data["registers"]["target_torque"]["type"] = "u16"


@pytest.mark.parametrize(
    ("causality", "change", "own", "reported"),
    [
        ("impedance", velocities, {}, "takes no torque; make the axis causality: admittance"),
        ("admittance", positions, {}, "takes no velocity; make the axis causality: impedance"),
        ("impedance", unsigned, {}, "its command register is unsigned"),
        ("impedance", None, {"function_codes": [3]}, "function_codes [3]: one that reads (3, 4)"),
        ("impedance", None, {"function_codes": [6]}, "function_codes [6]: one that reads (3, 4)"),
        ("admittance", None, {"function_codes": [3, 6]}, "32 bits needs function code 16"),
    ],
)
def test_a_drive_that_cannot_be_commanded_so_is_refused(
    causality: str,
    change: Callable[[dict[str, Any]], None] | None,
    own: dict[str, Any],
    reported: str,
    tmp_path: Path,
) -> None:
    data = generic()
    if change is not None:
        change(data)
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    found = refused([spec(1, causality)], devices=[device(1, **own) | {"profile": str(path)}])
    assert reported in found
    if change is None:
        enough = [device(1, function_codes=[3, 16])]
        block = options_of([spec(1, causality)], "generic", devices=enough)
        assert match_devices(ModbusOptions.model_validate(block), bus_of([spec(1, causality)]))


def test_an_endpoint_has_a_host_and_the_port_of_the_standard_unless_it_says_another() -> None:
    assert host_port("tcp://10.0.0.7") == ("10.0.0.7", 502)
    assert host_port("tcp://[fe80::7]:503") == ("fe80::7", 503)
    own = [device(1, endpoint="tcp://10.0.0.8:502")]
    found = refused([spec(1)], devices=own, link="rtu", endpoint="/dev/ttyUSB0")
    assert "endpoint of a device is for TCP; on a serial line all drives share" in found


def test_all_that_is_missing_of_a_drive_is_said_at_once() -> None:
    """Whichever of torque and command it is that needs to know."""
    options = ModbusOptions.model_validate(options_of([spec(1)], "generic", devices=[{"unit": 1}]))
    profile = load_profile("generic")
    linear = spec(1)._replace(kind="linear")
    name = profile.roles["effort"]
    amperes = profile.registers[name].model_copy(update={"unit": "A"})
    by_current = profile.model_copy(
        update={
            "counts_per_revolution": None,
            "registers": {**profile.registers, name: amperes},
        }
    )
    with pytest.raises(ConfigError) as found:
        scale_of(linear, options.devices[0], by_current)
    assert list(found.value.problems) == [
        "counts_per_revolution is required; its profile does not have it",
        "rated_torque [N m] is required: the drive reports effort as a share of it",
        "torque_constant [N m/A] is required: the drive reports effort in amperes",
        "feed [m per turn of the output] is required for a linear axis",
    ]


def test_scales_pass_gear_feed_and_units() -> None:
    profile = load_profile("generic")
    linear = spec(1)._replace(kind="linear")
    options = ModbusOptions.model_validate(
        options_of([linear], "generic", devices=[device(1, feed=0.02, gear_ratio=5.0)])
    ).devices[0]
    scale = scale_of(linear, options, profile)
    assert scale.position == pytest.approx(0.02 / (65536 * 5))
    assert scale.velocity == pytest.approx(0.1 / 60 * 0.02 / 5)
    # Power: torque times the motor's turn equals force times the way.
    assert scale.effort == pytest.approx(1e-3 * 5 * 2 * 3.141592653589793 / 0.02)


def test_a_file_of_ones_own_runs(tmp_path: Path) -> None:
    """The same drive, its registers elsewhere and the low word first."""
    data = generic()
    data["family"] = "mine"
    data["word_order"] = "low_first"
    for register in data["registers"].values():
        register["address"] += 0x300
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    mine = device(1, counts_per_revolution=65536) | {"profile": str(path)}
    made = bench(spec(1), devices=[mine])
    made.enable()
    made.run(20, 0.5)
    assert made.commanded(0) == 500.0
    assert made.world.axes[0].physics.x > 0.0
    made.driver.close()
    assert made.commanded(0) == 0.0


@pytest.mark.slow
def test_the_profiles_are_package_data() -> None:
    """Loaded as an installed package does, and without the vendor's library."""
    code = (
        "import sys, json; sys.modules['pymodbus'] = sys.modules['serial'] = None\n"
        "from tautwave.registry import load_driver\n"
        "from tautwave.contracts import AxisSpec, BusSpec\n"
        "plugin = load_driver('modbus')\n"
        "options = plugin.options.model_validate(json.loads(sys.argv[1]))\n"
        "bus = BusSpec('b', (AxisSpec('slave.a', 1, 'rotary', 'impedance', 1.0),), 100.0)\n"
        "print(plugin.make(options, bus, None, None).command_delay.periods, "
        "plugin.budget(options, bus).time_s > 0, len(plugin.facts(options, bus)))\n"
    )
    block = json.dumps(options_of([spec(1)], "dsy-rs"))
    done = subprocess.run(
        [sys.executable, "-c", code, block], capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["1", "True", "1"], done.stderr


def test_facts_are_the_steps_of_the_drive() -> None:
    axes = [spec(1), spec(2, "admittance")]
    block = plugin.options.model_validate(options_of(axes, "generic"))
    torque, velocity = plugin.facts(block, bus_of(axes))
    assert torque.effort_quantum == pytest.approx(1e-3)
    assert torque.velocity_quantum == 0.0
    assert velocity.velocity_quantum == pytest.approx(0.1 / 60 * 2 * 3.141592653589793)
    assert velocity.encoder_quantum == torque.encoder_quantum
