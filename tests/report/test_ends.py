"""What each end gave out in a run against its claim: kept, hit from outside, or broken."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave.config import resolved_yaml
from tautwave.couplings.wave.claim import claimed_joules
from tautwave.report.ends import End, ends_of
from tautwave.report.run.after_run import recheck_run
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import verdicts
from tautwave.rig import command_delays
from tautwave.session.reporting import final_code
from tests.certificate.rigs import rig

ROWS = 2000
CLAIM = 0.02
KEYS = yaml.safe_load(
    resolved_yaml(rig("master.axes.lever.velocity_limit=3", name="bench-1dof-2khz"))
)


def run(given: float, way: float, claim: float | None = CLAIM, **more: float) -> Run:
    """Return a run whose master gives evenly [J] while it moves evenly [rad per row]."""
    axis = "master.lever"
    damper, deviation = more.get("damper", 0.0), more.get("deviation", 0.0)
    rise = np.arange(ROWS) / (ROWS - 1)
    shaken = deviation * np.random.default_rng(1).standard_normal(ROWS)
    columns: Any = {
        f"{axis}.position": way * np.arange(ROWS) + shaken,
        f"{axis}.valid": np.ones(ROWS),
        f"{axis}.port_energy": -given * rise,
        f"{axis}.gross_flow": given * rise,
        "lever.port_master.absorbed": -given * rise,
        "lever.damper_master.absorbed": damper * rise,
        "skipped_slots": np.zeros(ROWS),
    }
    pairs = {"lever": {} if claim is None else {"claim_j": {"master": claim, "slave": claim}}}
    return Run(
        Path(), KEYS, "", {"pairs": pairs, "certificate": {"passed": False}}, tuple(columns), ROWS,
        whole=columns, time=np.arange(ROWS) / 2000.0,
    )  # fmt: skip


def only(found: Run) -> End:
    [end] = ends_of(found)
    return end


def test_a_kept_claim_needs_no_words() -> None:
    end = only(run(0.019, 1e-4))
    assert (end.passed, end.sentence, end.blow) == (True, "", 0.0)
    assert not list(ends_of(run(0.5, 1e-4, claim=None)))


def test_beyond_the_claim_exits_three_with_both_numbers() -> None:
    found = run(0.05, 1e-4)
    after = recheck_run(found)["certificate"]["after_run"]
    assert after["invalidated"]  # though nothing was certified
    assert final_code(0, invalidated=True, incomplete=False) == 3
    assert "gave out 50\u202fmJ, more than its claim of 20\u202fmJ" in after["sentences"][0]
    assert after["ends"]["master.lever"]["given_j"] == pytest.approx(0.05)


def test_a_blow_is_reported_and_is_no_part_of_the_claim() -> None:
    """Beyond the limit of 3 rad/s and all that the motor can have made of it in a period."""
    found = run(0.05, 6.0 / 2000.0)
    found.summary = recheck_run(found)
    after = found.summary["certificate"]["after_run"]
    assert not after["invalidated"]
    assert (
        "50\u202fmJ of it in a blow beyond its velocity limit; its claim is 20\u202fmJ"
        in after["notes"][0]
    )
    assert after["notes"][0] in verdicts(found)[-1].sentences
    assert only(run(0.05, 3.2 / 2000.0)).blow == 0.0  # its motor may have driven it


def test_the_damper_of_a_matched_end_is_part_of_it() -> None:
    found = run(0.05, 1e-4, damper=0.04)
    assert only(found).given == pytest.approx(0.01)


def test_claims_grow_with_the_time_that_a_run_takes() -> None:
    loaded = rig("duration_s=10", name="bench-1dof-2khz")
    longer = loaded.model_copy(update={"duration_s": 20.0})
    delays = command_delays(loaded)
    ten, twenty = (claimed_joules(one, "slave.lever", delays) for one in (loaded, longer))
    assert twenty > ten > 0.0


@pytest.mark.parametrize(
    ("times", "reported"), [(0.5, False), (1.0, False), (1.3, True), (2.0, True)]
)
def test_noise_beyond_the_declared_is_reported(times: float, reported: bool) -> None:
    """Whatever the lever does meanwhile: here it moves at 2 rad/s."""
    found = run(0.0, 1e-3, deviation=times * 9e-5)
    notes = recheck_run(found)["certificate"]["after_run"]["notes"]
    said = [note for note in notes if "times the declared (position_noise 9e-05)" in note]
    assert bool(said) == reported
    assert all(note.startswith("master.lever: its position noise is") for note in said)
