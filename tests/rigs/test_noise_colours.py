"""Encoder noise of every colour: a held force stays, at any command delay, declared or not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.claim import Claim
from tautwave.couplings.wave.claim import claim_of
from tautwave.errors import SafetyStop
from tautwave.rig import command_delays
from tautwave.simulation import simulate
from tests.certificate.rigs import rig

pytest.importorskip("numba")

NAME = "bench-1dof-2khz"
PAIR = "coupling.pairs.lever"
LAGS = range(1, 65)
COLOURS: dict[str, list[float]] = {
    "white": [],
    "two-sample mean": [0.5],
    "MA(-.5)": [-0.4],
    # Where the drain of a held lever is greatest: at half the rate without command delay, at a
    # quarter with a period of it, and at a sixth (or half) with two.
    "narrow, sixth": [0.97**k * math.cos(1.0 * k) * (1.0 - k / 65.0) for k in LAGS],
    "narrow, quarter": [0.97**k * math.cos(1.5 * k) * (1.0 - k / 65.0) for k in LAGS],
    "narrow, half": [0.97**k * math.cos(3.0 * k) * (1.0 - k / 65.0) for k in LAGS],
}


def measured(lags: list[float]) -> list[float]:
    """As `identify --noise` writes them: sixteen, tapered."""
    return [value * (1.0 - lag / 17.0) for lag, value in enumerate(lags[:16], 1)]


def held(colour: str, delay: int, *changes: str, seconds: float):
    """A hand that presses a tenth of the effort limit into a wall of 250 N m/rad, no friction."""
    press = "{type: minimum_jerk, waypoints: [[0.2, 0.0], [0.7, 0.1176]]}"
    given = [f"simulation.hand.lever.reference={press}", f"duration_s={seconds}"]
    for side in ("master", "slave"):
        truth = f"simulation.axes.{side}.lever"
        given += [
            f"{truth}.coulomb=0",
            f"{truth}.position_noise_autocorrelation={COLOURS[colour]}",
            f"{PAIR}.pole_{side}=0.5",
        ]
    options = f"buses.bench.options={{command_delay_s: {5e-4 * delay}}}"
    loaded = rig(*given, options, *changes, name=NAME)
    return loaded, simulate(loaded, engine="compiled")


def declared(colour: str) -> list[str]:
    lags = measured(COLOURS[colour])
    return [f"{s}.axes.lever.position_noise_autocorrelation={lags}" for s in ("master", "slave")]


@pytest.mark.slow
@pytest.mark.parametrize("known", [False, True], ids=["unknown", "declared"])
@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("colour", COLOURS)
def test_a_minute_of_holding_cuts_no_wave(colour: str, delay: int, known: bool) -> None:
    loaded, run = held(colour, delay, *(declared(colour) if known else ()), seconds=60.0)
    assert run.error is None

    def late(column: str) -> np.ndarray:
        return run.data[8000:-1000, run.columns.index(column)]

    error = late("lever.position_error")
    tenth = len(error) // 10
    assert abs(np.mean(error[-tenth:]) - np.mean(error[:tenth])) < 1e-4
    for side in ("master", "slave"):
        claim = claim_of(loaded, f"{side}.lever", command_delays(loaded))
        assert isinstance(claim, Claim)
        waves = np.mean(late(f"{side}.lever.wave_out") - late(f"{side}.lever.wave_in"))
        line = math.sqrt(loaded.coupling.pairs["lever"].wave_impedance / 2.0) * waves
        assert np.mean(late(f"{side}.lever.port_effort")) / line == pytest.approx(1.0, abs=5e-3)
        # A wave is cut where the tank is empty, and that is a reserve below what is recorded.
        assert late(f"lever.port_{side}.stored").min() > -0.5 * claim.reserve
    assert abs(np.mean(late("slave.lever.port_effort"))) == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
def test_another_colour_than_the_declared_ends_the_run_instead_of_the_force() -> None:
    """At one period of delay noise at half the rate takes next to nothing, at a quarter most."""
    loud = [f"{side}.axes.lever.position_noise=1.5e-4" for side in ("master", "slave")]
    for true, lost in (("narrow, half", False), ("narrow, quarter", True)):
        _, run = held(true, 1, *declared("narrow, half"), *loud, seconds=30.0)
        assert isinstance(run.error, SafetyStop) is lost
    assert "lost its coupling" in str(run.error)
    assert "of another colour" in str(run.error)
