"""What `check` says of an encoder: too coarse or too noisy for its port, or not linear."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.analysis.claim import Claim
from tautwave.certificate import certify
from tautwave.couplings.wave.claim import claim_of
from tautwave.couplings.wave.messages import noise_hints
from tautwave.rig import command_delays
from tautwave.session.facts import coupling_messages
from tests.certificate.rigs import element, rig

NAME = "bench-1dof-2khz"
BOTH = ("master", "slave")


def hints(*changes: str) -> list[tuple[str, str]]:
    loaded = rig(*changes, "coupling.pairs.lever.pole_slave=0.5", name=NAME)
    delays = command_delays(loaded)
    return [found for found in noise_hints(loaded, delays) if "slave" in found[0]]


def test_a_bench_with_a_fine_encoder_gets_no_hint() -> None:
    assert hints() == []


def test_a_step_that_is_felt_names_the_impedance_that_hides_it() -> None:
    """G q of b (l2 + l3/2) q / T = 0.05 * 0.625 * 2e-3 / 5e-4: 11 % of 1.125 N m."""
    [(where, text), (_, more)] = hints("slave.axes.lever.encoder_quantum=2.0e-3")
    assert where == "hint on slave.lever"
    assert "changes the effort by 11% of effort_limit" in text
    assert "wave_impedance up to 0.046" in text
    assert "drain" in more  # what a step costs of the claim
    assert "identify" not in more  # its noise matters little beside the step
    softer = ("slave.axes.lever.encoder_quantum=2.0e-3", "coupling.pairs.lever.wave_impedance=0.04")
    assert hints(*softer) == []


def test_noise_that_costs_much_of_the_claim_is_said_with_the_remedy() -> None:
    loud = "slave.axes.lever.position_noise=9.0e-4"
    [(_, text)] = hints(loud)
    assert "1.9% of what the motor can supply" in text
    assert "identify --noise" in text
    [(_, known)] = hints(loud, "slave.axes.lever.position_noise_autocorrelation=[]")
    assert "identify" not in known  # its colour is declared
    assert hints("slave.axes.lever.position_noise=6.0e-4") == []


def test_check_prints_the_hints() -> None:
    loaded = rig("slave.axes.lever.encoder_quantum=2.0e-3", name=NAME)
    said = dict(coupling_messages(loaded).facts(loaded, command_delays(loaded)))
    assert "hint on slave.lever" in said


SHARE = 0.02


def bench_claim() -> Claim:
    loaded = rig(f"slave.axes.lever.encoder_nonlinearity={SHARE}", name=NAME)
    claim = claim_of(loaded, "slave.lever", command_delays(loaded))
    assert isinstance(claim, Claim)
    return claim


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-SHARE, SHARE)), min_size=1)
)
def test_a_nonlinear_encoder_hides_no_more_than_is_stated(
    periods: list[tuple[float, float, float]],
) -> None:
    """Whatever it makes of each displacement; all of it where it always errs to one side."""
    claim = CLAIM
    for errs in (
        [e for _, _, e in periods],
        [-SHARE if f * x > 0 else SHARE for f, x, _ in periods],
    ):
        true = sum(f * x for f, x, _ in periods)
        seen = sum(f * x * (1.0 + e) for (f, x, _), e in zip(periods, errs, strict=True))
        passed = sum(abs(f * x) * (1.0 + e) for (f, x, _), e in zip(periods, errs, strict=True))
        assert abs(seen - true) <= claim.hidden(passed) + 1e-12


@pytest.mark.slow
def test_what_a_nonlinear_encoder_hides_is_stated_apart() -> None:
    loaded = rig(f"slave.axes.lever.encoder_nonlinearity={SHARE}", name=NAME)
    sentences = element(certify(loaded), "slave.lever port").sentences
    [said] = [text for text in sentences if "nonlinearity" in text]
    assert "2.04 %" in said
    assert CLAIM.hidden(1.0) == pytest.approx(SHARE / (1.0 - SHARE))
    plain = claim_of(rig(name=NAME), "slave.lever", command_delays(rig(name=NAME)))
    assert isinstance(plain, Claim)
    assert CLAIM.seen(60.0) == plain.seen(60.0)


CLAIM = bench_claim()
