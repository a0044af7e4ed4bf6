"""A layout for Foxglove and Lichtblick: plots, parameters and commands of this very rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.runtime.mcap_schema import TOPIC, message_layout
from tautwave.runtime.operate.states import SCALE
from tautwave.runtime.tap import Live

ENDS = ("position", "port_effort")
PAYLOADS = {SCALE: '{"scale": 1}'}


def layout_of(live: Live, commands: Sequence[str]) -> dict[str, Any]:
    """Return the layout as an object for JSON; it is imported in a viewer's layout menu."""
    layout = message_layout(live.columns)
    fields = {live.columns[at]: path for at, path in zip(layout.order, layout.fields, strict=True)}
    panels: dict[str, Any] = {}
    for name in live.facts.get("units", {}):
        for end in ENDS:
            columns = [f"{side}.{name}.{end}" for side in ("master", "slave")]
            panels[f"Plot!{name}-{end}"] = _plot(f"{name} {end}", columns, fields)
        stored = [c for c in fields if c.startswith(f"{name}.") and c.endswith(".stored")]
        panels[f"Plot!{name}-energy"] = _plot(f"{name} energy stored", stored, fields)
    panels["Plot!timing"] = _plot("timing", ["lateness_us", "compute_us"], fields)
    panels["StateTransitions!state"] = {
        "paths": [_path(fields[c]) for c in ("operation.state",) if c in fields],
        "isSynced": True,
    }
    panels["Parameters!knobs"] = {}
    for word in commands:
        panels[f"CallService!{word}"] = {
            "serviceName": f"/{word}", "requestPayload": PAYLOADS.get(word, "{}"),
            "buttonText": word,
        }  # fmt: skip
    plots = [key for key in panels if key.startswith("Plot")]
    rest = [key for key in panels if not key.startswith("Plot")]
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "layout": {
            "direction": "row",
            "first": _stack(plots),
            "second": _stack(rest),
            "splitPercentage": 70,
        },
    }


def _plot(title: str, columns: Sequence[str], fields: Mapping[str, str]) -> dict[str, Any]:
    paths = [_path(fields[column]) for column in columns if column in fields]
    return {"title": title, "paths": paths, "isSynced": True, "xAxisVal": "timestamp",
            "showLegend": True, "showXAxisLabels": True, "showYAxisLabels": True,
            "followingViewWidth": 10}  # fmt: skip


def _path(field: str) -> dict[str, Any]:
    return {"value": f"{TOPIC}.{field}", "enabled": True, "timestampMethod": "receiveTime"}


def _stack(keys: Sequence[str]) -> Any:
    """Return panels one above the other, each as high as the others."""
    if len(keys) == 1:
        return keys[0]
    share = 100 / len(keys)
    return {"direction": "column", "first": keys[0], "second": _stack(keys[1:]),
            "splitPercentage": share}  # fmt: skip
