"""The layout that Foxglove and Lichtblick import: what it shows of a run."""

from __future__ import annotations

from typing import Any

from tautwave.runtime.mcap_schema import TOPIC
from tautwave.runtime.tap import Live
from tautwave.view.foxglove_layout import layout_of

COLUMNS = (
    "time_s", "lateness_us", "compute_us", "master.lever.position", "slave.lever.position",
    "slave.lever.port_effort", "lever.line.stored", "operation.state",
)  # fmt: skip


def lines(*fields: str) -> list[dict[str, Any]]:
    return [
        {"value": f"{TOPIC}.{field}", "enabled": True, "timestampMethod": "receiveTime"}
        for field in fields
    ]


def plot(title: str, *fields: str) -> dict[str, Any]:
    return {
        "title": title, "paths": lines(*fields), "isSynced": True, "xAxisVal": "timestamp",
        "showLegend": True, "showXAxisLabels": True, "showYAxisLabels": True,
        "followingViewWidth": 10,
    }  # fmt: skip


def test_a_layout_plots_each_pair_and_has_a_button_for_each_command() -> None:
    live = Live(1, 3, COLUMNS, 100, 1000.0, {"units": {"lever": "rad"}})
    found = layout_of(live, ["engage", "scale"])
    assert found["configById"] == {
        "Plot!lever-position": plot(
            "lever position", "master.lever.position", "slave.lever.position"
        ),
        "Plot!lever-port_effort": plot("lever port_effort", "slave.lever.port_effort"),
        "Plot!lever-energy": plot("lever energy stored", "lever.line.stored"),
        "Plot!timing": plot("timing", "lateness_us", "compute_us"),
        "StateTransitions!state": {"paths": lines("operation.state"), "isSynced": True},
        "Parameters!knobs": {},
        "CallService!engage": {
            "serviceName": "/engage", "requestPayload": "{}", "buttonText": "engage",
        },
        "CallService!scale": {
            "serviceName": "/scale", "requestPayload": '{"scale": 1}', "buttonText": "scale",
        },
    }  # fmt: skip
    assert (found["globalVariables"], found["userNodes"]) == ({}, {})
    assert {key: found["layout"][key] for key in ("direction", "splitPercentage")} == {
        "direction": "row",
        "splitPercentage": 70,
    }


def test_panels_stand_one_above_the_other_each_as_high_as_the_others() -> None:
    live = Live(1, 3, COLUMNS, 100, 1000.0, {"units": {"lever": "rad"}})
    stack, heights, left = layout_of(live, [])["layout"]["first"], [], 100.0
    while isinstance(stack, dict):
        assert stack["direction"] == "column"
        heights.append(left * stack["splitPercentage"] / 100.0)
        left -= heights[-1]
        stack = stack["second"]
    assert [*heights, left] == [25.0] * 4
