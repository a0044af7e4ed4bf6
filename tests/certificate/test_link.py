"""Over a network: receivers are elements, no delay is assumed, and check adds up what to expect."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.certificate.loops import scattering_norm
from tautwave.errors import ConfigError
from tautwave.laws.receiver import RESERVE
from tautwave.rig import command_delays, line_delay, one_way_delay
from tautwave.session.checking import check
from tautwave.session.network import delay_budget
from tests.certificate.rigs import certified, element, rig

NAME = "network-loopback"


@pytest.mark.slow
def test_receivers_are_elements_with_their_reserve() -> None:
    certificate = certified(name=NAME)
    for side in ("master", "slave"):
        found = element(certificate, f"receiver of {side}.lever")
        assert found.passive.state == found.passive_quantised.state == "passed"
        assert found.numbers["reserve_j"] == RESERVE
    assert not [one for one in certificate.elements if one.kind == "line"]


@pytest.mark.parametrize("delay", [0.0, 0.01, 1.0])
def test_stability_is_that_of_any_delay(delay: float) -> None:
    certificate = certified(f"link.delay_s={delay}", name=NAME)
    found = certificate.verdicts["coupled_stable"]
    assert found.passed
    assert "for any delay" in certificate.loops[0].verdict.reason


def test_without_small_gain_nothing_is_claimed() -> None:
    """A pair that is stable at its own delay is not claimed at one that nobody knows."""
    ringing = [f"coupling.pairs.lever.{key}" for key in (
        "wave_filter_hz=null", "pole_master=plain", "pole_slave=plain", "wave_impedance=0.6"
    )]  # fmt: skip
    over = certified(*ringing, name=NAME)
    reason = over.loops[0].verdict.reason
    assert not over.loops[0].verdict.passed
    assert "no claim" in reason
    assert "the delay is unknown" in reason


def test_a_mode_that_waves_show_is_no_drift(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the position of a free device is let off: a gain above 1 is not."""
    monkeypatch.setattr("tautwave.certificate.loops.scattering_norm", lambda end: 1.0)
    assert not certified(name=NAME).verdicts["coupled_stable"].passed
    monkeypatch.setattr("tautwave.certificate.loops.scattering_norm", scattering_norm)
    assert certified(name=NAME).verdicts["coupled_stable"].passed


@pytest.mark.parametrize(
    ("changes", "way", "play_out"),
    [
        ((), 10, 10),
        (("link.depth_s=auto",), 10, 5),
        (("link.depth_s=auto", "link.jitter=exponential"), 10, 23),
        (("link.depth_s=auto", "link.deepest_s=0.002"), 10, 2),
        (("link.play_out=newest",), 12, 0),
        (("link.delay_s=0", "link.jitter_s=0", "link.depth_s=0"), 1, 0),
    ],
)
def test_the_delay_to_expect(changes: tuple[str, ...], way: int, play_out: int) -> None:
    found = line_delay(rig(*changes, name=NAME))
    assert found == (way, play_out, False)


@pytest.mark.parametrize("delay_s", [0.0, 0.004, 0.05])
def test_the_delay_of_a_constant_line_is_exact_and_all_on_the_way(delay_s: float) -> None:
    plain = rig(f"coupling.delay_s={delay_s}")
    assert line_delay(plain) == (round(delay_s / plain.period_s), 0, True)


def test_a_recorded_path_is_measured(tmp_path: Path) -> None:
    trace = tmp_path / "path.csv"
    delays = [0.004] * 95 + [0.012] * 5
    lines = [f"{0.01 * at},{delay},0" for at, delay in enumerate(delays)]
    trace.write_text("\n".join(["time_s,delay_s,lost", *lines, "9,0,1"]))
    found = line_delay(rig(f"link={{trace: {trace}}}", name=NAME))
    assert found == (4, 8, False)
    trace = tmp_path / "other.csv"
    trace.write_text("time_s,delay_s,lost\n0,x,0\n")
    spoilt = rig(f"link={{trace: {trace}}}", name=NAME)
    with pytest.raises(ConfigError, match=r"other\.csv:2: a line has three numbers"):
        line_delay(spoilt)


def test_the_budget_adds_up_to_the_delay_of_the_pair() -> None:
    loaded = rig("buses.arm.divisor=4", "link.lost_s=3", name=NAME)
    delays = command_delays(loaded)
    budget = delay_budget(loaded, "lever", delays)
    assert sum(budget.values()) == pytest.approx(one_way_delay(loaded, "lever", delays))
    assert budget["bus"] == pytest.approx(0.003)
    facts = dict(check(loaded).facts)
    assert facts["delay of lever"].startswith("26 ms each way = 1 sensing + 3 bus + 10 link + 10")
    assert "an outage of 0.5 s after 5 s" in facts["network"]
    assert "hold after 0.1 s without a packet, stop after 3 s" in facts["receivers"]


def test_what_a_site_reads_of_the_network_is_no_statement_about_the_real_one() -> None:
    words = dict(check(rig("sites.here=slave", name=NAME)).facts)["network"]
    assert words.startswith("the real network; delays assumed as in: 10 ms each way")
