"""Whole rigs that are certified, against passive users who are made to undo them.

Walls never give more than their device's damper took, ports never more than they claim. Walls of
1.3 times their limit break this: else it could not fail.
"""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tautwave.certificate import certify
from tests.certificate.adversaries import (
    HONEST,
    Account,
    Mischief,
    draw_rig,
    settle,
    with_users,
)
from tests.rigs.running import rig_of

pytestmark = pytest.mark.usefixtures("without_advice")

ROUNDING = 1e-9
DRAW = (Phase.explicit, Phase.generate)  # to shrink a whole rig takes a minute
CALM = settings(
    deadline=None, suppress_health_check=list(HealthCheck), derandomize=True, phases=DRAW
)
SEEDS = st.integers(0, 2**40)


def meet(seed: int, cycles: int, mischief: Mischief = HONEST, count: int = 8) -> list[Account]:
    """Simulate a rig with each of its users; empty if it is not certified.

    With mischief, the rig that runs is not the one that was certified.
    """
    honest, users = draw_rig(seed, cycles, count=count)
    certificate = certify(rig_of(with_users(honest, users[0])))
    if not certificate.verdicts["passive"].passed:
        return []
    data, users = draw_rig(seed, cycles, mischief, count)
    return [settle(rig_of(with_users(data, user)), certificate) for user in users]


def hold_rig(seed: int, cycles: int, count: int = 8) -> None:
    for account in meet(seed, cycles, count=count):
        assert account.wall <= ROUNDING
        assert account.port <= ROUNDING
        assert account.beyond <= ROUNDING


@settings(CALM, max_examples=2)
@given(SEEDS)
def test_no_user_draws_more_from_a_certified_rig_than_its_verdict_says(seed: int) -> None:
    hold_rig(seed, 400)


@pytest.mark.slow
@settings(CALM, max_examples=12)
@given(SEEDS)
def test_hundreds_of_certified_rigs(seed: int) -> None:
    hold_rig(seed, 400, count=12)


@pytest.mark.slow
@settings(CALM, max_examples=6)
@given(SEEDS)
def test_nothing_more_comes_with_time(seed: int) -> None:
    hold_rig(seed, 20_000)


@pytest.mark.slow
@pytest.mark.parametrize("quantum", [1e-6, 1e-4])
def test_encoder_steps_let_out_no_more_than_is_stated(quantum: float) -> None:
    for seed in range(8):
        data, users = draw_rig(seed, 1000, count=3)
        for side in ("master", "slave"):
            data[side]["axes"]["a"]["encoder_quantum"] = quantum
        certificate = certify(rig_of(with_users(data, users[0])))
        assert not certificate.verdicts["passive_quantised"].passed
        for user in users if certificate.verdicts["passive"].passed else ():
            assert settle(rig_of(with_users(data, user)), certificate).beyond <= ROUNDING
