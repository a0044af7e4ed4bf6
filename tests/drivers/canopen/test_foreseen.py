"""What an EDS tells of its drive before any wire: in `check`, and in a new rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.canopen import plugin
from tautwave_drivers.canopen.files.belonging import check_files
from tautwave_drivers.canopen.foresight import files_of
from tests.drivers.canopen.benches import driver_options
from tests.drivers.canopen.test_eds import dcf, entry

DRIVE = {
    "1000": "0x00020192", "1016sub1": "0", "1400sub5": "0", "6007": "1", "6040": "0", "6041": "0",
    "1017": "0", "6064": "0", "6071": "0", "6077": "0", "60FF": "0", "6502": "0x3AD",
}  # fmt: skip
"""Objects of a drive's file, and their defaults."""


def eds(path: Path, **changes: str | None) -> Path:
    objects: dict[str, Any] = DRIVE | {key.lstrip("x"): text for key, text in changes.items()}
    path.write_text(
        dcf("".join(
            entry("-", name=name, DefaultValue=text, ParameterName=f"Object {name}")
            for name, text in objects.items() if text is not None
        ))
    )  # fmt: skip
    return path


def checked(path: Path, causality: str = "impedance") -> list[str]:
    given = {"id": 1, "rated_torque": 0.5, "counts_per_revolution": 4096, "eds": str(path)}
    (node,) = driver_options({"interface": "virtual", "nodes": [given]}).nodes
    axis = AxisSpec("arm.j1", 1, "rotary", causality, 0.4)
    try:
        check_files(files_of([(axis, node)]))
    except ConfigError as err:
        return [one.replace(f"{path.parent}/", "") for one in err.problems]
    return []


@pytest.mark.parametrize(
    ("changes", "causality", "said"),
    [
        ({}, "impedance", ""),
        ({}, "admittance", ""),
        (
            {"x1000": "0x000F0191"},
            "impedance",
            "arm.j1: a.eds describes an I/O module (CiA 401), not a CiA 402 drive: 1000:00 device "
            "type is 0x000F0191, but its low word should be 0192; name this drive's own file",
        ),
        ({"x1000": ""}, "impedance", ""),
        ({"x1000": "0"}, "impedance", ""),
        ({"x6502": "0xA5"}, "impedance", "a.eds has no CST cyclic synchronous torque: 6502:00"),
        ({"x6502": "0x225"}, "admittance", "a.eds has no CSV cyclic synchronous velocity"),
        ({"x6502": "0"}, "impedance", ""),
        ({"x6502": None}, "impedance", ""),
        ({"x6071": None}, "impedance", "a.eds has no 6071:00 target torque, which CST"),
        ({"x6071": None}, "admittance", ""),
        ({"x6077": None}, "admittance", "a.eds has no 6077:00 torque actual value, which CSV"),
        ({"x60FF": None}, "admittance", "a.eds has no 60FF:00 target velocity"),
        ({"x6041": None, "x6071": None}, "impedance", ""),  # a file of some objects only
    ],
)
def test_what_the_run_would_refuse_is_said_before_any_wire(
    tmp_path: Path, changes: dict[str, str | None], causality: str, said: str
) -> None:
    found = checked(eds(tmp_path / "a.eds", **changes), causality)
    assert bool(found) == bool(said), found
    assert all(said in one for one in found)


def described(path: Path) -> Any:
    assert plugin.survey is not None
    return plugin.survey.describe(path, [1])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ""),
        ({"x1016sub1": None}, ""),
        ({"x1016sub1": None, "x1400sub5": None}, "it has no watchdog (neither 1016:01 nor"),
        ({"x6007": None}, "it does not say how it reacts to a lost master (no 6007:00)"),
        ({"x1017": None}, "it has no heartbeat (1017:00) by which its loss is noticed"),
    ],
)
def test_a_drive_without_a_watchdog_is_said_of_a_new_rig(
    tmp_path: Path, changes: dict[str, str | None], said: str
) -> None:
    notes = [note for note in described(eds(tmp_path / "a.eds", **changes)).notes if "EDS" in note]
    assert bool(notes) == bool(said), notes
    assert all(said in note and "--allow-unwatched" in note for note in notes)


@pytest.mark.parametrize(
    ("changes", "counts", "rated", "guessed"),
    [
        ({}, 4096, 0.1, ["rated_torque", "counts_per_revolution", "gear_ratio"]),
        (
            {"x608Fsub1": "1", "x608Fsub2": "1", "x6076": "0", "x6091sub1": "1"},
            4096, 0.1, ["rated_torque", "counts_per_revolution"],
        ),
        (
            {"x608Fsub1": "0", "x608Fsub2": "0", "x6076": "", "x6091sub1": "0"},
            4096, 0.1, ["rated_torque", "counts_per_revolution", "gear_ratio"],
        ),
        (
            {"x608Fsub1": "20000", "x608Fsub2": "2", "x6076": "700", "x6091sub1": "1"},
            10000, 0.7, [],
        ),
    ],
)  # fmt: skip
def test_a_default_that_states_nothing_is_a_guess_to_be_settled(
    tmp_path: Path, changes: dict[str, str], counts: int, rated: float, guessed: list[str]
) -> None:
    found = described(eds(tmp_path / "a.eds", **changes))
    (device,) = found.devices
    assert device.options["counts_per_revolution"] == counts
    assert device.options["rated_torque"] == pytest.approx(rated)
    notes = [note for note in found.notes if "is a guess: TODO" in note]
    assert [note.split(" ")[0] for note in notes] == guessed


UNREADABLE = [
    ("6076", "0,32", "a decimal comma"),
    ("6076", "1.6e2", "not a number"),
    ("608Fsub1", "4k", "not a number"),
    ("6080", "3.000", "not a number"),
    ("6502", "CST", "not a number"),
    ("1018sub2", "1,5", "a decimal comma"),
]


@pytest.mark.parametrize(("name", "text", "why"), UNREADABLE)
def test_a_default_that_a_new_rig_needs_is_refused_with_its_line(
    tmp_path: Path, name: str, text: str, why: str
) -> None:
    path = eds(tmp_path / "a.eds", **{f"x{name}": text})
    line = path.read_text().splitlines().index(f"DefaultValue={text}") + 1
    at = f"{name[:4]}:{int(name[7:] or '0'):02X}"
    with pytest.raises(ConfigError) as said:
        described(path)
    (problem,) = said.value.problems
    assert problem.startswith(
        f"{path}:{line}: {at} Object {name} has the default {text!r}: {why}; "
    )
    for remedy in ("", "0x20"):  # blank, or corrected
        path.write_text(path.read_text().replace(f"DefaultValue={text}", f"DefaultValue={remedy}"))
        assert described(path).devices
        text = remedy or text


@pytest.mark.parametrize("text", ["0,32", "1.6e2"])
def test_a_default_that_nobody_needs_is_noted_with_its_line(tmp_path: Path, text: str) -> None:
    path = eds(tmp_path / "a.eds", x6065=text, x6066="$NODEID+5", x6067="", x6068="; none")
    line = path.read_text().splitlines().index(f"DefaultValue={text}") + 1
    (note,) = [note for note in described(path).notes if "counts as not stated" in note]
    assert note.startswith(f"{path}: line {line}: 6065:00 Object 6065 has the default {text!r}: ")
    assert "6066" not in note
    assert not foreseen_of(path)


def test_check_names_a_default_that_it_cannot_compare(tmp_path: Path) -> None:
    (said,) = foreseen_of(eds(tmp_path / "a.eds", x6076="0,32"))
    assert "6076:00 Object 6076 has the default '0,32': a decimal comma; correct it" in said


def fixed(path: Path, access: str, **words: tuple[int, ...]) -> Path:
    """A file whose PDOs have these mappings, with an access."""
    sections = "".join(
        entry("-", name=f"{index}sub{sub:X}", AccessType=access, DefaultValue=f"0x{word:X}")
        for name, each in words.items()
        for index in [name.lstrip("x")]
        for sub, word in enumerate((len(each), *each))
    )
    eds(path)
    path.write_text(path.read_text() + sections)
    return path


LEAN_RPDO, LEAN_TPDO = (0x60400010, 0x60710010), (0x60410010, 0x60640020)


@pytest.mark.parametrize(
    ("access", "words", "said"),
    [
        ("const", {"x1600": LEAN_RPDO, "x1A00": LEAN_TPDO}, ""),
        ("const", {"x1600": (*LEAN_RPDO, 0x60600008)}, ""),
        ("const", {"x1600": (0x60710010, 0x60400010)}, ""),  # at other places
        ("const", {"x1A00": (*LEAN_TPDO, 0x60770010)}, ""),  # and more than is wanted
        ("const", {"x1600": (0x60400010, 0x607A0020)}, "a fixed mapping of RPDO1 (60400010, 607A0"),
        ("const", {"x1600": (*LEAN_RPDO, 0x60FF0020)}, "a fixed mapping of RPDO1"),  # a target more
        ("ro", {"x1A00": (0x60410010,)}, "a fixed mapping of TPDO1 (60410010 in 1A00h), not the"),
        ("ro", {"x1A00": ()}, "a fixed mapping of TPDO1 (nothing in 1A00h), not the wanted one: 6"),
        ("rw", {"x1A00": (0x60410010,), "x1600": (0x60400010,)}, ""),
    ],
)
def test_a_fixed_mapping_is_refused_unless_it_has_what_is_wanted(
    tmp_path: Path, access: str, words: dict[str, tuple[int, ...]], said: str
) -> None:
    found = checked(fixed(tmp_path / "a.eds", access, **words))
    assert bool(found) == bool(said), found
    assert all(said in one for one in found)


def foreseen_of(path: Path, **more: Any) -> list[str]:
    given = {"id": 1, "rated_torque": 0.5, "counts_per_revolution": 4096, "eds": str(path)} | more
    options = driver_options({"interface": "virtual", "nodes": [given]})
    axis = AxisSpec("arm.j1", 1, "rotary", "impedance", 0.4, 15.0)
    bus = BusSpec("can", (axis,), 1000.0)
    assert plugin.foreseen is not None
    assert plugin.facts(options, bus)
    return [one.replace(f"{path.parent}/", "") for one in plugin.foreseen(options, bus)]


DELIVERED = "arm.j1: a run refuses the drive while it holds the default of its EDS: "


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, ""),
        ({"x1016sub1": None, "x1400sub5": None}, "arm.j1: according to its EDS it has no watchdog"),
        ({"x607E": "0"}, ""),
        ({"x607E": "0x80"}, f"{DELIVERED}607E:00 polarity is 0x80"),
        ({"x60A8": "0x00B50000"}, ""),
        ({"x60A8": "0xFF410000"}, "state counts_per_revolution: 3600 in the rig, or set it"),
        ({"x6076": "0", "x6075": "0"}, ""),
        ({"x6076": "900"}, f"{DELIVERED}6076:00 motor rated torque is 900"),
        ({"x608Fsub1": "1"}, ""),
        ({"x608Fsub1": "2000"}, f"{DELIVERED}608F:01 encoder increments is 2000"),
        ({"x607C": "0xFFFFFF00"}, f"{DELIVERED}607C:00 home offset is -256"),
        ({"x6072": "100"}, f"{DELIVERED}6072:00 max torque is 100"),
        ({"x1018sub2": "0x402"}, ""),
    ],
)
def test_what_the_drive_comes_with_is_said_before_any_wire(
    tmp_path: Path, changes: dict[str, str | None], said: str
) -> None:
    found = foreseen_of(eds(tmp_path / "a.eds", **changes))
    assert bool(found) == bool(said), found
    assert all(said in one for one in found)


def test_two_identities_are_shown_as_manuals_and_as_tools_write_them(tmp_path: Path) -> None:
    path = eds(tmp_path / "a.eds", x1018sub2="0x402")
    path.write_text(path.read_text().replace("[DeviceInfo]", "[DeviceInfo]\nProductNumber=402"))
    (said,) = foreseen_of(path)
    assert "1018:02 product is 0x402 (1026), but [DeviceInfo] has 0x192 (402): 1018h counts" in said


@pytest.mark.parametrize(("mapped", "loud"), [("1", False), ("0", True), ("-", False)])
def test_an_object_that_no_pdo_carries_is_said(tmp_path: Path, mapped: str, loud: bool) -> None:
    path = eds(tmp_path / "a.eds")
    text = path.read_text().replace("[6041]", "[6041]\nPDOMapping=1")
    if mapped != "-":
        text = text.replace("[6071]", f"[6071]\nPDOMapping={mapped}")
    path.write_text(text)
    found = [one for one in foreseen_of(path) if "PDOMapping" in one]
    assert len(found) == loud, found


@pytest.mark.parametrize(
    ("name", "value", "refused"),
    [("607E", "0x80", True), ("607E", "0", False), ("6072", "100", True), ("6065", "5", False)],
)
def test_a_dcf_that_sets_what_a_run_refuses_is_refused(
    tmp_path: Path, name: str, value: str, refused: bool
) -> None:
    path = tmp_path / "a.dcf"
    eds(path)
    path.write_text(path.read_text() + entry(value, "0x0006", name=name))
    if not refused:
        foreseen_of(path)
        return
    with pytest.raises(ConfigError, match=rf"a\.dcf sets what a run refuses: {name}:00"):
        foreseen_of(path)


@pytest.mark.parametrize(("kind", "refused"), [("0", True), ("", False), ("0x00020192", False)])
def test_a_device_without_any_object_of_a_drive_is_none(
    tmp_path: Path, kind: str, refused: bool
) -> None:
    gone = {f"x{name}": None for name in DRIVE if name[0] == "6"}
    path = eds(tmp_path / "a.eds", x1000=kind, **gone)
    found = checked(path)
    assert bool(found) == refused, found
    assert all("no object of the drive profile (6000h to 9FFFh)" in one for one in found)


def test_no_rig_is_made_of_a_file_that_describes_no_drive(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="describes an encoder"):
        described(eds(tmp_path / "a.eds", x1000="0x00020196"))
    with pytest.raises(ConfigError, match="has no CST"):
        described(eds(tmp_path / "a.eds", x6502="1"))
