"""A DCF belongs to a node and to a kind of device; what is stored in a drive is what lasts."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError, DriverError
from tautwave_drivers.canopen.files.belonging import check_files, parameters
from tautwave_drivers.canopen.files.choosing import Choice, choose
from tautwave_drivers.canopen.files.reading import read_device_file
from tautwave_drivers.canopen.foresight import files_of
from tests.drivers.canopen.benches import driver_options
from tests.drivers.canopen.foreign import Foreign, foreign
from tests.drivers.canopen.test_eds import dcf, entry
from tests.drivers.canopen.test_mapping import mapped
from tests.foreign.cia402 import PRODUCT, VENDOR

MAX_TORQUE, CONSUMER, DEADLINE = (0x6072, 0), (0x1016, 1), (0x1400, 5)
TEMPORARY = (MAX_TORQUE, CONSUMER, DEADLINE)
WINDOW = (0x6065, 0)


def written(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def spec(number: int) -> AxisSpec:
    return AxisSpec(f"axis{number}", number, "rotary", "impedance", 0.4)


def checked(*nodes: tuple[int, str], identity: dict[str, int] | None = None) -> tuple[str, ...]:
    """Problems of the files of some nodes."""
    given: list[dict[str, Any]] = [
        {"id": number, "rated_torque": 0.5, "counts_per_revolution": 4096, "eds": file}
        | ({} if identity is None else {"identity": identity})
        for number, file in nodes
    ]
    options = driver_options({"interface": "virtual", "channel": "x", "nodes": given})
    try:
        check_files(files_of([(spec(node.id), node) for node in options.nodes]))
    except ConfigError as err:
        return tuple(err.problems)
    return ()


@pytest.mark.parametrize("spelling", ["DeviceComissioning", "DeviceCommissioning"])
def test_a_dcf_of_another_node_is_refused_before_the_bus(tmp_path: Path, spelling: str) -> None:
    text = dcf(f"[{spelling}]\nNodeID=1\n" + entry("2000"))
    file = written(tmp_path / "a.dcf", text)
    assert checked((1, file)) == ()
    (said,) = checked((2, file))
    assert said == (
        f"axis2: {file} is the DCF of node 1 (NodeID in it), but the rig gives it to node 2; "
        "export one from that drive, or correct the rig"
    )
    (said,) = checked((1, file), (2, file))
    assert said.startswith(f"axis1: {file} is given to nodes 1 and 2, but belongs to node 1")
    written(tmp_path / "a.dcf", text.replace("NodeID=1", "NodeName=AXIS"))  # as it tells to
    assert checked((1, file), (2, file)) == ()
    # a data sheet sets nothing, so it may say what it likes
    eds = written(tmp_path / "b.eds", text.replace("ParameterValue", "DefaultValue"))
    assert checked((1, eds), (2, eds)) == ()


@pytest.mark.parametrize(
    ("info", "said"),
    [
        ("VendorNumber=0x998\nProductNumber=0x402\n", "vendor 0x998, but the rig expects 0x999"),
        ("VendorNumber=0x999\nProductNumber=0x401\n", "product 0x401, but the rig expects 0x402"),
        ("VendorNumber=2457\nProductNumber=1026\n", ""),
        ("VendorNumber=0\nProductNumber=\n", ""),
    ],
)
def test_a_dcf_of_another_device_is_refused_before_the_bus(
    tmp_path: Path, info: str, said: str
) -> None:
    file = written(tmp_path / "a.dcf", f"[DeviceInfo]\n{info}" + entry("2000"))
    found = checked((1, file), identity={"vendor": VENDOR, "product": PRODUCT})
    assert bool(found) == bool(said)
    assert all(said in one for one in found)


def test_a_dcf_of_another_device_is_refused_by_what_the_drive_says(tmp_path: Path) -> None:
    file = written(tmp_path / "a.dcf", "[DeviceInfo]\nProductNumber=0x401\n" + entry("2000"))
    rig = foreign({WINDOW: 7}, first={"eds": file, "identity": None})
    assert "is for product 0x401, but it has 0x402; export a DCF from this drive" in rig.refused()
    assert rig.drive.values[WINDOW] == 7


def test_every_wrong_value_is_named_at_once(tmp_path: Path) -> None:
    text = dcf(entry("many") + entry("0x1FFFFFFFF", name="6066") + entry("5", name="6067"))
    found = checked((1, written(tmp_path / "a.dcf", text)))
    assert [one.split(": ")[2].split(" ")[0] for one in found] == ["6065:00", "6066:00"]


def run_with_configure(rig: Foreign) -> None:
    rig.enable()
    rig.cycle(0.05)
    assert [rig.drive.values[key] for key in TEMPORARY] == [800, 127 << 16 | 60, 60]
    rig.driver.close()


def test_what_is_temporary_is_never_stored(tmp_path: Path) -> None:
    file = written(tmp_path / "a.dcf", dcf(entry("2000")))
    rig = foreign({WINDOW: 7}, first={"eds": file}, configure=True)
    run_with_configure(rig)
    stored = rig.drive.stored
    assert [stored[key] for key in TEMPORARY] == [3000, 0, 0]
    assert (stored[WINDOW], stored[0x6007, 0], stored[0x1017, 0]) == (2000, 2, 20)
    (said, after) = [note for note in rig.driver.notes if "stored (1010:01)" in note]
    assert after.endswith("settings stored (1010:01)")  # what is stored is listed before
    assert said.endswith(
        " to be stored (1010:01): 6065:00, 60C2:01, 1017:00, 6007:00, 1A00:00, 1600:00"
    )
    assert [rig.drive.values[key] for key in TEMPORARY] == [3000, 0, 0]  # given back


def test_nothing_that_lasts_changed_stores_nothing() -> None:
    held = mapped([0x60400010, 0x60710010, 0x60600008], [0x60410010, 0x60640020, 0x60610008])
    rig = foreign(held | {(0x6007, 0): 2, (0x1017, 0): 20, (0x60C2, 1): 2}, configure=True)
    run_with_configure(rig)
    assert not rig.drive.stored
    assert any("nothing changed, nothing stored" in note for note in rig.driver.notes)


def test_the_watchdogs_of_a_run_that_was_killed_are_not_stored() -> None:
    rig = foreign({CONSUMER: 127 << 16 | 60, DEADLINE: 60}, configure=True)
    run_with_configure(rig)
    assert [rig.drive.stored[key] for key in TEMPORARY] == [3000, 0, 0]


def test_a_start_that_is_refused_gives_back_what_it_changed() -> None:
    rig = foreign(lacks=frozenset({0x6007}))
    assert "would keep following its last command" in rig.refused()
    assert [rig.drive.values[key] for key in TEMPORARY] == [3000, 0, 0]


def test_ctrl_c_while_starting_gives_back_what_was_changed() -> None:
    rig = foreign()
    take = rig.bus.send

    def interrupted(can_id: int, data: bytes) -> bool:
        if can_id == 0x601 and data[1:3] == b"\x00\x1a":  # at the mapping
            raise KeyboardInterrupt
        return take(can_id, data)

    rig.bus.send = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        rig.driver.open()
    assert [rig.drive.values[key] for key in TEMPORARY] == [3000, 0, 0]


def test_a_drive_whose_limit_is_not_set_again_after_storing_is_refused() -> None:
    rig = foreign(configure=True)
    shown = rig.drive._shown

    def stuck(index: int, subindex: int, **rest: Any) -> int | None:
        if (index, subindex) == MAX_TORQUE and rig.drive.stored:
            return 3000
        return shown(index, subindex, **rest)

    rig.drive.node._read_callbacks[:] = [stuck]
    with pytest.raises(DriverError, match=r"6072:00 max torque is 3000 .* after 800"):
        rig.driver.open()


# -- what is written ---------------------------------------------------------------------------

LEFT = {
    "1005": "SYNC COB-ID", "1010sub1": "Save all", "1011sub1": "Restore", "1017": "Heartbeat",
    "1400sub5": "Timer", "1A00sub1": "Mapping", "1F80": "Startup",
    "2000": "a", "2001": "b", "2005": "c", "2009": "d",
    "2100": "Node-ID", "2101": "CAN Baudrate", "2102": "Bit rate", "2103": "Store parameters",
    "2104": "Restore defaults", "2105": "Reset device", "2106": "Holding brake mode",
    "2107": "Digital outputs", "2108": "Boot delay", "2109": "Password", "210Asub1": "CAN address",
    "6042": "vl target", "60C1sub1": "Set-point", "60FEsub1": "Outputs", "6200sub1": "Out",
    "6411sub1": "Out", "68FEsub1": "Outputs of axis 2",
}  # fmt: skip
ALWAYS = {"6040": "Control", "6060": "Mode", "6071": "Target", "607A": "Target", "60FF": "Target",
          "60B2": "Offset", "6871": "Target of axis 2"}  # fmt: skip
WRITTEN = {
    "2006": "Current gain", "2100": "Position loop gain", "2101sub3": "Notch filter frequency",
    "5FFF": "Torque constant", "6065": "Following error window", "607E": "Polarity",
    "608Fsub1": "Encoder increments", "60F6sub1": "Gain", "6087": "Torque slope",
    "2110": "Control loop", "2111": "Bandwidth",
}  # fmt: skip


def choice(names: dict[str, str], include: tuple[str, ...] = ()) -> Choice:
    text = dcf("".join(entry("5", name=at, ParameterName=name) for at, name in names.items()))
    with TemporaryDirectory() as folder:
        file = read_device_file(written(Path(folder) / "a.dcf", text))
        return choose(parameters(file, 1), include)


@pytest.mark.parametrize("at", LEFT | ALWAYS)
def test_what_sets_the_node_triggers_or_moves_is_left_out_and_listed(at: str) -> None:
    name = (LEFT | ALWAYS)[at]
    found = choice({at: name, "6065": "Window"})
    assert [one.object.index for one in found.written] == [0x6065]
    address = at[:4] if at < "2" else f"{at[:4]}:"
    assert (address in found.note) or "1 objects of communication" in found.note


@pytest.mark.parametrize("at", WRITTEN)
def test_what_tunes_a_drive_is_written(at: str) -> None:
    found = choice({at: WRITTEN[at]})
    assert len(found.written) == 1
    assert found.note == ""


@pytest.mark.parametrize("at", LEFT)
def test_what_the_rig_names_is_written(at: str) -> None:
    index, _, sub = at.partition("sub")
    for named in (index, f"{index}:{int(sub or '0', 16):02x}"):
        assert len(choice({at: LEFT[at]}, (named,)).written) == 1
    assert not choice({at: LEFT[at]}, (f"{index}:7F",)).written


def test_an_object_that_the_file_lacks_or_that_moves_cannot_be_named(tmp_path: Path) -> None:
    file = written(tmp_path / "a.dcf", dcf(entry("5", name="6071") + entry("5", name="2001")))
    given = {"id": 1, "rated_torque": 0.5, "counts_per_revolution": 4096, "eds": file}

    def said(*include: str) -> list[str]:
        block = {"interface": "virtual", "nodes": [given | {"dcf_include": list(include)}]}
        (node,) = driver_options(block).nodes
        try:
            check_files(files_of([(spec(1), node)]))
        except ConfigError as err:
            return list(err.problems)
        return []

    assert said("2001") == []
    assert said("2002") == [
        f"axis1: dcf_include names 2002, but {file} has no value for it that can be written; "
        "remove it"
    ]
    assert "a file must not move a motor: remove it" in said("6071:00")[0]


def test_only_differences_are_written_and_what_is_left_out_is_said(tmp_path: Path) -> None:
    text = dcf(
        entry("2000")
        + entry("300", name="6066", kind="0x6")
        + entry("5", "0x5", name="2000", ParameterName="Node-ID")
        + entry("6", name="1006")
    )
    file = written(tmp_path / "a.dcf", text)
    held = {WINDOW: 2000, (0x6066, 0): 7, (0x2000, 0): 1, (0x1006, 0): 0}
    rig = foreign(held, first={"eds": file})
    rig.enable()
    rig.driver.close()
    given = [key for key, _ in rig.drive.written]
    assert (0x6066, 0) in given
    assert not {WINDOW, (0x2000, 0), (0x1006, 0)} & set(given)
    said = "\n".join(rig.driver.notes)
    assert "2000:00 Node-ID (node id and bit rate on many drives), 1 objects of comm" in said
    assert f"2 parameter values of {file}: 1 written and read back, 1 already in the drive" in said
