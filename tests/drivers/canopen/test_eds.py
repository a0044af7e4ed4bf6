"""EDS and DCF files: what the vendor's library is given, and what it may not be given."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.errors import ConfigError
from tautwave_drivers.canopen.bus.network import LARGEST_EDS, read_dictionary
from tests.drivers.canopen.test_more import EDS


def refused(path: Path) -> str:
    with pytest.raises(ConfigError) as found:
        read_dictionary(str(path), 1)
    (sentence,) = found.value.problems
    assert "\n" not in sentence
    return sentence.replace(f"{path.parent}/", "")


def test_a_file_of_a_windows_editor_is_read(tmp_path: Path) -> None:
    path = tmp_path / "drive.EDS"
    text = EDS.replace("ParameterName=", "ParameterName=Gerät ", 1)
    for encoding in ("utf-8", "utf-8-sig", "cp1252"):
        path.write_bytes(text.encode(encoding))
        names = [one.name for one in read_dictionary(str(path), 1).values()]
        assert any(name.startswith("Gerät ") for name in names)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"x" * (LARGEST_EDS + 1), "a.eds: larger than 4096 KiB, so not an EDS or DCF file"),
        (b"\x7fELF\0\0\xff", "a.eds:1: not text (character U+0000), so not an EDS or DCF file"),
        (b"name: bench\n", "a.eds: not an EDS or DCF file (MissingSectionHeader"),
        (b"[DeviceInfo]\n[6040]\nParameterName=a\n", "a.eds: not an EDS or DCF file (NoOption"),
        (b"[DeviceInfo]\n[x]\n", "a.eds: defines no objects; use the one supplied"),
        (b"[6040]\nObjectType=7\nObjectType=7\n", "a.eds: not an EDS or DCF file (Duplicate"),
        (
            b"[1003]\nParameterName=a\nObjectType=8\nCompactSubObj=9\nDataType=7\nAccessType=ro\n"
            b"[1003Name]\nNrOfEntries=99999999999\n",
            "a.eds:8: NrOfEntries is 99999999999; an object has 254 sub-indices at most",
        ),
    ],
    ids=["large", "binary", "yaml", "cut", "nothing", "twice", "endless"],
)
def test_what_is_not_an_eds_is_one_sentence(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "a.eds"
    path.write_bytes(content)
    assert refused(path).startswith(said)


def test_other_formats_are_not_handed_on(tmp_path: Path) -> None:
    """The library would read .epf, XML, with no bound on what it expands to."""
    for name in ("a.epf", "a.xdd", "a"):
        assert refused(tmp_path / name) == f"{name}: not an EDS or DCF file (.eds, .dcf)"


@given(st.data())
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_damage_leaves_a_dictionary_or_a_sentence(tmp_path: Path, data: st.DataObject) -> None:
    raw = bytearray(EDS.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(raw) - 1))
        raw[at : at + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=4))
    path = tmp_path / "a.dcf"
    path.write_bytes(raw)
    try:
        read_dictionary(str(path), 1)
    except ConfigError as err:
        (sentence,) = err.problems
        assert "\n" not in sentence
