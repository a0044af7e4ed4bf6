"""The text of a first rig file: what the devices report, and `TODO` where only a person knows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from tautwave.config.text.resolved import flow_yaml
from tautwave.session.new.arms import Arm, arm_lines, simulated_lines
from tautwave.session.new.choosing import Chosen
from tautwave.types import FoundBus, Setting

_BEHIND = 32
"""Column of comments."""

NEAR = {"rotary": (0.05, "rad"), "linear": (0.005, "m")}
"""How near to its place a slave has to be before a pair with a fixed offset engages, by kind."""


PATIENCE = Setting(5, "")
"""Slots that a stalled host may skip where the devices do not tell how far that takes them."""


class Draft(NamedTuple):
    """A rig file to be written: one joint a pair, `rate_hz` [Hz].

    `overrun_limit`: slots that a stalled host may skip, and why so many. `arms` are those of the
    sides, and `path` is where the file goes, which theirs are relative to. With `simulated` there
    are no devices, but arms that are simulated by what their files say.
    """

    name: str
    master: Sequence[Chosen]
    slave: Sequence[Chosen]
    joints: Sequence[str]
    rate_hz: float
    overrun_limit: Setting = PATIENCE
    arms: Mapping[str, Arm] = MappingProxyType({})
    path: Path = Path()
    simulated: bool = False


def draft_text(draft: Draft) -> str:
    """Return the rig file, YAML with comments, SI units."""
    return "\n".join(_lines(draft)) + "\n"


def _lines(draft: Draft) -> Iterator[str]:
    yield (
        "# Written by `tautwave new`. Only you know the values marked "
        "TODO: settle each of them before"
    )
    if draft.simulated:
        yield "# a motor moves, then remove the mark. Until then they are what is simulated."
    else:
        yield "# anything moves, then unmark it. Then: calibrate (--configure once), accept, run."
    yield ""
    yield f"name: {flow_yaml(draft.name)}"
    if draft.simulated:
        yield _line(0, "rate_hz", Setting(draft.rate_hz, "[Hz] TODO: what the drives' bus allows"))
        yield _line(0, "duration_s", Setting(20.0, ""))
    else:
        rate = Setting(draft.rate_hz, "[Hz] at most 70 % of what the buses allow")
        yield _line(0, "rate_hz", rate)
        yield _line(0, "operate", Setting({}, "starts idle; keys and commands engage it"))
    yield _line(0, "require", Setting("passive", "nothing moves without this certificate"))
    limit, why = draft.overrun_limit
    yield _line(0, "loop", Setting({"missing_limit": 3, "overrun_limit": limit}, why))
    yield ""
    yield "buses:"
    used = dict.fromkeys(one.bus.name for one in (*draft.master, *draft.slave))
    everyone = [*draft.master, *draft.slave]
    for name in used:
        yield from _bus([one for one in everyone if one.bus.name == name])
    for side, chosen in (("master", draft.master), ("slave", draft.slave)):
        yield ""
        yield from _side(side, chosen, draft.joints, draft.arms.get(side))
        if side in draft.arms:
            yield from arm_lines(draft.arms[side], draft.path)
    yield ""
    yield "coupling:"
    yield _line(
        1,
        "law",
        Setting("auto", "law and gains by the devices and the delay; `check` says which and why"),
    )
    yield _line(1, "engage_ramp_s", Setting(1.0, "forces fade in over a second"))
    if draft.simulated:
        yield _line(1, "delay_s", Setting(0.0, "[s] one way: both arms on one machine"))
    else:
        kind = draft.master[0].device.axis["kind"].value
        yield from _offsets(*NEAR[kind])
    yield "  pairs:"
    for joint in draft.joints:
        yield f"    {joint}: {{}}"
    if draft.simulated:
        yield ""
        yield from simulated_lines(draft.joints, draft.arms)


def _offsets(tolerance: float, unit: str) -> Iterator[str]:
    why = "TODO: 0 once calibrated: the slave then moves to its master first"
    yield "  defaults:"
    yield _line(2, "offset", Setting("at_engage", why))
    yield _line(2, "engage_tolerance", Setting(tolerance, f"[{unit}] how close it must be then"))


def _bus(chosen: Sequence[Chosen]) -> Iterator[str]:
    bus: FoundBus = chosen[0].bus
    yield f"  {bus.name}:"
    yield f"    driver: {bus.driver}"
    if not bus.listed_as:
        return
    yield "    options:"
    for key, value in bus.options.items():
        yield _line(3, key, value)
    for note in bus.notes:
        yield f"      # {note}"
    yield f"      {bus.listed_as}:"
    for one in chosen:
        yield f"        - {flow_yaml(dict(one.device.options))}"


def _side(
    side: str, chosen: Sequence[Chosen], joints: Sequence[str], arm: Arm | None
) -> Iterator[str]:
    keys = [{"bus": Setting(one.bus.name), **one.device.axis} for one in chosen]
    shared = {
        key: value for key, value in keys[0].items() if all(k.get(key) == value for k in keys)
    }
    yield f"{side}:"
    yield "  defaults:"
    for key, value in shared.items():
        yield _line(2, key, value)
    own = [{key: value for key, value in one.items() if key not in shared} for one in keys]
    for comment in dict.fromkeys(f"{k}: {t.comment}" for one in own for k, t in one.items()):
        if "TODO" in comment:
            yield f"  # {comment}"
    yield "  axes:"
    for at, (joint, one, rest) in enumerate(zip(joints, chosen, own, strict=True)):
        entry: dict[str, Any] = {"id": one.device.id}
        if arm is not None and arm.joints[at].limits.name != joint:
            entry["joint"] = arm.joints[at].limits.name
        entry |= {key: value.value for key, value in rest.items()}
        remark = f"   # {one.device.name}" if one.device.options else ""
        yield f"    {joint}: {flow_yaml(entry)}{remark}"


def _line(depth: int, key: str, value: Setting) -> str:
    text = f"{'  ' * depth}{key}: {flow_yaml(value.value)}"
    return f"{text:<{_BEHIND}}  # {value.comment}" if value.comment else text
