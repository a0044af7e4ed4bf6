"""What a terminal says of a run fits on one screen, and a bad day does not look good."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.cli.group import COMMANDS, DAILY
from tautwave.cli.terminal.screen import LINES, line_count
from tautwave.cli.terminal.show import plain_text
from tautwave.cli.terminal.summary import summary_sections
from tautwave.config import load_rig
from tautwave.report.html import STYLE, badge
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import outcome, verdicts
from tautwave.summary import summary_of
from tautwave.summary.ending import eventful, events, first_cause
from tautwave.summary.model import Summary
from tautwave.summary.repeats import collapsed
from tautwave.tables import GOOD, NOTE
from tests.cli.conftest import SUMMARY
from tests.commands import keep_in_one_process

CONFIGS = Path(__file__).parents[2] / "configs"
HEAVY = ("arms", "tissue", "scene", "three-bus")
SHIPPED = sorted(
    str(path.relative_to(CONFIGS))
    for path in [*CONFIGS.glob("*.yaml"), *CONFIGS.glob("arms/*.yaml")]
)


def made(**keys: Any) -> Summary:
    return summary_of({**SUMMARY, **keys})[0]


def entry(at_s: float, word: str, text: str = "", state: str = "engaged") -> dict[str, Any]:
    return {"at_s": at_s, "word": word, "source": "rig", "state": state, "text": text}


FAULT = "slave.wrist: over-heated"


def bad_day() -> Summary:
    """11 of 113 s engaged, 188 faults, one of them first."""
    journal = [entry(0.0, "engage"), entry(2.0, "fault", "master.wrist: no power", "holding")]
    for n in range(187):
        journal += [entry(3.0 + 0.5 * n, "engage"), entry(3.2 + 0.5 * n, "fault", FAULT, "holding")]
    operation = {"engagements": 188, "engaged_s": 11.0, "journal": journal, "episodes": []}
    return made(operation=operation, duration_s=113.0)


def test_a_bad_day_does_not_look_good() -> None:
    summary = bad_day()
    assert events(summary) == ["engaged 11 s of 113 s", "188 faults"]
    assert eventful(summary)
    assert first_cause(summary) == "master.wrist: no power, after 2 s."
    head = summary_sections("rig", summary, Path(), 0, verbose=False)[0]
    assert head.level == NOTE
    assert "engaged 11 s of 113 s, 188 faults" in head.title


def test_a_report_says_what_happened_before_any_joule() -> None:
    run = Run(Path(), {}, "", bad_day())
    assert outcome(run).status == "note"
    found = verdicts(run)
    assert [one.topic for one in found[:3]] == ["Tracking", "What happened", "Energy books"]
    assert found[1].status == "note"
    assert found[1].sentences == (
        "Engaged 11 s of 113 s, 188 faults.",
        "First: master.wrist: no power, after 2 s.",
    )
    assert outcome(Run(Path(), {}, "", made())).status == "ok"
    assert "What happened" not in [one.topic for one in verdicts(Run(Path(), {}, "", made()))]


def test_a_good_day_is_green() -> None:
    operation = {"engagements": 1, "engaged_s": 100.0, "journal": [entry(0.0, "engage")]}
    summary = made(operation=operation, duration_s=113.0)
    assert not eventful(summary)
    assert summary_sections("rig", summary, Path(), 0)[0].level == GOOD
    noted = made(faults=[{"text": "warm", "axis": "slave.wrist", "fatal": False}])
    assert not eventful(noted)
    assert eventful(made(faults=[{"text": "hot", "axis": "slave.wrist", "fatal": True}]))


@pytest.mark.parametrize(
    ("kind", "status"),
    [
        ("finished", "ok"),
        ("interrupted", "note"),
        ("safety_stop", "bad"),
        ("fault", "bad"),
        ("unknown", "open"),
    ],
)
def test_a_report_is_headed_in_the_colour_of_how_its_run_ended(kind: str, status: str) -> None:
    ended = made(outcome={"kind": kind, "sentence": ""})
    found = outcome(Run(Path(), {}, "", ended))
    assert found.status == status
    assert f'class="badge {status}"' in badge(found)
    assert f".badge.{status} {{ background: var(--{status}); }}" in STYLE


def test_repeats_in_a_journal_are_one_with_the_first_on_top() -> None:
    operation = bad_day().operation
    assert operation is not None
    found = collapsed(operation.journal)
    assert [(one.word, one.text, times, last) for one, times, last in found] == [
        ("engage", "", 188, 96.0),
        ("fault", "master.wrist: no power", 1, 2.0),
        ("fault", FAULT, 187, 96.2),
    ]
    words = [made(operation={"journal": [entry(at, word) for at, word in enumerate("abab")]})]
    assert words[0].operation is not None
    assert len(collapsed(words[0].operation.journal)) == 4


def test_many_pairs_devices_and_warnings_fit_on_a_screen() -> None:
    """Of alike pairs the greatest numbers stand there; the rest is behind --verbose."""
    size = {"rms": 0.01, "max": 0.04}
    pairs = {
        f"j{n}": {"kind": "rotary", "position_error": {**size, "max": 0.04 + n}, "elements": {}}
        for n in range(1, 8)
    }
    lost = {"lost": 4, "late": 1, "faults": [{"text": "over-heated"}]}
    does = {f"slave.j{n}": f"(servo {n}) keeps {10 * n} %" for n in range(1, 8)}
    summary = made(
        pairs=pairs,
        axes={f"{side}.j{n}": lost for side in ("master", "slave") for n in range(1, 8)},
        warnings=[f"warning {n}" for n in range(9)],
        buses={"can": {"unwatched": does}},
        operation=bad_day().operation.model_dump(),
        duration_s=113.0,
    )
    shown = summary_sections("rig", summary, Path(), 0, verbose=False)
    assert line_count(shown) <= LINES
    said = " ".join(plain_text(shown).split())
    assert "j1-j7 <= 10 mrad <= 7.04 rad" in said
    assert "slave.j1-j7: keeps 10 to 70 %" in said
    assert "more: --verbose" in said
    assert line_count(summary_sections("rig", summary, Path(), 0)) > 2 * LINES


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(one, marks=pytest.mark.nightly if any(h in one for h in HEAVY) else ())
        for one in SHIPPED
    ],
)
def test_a_run_of_a_shipped_rig_is_one_screen(
    name: str, tautwave_cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    rig = CONFIGS / name
    bare = () if "\nsimulation:" in rig.read_text() else ("--set", "simulation={}")
    done = tautwave_cli(
        *("run", rig, "--clock", "fake", "--simulate", "--duration", "0.4", "--quiet"),
        *("--allow-unwatched", *bare),
    )
    assert done.exit_code in (0, 3), done.output
    shown = done.stdout.splitlines()
    first = next(k for k, line in enumerate(shown) if line.startswith(f"{load_rig(rig).name}: "))
    assert len(shown[first:]) <= LINES - 4  # and the lines on its buses


def test_help_has_the_commands_of_a_day_first(tautwave_cli) -> None:
    lines = tautwave_cli("--help").stdout.splitlines()
    daily, more = lines.index("Daily:"), lines.index("More:")
    named = [
        line.split()[0] for line in lines[daily + 1 :] if line.split()[:1] and line[:3] != "   "
    ]
    assert daily < more
    assert [one for one in named if one in COMMANDS] == list(COMMANDS)
    assert len(DAILY) == 14
