"""From column names to a message definition, read back by an independent ROS 2 parser."""

from __future__ import annotations

import re
import struct
import warnings
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.runtime.mcap_schema import CDR_HEADER, SCHEMA_NAME, message_layout

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from mcap_ros2._dynamic import generate_dynamic

# What Foxglove (ros2.ne: field) and PlotJuggler (rosx_introspection: ROSField) accept.
FOXGLOVE_FIELD = re.compile(r"^[a-z](?:_?[a-z0-9]+)*$")
PLOTJUGGLER_TYPE = re.compile(r"^[a-zA-Z][a-zA-Z0-9_]*(/[a-zA-Z][a-zA-Z0-9_]*)?$")

COLUMNS = (
    "time_s",
    "lateness_us",
    "master.wrist.position",
    "slave.wrist.position",
    "master.wrist.velocity",
    "wrist.position_error",
    "wrist.line.absorbed",
    "true.master.wrist.position",
)


def leaves(message: Any, path: str = "") -> dict[str, float]:
    found: dict[str, float] = {}
    for name in getattr(message, "__slots__", None) or vars(message):
        value = getattr(message, name)
        if isinstance(value, float):
            found[path + name] = value
        else:
            found |= leaves(value, f"{path}{name}.")
    return found


def decode(definition: str, count: int) -> SimpleNamespace:
    decoder = generate_dynamic(SCHEMA_NAME, definition)[SCHEMA_NAME]
    return decoder(CDR_HEADER + struct.pack(f"<{count}d", *map(float, range(count))))


def test_dots_become_a_tree_and_the_order_says_which_column_is_where() -> None:
    layout = message_layout(COLUMNS)
    assert dict(zip(layout.fields, (COLUMNS[k] for k in layout.order), strict=True)) == {
        "time_s": "time_s",
        "lateness_us": "lateness_us",
        "master.wrist.position": "master.wrist.position",
        "master.wrist.velocity": "master.wrist.velocity",
        "slave.wrist.position": "slave.wrist.position",
        "wrist.position_error": "wrist.position_error",
        "wrist.line.absorbed": "wrist.line.absorbed",
        "truth.master.wrist.position": "true.master.wrist.position",
    }


def test_an_independent_parser_finds_the_fields_in_our_order() -> None:
    layout = message_layout(COLUMNS)
    found = leaves(decode(layout.definition, len(COLUMNS)))
    assert found == {name: float(k) for k, name in enumerate(layout.fields)}


@pytest.mark.parametrize(
    ("columns", "fields"),
    [
        (["Wrist.x", "wrist.x"], ["wrist.x", "wrist_2.x"]),
        (["a", "a.b"], ["a", "a_2.b"]),
        (["a.b", "a"], ["a.b", "a_2"]),
        (["a-b", "a b", "a__b_"], ["a_b", "a_b_2", "a_b_3"]),
        (["7th", "", "."], ["x_7th", "x", "x_2.x"]),
        (["cycle.time.t", "time.t"], ["cycle.time.t", "time.t"]),
        (["größe"], ["gr_e"]),
        (["a.b.c.d.e.f.g.h.i"], ["a.b.c.d.e.f.g.h.i"]),
        (["a.b.c.d.e.f.g.h.i.j.k"], ["a.b.c.d.e.f.g.h.i_j_k"]),  # eight deep, and no more
    ],
)
def test_names_are_made_legal_and_unique(columns: list[str], fields: list[str]) -> None:
    assert list(message_layout(columns).fields) == fields


names = st.one_of(
    st.text(max_size=12),
    st.lists(st.sampled_from(["a", "B", "b", "true", "time", "x_", "2", ""]), max_size=10).map(
        ".".join
    ),
)


@given(st.lists(names, min_size=1, max_size=25))
def test_any_names_make_a_definition_every_reader_accepts(columns: list[str]) -> None:
    layout = message_layout(columns)
    assert sorted(layout.order) == list(range(len(columns)))
    assert len(set(layout.fields)) == len(columns)
    for line in layout.definition.splitlines():
        if line.startswith("="):
            assert line == "=" * 80
        elif line.startswith("MSG: "):
            assert PLOTJUGGLER_TYPE.match(line[5:])
        else:
            kind, name = line.split(" ")
            assert PLOTJUGGLER_TYPE.match(kind)
            assert FOXGLOVE_FIELD.match(name)
    types = [line for line in layout.definition.splitlines() if line.startswith("MSG: ")]
    assert len(set(types)) == len(types)
    found = leaves(decode(layout.definition, len(columns)))
    assert found == {name: float(k) for k, name in enumerate(layout.fields)}
