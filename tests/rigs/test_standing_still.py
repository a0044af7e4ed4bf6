"""What `check` says of a pair that stands still under an effort, against runs that do."""

from __future__ import annotations

import re

import pytest

from tautwave.config import Rig
from tautwave.couplings.wave.claim import held_share
from tautwave.rig import command_delays, standing_offset
from tautwave.session import check
from tautwave.session.facts import pair_facts, pair_sentence
from tests.certificate.rigs import rig
from tests.rigs.running import Run, pair_of, run_rig
from tests.rigs.test_wave_choices import first

PAIR = "coupling.pairs.lever"
QUIET = [
    f"{side}.axes.lever.{key}=0"
    for side in ("master", "slave")
    for key in ("encoder_quantum", "position_noise")
]
PRESSED = (
    *QUIET,
    "duration_s=2.5",
    "coupling.release_ramp_s=0",
    "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0.2, 0.0], [0.7, 0.2]]}",
)
"""The hand presses the slave into its wall until all rests."""

POLES = (f"{PAIR}.pole_master=0.3", f"{PAIR}.pole_slave=plain")
FILTER = (f"{PAIR}.wave_filter_hz=60",)
LATE = ("buses.bench.options={command_delay_s: 0.001}",)  # two periods
LINE = ("coupling.delay_s=0.01", "duration_s=8")
SCALED = (
    f"{PAIR}.position_scale=0.8",
    f"{PAIR}.force_scale=1.2",
    f"{PAIR}.sign=-1",
    "simulation.environment.lever.side=below",
    "simulation.environment.lever.position=-0.06",
)
FILTERED = ("master.axes.lever.velocity_filter_s=0.002", "slave.axes.lever.velocity_filter_s=0.004")


def pressed(*changes: str) -> tuple[Rig, Run]:
    loaded = rig(*PRESSED, *changes, name="bench-1dof-2khz")
    return loaded, run_rig(loaded)


def at_rest(run: Run) -> tuple[float, float, float]:
    """Return the coupling's effort on master and slave [N m] and the position error [rad]."""
    error = run["lever.position_error"]
    assert error[-1] == pytest.approx(error[-500], rel=1e-4), "it still moves"
    master, slave = (float(run[f"{side}.lever.port_effort"][-1]) for side in ("master", "slave"))
    assert master > 0.05
    return master, slave, float(error[-1])


@pytest.mark.sparse(8)
@pytest.mark.parametrize(
    ("changes", "exact"),
    [
        ((), 1e-9),
        (POLES, 1e-9),
        ((*LATE, *FILTER), 1e-9),
        (SCALED, 1e-9),
        (LINE, 1e-5),
        ((*LATE, *LINE, *POLES, *SCALED), 1e-5),
    ],
)
def test_a_wave_pair_stands_off_as_check_says(changes: tuple[str, ...], exact: float) -> None:
    loaded, run = pressed(*changes)
    delays = command_delays(loaded)
    facts = pair_facts(loaded, "lever", delays)
    master, slave, error = at_rest(run)
    ports = pair_of(run.assembly, "lever").axes
    # What an empty account could not send yet would be an offset of its own.
    assert min(state.end.account for _, state in ports.values()) > 0.0
    assert error == pytest.approx(master * facts.offset_per_effort, rel=exact)
    # One effort is on the line; each port gives all of it, a plain one its share.
    keys = loaded.coupling.pairs["lever"]
    felt = -keys.sign * slave / keys.effective_force_scale
    arriving = -ports["master"][0].end.port.root * float(run["master.lever.wave_in"][-1])
    shares = [held_share(loaded, "lever", side, delays) for side in ("master", "slave")]
    assert master == pytest.approx(shares[0] * arriving, rel=max(exact, 1e-6))
    assert felt == pytest.approx(shares[1] * arriving, rel=max(exact, 1e-6))
    assert facts.held_share == min(shares)
    assert (facts.held_share < 0.99) == ("plain" in " ".join(changes))


@pytest.mark.sparse(3)
@pytest.mark.parametrize("changes", [(), (*FILTERED, *SCALED), FILTERED])
def test_a_position_pair_is_as_stiff_as_check_says(changes: tuple[str, ...]) -> None:
    law = f"{PAIR}={{stiffness: 25.4, damping: 0.1}}"
    loaded, run = pressed("coupling.law=position", law, *changes)
    facts = pair_facts(loaded, "lever", command_delays(loaded))
    master, _, error = at_rest(run)
    acts = master / error
    assert facts.offset_per_effort == pytest.approx(1.0 / acts, rel=1e-9)
    assert facts.held_share == pytest.approx(acts / 25.4, rel=1e-9)
    assert (acts < 20.0) is (changes != ())
    said = pair_sentence(loaded, "lever", command_delays(loaded))
    assert said.endswith(f"held still, K = 25.4 N m/rad acts as {acts:.4g}")


@pytest.mark.slow
def test_check_says_what_the_standing_offset_is_made_of() -> None:
    """Three parts that add up to it, and the weight that halving it would double."""
    made = first(
        "coupling.delay_s=0.02", f"{PAIR}.wave_impedance=0.02", f"{PAIR}.wave_filter_hz=200"
    )
    text = dict(check(made).facts)["offset of lever"]
    words = re.findall(r"[0-9.]+(?= rad per| from sampling| from the wave)", text)
    parts = [float(word) for word in words]
    assert parts[0] == pytest.approx(0.02 / 0.02)
    assert parts[1] == pytest.approx(0.0005 / 0.02)
    delays = command_delays(made)
    assert sum(parts) == pytest.approx(standing_offset(made, "lever", delays), rel=1e-2)
    weight = 0.02 * 0.02 * standing_offset(made, "lever", delays)
    assert f"b tau = {weight:.2g} kg m^2, beside 0.0032 of the devices" in text
