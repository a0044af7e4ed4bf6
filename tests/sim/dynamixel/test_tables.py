"""Control tables against those that dynamixel-sdk ships, and against themselves."""

from __future__ import annotations

from importlib import resources

import pytest

from tautwave_sim.dynamixel.items import EEPROM, RW, Model, R
from tautwave_sim.dynamixel.memory import Memory
from tautwave_sim.dynamixel.models import MODELS, find_model
from tautwave_sim.dynamixel.packets import WRITE
from tests.sim.dynamixel.line import Host

FOLDER = resources.files("dynamixel_easy_sdk") / "control_table"
NEW = [model for model in MODELS.values() if model.protocol >= 2.0]
# The SDK numbers indirect items differently, and leaves out what newer pages add.
OTHERS_ONLY = {"Indirect Address Write", "Indirect Data Write", "Indirect Address Read"}
OTHERS_ONLY |= {"Indirect Data Read"}


def sdk_table(model: Model) -> dict[str, tuple[int, int]]:
    """Return address and size by name, as the SDK has them for the newest firmware."""
    name = model.name.lower().replace("-", "_")
    file = FOLDER / f"{name}_fw52.model"
    if not file.is_file():
        file = FOLDER / f"{name}.model"
    lines = file.read_text().split("[control table]")[1].strip().splitlines()[1:]
    rows = [line.split("\t") for line in lines if line.strip()]
    return {row[2].strip(): (int(row[0]), int(row[1])) for row in rows}


@pytest.mark.parametrize("model", NEW, ids=lambda model: model.name)
def test_addresses_and_sizes_are_those_of_the_sdk(model: Model) -> None:
    ours = {item.name: (item.address, item.size) for item in model.items}
    theirs = sdk_table(model)
    assert {k: v for k, v in theirs.items() if k not in OTHERS_ONLY}.items() <= ours.items()
    extra = {name for name in ours if name not in theirs and "Indirect" not in name}
    assert extra <= {"Startup Configuration", "Backup Ready"}, extra


def test_model_numbers_are_those_of_the_sdk() -> None:
    lines = (FOLDER / "dynamixel.model").read_text().strip().splitlines()[1:]
    theirs = {int(number): name for number, name in (line.split() for line in lines)}
    for model in NEW:
        assert theirs[model.number] == model.name.lower().replace("-", "_") + ".model"


@pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
def test_a_table_is_sound(model: Model) -> None:
    at = 0
    for item in model.items:
        assert item.address >= at, item
        at = item.end
        assert item.size in (1, 2, 4)
        assert item.access in (R, RW)
        if item.access == RW:
            assert item.low <= item.initial <= item.high, item
        assert item.decode(item.encode(item.initial)) == item.initial
    assert {item.area for item in model.items if item.address >= 64} <= {"RAM", EEPROM}
    assert len({item.name for item in model.items}) == len(model.items)
    assert model.torque_constant > 0.0


@pytest.mark.parametrize(
    ("name", "constant"),
    [  # stall torque over stall current of the page
        ("XL330-M077", 0.146),
        ("XL330-M288", 0.354),
        ("XC330-M288", 0.517),
        ("XM430-W210", 1.30),
        ("XM430-W350", 1.78),
        ("XH430-W350", 2.62),
        ("XM540-W270", 2.41),
        ("XH540-W150", 1.45),
        ("XH540-W270", 2.02),
    ],
)
def test_torque_constants(name: str, constant: float) -> None:
    assert MODELS[name].torque_constant == pytest.approx(constant, rel=5e-3)


def test_units_of_the_current() -> None:
    assert MODELS["XL330-M288"].current_unit_a == 1e-3
    assert MODELS["XM430-W350"].current_unit_a == 2.69e-3
    assert MODELS["XH430-V350"].current_unit_a == 1.34e-3
    assert MODELS["XL430-W250"].current_unit_a == 0.0
    units = {item.name: item.unit for item in MODELS["XH430-V350"].items}
    assert units["Goal Current"] == "1.34 mA"


def test_indirect_data_of_a_330_move_with_the_firmware() -> None:
    assert find_model("XL330-M288", 53).indirect[0].data == 208
    assert find_model("XL330-M288", 45).indirect[0].data == 224
    assert find_model("XM430-W350", 45).indirect[0].data == 224


@pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
def test_every_register_reads_its_default_on_the_wire(model: Model) -> None:
    if model.protocol < 2.0:
        return
    host = Host((1,), model.name)
    for item in model.items:
        if item.area == EEPROM and item.name not in ("Baud Rate", "ID"):
            assert host.read(1, item.name) == item.initial, item.name


@pytest.mark.sparse(4)
@pytest.mark.parametrize("model", NEW, ids=lambda model: model.name)
def test_every_register_takes_its_ends_and_no_more(model: Model) -> None:
    """Each writable item takes lowest and highest value, refuses one beyond, and reads back."""
    for item in model.items:
        if item.access == R or item.limit or item.name in ("Goal Position", "Operating Mode"):
            continue
        memory = Memory(model, {})
        for value in (item.low, item.high):
            assert memory.items_of(item.address, item.encode(value)) == (0, [(item, value)])
        for value in (item.low - 1, item.high + 1):
            if item.decode(item.encode(value)) == value:
                assert memory.items_of(item.address, item.encode(value))[0] == 4, item.name


def test_a_model_unknown_is_named_with_its_nearest() -> None:
    with pytest.raises(ValueError, match="did you mean XM430-W350"):
        find_model("xm430-w35")


def test_firmware_before_38_has_no_watchdog() -> None:
    host = Host((1,), simulator={"servos": {1: {"firmware": 37}}})
    assert host.error(1, WRITE, 98, 0, 5) == 7
    assert "Bus Watchdog" not in host.servos[0].memory.items
    assert host.write(1, "Torque Enable", 1) == 0
    host.pass_time(0.1)
    assert host.read(1, "Torque Enable") == 1


def test_firmware_is_what_was_asked_for() -> None:
    host = Host((1,), simulator={"servos": {1: {"firmware": 41}}})
    assert host.servos[0].firmware == 41
    assert host.read(1, "Firmware Version") == 41
    assert host.error(1, WRITE, 6, 0, 42) == 7
