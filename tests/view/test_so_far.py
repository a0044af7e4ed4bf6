"""What the top of a run's page says: engaged time, faults, stops, times without the other site."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.runtime.operate.journal import Journal
from tautwave.runtime.operate.states import (
    COMMANDS,
    ENGAGED,
    FAULT,
    HOLDING,
    IDLE,
    REST,
    STATES,
    STOP,
    Standing,
    follow,
    refusal,
)
from tautwave.runtime.tap import Live
from tautwave.view.facts import facts_of
from tautwave.view.so_far import MAX_KINDS, SoFar, silence_of

CONFIGS = Path(__file__).parents[2] / "configs"
COLUMNS = ("time_s", "operation.state", "link.silence_s")


def rows(*of: tuple[float, str, float]) -> list[float]:
    return [value for at, state, silent in of for value in (at, STATES.index(state), silent)]


def entry(number: int, word: str, state: str = HOLDING, text: str = "", **more: Any) -> Any:
    fields = {"at_s": 0.1 * number, "word": word, "source": "controller", "state": state}
    return number, {**fields, "text": text, "refused": False, **more}


def test_engaged_time_is_counted_from_the_first_row_that_was_seen() -> None:
    so_far = SoFar(COLUMNS)
    for k in range(40, 60):
        state = ENGAGED if k < 50 else HOLDING
        so_far.take_rows(rows(*((0.1 * k + 0.05 * n, state, 0.0) for n in (0, 1))))
    facts = so_far.facts()
    assert facts["from_s"] == 4.0
    assert facts["engaged_s"] == pytest.approx(0.95)
    assert SoFar(("time_s",)).facts()["operated"] is False


def test_each_silence_beyond_the_rigs_limit_is_one_moment_cut_off() -> None:
    quiet = [0.0, 0.3, 0.4, 0.0, 0.05, 0.2, 0.0]
    given = rows(*((0.1 * k, ENGAGED, value) for k, value in enumerate(quiet)))
    for limit, cut in ((0.1, 2), (0.25, 1), (None, 0)):
        so_far = SoFar(COLUMNS, limit)
        for k in range(0, len(given), 3):
            so_far.take_rows(given[k : k + 3])
        assert so_far.facts()["cut_off"] == cut
    for name in ("bench-1dof-loopback", "network-loopback"):
        rig = load_rig(CONFIGS / f"{name}.yaml")
        assert silence_of(rig) == (None if rig.link is None else rig.link.silence_s)


def test_a_journal_is_counted_once_and_its_repeats_are_one_kind() -> None:
    so_far = SoFar(COLUMNS)
    news = [
        entry(1, "engage", ENGAGED),
        entry(2, FAULT, text="master.wrist: no power"),
        entry(3, FAULT, text="slave.wrist: 21 samples missing"),
        entry(4, "engage", text="no", refused=True),
        entry(5, FAULT, text="slave.wrist: 4 samples missing"),
        entry(6, STOP, text="no", refused=True),
        entry(7, STOP),
    ]
    for last in range(1, len(news) + 1):
        so_far.take_news(news[max(0, last - 3) : last])  # viewers get the newest ones
    facts = so_far.facts()
    assert (facts["faults"], facts["stops"], facts["faulted"]) == (3, 1, True)
    assert facts["cause"]["text"] == "master.wrist: no power"
    told = [(place, one["text"], times) for place, one, times, _ in so_far.kinds()]
    assert (2, "slave.wrist: 21 samples missing", 2) in told
    assert len(told) == 6
    assert [place for place, *_ in so_far.take_new()] == list(range(6))
    assert so_far.take_new() == []
    so_far.take_news([entry(8, FAULT, text="slave.wrist: 9 samples missing")])
    ((place, _, times, last_s),) = so_far.take_new()
    assert (place, times, last_s) == (2, 3, pytest.approx(0.8))


def test_a_fault_is_acknowledged_by_the_rest_that_leads_to_idle() -> None:
    so_far = SoFar(COLUMNS)
    so_far.take_news([entry(1, FAULT, text="no power")])
    so_far.take_news([entry(2, REST, text="the devices are reset")])
    so_far.take_news([entry(3, REST, IDLE, text="not recovered", refused=True)])
    assert so_far.facts()["faulted"] is True
    so_far.take_news([entry(4, REST, IDLE, text="the devices are back")])
    assert so_far.facts()["faulted"] is False
    assert so_far.facts()["cause"] is None
    so_far.take_news([entry(5, FAULT, text="too hot")])
    assert so_far.facts()["cause"]["text"] == "too hot"


def test_a_page_that_comes_late_gets_the_last_kinds() -> None:
    so_far = SoFar(COLUMNS)
    so_far.take_news([entry(k, f"word {k}") for k in range(1, 2 * MAX_KINDS)])
    kinds = so_far.kinds()
    assert [place for place, *_ in kinds] == list(range(MAX_KINDS - 1, 2 * MAX_KINDS - 1))


@pytest.mark.parametrize("state", STATES)
def test_a_page_knows_every_refusal_of_the_run(state: str) -> None:
    """What it may not know is whether a dead-man is held: it names the key."""
    dead_man = "{device: /dev/input/event0, dead_man: KEY_SPACE}"
    rig = load_rig(
        CONFIGS / "bench-1dof-loopback.yaml", overrides=[f"operate.key_devices=[{dead_man}]"]
    )
    facts = facts_of(Live(0, 0, COLUMNS, 1, 1.0, {"mailbox": "x"}), rig)
    assert facts["dead_men"] == ["KEY_SPACE"]
    for word in COMMANDS:
        now = Standing(state)
        refused = follow(now, word) is None
        assert facts["refusals"][state].get(word, "") == (refusal(now, word) if refused else "")
    assert facts["refusals"][state].get("episode", "") == Journal().misplaced("", state)
    assert facts["after_fault"] == refusal(Standing(state, faulted=True), "engage")
