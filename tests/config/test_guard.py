"""What stands before every parser of other people's files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.config.guard import DEEPEST_JSON, parse_json, read_guarded
from tautwave.errors import ConfigError

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=20,
)


def refused(path: Path, *encodings: str) -> str:
    with pytest.raises(ConfigError) as found:
        read_guarded(path, "EDS file", 1024, encodings or ("utf-8-sig",))
    (sentence,) = found.value.problems
    return sentence.replace(f"{path.parent}/", "")


def test_what_is_no_such_file_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "a.eds"
    assert refused(path) == "a.eds: no such file"
    path.write_bytes(b"x" * 1025)
    assert refused(path) == "a.eds: larger than 1 KiB, so not an EDS file"
    path.write_bytes(b"ab\xe9")
    assert refused(path) == "a.eds: not UTF-8 text (byte 0xe9 at offset 2)"
    path.write_bytes(b"a\n\xe9\0")
    assert refused(path, "utf-8", "latin-1") == (
        "a.eds:2: not text (character U+0000), so not an EDS file"
    )
    path.unlink()
    path.mkdir()
    assert refused(path) == "a.eds: a directory, not an EDS file"


def test_another_encoding_is_tried_in_turn(tmp_path: Path) -> None:
    path = tmp_path / "a.eds"
    path.write_bytes("Ger\xe4t".encode("cp1252"))
    assert read_guarded(path, "EDS file", 1024, ("utf-8-sig", "cp1252")) == "Gerät"


@given(JSON)
def test_json_is_what_the_library_reads(value: object) -> None:
    assert parse_json(json.dumps(value)) == value
    assert parse_json(json.dumps(value, ensure_ascii=False, indent=1)) == value


@pytest.mark.parametrize("opening", ["[", '{"a": ', '["[[\\"", '])
def test_json_may_not_be_deeper_than_its_parser_recurses(opening: str) -> None:
    with pytest.raises(ValueError, match=f"line 2: nested deeper than {DEEPEST_JSON} levels"):
        parse_json("\n" + opening * 100_000)


def test_brackets_inside_text_are_no_depth() -> None:
    assert parse_json(json.dumps("[" * 1000)) == "[" * 1000


@given(st.text('[]{}",:\\ 1a', max_size=60))
def test_any_text_is_json_or_a_sentence(text: str) -> None:
    try:
        parse_json(text)
    except ValueError as err:
        assert str(err).startswith("line ")  # noqa: PT017
