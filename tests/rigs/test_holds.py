"""A press of a minute under every law: whoever lets go says so."""

from __future__ import annotations

import pytest

from tautwave.simulation import simulate
from tests.rigs.holds import LAWS, cases, lets_go_unsaid

pytest.importorskip("numba")
pytestmark = [pytest.mark.slow, pytest.mark.long, pytest.mark.timeout(900)]


@pytest.mark.parametrize("law", [law for law in LAWS if law.endswith("account") or law == "wave"])
def test_nothing_lets_go_unsaid(law: str) -> None:
    for case in cases([law]):
        run = simulate(case.rig, engine="compiled")
        assert not lets_go_unsaid(run), case
