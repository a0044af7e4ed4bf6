"""What changes the meaning of a number on the bus is right, or refused before any torque.

The drive is a foreign one: its motor's angle and torque are the truth, and every object of the
factor group changes what the bus shows of them.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError, DriverError
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.setup import meaning
from tautwave_drivers.canopen.setup.meaning import ENTRIES, TABLE, verdicts
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry
from tests.drivers.canopen.benches import block, driver_options, make, node
from tests.drivers.canopen.foreign import Foreign, foreign, remedies
from tests.foreign.cia402 import ForeignDrive, Key

INCREMENTS, TENTH_DEGREE, REV, TURNS_PER_MINUTE = 0x00B50000, 0xFF410000, 0x00B40000, 0x00B44700
COUNT = math.tau / 4096

OTHERS: dict[Key, tuple[int, ...]] = {
    (0x607E, 0): (0, 0x20, 0x40, 0x80, 0xA0, 0xC0, 0xE0),
    (0x607C, 0): (0, 1, -500),
    (0x60A8, 0): (0, INCREMENTS, TENTH_DEGREE, 0xFD410000, REV, 0xFA010000, 0x00770000),
    (0x608F, 1): (4096, 1000, 40960, 1),
    (0x608F, 2): (1, 2, 0),
    (0x60A9, 0): (0, 0x00B50300, TURNS_PER_MINUTE, 0xFFB44700, 0x00770300),
    (0x6075, 0): (1000, 0),
    (0x6076, 0): (500, 0, 499, 5000, 500_000),
    (0x6072, 0): (3000, 800, 799, 0),
    (0x6073, 0): (3000, 800, 799, 0),
    (0x607F, 0): (0xFFFFFFFF, 9779, 9770, 1, 0),
    (0x6089, 0): (0, -1, 3),
    (0x608A, 0): (0, 0xB5, 0xAC, 0x41, 0xB4, 0x10, 0x01, 0x77),
    (0x608B, 0): (0, -3),
    (0x608C, 0): (0, 0xA4, 0xB4, 0x01, 0x77),
    (0x60E0, 0): (3000, 800, 799, 0),
    (0x60E1, 0): (3000, 800, 799, 0, 0x10000 - 800, 0x10000 - 799, 0xFFFF),
    (0x6080, 0): (5000, 144, 143, 0),
    (0x60B2, 0): (0, 300, -300),
    (0x60B0, 0): (0, 300),
    (0x60B1, 0): (0, 300),
}
"""Values of single objects: what leaves all alone, and others."""

FACTORS: dict[int, tuple[tuple[int, int], ...]] = {
    0x6090: ((1, 1), (4096, 1), (8192, 2), (1000, 1)),
    0x6091: ((1, 1), (7, 1), (2, 2), (0, 0)),
    0x6092: ((1, 1), (4096, 1), (3600, 1), (40960, 10)),
    0x6093: ((1, 1), (3, 3), (128, 10)),
    0x6094: ((1, 1), (2, 1)),
    0x6095: ((1, 1), (2, 1)),
    0x6096: ((1, 1), (3, 2)),
    0x607B: ((0, 0), (-(1 << 31), (1 << 31) - 1), (0, 4095), (-1_000_000_000, 1_000_000_000)),
}
"""Values of the objects with two sub-indices."""

CASES: list[dict[Key, int]] = [
    *({key: value} for key, values in OTHERS.items() for value in values),
    *(
        {(index, 0): 2, (index, 1): first, (index, 2): second}
        for index, pairs in FACTORS.items()
        for first, second in pairs
    ),
    {(0x60A8, 0): TENTH_DEGREE, (0x6091, 1): 7, (0x6091, 2): 1},
    {(0x6092, 1): 28672, (0x6092, 2): 1, (0x6091, 1): 7, (0x6091, 2): 1},
    {(0x6089, 0): -1, (0x608A, 0): 0x41},
    {(0x6089, 0): 0, (0x608A, 0): 0xB5},
    {(0x608B, 0): -3, (0x608C, 0): 0xA4},
    {(0x60A9, 0): TURNS_PER_MINUTE, (0x6090, 1): 1000, (0x6090, 2): 1},
]
NEUTRAL: list[dict[Key, int]] = [
    {(0x607E, 0): 0},
    {(0x60A8, 0): INCREMENTS},
    {(0x608F, 1): 1},
    {(0x6091, 0): 2, (0x6091, 1): 1, (0x6091, 2): 1},
    {(0x6092, 0): 2, (0x6092, 1): 40960, (0x6092, 2): 10},
    {(0x60E0, 0): 800, (0x60E1, 0): 800},
    {(0x60E0, 0): 800, (0x60E1, 0): 0x10000 - 800},  # counted downwards
    {(0x60B2, 0): 300},
    {(0x6080, 0): 144},
    {(0x6073, 0): 800},
    {(0x607F, 0): 9779},
    {(0x6089, 0): 0, (0x608A, 0): 0xB5},
    {(0x608A, 0): 0xAC},
    {(0x608B, 0): 0, (0x608C, 0): 0},
]
"""Some that have to go through: a driver that refuses everything would pass the rest."""


def named(case: dict[Key, int]) -> str:
    return " ".join(f"{index:04X}:{sub}={value}" for (index, sub), value in case.items())


def measured_rightly(rig: Foreign, causality: str) -> None:
    """Torques, velocities and positions are what the motor has."""
    rig.enable()
    drive: ForeignDrive = rig.drive
    for _ in range(5):  # until the motor turns
        rig.cycle(0.1, 2.0)
    for _ in range(10):
        before = drive.angle
        (state,) = rig.cycle(0.1, 2.0)
        assert state.position == pytest.approx(before, abs=2 * COUNT + 0.004 * drive.speed)
        if causality == "impedance":
            assert drive.torque == pytest.approx(0.1, abs=5e-4)
        else:
            assert drive.speed == pytest.approx(2.0, rel=1e-3)
    assert drive.angle > 0.01
    rig.driver.close()


@pytest.mark.parametrize("causality", ["impedance", "admittance"])
@pytest.mark.parametrize("case", CASES, ids=named)
def test_a_number_means_what_the_rig_says_or_the_drive_is_refused(
    case: dict[Key, int], causality: str
) -> None:
    rig = foreign(case, causality=causality)
    try:
        measured_rightly(rig, causality)
    except DriverError as err:
        sentence = str(err)
        assert rig.drive.state == "disabled"
        assert rig.drive.angle == 0.0
        assert any(f"{index:04X}:" in sentence for index, _ in case), sentence
        assert not any(case == allowed for allowed in NEUTRAL), sentence


@pytest.mark.parametrize("case", NEUTRAL, ids=named)
def test_values_that_leave_everything_alone_are_not_refused(case: dict[Key, int]) -> None:
    measured_rightly(foreign(case), "impedance")


@pytest.mark.parametrize(
    ("low", "high", "jumps"),
    [
        (-1_000_000_000, 1_000_000_000, False),
        (0, 4095, True),
        (-5200, 5200, False),
        (-5100, 5100, True),  # within a tenth of an end
        (-5000, 4000, True),
    ],
)
def test_ends_of_607b_far_outside_the_position_range_are_left(
    low: int, high: int, jumps: bool
) -> None:
    """4096 counts a turn, a range of a turn either way."""
    stated = {"id": 1, "rated_torque": 0.5, "counts_per_revolution": 4096}
    options = driver_options({"interface": "virtual", "nodes": [stated]})
    (one,) = options.nodes
    spec = AxisSpec("a", 1, "rotary", "impedance", 0.4, 50.0, (-math.tau, math.tau))
    read = dict.fromkeys(ENTRIES) | {o.MIN_WRAP: low, o.MAX_WRAP: high}
    axis = Axis(spec, one, options, 1000.0)
    said = [one.refusal for row, one in verdicts(read, axis) if o.MIN_WRAP in row.entries]
    assert bool(said and said[0]) is jumps, said


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row.entries[0].address)
def test_every_row_of_the_table_is_tried(row: object) -> None:
    tried = {key for case in CASES for key in case}
    assert {(entry.index, entry.sub) for entry in row.entries} <= tried  # type: ignore[attr-defined]


PROFILE = """
6060-607F 6080-608E 608F-609A 60A2-60A4 60A8-60AB 60B0-60B2 60B8-60BD 60C0-60C6 60D0-60D5 60E0 60E1
60E3-60EF 60F2 60F4 60F6-60FF
"""
"""Indices that CiA 402-2 gives a meaning from 6060h to 60FFh, those of edition 2 included."""

LEFT_ALONE = {
    "6062 6063 6069 606B 6074 6078 6079 60F4 60FA 60FC 60FD":
        "the drive only shows it; no command is made of it",
    "6065 6066 6067 6068": "windows of a position loop, which CST and CSV have not",
    "606A 606C": "velocity as the drive has it, and from which sensor: read for its sign alone",
    "606D 606E 606F 6070": "windows of PV; bits of 6041h that are not read",
    "607D": "software position limits: a drive that stops there says so in 6041h, bit 11",
    "6081 6083 6084 6085": "ramps and velocity of profile moves and of a quick stop",
    "6082 6086 6087 6088 608D 608E 6097 60A2 60A3 60A4 60AA 60AB":
        "ramps, jerk and their units are of profile modes: CST and CSV take each set-point as sent",
    "60B8 60B9 60BA 60BB 60BC 60BD 60D0 60D1 60D2 60D3 60D4 60D5": "touch probe, never started",
    "60C0 60C1 60C3 60C4": "interpolated position mode, which is not used",
    "60C5 60C6": "ends of profile ramps; a drive that ramps CSV by them comes late, not to another "
        "velocity, and its measured position shows that",
    "60E3 60E7 60E9 60EB 60EC 60ED 60EE 60EF 60E4 60E5 60E6 60E8":
        "homing methods, and further encoders, which are not read",
    "60EA": "commutation angle of CSTCA, which is not used",
    "60F2": "kinds of positioning in PP",
    "60F6 60F7 60F9 60FB": "gains and motor data of the drive's loops",
    "60F8": "slippage of PV: it ends a move by a bit of 6041h, and caps nothing",
    "60FE": "outputs and brake are the drive's; a file writes them only where dcf_include names it",
}  # fmt: skip
"""What no rule looks at, and why that does not matter to a number that is sent or read."""


def indices(text: str) -> set[int]:
    found: set[int] = set()
    for word in text.split():
        first, _, last = word.partition("-")
        found |= set(range(int(first, 16), int(last or first, 16) + 1))
    return found


def test_every_object_of_the_profile_has_a_rule_a_use_or_a_reason() -> None:
    package = Path(meaning.__file__).parent.parent
    source = "\n".join(path.read_text() for path in package.rglob("*.py"))
    used = {
        entry.index
        for name, entry in vars(o).items()
        if isinstance(entry, Entry) and re.search(rf"\bo\.{name}\b", source)
    }
    judged = {entry.index for entry in ENTRIES}
    left = [index for text in LEFT_ALONE for index in indices(text)]
    assert len(left) == len(set(left))
    assert not used & set(left)
    assert judged <= used
    assert {f"{index:04X}" for index in indices(PROFILE) - used - set(left)} == set()
    assert set(left) <= indices(PROFILE)


def profile_refusal(held: int, move: dict[str, Any] | None, causality: str) -> str:
    stated: dict[str, Any] = {"id": 1, "rated_torque": 0.5, "counts_per_revolution": 4096}
    stated |= {"move": move} if move else {}
    options = driver_options({"interface": "virtual", "nodes": [stated]})
    (one,) = options.nodes
    axis = Axis(AxisSpec("a", 1, "rotary", causality, 0.4, 15.0), one, options, 1000.0)
    read = dict.fromkeys(ENTRIES) | {o.MAX_PROFILE_VELOCITY: held}
    (said,) = (
        v.refusal for row, v in verdicts(read, axis) if o.MAX_PROFILE_VELOCITY in row.entries
    )
    return said


def test_a_max_profile_velocity_counts_where_a_velocity_is_sent() -> None:
    """15 rad/s are 9778.5 counts/s; a move of 2 rad/s 1303.8."""
    slow: dict[str, Any] = {"position": 0.0, "velocity": 2.0}
    assert "velocity_limit 15; lower that, or set it to at least 9779" in profile_refusal(
        9700, None, "admittance"
    )
    assert not profile_refusal(9779, None, "admittance")
    assert not profile_refusal(1, None, "impedance")
    assert not profile_refusal(1, slow, "impedance")  # by CSP
    assert not profile_refusal(1304, slow | {"mode": "pv"}, "impedance")
    assert "velocity of move 2; lower" in profile_refusal(1, slow | {"mode": "pv"}, "impedance")


@pytest.mark.parametrize(
    ("case", "first", "said"),
    [
        ({(0x607E, 0): 0x80}, {}, "607E:00 polarity is 0x80; right .* is 0 alone: set it to 0"),
        (
            {(0x60A8, 0): TENTH_DEGREE},
            {},
            r"is 0xFF410000 \(10\*\*-1 deg\); .* 3600 counts .* the rig states 4096; state counts",
        ),
        ({(0x607C, 0): -500}, {}, "607C:00 home offset is -500; .*state home_offset: -500"),
        ({(0x608F, 1): 2000}, {}, "608F:01 encoder increments is 2000.*state counts_per_rev"),
        ({(0x6076, 0): 0}, {}, "motor rated torque is 0; .*set it to 500 .mN m"),
        ({(0x6076, 0): 700}, {}, "state rated_torque: 0.7 in the rig .*or set 6076h to 500"),
        (
            {(0x60A8, 0): TENTH_DEGREE, (0x608F, 1): 1024},
            {"counts_per_revolution": 3600},
            "608F:01 .*only 1024 increments per motor turn for the 3600 position units",
        ),
        (
            {(0x60A8, 0): 0xFA010000},
            {},
            r"0xFA010000 \(10\*\*-6 m\).*: a length, but the axis is rotary",
        ),
        (
            {(0x60A8, 0): 0x00770000},
            {},
            "unit 77h of CiA 303-2.*does not know that unit; set it to",
        ),
        (
            {(0x6089, 0): -1, (0x608A, 0): 0x41},
            {},
            "6089:00 position notation index is -1, 608A:00 position dimension index is 65; .*"
            "3600 counts .* the rig states 4096; state counts_per_rev.*, or set both to 0",
        ),
        ({(0x608A, 0): 0x77}, {}, "608A:00 .* is 119; .*does not know that unit; set both to 0"),
        (
            {(0x6073, 0): 799},
            {},
            "6073:00 max current is 799; .* below the rig's effort_limit 0.4; .*at least 800",
        ),
    ],
)
def test_a_refusal_says_object_value_what_is_right_and_how(
    case: dict[Key, int], first: dict[str, object], said: str
) -> None:
    sentence = foreign(case, first=first).refused()
    assert sentence.startswith("master.a1 (node 1): ")
    assert re.search(said, sentence), sentence


@pytest.mark.parametrize(
    "case",
    [
        {(0x60A8, 0): TENTH_DEGREE},
        {(0x6089, 0): -1, (0x608A, 0): 0x41},
        {(0x608F, 1): 2000},
        {(0x6092, 0): 2, (0x6092, 1): 3600, (0x6092, 2): 1},
        {(0x6076, 0): 700},
        {(0x607C, 0): -500},
    ],
    ids=named,
)
def test_what_a_refusal_tells_to_state_is_what_runs(case: dict[Key, int]) -> None:
    (remedy,) = remedies(foreign(case).refused())
    key, value = remedy.split(": ")
    stated = foreign(case, first={key: float(value) if "." in value else int(value)})
    if key == "home_offset":  # a zero elsewhere; the rest as before
        stated.enable()
        (state,) = stated.cycle()
        assert state.position == pytest.approx(-500 * COUNT)
        stated.driver.close()
    else:
        measured_rightly(stated, "impedance")


def test_a_velocity_unit_of_increments_is_one_count_per_second() -> None:
    case = {(0x60A9, 0): 0x00B50300}
    said = foreign(case, causality="admittance", first={"velocity_factor": 7.0}).refused()
    assert "one unit is 1 counts/s, but the rig states velocity_factor 7" in said
    measured_rightly(foreign(case, causality="admittance"), "admittance")


@pytest.mark.parametrize(
    ("held", "unit", "stated"),
    [
        (500, 1e-3, {}),
        (500_000, 1e-6, {"rated_torque_unit": "uN m"}),
        (6000, 1e-3 / 12.0, {"rated_torque_unit": "mA", "torque_constant": 1.0 / 12.0}),
    ],
)
def test_a_rated_torque_in_another_unit_is_stated_and_right(
    held: int, unit: float, stated: dict[str, object]
) -> None:
    rig = foreign({(0x6076, 0): held}, first=stated)
    rig.drive.unit_of_rated = unit
    measured_rightly(rig, "impedance")
    if stated:
        said = foreign({(0x6076, 0): held}).refused()
        assert "rated_torque_unit (mN m, uN m, or mA with the motor's torque_constant) if" in said
        assert f"that is {held * 1e-3:g} N m, counted in mN m, but the rig states 0.5" in said


def test_a_rated_torque_of_0_is_set_in_the_drive_not_in_the_rig() -> None:
    for unit, wanted in (({}, 500), ({"rated_torque_unit": "mA", "torque_constant": 0.1}, 5000)):
        said = foreign({(0x6076, 0): 0}, first=unit).refused()
        assert f"the drive has no motor data; set it to {wanted} (" in said
        assert "with the motor's other data" in said
        assert not remedies(said)
        measured = foreign({(0x6076, 0): wanted}, first=unit)
        measured.drive.unit_of_rated = 0.5 / wanted
        measured_rightly(measured, "impedance")


@pytest.mark.parametrize("first", [{"rated_torque_unit": "mA"}, {"torque_constant": 0.1}])
def test_a_current_needs_the_constant_and_the_constant_a_current(first: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=r"rated_torque_unit: mA and torque_constant .* together"):
        foreign(first=first)


def test_a_simulated_drive_states_its_rated_torque_as_a_current_where_the_rig_has_it_so() -> None:
    unit = {"rated_torque_unit": "mA", "torque_constant": 0.05}
    rig = make(block(node(1, **unit)), ("impedance",))
    assert rig.devices()[0].objects.number(0x6076) == 10_000
    rig.open_and_enable()
    rig.driver.close()


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("direction", [1, -1])
def test_velocity_and_torque_are_told_along_the_axis(direction: int, turned: int) -> None:
    rig = foreign({(0x607C, 0): 0}, first={"direction": direction})
    rig.drive.turns_torque = turned
    rig.enable()
    rig.driver.witness("master.a1")
    for _ in range(40):
        (state,) = rig.cycle(0.05)
    velocity, effort = rig.driver.witness("master.a1")
    assert state.position > 0.0
    assert velocity == pytest.approx(direction * rig.drive.speed, rel=0.5)
    assert effort == pytest.approx(turned * 0.05, abs=1e-3)
    assert rig.driver.identities["master.a1"]["scales"].startswith("607C:00=0 ")
    assert "6072" not in rig.driver.identities["master.a1"]["scales"]
    rig.driver.close()
