"""Laws in an account at two sites: credits, words and efforts over sockets, each with its books."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from tautwave.link.packet import Line
from tests.session.sites import Pair

GAINS = "stiffness: 8.0, damping: 0.05"
LAWS = {
    "position": GAINS,
    "position_force": f"{GAINS}, master_damping: 0.01",
    "four_channel": GAINS,
    "pd_damping": f"{GAINS}, injection: 0.05",
}


@contextmanager
def pair(law: str, *changes: str) -> Iterator[Pair]:
    keys = f"coupling={{law: {law}, account: {{}}, pairs: {{lever: {{{LAWS[law]}}}}}}}"
    two = Pair(keys, *changes)
    try:
        yield two
    finally:
        two.close()


def books_close(two: Pair) -> None:
    """Each site's to rounding, and no credit came that was not sent."""
    for half in (two.master, two.slave):
        assert half.residual() < 1e-12
    away = two.master["lever.credits.stored"] + two.slave["lever.credits.stored"]
    assert away.min() > -1e-12


@pytest.mark.sparse(4)
@pytest.mark.parametrize("law", LAWS)
def test_both_sites_follow_each_other_and_their_books_close(law: str) -> None:
    with pair(law) as two:
        two.run(700)
        one, other = two.master, two.slave
        assert np.ptp(one["master.lever.position"]) > 0.05
        apart = one["master.lever.position"][-200:] - other["slave.lever.position"][-200:]
        assert np.max(np.abs(apart)) < 0.05
        books_close(two)
        assert "lever.account_slave.stored" not in one.control.columns


def test_credit_goes_over_and_what_a_law_gives_at_the_slave_is_paid_by_the_master() -> None:
    """A reflected force takes at the master alone what its slave gives."""
    with pair("position_force") as two:
        two.run(700)
        assert two.master["lever.credits.stored"][-1] > 0.0
        assert two.slave["lever.credits.stored"][-1] < 0.0


@pytest.mark.sparse(2)
@pytest.mark.parametrize("kept", [0.05, 1.0])
def test_a_slave_that_keeps_little_gives_its_spring_back_to_the_master(kept: float) -> None:
    account = f"coupling.account={{kept: {kept}, tank: 2.0e-3, reserve: 1.0e-6}}"
    spring = "simulation.environment.lever={type: spring, position: 0.0, stiffness: 4}"
    with pair("position", account, spring) as two:
        two.run(900)
        one, other = (
            half.control.axes[half.control._own[0]].end.account for half in (two.master, two.slave)
        )
        assert other.taken > 0.0
        assert (other.sent > 0.0) == (one.taken > 0.0) == (kept < 1.0)
        assert one.taken <= other.sent
        books_close(two)


def test_a_silence_is_a_hold_and_the_session_goes_on() -> None:
    with pair("position") as two:
        two.run(400)
        two.run(200, cut=True)
        assert two.master.held
        assert two.slave.held
        two.run(300)
        assert not two.slave.held
        assert len(two.slave.control.sessions) == 1
        books_close(two)
        apart = two.master["master.lever.position"][-1] - two.slave["slave.lever.position"][-1]
        assert abs(apart) < 0.03


@pytest.mark.slow
def test_what_moved_too_far_in_a_silence_is_a_new_session_and_a_new_reserve() -> None:
    with pair("position", "sites.greatest_backlog=0.001") as two:
        two.run(400)
        two.run(200, cut=True)
        two.run(300)
        assert len(two.slave.control.sessions) == 2
        two.until(lambda: not two.slave.held)
        two.run(100)
        for half in (two.master, two.slave):
            assert half.residual() < 1e-12


def test_an_older_word_changes_nothing() -> None:
    with pair("position") as two:
        two.run(300)
        control = two.slave.control
        end, k, _ = control._ends[0]
        before, funds = end.network.heard, control.axes[control._own[0]].end.account.funds
        control._take(before - 5, [Line(2**50, 0, ((0, 0),))])
        assert end.network.heard == before
        assert control._site.owed(end, k, control.table, None, None) == 0.0
        two.run(1)
        assert control.axes[control._own[0]].end.account.funds == pytest.approx(funds, abs=1e-3)


@pytest.mark.slow
def test_a_model_crosses_in_scaled_and_turned_units() -> None:
    keys = f"{GAINS}, touch: 0.03, stiffest: 100, position_scale: 0.5, sign: -1"
    two = Pair(f"coupling={{law: mediated, account: {{}}, pairs: {{lever: {{{keys}}}}}}}")
    try:
        two.run(700)
        master, slave = two.master["master.lever.position"], two.slave["slave.lever.position"]
        assert np.ptp(master) > 0.05
        assert np.max(np.abs(master[-200:] + 2.0 * slave[-200:])) < 0.01
        books_close(two)
    finally:
        two.close()
