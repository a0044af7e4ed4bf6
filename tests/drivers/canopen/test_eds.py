"""EDS and DCF files as vendors write them: read with every value, or refused with its line."""

from __future__ import annotations

import random
import re
import struct
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.errors import ConfigError
from tautwave_drivers.canopen.files.belonging import identity_of, parameters
from tautwave_drivers.canopen.files.reading import LARGEST, DeviceFile, read_device_file
from tautwave_drivers.cia402.objects import HOMING_SLOW
from tests.drivers.canopen.test_more import EDS

WINDOW = (0x6065, 0)


def read(path: Path, text: str | bytes) -> DeviceFile:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_device_file(str(path))


def refused(path: Path) -> str:
    with pytest.raises(ConfigError) as found:
        read_device_file(str(path))
    (sentence,) = found.value.problems
    assert "\n" not in sentence
    return sentence.replace(f"{path.parent}/", "")


def values(path: Path, text: str | bytes, node: int = 5) -> dict[tuple[int, int], bytes]:
    """Parameter values of a DCF, as bytes."""
    found = parameters(read(path, text), node)
    return {(one.object.index, one.object.sub): one.data for one in found}


def dcf(section: str, *, before: str = "[FileInfo]\nFileName=a.dcf\n") -> str:
    return f"{before}[DeviceInfo]\nVendorName=a vendor\n{section}"


def entry(value: str, kind: str = "0x0007", name: str = "6065", **more: str) -> str:
    keys = {"ParameterName": "Window", "ObjectType": "0x7", "DataType": kind, "AccessType": "rw"}
    keys |= {"ParameterValue": value} | more
    lines = [f"{key}={text}" for key, text in keys.items() if text != "-"]
    return "\n".join([f"[{name}]", *lines, ""])


COMPACT = """[6099]
ParameterName=Homing speeds
ObjectType=0x8
DataType=0x0007
AccessType=rw
CompactSubObj=2
"""
U32_777 = struct.pack("<I", 777)

TRAITS = {
    "access RWW": (entry("777", AccessType="RWW"), {WINDOW: U32_777}),
    "boolean": (entry("1", "0x1"), {WINDOW: b"\1"}),
    "CR line ends": (entry("777").replace("\n", "\r"), {WINDOW: U32_777}),
    "CR LF line ends": (entry("777").replace("\n", "\r\n"), {WINDOW: U32_777}),
    "Ctrl-Z at the end": (entry("777") + "\x1a", {WINDOW: U32_777}),
    "NUL at the end": (entry("777") + 40 * "\0", {WINDOW: U32_777}),
    "DummyUsage without all": ("[DummyUsage]\nDummy0002=1\n" + entry("777"), {WINDOW: U32_777}),
    "a section twice": (entry("5") + entry("777"), {WINDOW: U32_777}),
    "a key twice": (entry("5") + "ParameterValue=777\n", {WINDOW: U32_777}),
    "indented keys": (entry("777").replace("\nD", "\n   D"), {WINDOW: U32_777}),
    "comments without Lines": ("[Comments]\nLine1=hello\n" + entry("777"), {WINDOW: U32_777}),
    "comment by //": ("// made by a tool\n" + entry("777"), {WINDOW: U32_777}),
    "comment by #": ("# made by a tool\n" + entry("777"), {WINDOW: U32_777}),
    "comment behind a value": (entry("777 ; counts"), {WINDOW: U32_777}),
    "comment close behind": (entry("777;counts"), {WINDOW: U32_777}),
    "hex in a signed type": (entry("0xFFFE", "0x3"), {WINDOW: struct.pack("<h", -2)}),
    "negative hex": (entry("-0x10", "0x3"), {WINDOW: struct.pack("<h", -16)}),
    "negative": (entry("-16", "0x4"), {WINDOW: struct.pack("<i", -16)}),
    "no DataType of a standard object": (entry("777", "-", name="6085"), {(0x6085, 0): U32_777}),
    "no ParameterName": (entry("777", ParameterName="-"), {WINDOW: U32_777}),
    "no AccessType": (entry("777", AccessType="-"), {WINDOW: U32_777}),
    "ObjectType 0": (entry("777", ObjectType="0"), {WINDOW: U32_777}),
    "blank ObjectType": (entry("777", ObjectType=""), {WINDOW: U32_777}),
    "no ObjectType": (entry("777", ObjectType="-"), {WINDOW: U32_777}),
    "REAL32": (entry("1.5", "0x8"), {WINDOW: struct.pack("<f", 1.5)}),
    "REAL64": (entry("-1e3", "0x11"), {WINDOW: struct.pack("<d", -1e3)}),
    "24 bits": (entry("0x10203", "0x16"), {WINDOW: b"\3\2\1"}),
    "text": (entry("AXIS 1", "0x9"), {WINDOW: b"AXIS 1"}),
    "bytes": (entry("01 02 0xFF", "0xA"), {WINDOW: b"\1\2\xff"}),
    "octal": (entry("01411"), {WINDOW: U32_777}),
    "0309h": (entry("0309h"), {WINDOW: U32_777}),
    "upper-case 0X": (entry("0X309"), {WINDOW: U32_777}),
    "quoted": (entry('"777"'), {WINDOW: U32_777}),
    "plus": (entry("+777"), {WINDOW: U32_777}),
    "a colon for =": (entry("777").replace("Value=", "Value: "), {WINDOW: U32_777}),
    "blanks around =": (entry("777").replace("=", "  = "), {WINDOW: U32_777}),
    "blanks in brackets": (entry("777", name=" 6065 "), {WINDOW: U32_777}),
    "lower-case keys": (entry("777").lower(), {WINDOW: U32_777}),
    "upper-case keys": (entry("777").upper().replace("0X", "0x"), {WINDOW: U32_777}),
    "lower-case index": (entry("9", name="60fe"), {(0x60FE, 0): struct.pack("<I", 9)}),
    "nothing given": (entry(""), {}),
    "read-only": (entry("777", AccessType="ro"), {}),
    "an unknown section": ("[Vendor.Extra]\na=b\n" + entry("777"), {WINDOW: U32_777}),
    "an unknown key": (entry("777", Colour="red"), {WINDOW: U32_777}),
    "a line without a key": ("just text\n" + entry("777") + "more text\n", {WINDOW: U32_777}),
    "VendorNumber=001 (canopen 313)": (
        "[DeviceInfo]\nVendorNumber=001\nLSS_Supported=?\n" + entry("777"), {WINDOW: U32_777},
    ),
    "odd limits": (entry("777", LowLimit="", HighLimit="2^31"), {WINDOW: U32_777}),
    "a value counted from the node": (entry("$NODEID+0x200"), {WINDOW: struct.pack("<I", 0x205)}),
    "$NodeID last, blanks": (entry("0x200 + $NodeID"), {WINDOW: struct.pack("<I", 0x205)}),
    "$NODEID alone": (entry("$NODEID", "0x5"), {WINDOW: b"\5"}),
    "$NODEID in brackets, by |": (
        entry("($nodeid|0x80)+0x40000000"), {WINDOW: struct.pack("<I", 0x40000085)},
    ),
    "$NODEID shifted": (entry("($NODEID<<16)+500"), {WINDOW: struct.pack("<I", 0x501F4)}),
    "$NODEID times": (entry("$NODEID*0x10000+500"), {WINDOW: struct.pack("<I", 0x501F4)}),
    "sub before its object": (
        entry("10", name="6099sub1") + "[6099]\nObjectType=0x8\n", {(0x6099, 1): b"\n\0\0\0"},
    ),
    "sub without its object": (entry("10", name="6099sub1"), {(0x6099, 1): b"\n\0\0\0"}),
    "SUB in capitals": (
        "[6099]\nObjectType=0x8\n" + entry("10", name="6099SUB1"), {(0x6099, 1): b"\n\0\0\0"},
    ),
    "sub A is hexadecimal": (entry("10", name="2100subA"), {(0x2100, 10): b"\n\0\0\0"}),
    "a gap in the subs": (
        entry("1", name="2100sub1") + entry("7", name="2100sub7"),
        {(0x2100, 1): b"\1\0\0\0", (0x2100, 7): b"\7\0\0\0"},
    ),
    "compact, values listed": (
        COMPACT + "[6099Value]\nNrOfEntries=2\n1=10\n2=0x14\n",
        {(0x6099, 1): b"\n\0\0\0", (0x6099, 2): b"\x14\0\0\0"},
    ),
    "compact, names and one value": (
        COMPACT + "[6099Name]\nNrOfEntries=1\n1=fast\n[6099VALUE]\n2=20\n",
        {(0x6099, 2): b"\x14\0\0\0"},
    ),
    "compact, and a sub of its own": (
        COMPACT + entry("30", name="6099sub2"), {(0x6099, 2): b"\x1e\0\0\0"},
    ),
    "own type of CANFestival": (
        "[A0]\nObjectType=0x7\n[A0sub1]\nDefaultValue=0x6\n" + entry("9", "0xA0"),
        {WINDOW: b"\t\0"},
    ),
}  # fmt: skip
"""What vendors write, and the values that a drive is to get."""


@pytest.mark.parametrize("trait", TRAITS)
def test_what_vendors_write_is_read_with_every_value(tmp_path: Path, trait: str) -> None:
    section, wanted = TRAITS[trait]
    assert values(tmp_path / "a.dcf", dcf(section)) == wanted


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"]
)
def test_a_file_of_a_windows_editor_is_read(tmp_path: Path, encoding: str) -> None:
    text = dcf(entry("777", ParameterName="Gerät"))
    file = read(tmp_path / "a.EDS", text.encode(encoding))
    assert file.objects[WINDOW].name == "Gerät"
    assert values(tmp_path / "a.dcf", text.encode(encoding)) == {WINDOW: U32_777}


@pytest.mark.parametrize("name", ["\u9a71\u52a8\u5668", "\u4f4d\u7f6e\u504f\u5dee"])
def test_a_chinese_file_is_read(tmp_path: Path, name: str) -> None:
    text = dcf(entry("777", ParameterName=name)).encode("gbk")
    assert values(tmp_path / "a.dcf", text) == {WINDOW: U32_777}


def test_text_before_the_first_section_is_skipped(tmp_path: Path) -> None:
    text = dcf(entry("777"), before="EDS of a drive\nVersion: 2\n")
    assert values(tmp_path / "a.dcf", text) == {WINDOW: U32_777}


@pytest.mark.parametrize(("suffix", "more", "wanted"), [
    ("eds", "", 0), ("dcf", "", 2), ("eds", entry("777"), 3),
])  # fmt: skip
def test_listed_values_are_defaults_in_an_eds_and_settings_in_a_dcf(
    tmp_path: Path, suffix: str, more: str, wanted: int
) -> None:
    text = dcf(COMPACT + "[6099Value]\nNrOfEntries=2\n1=10\n2=0x14\n" + more)
    file = read(tmp_path / f"a.{suffix}", text)
    assert len(parameters(file, 1)) == wanted
    assert file.number(HOMING_SLOW) == 20


WRONG = {
    "decimal comma": (entry("0,5", "0x8"), ":10: .*6065:00 Window has the value '0,5', .*comma"),
    "decimal comma in an integer": (entry("1,5"), ":10: .*a decimal comma"),
    "a word": (entry("fast"), ":10: 6065:00 Window has the value 'fast', which is not a number"),
    "a fraction": (entry("2000.5"), "which is not a number"),
    "underscores": (entry("2_000"), "which is not a number"),
    "no octal": (entry("0890"), "no octal number, as its leading 0 would make it"),
    "too large": (entry("0x1FFFFFFFF"), r"outside UNSIGNED32 \(0 to 4294967295\)"),
    "too large, signed": (entry("40000", "0x3"), r"outside INTEGER16 \(-32768 to 32767\)"),
    "too large, in hex": (entry("0x10000", "0x3"), "outside INTEGER16"),
    "negative in an unsigned": (entry("-1", "0x5"), r"outside UNSIGNED8 \(0 to 255\)"),
    "boolean 2": (entry("2", "0x1"), r"outside BOOLEAN \(0 to 1\)"),
    "not a number": (entry("nan", "0x8"), "no finite number"),
    "infinite": (entry("1e999", "0x11"), "no finite number"),
    "beyond REAL32": (entry("1e300", "0x8"), "outside REAL32"),
    "no bytes": (entry("xyz", "0xA"), "not bytes in hexadecimal"),
    "no DataType": (entry("5", "-", name="2100"), "of an object without a DataType"),
    "unknown DataType": (entry("5", "0x0C"), "of the data type 0x000C, whose values are not"),
    "a wild sum": (entry("1<<99"), "which is not a number"),
    "a call": (entry("__import__('os')"), "which is not a number"),
    "a power": (entry("9**9**9"), "which is not a number"),
    "long": (entry(200 * "1"), "which is not a number"),
    "compact value that is none": (
        COMPACT + "[6099Value]\n1=many\n", "6099:01 Homing speeds has the value 'many'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_value_that_cannot_be_read_is_an_error_with_its_line(tmp_path: Path, case: str) -> None:
    section, said = WRONG[case]
    path = tmp_path / "a.dcf"
    with pytest.raises(ConfigError, match=said) as found:
        values(path, dcf(section))
    (sentence,) = found.value.problems
    assert sentence.startswith(f"{path}:")
    assert "\n" not in sentence


STRAY = {
    "value of no object": ("[60X5]\nParameterValue=5\n", r"a.dcf:6: a ParameterValue in \[60X5\]"),
    "a bracket lost": ("6066]\nParameterValue=5\n", "a.dcf:5: '6066]' is neither a section"),
    "the other one": ("[6066\nParameterValue=5\n", "a.dcf:5: '.6066' is neither a section"),
    "no separator": (entry("-") + "ParameterValue 5\n", "a.dcf:10: 'ParameterValue 5' is neither"),
    "value of a record": (
        entry("5", ObjectType="0x9") + entry("6", name="6065sub1"),
        "whose values belong to its sub-objects",
    ),
    "too many subs": (COMPACT.replace("Obj=2", "Obj=700"), "CompactSubObj is 700; an object has"),
    "a sub that is none": (COMPACT + "[6099Value]\n999=1\n", "'999' in .6099Value. is no sub"),
}  # fmt: skip


@pytest.mark.parametrize("case", STRAY)
def test_a_value_whose_object_is_not_clear_is_an_error_with_its_line(
    tmp_path: Path, case: str
) -> None:
    section, said = STRAY[case]
    path = tmp_path / "a.dcf"
    path.write_text(dcf(section))
    sentence = refused(path)
    assert re.search(said, sentence), sentence


def test_what_was_odd_is_said(tmp_path: Path) -> None:
    text = dcf(entry("5", Colour="red") + entry("777") + "stray\n")
    twice, unused = read(tmp_path / "a.dcf", text).remarks
    assert "[6065] (line 12)" in twice
    assert "comes twice, and counts as it comes last" in twice
    assert "'colour' (line 11), 'stray' (line 18): is not used" in unused
    assert not read(tmp_path / "b.dcf", dcf(entry("777"))).remarks


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"x" * (LARGEST + 1), "a.eds: larger than 4096 KiB, so not an EDS or DCF file"),
        (b"\x7fELF\0\0\xff", "a.eds: not an EDS or DCF file: it defines no objects"),
        (b"name: bench\n", "a.eds: not an EDS or DCF file: it defines no objects"),
        (b"[DeviceInfo]\n[x]\n", "a.eds: not an EDS or DCF file: it defines no objects"),
        (
            b"".join(b"[%04X]\nObjectType=8\nCompactSubObj=254\n" % at for at in range(100)),
            "a.eds: more than 20000 objects, so no drive's file",
        ),
    ],
    ids=["large", "binary", "yaml", "nothing", "endless"],
)
def test_what_is_not_an_eds_is_one_sentence(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.eds"
    path.write_bytes(content)
    assert refused(path).startswith(said)


def test_other_formats_are_not_read(tmp_path: Path) -> None:
    for name in ("a.epf", "a.xdd", "a"):
        assert refused(tmp_path / name) == f"{name}: not an EDS or DCF file (.eds, .dcf)"


@pytest.mark.parametrize(
    "spelling", ["DeviceComissioning", "DeviceCommissioning", "DEVICECOMISSIONING"]
)
@pytest.mark.parametrize(
    ("text", "node"), [("3", 3), ("0x03", 3), ("", None), ("0", None), ("255", None)]
)
def test_the_node_of_a_dcf_is_read_in_both_spellings(
    tmp_path: Path, spelling: str, text: str, node: int | None
) -> None:
    file = read(tmp_path / "a.dcf", dcf(f"[{spelling}]\nNodeID={text}\n" + entry("777")))
    assert file.node_id == node
    assert file.remarks == ()


@pytest.mark.parametrize("text", ["128", "-1", "axis 3", "9" * 500])
def test_a_node_id_that_is_none_is_said(tmp_path: Path, text: str) -> None:
    file = read(tmp_path / "a.dcf", dcf(f"[DeviceComissioning]\nNodeID={text}\n" + entry("777")))
    assert file.node_id is None
    (said,) = file.remarks
    assert f"NodeID is {text[:40]!r}, no node id (1 to 127)" in said


@pytest.mark.parametrize("key", ["VendorNumber", "ProductNumber", "RevisionNumber"])
def test_an_identity_that_is_no_number_is_said(tmp_path: Path, key: str) -> None:
    file = read(tmp_path / "a.dcf", dcf(f"[DeviceInfo]\n{key}=zz\n" + entry("777")))
    said = f"{key.lower()} is 'zz', not a number: it was not compared"
    assert any(one.endswith(said) for one in file.remarks)


def test_the_identity_is_that_of_1018_and_of_the_device_info_where_it_is_empty(
    tmp_path: Path,
) -> None:
    info = "[DeviceInfo]\nVendorNumber=0x65\nProductNumber=0x19\n"
    vendor = entry("-", name="1018sub1", DefaultValue="0x999")
    product = entry("-", name="1018sub2", DefaultValue="0")
    file = read(tmp_path / "a.eds", info + vendor + product)
    assert identity_of(file) == {"vendor": 0x999, "product": 0x19}
    assert identity_of(read(tmp_path / "b.eds", "[DeviceInfo]\n" + product)) == {}


@given(st.data())
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_leaves_a_file_or_a_sentence(tmp_path: Path, data: st.DataObject) -> None:
    raw = bytearray(EDS.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(raw) - 1))
        raw[at : at + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=4))
    try:
        parameters(read(tmp_path / "a.dcf", bytes(raw)), 1)
    except ConfigError as err:
        (sentence,) = err.problems
        assert "\n" not in sentence


WHOLE = dcf(
    "[DeviceCommissioning]\nNodeID=5\n"
    + "".join(entry(str(300 + at), name=f"21{at:02X}") for at in range(6))
    + "".join(entry(str(400 + at), name=f"2200sub{at}") for at in range(1, 4))
    + COMPACT + "[6099Value]\nNrOfEntries=2\n1=501\n2=502\n"
)  # fmt: skip
WHOLE_VALUES = 11


@pytest.mark.sparse(10)
@pytest.mark.parametrize("seed", range(20))
def test_no_mutation_of_a_file_loses_a_value_without_a_word(tmp_path: Path, seed: int) -> None:
    """100 files each: a letter, a line or a piece changed, lost, doubled or moved."""
    draw = random.Random(seed)
    path = tmp_path / "a.dcf"
    assert len(values(path, WHOLE)) == WHOLE_VALUES
    sentences: list[str] = []
    for _ in range(100):
        text = _mutated(WHOLE, draw)
        try:
            file = read(path, text)
            found = parameters(file, 5)
        except ConfigError as err:
            sentences += err.problems
            continue
        given = sum(_gives_a_value(line) for line in text.splitlines())
        assert len(found) >= given or file.remarks, text
    assert sentences
    assert all("\n" not in one and one.startswith(f"{path}:") for one in sentences)


def _gives_a_value(line: str) -> bool:
    key, _, value = line.partition("=")
    return key in ("ParameterValue", "1", "2") and bool(value.strip())


def _mutated(text: str, draw: random.Random) -> str:
    lines = text.splitlines()
    at, other = draw.randrange(len(lines)), draw.randrange(len(lines))
    kind = draw.randrange(6)
    if kind == 0:  # one letter
        line = list(lines[at] or " ")
        line[draw.randrange(len(line))] = chr(draw.randrange(32, 127))
        lines[at] = "".join(line)
    elif kind == 1:
        lines.insert(other, lines[at])
    elif kind == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 3:  # two lines in one
        lines[at : at + 2] = ["".join(lines[at : at + 2])]
    elif kind == 4:
        cut = draw.randrange(len(lines[at]) + 1)
        lines[at : at + 1] = [lines[at][:cut], lines[at][cut:]]
    else:
        lines[at] = lines[at].swapcase()
    return "\n".join(lines) + "\n"
