"""What a viewer has to know of a run before its rows mean anything: one JSON object."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from tautwave.config import Rig, SolidWall, local_wall
from tautwave.runtime.operate.commands import EPISODE, HAND_BACK, TAKE_OVER
from tautwave.runtime.operate.journal import Journal
from tautwave.runtime.operate.led import leads_already
from tautwave.runtime.operate.states import (
    AFTER_FAULT,
    BUTTONS,
    COMMANDS,
    SCALE,
    STATES,
    STOP,
    Standing,
    follow,
    refusal,
)
from tautwave.runtime.tap import Live
from tautwave.summary.model import certified_severity

ELEMENT = re.compile(r"(?P<pair>.+)\.(?P<element>[^.]+)\.absorbed")


def facts_of(live: Live, rig: Rig) -> dict[str, Any]:
    """Return columns and units, the pairs and what they are made of, states and commands."""
    facts = live.facts
    return {
        "rig": rig.name,
        "columns": list(live.columns),
        "rate_hz": live.rate_hz,
        "delay_s": None if rig.scene is not None else rig.coupling.delay_s,
        "law": "scene" if rig.scene is not None else rig.coupling.law,
        "pairs": [_pair(live, rig, name) for name in facts.get("units", {})],
        "certificate": _certificate(facts.get("certificate")),
        "states": list(STATES),
        "commands": commands_of(live, rig),
        "scales": scales_of(rig),
        "refusals": _refusals(),
        "after_fault": AFTER_FAULT,
        "leads_already": {word: leads_already(word) for word in (TAKE_OVER, HAND_BACK)},
        "dead_men": dead_men_of(rig),
        "pointer": (facts.get("pointer") or {}).get("ranges"),
        "axes": [] if rig.scene is None else [_scene_axis(rig, name) for name in rig.master.axes],
        "tunables": _tunables(facts.get("tuning")),
    }


def _certificate(facts: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return a certificate with how serious its state is."""
    if facts is None:
        return None
    return {**facts, "severity": certified_severity(facts["passed"], facts["state"])}


def commands_of(live: Live, rig: Rig) -> list[str]:
    """Return the words of the commands that a run takes."""
    if live.facts.get("mailbox") is None:
        return [STOP]
    led = rig.operate is not None and rig.operate.policy is not None
    others = [*([SCALE] if scales_of(rig) else []), *([TAKE_OVER, HAND_BACK] if led else [])]
    return [*BUTTONS, *others, EPISODE]


def scales_of(rig: Rig) -> list[float]:
    """Return the factors that `scale` takes, none where the rig has no other than its own."""
    if rig.operate is None or not rig.operate.scales:
        return []
    return sorted({1.0, *rig.operate.scales})


def dead_men_of(rig: Rig) -> list[str]:
    """Return the keys that have to be held while a rig is engaged."""
    devices = () if rig.operate is None else rig.operate.key_devices
    return [one.dead_man for one in devices if one.dead_man is not None]


def _tunables(facts: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """Return the knobs of a run, and what it cannot turn."""
    return [] if facts is None else [*facts["knobs"], *facts["fixed"]]


def _refusals() -> dict[str, dict[str, str]]:
    """Return why commands are refused, by state and word; what is not here is possible."""
    refusals = {}
    for state in STATES:
        now = Standing(state)
        words = [word for word in COMMANDS if follow(now, word) is None]
        refusals[state] = {word: refusal(now, word) for word in words}
        if why := Journal().misplaced("", state):
            refusals[state][EPISODE] = why
    return refusals


def _pair(live: Live, rig: Rig, name: str) -> dict[str, Any]:
    unit = live.facts["units"][name]
    return {
        "name": name,
        "unit": unit,
        "effort": "N m" if unit == "rad" else "N",
        "sides": {side: _side(rig, f"{side}.{name}") for side in ("master", "slave")},
        "elements": _elements(live, name),
    }


def _met(rig: Rig, axis_name: str) -> float | None:
    """Return the place of the simulated wall that a slave meets, None without one."""
    side, _, name = axis_name.partition(".")
    environment = {} if rig.simulation is None or side != "slave" else rig.simulation.environment
    met = environment.get(name)
    return met.position if isinstance(met, SolidWall) else None


def _scene_axis(rig: Rig, name: str) -> dict[str, Any]:
    """Return an axis of a scene as a pair that has one end."""
    rotary = rig.master.axes[name].kind == "rotary"
    return {
        "name": name,
        "unit": "rad" if rotary else "m",
        "effort": "N m" if rotary else "N",
        "sides": {"master": _side(rig, f"master.{name}")},
    }


def _side(rig: Rig, axis_name: str) -> dict[str, Any]:
    axis = rig.axes[axis_name]
    wall = local_wall(rig, axis_name)
    return {
        "bus": axis.bus,
        "driver": rig.buses[axis.bus].driver,
        "causality": axis.causality,
        "effort_limit": axis.effort_limit,
        "range": axis.position_range,
        "wall": None if wall is None else wall.position,
        "met": _met(rig, axis_name),
    }


def _elements(live: Live, pair: str) -> list[str]:
    """Return the elements of a pair that have an account of their own, in their order."""
    matches = (ELEMENT.fullmatch(column) for column in live.columns)
    return [m["element"] for m in matches if m is not None and m["pair"] == pair]
