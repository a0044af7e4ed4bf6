"""Ten families of drives with traits of their own, written as profiles from the docs: simulated.

Their registers are as public descriptions have them, or made up around one trait; nobody has tried
them on a real drive.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.errors import ConfigError
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.budget import budget
from tautwave_drivers.modbus.profile import load_profile, parse_profile
from tests.drivers.modbus.parts import FAST_RTU, Bench, bench, bus_of, options_of, spec

FOLDER = Path(__file__).with_name("families")
OWN: dict[str, dict[str, Any]] = {
    "mr-je-c": {"unit": 255},
    "orca": {"feed": 1.0},
    "oriental-az": {},
    "trigger": {"torque_constant": 1.0},
    "svd48v": {"torque_constant": 1.0},
    "split-tables": {"rated_torque": None},
}
VELOCITY = ("oriental-az", "split-tables")
CODES = {
    "oriental-az": [23, 3, 3],
    "mr-je-c": [16, 3, 3],
    "orca": [23, 3],
    "split-tables": [16, 4],
    "coils": [16, 4, 2],
    "trigger": [6, 6, 6, 3, 3],
    "svd48v": [16, 3, 3],
    "seconds": [16, 3],
    "ezmotion": [16, 3, 3],
    "sixteen": [23],
}


def made(name: str, rtu: bool) -> Bench:
    own = {"rated_torque": 1.0, **OWN.get(name, {})}
    unit = 1 if rtu else own.pop("unit", 1)
    own.pop("unit", None)
    axis = spec(unit, "admittance" if name in VELOCITY else "impedance")
    if name == "orca":
        axis = axis._replace(kind="linear")
    device = {"unit": unit, "profile": str(FOLDER / f"{name}.yaml"), **own}
    device = {key: value for key, value in device.items() if value is not None}
    more: dict[str, Any] = dict(FAST_RTU) if rtu else {}
    return bench(axis, devices=[device], **more)


def test_there_are_ten() -> None:
    assert {path.stem for path in FOLDER.glob("*.yaml")} == set(CODES)


@pytest.mark.parametrize("rtu", [False, True])
@pytest.mark.parametrize("name", CODES)
def test_a_family_is_enabled_driven_and_switched_off(name: str, rtu: bool) -> None:
    one = made(name, rtu)
    one.enable()
    one.run(200, 0.5)
    assert not [fault for fault in one.faults() if fault.fatal]
    states = one.run(2, 0.5)
    assert states[-1][0].valid
    assert states[-1][0].position == pytest.approx(one.world.axes[0].physics.x, abs=2e-3)
    assert states[-1][0].position > 1e-3
    assert one.commanded(0) != 0.0
    one.driver.close()
    assert one.driver.unconfirmed == {}
    assert one.commanded(0) == 0.0


@pytest.mark.parametrize("name", CODES)
def test_what_a_cycle_asks_is_what_check_counts(name: str) -> None:
    one = made(name, rtu=False)
    one.enable()
    one.run(2, 0.1)
    codes = [request.function for request in one.driver.stations[0].plan.requests]
    assert codes == CODES[name]
    said = budget(one.driver._options, one.bus).arithmetic
    assert f"({' + '.join(f'FC {code}' for code in codes)})" in said
    one.driver.close()


def test_a_time_out_of_whole_seconds_is_what_the_drive_is_said_to_take() -> None:
    one = made("seconds", rtu=False)
    one.enable()
    assert dict(one.driver.watchdog_s) == {"slave.a1": 1.0}
    assert one.number(1, "timeout") == 1
    one.driver.close()


def test_a_strobe_follows_each_command_and_the_zero_of_the_end() -> None:
    one = made("trigger", rtu=False)
    one.enable()
    seen: list[tuple[int, int]] = []
    drive = one.world.bus.drives[1]
    write = drive.write

    def log(address: int, words: list[int], table: str = "holding") -> None:
        seen.append((address, words[0]))
        write(address, words, table)

    drive.write = log
    one.run(3, 0.5)
    assert seen[-3:] == [(0x20, 5), (0x22, 0), (0x22, 0x10)]
    seen.clear()
    one.driver.disable()
    assert seen[:3] == [(0x20, 0), (0x22, 0), (0x22, 0x10)]
    one.driver.close()


TEXT = (FOLDER / "coils.yaml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{address: 7, table: discrete, access: r}", "{address: 7, table: discrete}", ""),
        ("functions: [1, 2,", "functions: [1,", "function code 2 reads a register of discrete"),
        ("3, 4, 5, 16]", "3, 4, 16]", "run is a coil: function code 5 or 15 writes it"),
        ("{address: 7, table: coil}", "{address: 7, table: input}", "the table input, which"),
        ("{address: 7, table: coil}", "{address: 7, table: coil, type: i32}", "a coil is one bit"),
        ("{write: run, value: 1}", "{write: run, value: 2}", "run holds 0 to 1"),
        ("modes: {}", "modes: {}\nafter_command: [{wait: run, value: 1}]", "has writes only"),
        ("modes: {}", "modes: {}\ngaps: {coil: maybe}", "gaps"),
        ("{holding: 2, input: 4}", "{holding: 2, bits: 4}", "most_registers"),
    ],
)  # fmt: skip
def test_what_no_function_code_reaches_is_refused(old: str, new: str, words: str) -> None:
    assert TEXT.count(old) == 1
    text = TEXT.replace(old, new)
    if not words:
        parse_profile(text, "mine")
        return
    with pytest.raises(ConfigError, match=words):
        parse_profile(text, "mine")


def test_32_bits_want_function_code_16() -> None:
    text = (FOLDER / "oriental-az.yaml").read_text()
    with pytest.raises(ConfigError, match="op_type has 32 bits: only function code 16 writes"):
        parse_profile(text.replace("[3, 6, 16, 23]", "[3, 6]"), "mine")


def test_force_is_of_linear_axes() -> None:
    block = options_of([spec(1)], "generic")
    block["devices"] = [{"unit": 1, "profile": str(FOLDER / "orca.yaml")}]
    with pytest.raises(ConfigError, match="effort in N, which is for linear axes"):
        budget(plugin.options.model_validate(block), bus_of([spec(1)]))


@pytest.mark.parametrize(
    ("gaps", "most", "blocks"),
    [
        ("readable", 125, 1), ("refused", 125, 3), ("{input: readable}", 125, 1),
        ("{holding: readable}", 125, 3), ("readable", "{input: 3}", 3), ("readable", 20, 2),
    ],
)  # fmt: skip
def test_blocks_keep_the_limits_of_their_table(gaps: str, most: int | str, blocks: int) -> None:
    text = (FOLDER / "split-tables.yaml").read_text().replace("{address: 0x20", "{address: 0x1A")
    text = text.replace("{address: 0x30, table", "{address: 0x24, table")
    text = text.replace("gaps: {input: readable}", f"gaps: {gaps}\nmost_registers: {most}")
    found = parse_profile(text, "mine").blocks(["position", "torque", "status"])
    assert len(found) == blocks
    assert found[0].names[0] == "position"
    assert {block.table for block in found} == {"input"}


def test_shipped_profiles_say_that_nobody_tried_them() -> None:
    for name in ("dsy-rs", "cia402"):
        assert any("real drive" in caveat for caveat in load_profile(name).caveats)
