"""One list of verdicts: the page and the terminal say as serious as it does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.cli.terminal.summary import SAID, summary_sections
from tautwave.report.judged import Topic, judged, severity_of
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import verdicts
from tautwave.summary import summary_of
from tautwave.summary.model import Severity
from tautwave.tables import Cell

CLOSED = {"gross_flow": 1.0, "residual": 0.0, "motors_net": 1e-4, "generated": 0.0}
GOOD = {"passed": True, "state": "passed"}
END = {"given_j": 2.0, "claim_j": 1.0, "passed": False}
CASES: dict[str, tuple[dict[str, Any], Topic, Severity]] = {
    "closed": ({"energy_j": CLOSED}, "energy books", "ok"),
    "open books": ({"energy_j": {**CLOSED, "residual": 0.5}}, "energy books", "bad"),
    "no books": ({"energy_j": {}}, "energy books", "open"),
    "more than claimed": (
        {
            "energy_j": CLOSED,
            "pairs": {"w": {"motors": {"worst": 2.0, "worst_at_s": 1.0, "stated_debt": 1.0}}},
        },
        "motors gave",
        "bad",
    ),
    "claim broken": (
        {"energy_j": CLOSED, "certificate": {**GOOD, "after_run": {"ends": {"master.w": END}}}},
        "claims",
        "bad",
    ),
    "passed": ({"certificate": GOOD}, "certificate", "ok"),
    "conditional": ({"certificate": {**GOOD, "state": "conditional"}}, "certificate", "note"),
    "not passed": ({"certificate": {"passed": False}}, "certificate", "bad"),
    "not evaluated": ({"certificate": {}}, "certificate", "open"),
    "invalidated": (
        {"certificate": {**GOOD, "after_run": {"invalidated": True, "sentences": ["x"]}}},
        "certificate",
        "bad",
    ),
    "unmet condition": (
        {"certificate": {**GOOD, "after_run": {"broken_conditions": ["x"]}}},
        "certificate",
        "note",
    ),
    "on time": ({"cycles": 1000, "missed_cycles": 0}, "timing", "ok"),
    "a few missed": ({"cycles": 1000, "missed_cycles": 10}, "timing", "note"),
    "many missed": ({"cycles": 1000, "missed_cycles": 11}, "timing", "bad"),
    "rows dropped": (
        {"cycles": 9, "missed_cycles": 0, "recording": {"rows_dropped": 1}},
        "timing",
        "note",
    ),
    "no recording": (
        {"cycles": 9, "missed_cycles": 0, "recording": {"error": "disk full"}},
        "timing",
        "bad",
    ),
    "buzzing": ({"pairs": {"w": {"fast_share": {"master": 0.5}}}}, "tracking", "bad"),
    "calm": ({"pairs": {"w": {"fast_share": {"master": 0.1}}}}, "tracking", "info"),
    "held by the link": ({"pairs": {"w": {"link": {"master": {"holds": 1}}}}}, "link", "note"),
    "a fault": (
        {"faults": [{"text": "hot", "axis": "slave.w", "fatal": True}]},
        "what happened",
        "note",
    ),
}
TOPICS: dict[str, tuple[Topic, ...]] = {
    "Tracking": ("tracking",),
    "What happened": ("what happened",),
    "Link": ("link",),
    "Energy books": ("energy books", "claims", "motors gave"),
    "Timing": ("timing",),
    "Certificate": ("certificate",),
}
"""Topics of a page, and what they gather."""


@pytest.mark.parametrize("name", CASES)
def test_how_serious_a_topic_is(name: str) -> None:
    changes, topic, severity = CASES[name]
    assert severity_of(judged(summary_of(changes)[0]), topic) == severity


@pytest.mark.parametrize("name", CASES)
def test_page_and_terminal_say_it_alike(name: str) -> None:
    summary = summary_of({"cycles": 1000, **CASES[name][0]})[0]
    found = judged(summary)
    for one in verdicts(Run(Path(), {}, "", summary)):
        assert one.status == severity_of(found, *TOPICS[one.topic]), one.topic
    levels = {"ok": "ok", "note": "note", "bad": "bad", "open": "note"}
    rows = {
        str(row[0]): row[1]
        for table in summary_sections("rig", summary, Path(), 0, verbose=False)
        for row in table.rows
        if len(row) == 2
    }
    for topic in SAID:
        said = [one for one in found if one.topic == topic and one.words]
        assert (topic in rows) == bool(said)
        if said:
            cell = rows[topic]
            assert isinstance(cell, Cell)
            assert cell.level == levels[said[-1].severity]
            assert said[-1].words in cell.text
