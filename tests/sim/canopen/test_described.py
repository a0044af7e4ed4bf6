"""Simulated drives follow the file that a rig names: objects, access, defaults, mapping, modes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.errors import DriverError
from tests.drivers.canopen.benches import Rig, block, make, node
from tests.drivers.canopen.test_eds import entry
from tests.foreign.eds_files import Fields, Key, file_text, objects_of, one_of


def rig_of(path: Path, objects: dict[Key, Fields], suffix: str = "eds", more: str = "") -> Rig:
    """A driver with one simulated drive, by a file of these objects; its numbers are the rig's."""
    file = path / f"drive.{suffix}"
    file.write_text(file_text(objects) + more)
    given = {"rated_torque": 0.64, "counts_per_revolution": 8192, "eds": str(file)}
    return make(block(node(1, **given)), ("impedance",))


def without(*keys: Key) -> dict[Key, Fields]:
    return {key: fields for key, fields in objects_of().items() if key not in keys}


def changed(**changes: dict[str, str]) -> dict[Key, Fields]:
    objects = objects_of()
    for name, fields in changes.items():
        index, _, sub = name.lstrip("x").partition("_")
        objects[int(index, 16), int(sub or "0")] |= fields
    return objects


def test_a_drive_of_a_file_runs(tmp_path: Path) -> None:
    rig = rig_of(tmp_path, objects_of())
    rig.open_and_enable()
    rows, _ = rig.run(20, 0.05)
    assert rows[-1][0].position > 0.0
    assert any("vendor 0x999, product 0x402" in note for note in rig.driver.notes)
    rig.driver.close()


REFUSED: list[tuple[dict[Key, Fields], str]] = [
    (without((0x6007, 0)), "has no 6007:00 abort connection option (0x06020000"),
    (without((0x1017, 0)), "has no 1017:00 producer heartbeat (0x06020000"),
    (without((0x1016, 1), (0x1400, 5)), "has no 1400:05 deadline timer (0x06090011"),
    (
        changed(x6007={"AccessType": "const", "DefaultValue": "0"}),
        "6007:00 abort connection option stays 0",
    ),
    (objects_of() | {(0x607E, 0): one_of("u1", "rw", "0x80")}, "607E:00 polarity is 0x80"),
    (objects_of() | {(0x60A8, 0): one_of("u4", "rw", "0xFF410000")}, "60A8:00 SI unit position"),
    (changed(x6076={"DefaultValue": "900"}), "6076:00 motor rated torque is 900"),
    (changed(x608F_1={"DefaultValue": "2000"}), "608F:01 encoder increments is 2000"),
    (changed(x6072={"DefaultValue": "10"}), "6072:00 max torque is 10"),
]


@pytest.mark.parametrize(("objects", "said"), REFUSED)
def test_what_a_drive_of_the_file_would_be_refused_for_its_simulation_is(
    objects: dict[Key, Fields], said: str, tmp_path: Path
) -> None:
    rig = rig_of(tmp_path, objects)
    with pytest.raises(DriverError) as found:
        rig.open_and_enable()
    assert said in str(found.value)
    rig.driver.close()


@pytest.mark.parametrize(
    "objects",
    [
        changed(x6076={"DefaultValue": "0"}, x6075={"DefaultValue": "0"}),
        changed(x608F_1={"DefaultValue": "1"}),
        changed(x1000={"DefaultValue": "0"}),
        changed(x6502={"DefaultValue": ""}),
        without((0x6072, 0)),
        without((0x605A, 0)),
        without(*((0x60C2, sub) for sub in range(3))),
        {(0x6065, 0): one_of("u4", "rw", "7")},  # a file of some objects only
    ],
)
def test_what_a_file_leaves_open_is_the_rigs(objects: dict[Key, Fields], tmp_path: Path) -> None:
    rig = rig_of(tmp_path, objects)
    rig.open_and_enable()
    rows, _ = rig.run(20, 0.05)
    assert rows[-1][0].position > 0.0
    rig.driver.close()


def test_modes_are_those_of_the_file(tmp_path: Path) -> None:
    objects = changed(x6502={"DefaultValue": "0x200"})  # CST alone
    rig = rig_of(tmp_path, objects)
    rig.open_and_enable()
    drive = rig.devices()[0].drive
    assert drive.modes == (10,)
    assert any("modes CST" in note and "," not in note for note in rig.driver.notes), (
        rig.driver.notes
    )
    rig.driver.close()


@pytest.mark.parametrize(
    ("access", "rpdo", "said"),
    [
        ("const", (0x60400010, 0x60710010), "RPDO1 0x201 on every SYNC: 6040 controlword, 6071"),
        ("rw", (0x60400010,), "written and read back"),
    ],
)
def test_mappings_are_those_of_the_file(
    access: str, rpdo: tuple[int, ...], said: str, tmp_path: Path
) -> None:
    objects = {key: fields for key, fields in objects_of().items() if key[0] != 0x1600}
    objects[0x1600, 0] = one_of("u1", access, len(rpdo))
    count = 8 if access == "rw" else len(rpdo)
    for sub in range(1, count + 1):
        word = rpdo[sub - 1] if sub <= len(rpdo) else 0
        objects[0x1600, sub] = one_of("u4", access, f"0x{word:X}")
    rig = rig_of(tmp_path, objects)
    rig.open_and_enable()
    (note,) = [note for note in rig.driver.notes if "RPDO1" in note]
    assert said in note
    assert ("(lean:" in note) == (access == "const"), note
    rows, _ = rig.run(20, 0.05)
    assert rows[-1][0].position > 0.0
    rig.driver.close()


def test_objects_that_no_pdo_carries_are_refused_there(tmp_path: Path) -> None:
    rig = rig_of(tmp_path, changed(x6060={"PDOMapping": "0"}))
    rig.open_and_enable()
    assert any("(lean:" in note and "mapped to a PDO" in note for note in rig.driver.notes)
    rig.driver.close()


def test_a_dcf_with_a_manufacturers_objects_can_be_simulated(tmp_path: Path) -> None:
    objects = objects_of() | {(0x2350, 0): one_of("u2", "rw", 5)}
    rig = rig_of(tmp_path, objects, "dcf", entry("777", "0x6", name="2351"))
    rig.open_and_enable()
    assert any("1 parameter values of" in note and "1 written" in note for note in rig.driver.notes)
    held = rig.devices()[0].objects
    assert (held.number(0x2350), held.number(0x2351)) == (5, 777)
    rig.driver.close()


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_pdos_that_the_file_has_not_are_off(number: int, tmp_path: Path) -> None:
    gone = [0x1400 + at for at in range(number, 4)] + [0x1800 + at for at in range(number, 4)]
    both = {*gone, *(index + 0x200 for index in gone)}
    objects = {key: fields for key, fields in objects_of().items() if key[0] not in both}
    rig = rig_of(tmp_path, objects)
    rig.open_and_enable()
    device = rig.devices()[0]
    assert not any(pdo.valid for pdo in (*device.rpdos[1:], *device.tpdos[1:]))
    rig.driver.close()
