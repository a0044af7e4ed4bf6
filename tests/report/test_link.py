"""What a report says of a network, and a receiver that gave more than it got, to the quantum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.laws.counters import ENERGY_QUANTUM
from tautwave.laws.receiver import RESERVE
from tautwave.report.judged import judged, severity_of
from tautwave.report.link import kept_of, link_figures, link_sentences
from tautwave.report.motors import stated_debt
from tautwave.report.run.after_run import recheck_run
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import verdicts
from tautwave.summary import Summary, summary_of
from tests.report.rows_of import put

ROWS = 1000
KEYS: dict[str, Any] = {
    "rate_hz": 1000,
    "link": {"silence_s": 0.05},
    "coupling": {"pairs": {"lever": {}}},
    "master": {"axes": {"lever": {"kind": "rotary"}}},
}


def run(least: float = 0.0, network: float = 0.0, **columns: Any) -> Run:
    """Return a run of 1 s at 1 kHz whose master lost a tenth and held for 0.1 s."""
    at = np.arange(ROWS) * 1e-3
    silence = np.where((at > 0.4) & (at <= 0.55), at - 0.4, 0.0)
    own = "master.lever"
    whole: Any = {
        f"{own}.link_delay": np.where(at < 0.02, 0.0, 0.02),
        f"{own}.link_depth": np.full(ROWS, 0.006),
        f"{own}.link_backlog": np.where(silence > 0.0, -0.2, 0.0),
        f"{own}.link_silence": silence,
        f"{own}.link_lost": np.arange(ROWS) // 10,
        f"{own}.link_cut": np.zeros(ROWS),
        "skipped_slots": np.zeros(ROWS),
        "lever.receiver_master.stored": np.where(at == 0.5, least, 1e-3),
        "lever.receiver_slave.stored": np.full(ROWS, 1e-3),
        "lever.network.stored": np.where(at == 0.5, network, 1e-3),
        **columns,
    }
    pair: dict[str, Any] = {
        "kind": "rotary",
        "receiver_j": RESERVE,
        "claim_j": {"master": 0.5, "slave": 0.25},
        "delay_budget_s": {
            "sensing": 0.001, "bus": 0.0, "link": 0.01, "play_out": 0.006, "command": 0.0005
        },
    }  # fmt: skip
    found = Run(
        Path(), KEYS, "",
        summary_of({"pairs": {"lever": pair}, "certificate": {"passed": True}})[0],
        tuple(whole), ROWS, whole=whole, time=at,
    )  # fmt: skip
    put(found, {"pairs": {"lever": {"link": link_figures(found, "lever")}}})
    return found


def test_figures() -> None:
    [figures] = link_figures(run(), "lever").values()
    assert figures["loss"] == pytest.approx(0.1, rel=0.03)
    assert figures["holds"] == 1
    assert figures["held_s"] == pytest.approx(0.1, abs=2e-3)
    assert figures["backlog"] == pytest.approx(0.2)
    assert figures["delay_p50_s"] == figures["delay_p99_s"] == pytest.approx(0.02)
    assert (figures["link_s"], figures["play_out_s"]) == pytest.approx((0.014, 0.006))


def test_sentences_compare_the_delay_with_what_was_expected() -> None:
    said, budget = link_sentences(run())
    assert severity_of(judged(run().result), "link") == "note"
    for words in ("master.lever: 10 % of the packets lost", "held 1 x", "200\u202fmrad owed"):
        assert words in said
    assert budget.startswith("lever: 21.5 ms one way at the median, 17.5 expected: sensing 1 (1)")
    assert "link 14 (10), play-out 6 (6), command 0.5 (0.5) ms" in budget


def test_without_a_network_there_is_none() -> None:
    bare = Run(
        Path(), {}, "", Summary(), ("skipped_slots",), 1, whole={"skipped_slots": np.zeros(1)}
    )
    assert link_sentences(bare) == []


@pytest.mark.parametrize("quanta", [0, 1])
def test_a_quantum_beyond_the_reserve_breaks_the_certificate(quanta: int) -> None:
    """The judgement is one of integers: the reserve itself is allowed, a quantum more is not."""
    reserve = math.floor(RESERVE / ENERGY_QUANTUM)
    found = run(least=-(reserve + quanta) * ENERGY_QUANTUM)
    kept = {one.element: one.passed for one in kept_of(found)}
    assert kept == {
        "receiver of master.lever": quanta == 0,
        "receiver of slave.lever": True,
        "network of lever": True,
    }
    after = recheck_run(found).certificate.after_run
    assert after.invalidated is (quanta == 1)
    said = " ".join(after.sentences)
    assert said.startswith("receiver of master.lever: supplied 1") is (quanta == 1)


def test_the_network_has_no_reserve() -> None:
    assert [one.passed for one in kept_of(run(network=-ENERGY_QUANTUM))] == [True, True, False]


def test_receivers_are_part_of_what_the_pair_may_owe() -> None:
    assert stated_debt(run(), "lever") == pytest.approx(0.75 + 2.0 * RESERVE, abs=1e-12)


def test_the_page_has_a_line_for_it() -> None:
    topics = [verdict.topic for verdict in verdicts(run())]
    assert topics[:3] == ["Tracking", "Link", "Energy books"]
