"""From a rig's keys to the knobs of its controller: what each part declares to be tunable."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from tautwave import registry
from tautwave.config import Rig, local_wall
from tautwave.rig.controller import coupling_law
from tautwave.rig.parts import coupling_part
from tautwave.runtime.control import Control
from tautwave.runtime.tuning.knobs import Knob, Turning, ceiling_knob, coupling_knob, wall_knob

WIDEST = 10.0
"""How far beyond its value in the rig a wall's stiffness or damping may be asked for."""

MIN_CEILING = 0.05
"""Of the effort limit, and of the filter's corner: below, an axis would be left without force."""


def declared(keys: BaseModel) -> Iterator[tuple[str, str]]:
    """Yield the keys of a block that may be tuned, and when."""
    for key, field in type(keys).model_fields.items():
        extra = field.json_schema_extra
        if isinstance(extra, Mapping) and "tuning" in extra:
            yield key, str(extra["tuning"])


def tunables(rig: Rig) -> Iterator[tuple[str, str, Any]]:
    """Yield path, `when` and value of every key of this site that may be tuned."""
    sides = ("master", "slave") if rig.site is None else (rig.site,)
    for name, pair in rig.coupling.pairs.items():
        path = f"coupling.pairs.{name}"
        for key, when in declared(pair):
            yield f"{path}.{key}", when, getattr(pair, key)
        for side in sides:
            wall = local_wall(rig, f"{side}.{name}")
            if wall is not None:
                for key, when in declared(wall):
                    yield f"{path}.wall_{side}.{key}", when, getattr(wall, key)
    for axis_name, axis in rig.axes.items():
        side, name = axis_name.split(".")
        for key, when in declared(axis) if side in sides else ():
            yield f"{side}.axes.{name}.{key}", when, getattr(axis, key)


def knobs_of(rig: Rig, control: Control) -> list[Knob]:
    """Return the knobs of a rig's controller; a key that cannot be turned here has none."""
    places = {name.name: at for at, name in enumerate(control.names)}
    knobs = []
    for path, when, value in tunables(rig):
        knob = _knob(rig, control, places, path, when, value)
        if knob is not None:
            knobs.append(knob)
    return knobs


def _knob(
    rig: Rig,
    control: Control,
    places: Mapping[str, int],
    path: str,
    when: str,
    value: Any,
) -> Knob | None:
    words = path.split(".")
    if when == "between runs" or not isinstance(value, float):
        return None
    if words[1] == "axes":
        axis_name = f"{words[0]}.{words[2]}"
        if rig.axes[axis_name].causality != "impedance":
            return None
        which = places[axis_name]
        limit = control.params[which].ceiling
        alike = rig.scene is None and coupling_law(rig).alike
        unit = _effort(rig, axis_name)
        pair = (places[f"master.{words[2]}"], places[f"slave.{words[2]}"]) if alike else ()
        turning = ceiling_knob(control, which, pair)
        column = f"tuning.{axis_name}.effort_ceiling"
        return Knob(path, column, unit, when, limit, MIN_CEILING * limit, limit, turning)
    name = words[2]
    if len(words) == 5:
        axis_name = f"{words[3].removeprefix('wall_')}.{name}"
        if rig.axes[axis_name].causality != "impedance":
            return None  # what its wall does depends on its law
        return _wall(rig, control, places[axis_name], axis_name, words[4], path, when, value)
    tune = coupling_part(rig).tune
    if not tune or rig.link is not None:
        return None  # a receiver takes the place of the line and its filter
    ends = (places[f"master.{name}"], places[f"slave.{name}"])
    turning = coupling_knob(control, ends, registry.load_named(tune), words[3])
    low = MIN_CEILING * value
    return Knob(path, f"tuning.{name}.{words[3]}", "Hz", when, value, low, value, turning, False)


def _wall(
    rig: Rig,
    control: Control,
    which: int,
    axis_name: str,
    key: str,
    path: str,
    when: str,
    value: float,
) -> Knob:
    axis = rig.axes[axis_name]
    effort, angle = _effort(rig, axis_name), "rad" if axis.kind == "rotary" else "m"
    low, high = 0.0, WIDEST * value
    if key == "damping":
        high = max(high, axis.damping.value)
        unit = f"{effort} s/{angle}"
    elif key == "stiffness":
        low, unit = value / 1e3, f"{effort}/{angle}"
    else:
        low, high = axis.position_range or (-abs(10.0 * value) - 1.0, abs(10.0 * value) + 1.0)
        unit = angle
    turning: Turning = wall_knob(control, which, key)
    column = f"tuning.{axis_name}.wall_{key}"
    return Knob(path, column, unit, when, value, low, high, turning, key != "position")


def _effort(rig: Rig, axis_name: str) -> str:
    return "N m" if rig.axes[axis_name].kind == "rotary" else "N"
