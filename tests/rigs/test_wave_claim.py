"""What the claim of a wave port says of noise, against sums over explicit noise."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.analysis.claim import DEVIATIONS, Claim, stated_claim
from tautwave.certificate import Certificate
from tautwave.certificate.verdict import certify
from tautwave.config.keys.rig import CLAIMED_S, UNTIL_STOPPED_S
from tautwave.couplings.wave.claim import claim_of, claimed_joules
from tautwave.errors import ConfigError
from tautwave.models.noise_colour import LAGS, greatest_spectrum, spectrum
from tautwave.report.ends import End
from tautwave.rig import claim_verdict, command_delays
from tautwave.rig.claim_verdict import claim_hints
from tautwave.session.operating import claimed_span
from tautwave.simulation import simulate
from tautwave.types import CommandDelay
from tests.certificate.rigs import rig

NAME = "bench-1dof-2khz"
DELAYS = {f"{side}.lever": CommandDelay(0, 0.0) for side in ("master", "slave")}
WALLED = ("coupling.pairs.lever.wall_slave=null", "loop.overrun_limit=2")
MEAN_OF_MANY = tuple(1.0 - k / (LAGS + 1.0) for k in range(1, LAGS + 1))
"""Colour of the mean of 17 samples of white noise: the strongest that can be declared."""


SHORT = ("loop.overrun_limit=2", "loop.missing_limit=2")
STRONG = ("master.axes.lever.effort_limit=15", "master.axes.lever.effort_rate_limit=1e5")


def claim(*changes: str) -> Claim:
    loaded = rig("master.axes.lever.effort_rate_limit=10", *changes, name=NAME)
    found = claim_of(loaded, "master.lever", command_delays(loaded))
    assert isinstance(found, Claim)
    return found


def drawn(one: Claim, lags: tuple[float, ...], seconds: float) -> float:
    """Return DEVIATIONS of the sum of F_k (n[k+1] - n[k]) [J] while F goes to and fro."""
    step = one.rate * one.period
    turns = round(2.0 * one.effort / step)
    count = round(seconds / one.period)
    changes = np.where((np.arange(count) // turns) % 2 == 0, step, -step)
    filtered = np.convolve(changes, [*lags[::-1], 1.0, *lags], "same")
    return DEVIATIONS * one.deviation * float(np.sqrt(changes @ filtered))


@pytest.mark.parametrize(
    ("declared", "lags"),
    [
        ("[]", ()),
        ("[-0.4]", (-0.4,)),
        (str(list(MEAN_OF_MANY)), MEAN_OF_MANY),
        ("null", MEAN_OF_MANY),
    ],
    ids=["white", "blue", "slow", "undeclared"],
)
def test_coloured_noise_and_moving_efforts_feign_no_more_than_is_claimed(
    declared: str, lags: tuple[float, ...]
) -> None:
    """A slow colour draws the square root of its greatest spectrum more than white noise."""
    one = claim(f"master.axes.lever.position_noise_autocorrelation={declared}")
    seconds = 300.0
    claimed = one.true(seconds) - one.seen(seconds) - one.feigned * seconds - one.stopping
    error = one.deviation + 0.5 * one.quantum
    walked = claimed - 2.0 * DEVIATIONS * error * one.effort
    assert drawn(one, lags, seconds) <= walked
    if lags != (-0.4,):  # that one is strong where an effort cannot follow
        assert drawn(one, lags, seconds) > 0.9 * walked


@pytest.mark.parametrize("lags", [(), (0.5,), (-0.5,), (0.1, -0.3, 0.2), MEAN_OF_MANY])
def test_the_greatest_spectrum_is_none_that_is_exceeded(lags: tuple[float, ...]) -> None:
    found = max(spectrum(lags, theta) for theta in np.linspace(0.0, np.pi, 20001))
    assert found <= greatest_spectrum(lags) * (1.0 + 1e-12)
    assert greatest_spectrum(lags) < 1.03 * found
    assert greatest_spectrum(lags) <= greatest_spectrum(None) == LAGS + 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            ("loop.overrun_limit=40",),
            "4.1 times the kinetic energy at the velocity limit, most of it from "
            "loop.overrun_limit 40; with 26 it is 1.0 times",
        ),
        (
            ("loop.overrun_limit=2", "loop.missing_limit=60"),
            "most of it from loop.missing_limit 60; with 29 it is 1.0",
        ),
        (
            (
                *SHORT,
                "master.axes.lever.effort_limit=15",
                "master.axes.lever.effort_rate_limit=1e5",
            ),
            "; lower effort_limit",
        ),
        ((*SHORT, "master.axes.lever.effort_rate_limit=20"), "; raise effort_rate_limit"),
    ],
    ids=["stalls", "samples", "effort", "ramp"],
)
def test_a_stall_above_the_kinetic_energy_has_a_hint_which_key_lowers_it(
    changes: tuple[str, ...], said: str
) -> None:
    loaded = rig(*changes, name=NAME)
    texts = [text for _, text in claim_hints(loaded, command_delays(loaded))]
    assert any(said in text for text in texts), texts


@pytest.mark.parametrize("key", ["overrun_limit", "missing_limit"])
@pytest.mark.parametrize("limit", [40, 5000])
def test_the_limit_of_a_hint_is_the_greatest_that_helps_and_is_searched(
    key: str, limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of five thousand was tried: 17 s of check."""
    others = ("loop.overrun_limit=2", "loop.missing_limit=2")

    def stall(value: int) -> float:
        loaded = rig(*others, f"loop.{key}={value}", name=NAME)
        claims = (claim_of(loaded, axis, command_delays(loaded)) for axis in loaded.axes)
        return max(one.let_go / one.kinetic for one in claims if isinstance(one, Claim))

    tried: list[str] = []
    terms = claim_verdict.terms_of
    monkeypatch.setattr(claim_verdict, "terms_of", lambda *of: (tried.append(of[1]), terms(*of))[1])
    loaded = rig(*others, f"loop.{key}={limit}", name=NAME)
    [hint] = claim_hints(loaded, command_delays(loaded))
    named, _, value = str(hint.change).partition("=")
    assert named == f"loop.{key}"
    assert stall(int(value)) <= 1.0 < stall(int(value) + 1)
    assert len(tried) < 40


def test_what_an_end_may_supply_is_computed_once_for_a_rig() -> None:
    loaded = rig(name=NAME)
    delays = command_delays(loaded)
    assert claim_of(loaded, "master.lever", delays) is claim_of(loaded, "master.lever", delays)
    other = rig("loop.missing_limit=4", name=NAME)
    assert claim_of(other, "master.lever", delays) != claim_of(loaded, "master.lever", delays)


@pytest.mark.parametrize("changes", [(), SHORT])
def test_a_stall_below_the_kinetic_energy_has_no_hint(changes: tuple[str, ...]) -> None:
    loaded = rig(*changes, name=NAME)
    assert not list(claim_hints(loaded, command_delays(loaded)))


def test_a_host_may_stall_for_20_ms_where_no_limit_is_stated() -> None:
    rates = {2000: 40, 500: 10, 50: 2}
    for rate, slots in rates.items():
        changes = ("loop={}", f"rate_hz={rate}", "coupling.pairs.lever.wave_filter_hz=5")
        assert rig(*changes, name=NAME).overrun_limit == slots
    assert rig("loop.overrun_limit=7", name=NAME).overrun_limit == 7


def test_a_run_without_an_end_claims_by_the_hour() -> None:
    """Reserve and what acts unseen once an engagement, the leak for an hour, not for a day."""
    endless = rig(f"duration_s={UNTIL_STOPPED_S}", name=NAME)
    one = claim()
    assert endless.claimed_s == CLAIMED_S == 3600.0
    assert claimed_span(endless, 10) == 3600.0
    assert claimed_span(endless, round(3601.0 / endless.period_s)) == 7200.0
    hour = claimed_joules(endless, "master.lever", command_delays(endless))
    free = rig(name=NAME)
    own = claim_of(free, "master.lever", command_delays(free))
    assert isinstance(own, Claim)
    assert hour == pytest.approx(2.0 * own.reserve + own.under_way + 3600.0 * own.leak)
    assert claimed_span(free, 10) == free.duration_s
    assert one.leak == own.leak


def test_limits_that_bound_nothing_are_refused() -> None:
    changes = [
        f"{side}.axes.lever.{key}=1e15"
        for side in ("master", "slave")
        for key in ("effort_limit", "effort_rate_limit")
    ]
    found = certify(rig(*changes, name=NAME))
    assert all("at once while the host is prompt" in why for why in found.sentences())
    assert not found.passed
    [weaker] = {why.split("effort_limit of ")[1].split()[0] for why in found.sentences()}
    changes += [f"{side}.axes.lever.effort_limit={weaker}" for side in ("master", "slave")]
    left = certify(rig(*changes, name=NAME)).sentences()
    assert not any("at once" in why for why in left)  # what it names has been tried


def test_what_a_refused_prompt_claim_names_is_enough() -> None:
    changes = [f"{side}.axes.lever.effort_rate_limit=0.5" for side in ("master", "slave")]
    loaded = rig(*changes, *WALLED, name="bench-1dof-loopback")
    found = certify(loaded).sentences()
    [enough] = {why.split("effort_rate_limit of ")[1].split()[0] for why in found}
    changes = [f"{side}.axes.lever.effort_rate_limit={enough}" for side in ("master", "slave")]
    assert not [
        why
        for why in certify(rig(*changes, *WALLED, name="bench-1dof-loopback")).sentences()
        if "at once" in why
    ]


@pytest.mark.parametrize("changes", [("loop.overrun_limit=100000",), ("loop.missing_limit=90000",)])
def test_what_a_refused_stall_names_is_enough(changes: tuple[str, ...]) -> None:
    """Half of what is left is no longer refused; end stops are the other way."""
    loaded = rig(*changes, name=NAME)
    found = certify(loaded).sentences()
    assert len(found) == 2
    for why in found:
        assert "in one stall of" in why
        assert ", or give mechanical_range" in why
    key, value = found[0].split("; lower loop.")[1].split(",")[0].split(" to ")
    assert certify(rig(*changes, f"loop.{key}={value}", name=NAME)).passed
    stops = [f"{side}.axes.lever.mechanical_range=[-1,1]" for side in ("master", "slave")]
    stopped = certify(rig(*changes, *stops, name=NAME))
    assert stopped.passed
    assert any("the host never stalls for more than" in one for one in conditions(stopped))


def conditions(certificate: Certificate) -> list[str]:
    return [one for element in certificate.elements for one in element.passive.conditions]


def test_a_claim_between_passed_and_refused_depends_on_the_host() -> None:
    """In words, and with a stall that short it is what the device has at its velocity limit."""
    found = certify(rig("loop.overrun_limit=40", name=NAME))
    [said] = {one for one in conditions(found) if "master.lever may supply" in one}
    assert said.startswith("the host never stalls for more than 7 ms")
    free = claim_of(rig("loop.overrun_limit=40", name=NAME), "master.lever", DELAYS)
    assert isinstance(free, Claim)
    assert free.held(14.0) <= free.kinetic < free.held(15.0)  # periods of 0.5 ms


def test_noise_that_comes_in_for_an_hour_is_a_condition_and_no_refusal() -> None:
    found = certify(rig(f"duration_s={UNTIL_STOPPED_S}", name="bench-1dof-2khz-noisy"))
    assert any("its noise and effort steps leak" in one for one in conditions(found))


def test_a_forced_run_without_limits_names_every_side() -> None:
    changes = [f"{side}.axes.lever.velocity_limit=null" for side in ("master", "slave")]
    with pytest.raises(ConfigError, match=r"master's axis(.|\n)*slave's axis"):
        simulate(rig(*changes, name=NAME), engine="python")


@pytest.mark.parametrize(
    ("delay_s", "why"), [(0.0085, "17 periods late, and the proof covers up to 16"), (1.0, "")]
)
def test_commands_that_act_too_late(delay_s: float, why: str) -> None:
    """They were tried for minutes."""
    late = rig(f"buses.bench.options={{command_delay_s: {delay_s}}}", name=NAME)
    if why:
        assert all(why in one for one in certify(late).sentences())
    else:
        with pytest.raises(ConfigError, match="2000 periods late, and more than 20"):
            certify(late)


PLAIN = Claim(
    reserve=2.0, leak=0.5, feigned=0.25, effort=3.0, rate=6.0, velocity=4.0, period=0.5,
    blind=2.0, mass=8.0, deviation=0.0, peak=1.0, quantum=0.0, nonlinearity=0.0, stop_damping=0.0,
    release=1.0, kinetic=64.0,
)  # fmt: skip


def test_the_terms_are_those_of_the_docstring() -> None:
    """By hand: efforts act unseen for 2 * 0.5 + 3 / (2 * 6) = 1.25 s."""
    moved = 4.0 * 1.25 + 0.5 * 3.0 * 1.25**2 / 8.0
    assert PLAIN.under_way == pytest.approx(3.0 * moved, rel=1e-15)
    assert PLAIN.seen(10.0) == pytest.approx(4.0 + 3.0 * moved + 5.0, rel=1e-15)
    assert PLAIN.true(10.0) == pytest.approx(PLAIN.seen(10.0) + 2.5, rel=1e-15)
    walled = PLAIN._replace(owed=5.0)
    assert walled.seen(10.0) == pytest.approx(PLAIN.seen(10.0) + 5.0, rel=1e-15)
    stopped = PLAIN._replace(travel=2.0)
    assert stopped.under_way == 6.0
    pressing = PLAIN._replace(spring=7.0)
    assert pressing.under_way == pytest.approx(3.0 * moved + 3.5 * 5.0**2, rel=1e-15)


@pytest.mark.parametrize("kinetic", [1e-9, 1.0, 64.0])
@pytest.mark.parametrize("blind", [0.0, 1.0, 2.0, 9.0])
def test_a_host_that_misses_nothing_does_not_stall(kinetic: float, blind: float) -> None:
    """However little a device has at its velocity limit: one period between samples is no gap."""
    claim = PLAIN._replace(kinetic=kinetic, blind=blind)
    end = End("master.a", 0.0, 0.0, 1.0, 1.0, None, 0.5, stated_claim(claim, 1.0, None))
    assert end.stalled in {None, False}
    assert end.sentence == ""
    late = end._replace(gap_s=claim.safe_gap() + 0.5)
    assert late.stalled is (None if end.stalled is None else True)


def test_a_stop_whose_damping_acts_on_noise_claims_its_power() -> None:
    noisy = PLAIN._replace(deviation=0.1, quantum=0.2, stop_damping=0.3)
    still = noisy._replace(stop_damping=0.0)
    power = 4.0 * 0.3 * (0.1**2 + 0.25 * 0.2**2) / 0.5**2
    assert noisy.true(10.0) - still.true(10.0) == pytest.approx(power * 1.0, rel=1e-12)
    assert noisy.seen(10.0) == still.seen(10.0)


STALLED = (
    "seed=195", "loop.overrun_limit=20", "coupling.delay_s=0",
    "coupling.pairs.lever.wave_impedance=0.2",
    "slave.axes.lever.environment_stiffness_upper=243",
    "simulation.environment.lever={type: spring, stiffness: 243, position: 0}",
    "simulation.hand.lever.reference={type: multisine, ramp_s: 0.05, "
    "components: [[7.0, 0.240934, 0]]}",
    "simulation.faults.overrun_probability=0.01", "simulation.faults.overrun_slots=19",
)  # fmt: skip


def test_a_host_that_stalls_may_press_a_drive_into_a_spring() -> None:
    """A drive that takes velocity goes on with it: 1.28 J of the spring came back, of 465 mJ."""
    loaded = rig(*STALLED, name="bench-admittance-loopback")
    rows = simulate(loaded, duration_s=0.5, engine="python")
    given = float((-rows["slave.lever.port_energy"]).max())
    assert 1.0 < given < claimed_joules(loaded, "slave.lever", command_delays(loaded))
