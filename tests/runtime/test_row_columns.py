"""Columns as declared, beside what the controller writes where they say."""

from __future__ import annotations

import pytest

from tautwave.columns import Column, Kinds, names
from tautwave.config import load_rig
from tautwave.config.shipped import find_example
from tautwave.controller.pair import effort_error, position_error
from tautwave.controller.rows import AXIS, MEASURED, PAIR, WALL
from tautwave.recordings.layout import DESCRIBED
from tautwave.recordings.recording import described_in
from tautwave.report.columns import SECTIONS, about, describe
from tautwave.rig import command_delays
from tautwave.rig.controller import make_control

FIELDS = {
    "position": "position",
    "velocity": "velocity",
    "commanded": "command",
    "port_effort": "port_effort",
    "port_energy": "port_energy",
    "gross_flow": "gross_flow",
    "uncertainty": "uncertainty",
    "limited": "limited",
    "measured_effort": "outside",
    "wall_effort": "wall_effort",
}
"""Fields of an axis' state by the column that has them; `valid` is a word of its own."""


@pytest.mark.parametrize("rig_name", ["bench-1dof-loopback", "bench-admittance-loopback"])
def test_a_declared_column_has_its_own_field_of_the_state(rig_name: str) -> None:
    rig = load_rig(find_example(f"{rig_name}.yaml").path)
    control = make_control(rig, command_delays(rig), 10)
    for at, side in enumerate(("one", "two")):
        state = getattr(control.view.views[0], side)
        for number, field in enumerate(FIELDS.values()):
            setattr(state, field, 1.0 + number + 100.0 * at)
    row = [0.0] * len(control.columns)
    control.fill(row, 0)
    written = dict(zip(control.columns, row, strict=True))
    pair = control.view.views[0]
    name = control.pair_names[0]
    for side, s, p in (("master", pair.one, pair.p1), ("slave", pair.two, pair.p2)):
        there = names(AXIS) + [MEASURED.name] * (not p.impedance or p.senses)
        there += [WALL.name] * p.site.has_wall
        for column in there:
            if column == "valid":
                continue
            weight = p.weight if column in ("port_energy", "gross_flow", "uncertainty") else 1.0
            value = weight * getattr(s, FIELDS[column])
            assert written[f"{side}.{name}.{column}"] == value, column
    assert {one: written[f"{name}.{one}"] for one in names(PAIR)} == {
        "position_error": position_error(pair),
        "effort_error": effort_error(pair),
    }


def test_units_are_those_of_the_declarations() -> None:
    listed = [one for columns in SECTIONS.values() for one in columns]
    of_axes = about({"master.linear": ("linear", "impedance")})
    for column in (*AXIS, MEASURED, WALL):
        given = column.unit.split("; ")[0].split(", ")
        written = ["" if one in ("0", "1") else one for one in given]
        for axis, expected in (("wrist", written[0]), ("linear", written[-1])):
            name = f"master.{axis}.{column.name}"
            assert describe([name], Kinds(listed), of_axes)[name].unit == expected
    assert len(listed) == len({one.name for one in listed})


@pytest.mark.parametrize(
    ("column", "kind"),
    [
        ("master.wrist.pitch.position", "SIDE.AXIS.position"),
        ("true.slave.a.position", "true.SIDE.AXIS.position"),
        ("scene.at.left_knob", "scene.at.NODE"),
        ("lever.port_slave.absorbed", "PAIR.port_SIDE.absorbed"),
        ("lever.port_slave.stored", "PAIR.ELEMENT.stored"),
        ("master.wrist.positions", None),
    ],
)
def test_a_column_is_of_the_first_kind_that_matches(column: str, kind: str | None) -> None:
    ordered = ("PAIR.port_SIDE.absorbed", "true.SIDE.AXIS.position", "SIDE.AXIS.position")
    every = (*ordered, "scene.at.NODE", "PAIR.ELEMENT.stored", "PAIR.ELEMENT.absorbed")
    found = Kinds(Column(name, "", "") for name in every).of(column)
    assert (found.name if found else None) == kind


@pytest.mark.parametrize("told", ["", "x", "[1]", "3", '{"a": 1}', '{"a": ["m"]}', "[" * 100_000])
def test_what_a_recording_says_wrongly_of_its_columns_is_not_taken(told: str) -> None:
    assert described_in({DESCRIBED: told}) == {}
    assert described_in({DESCRIBED: '{"a": ["m", "there"]}'}) == {"a": ("m", "there")}
    assert described_in({}) == {}
