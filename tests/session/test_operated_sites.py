"""Two sites of an operated rig: what people do at either is done at both."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from tests.session.sites import Half, Pair

Make = Callable[..., Pair]
OPERATE = "operate={}"
FREE = "simulation.environment.lever={type: free}"


@pytest.fixture
def pair() -> Iterator[Make]:
    with ExitStack() as stack:

        def make(*changes: str) -> Pair:
            made = Pair(OPERATE, FREE, *changes)
            stack.callback(made.close)
            return made

        yield make


def both(two: Pair, state: str) -> Callable[[], bool]:
    return lambda: two.master.state == two.slave.state == state


def engage(two: Pair, by: Half) -> None:
    by.ask("engage")
    two.run(1)
    two.until(both(two, "engaged"))
    two.run(300)


def test_commands_of_either_site_are_done_at_both(pair: Make) -> None:
    two = pair()
    two.run(50)
    assert both(two, "idle")()
    assert len(two.used) == 1
    for at, by in enumerate((two.master, two.slave), 1):
        engage(two, by)
        other = two.slave if by is two.master else two.master
        by.ask("clutch")
        two.run(1)
        assert by.state == "clutched"  # at once
        two.run(3)
        assert other.state == "clutched"
        assert len(two.used) == at + 1
        two.run(200)
    for half in (two.master, two.slave):
        assert half.control.journal.engagements == 2
        assert half.residual() < 1e-9
        print([(e.at_s, e.word, e.source, e.state, e.text) for e in half.control.journal.entries])
    assert np.ptp(two.slave["slave.lever.position"]) > 0.01
