"""What each end gave out in a run against its claim: kept, hit from outside, or broken."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave.analysis.claim import Stated
from tautwave.cli.terminal.show import plain
from tautwave.cli.terminal.summary import summary_sections
from tautwave.config import resolved_yaml
from tautwave.couplings.wave.claim import claimed_joules
from tautwave.report.claims import blows_of, exceeds
from tautwave.report.ends import End, ends_of
from tautwave.report.noise import measured_deviation
from tautwave.report.run.after_run import recheck_run
from tautwave.report.run.rundir import Run
from tautwave.report.run.tables import claim_table
from tautwave.report.run.verdicts import verdicts
from tautwave.rig import command_delays
from tautwave.session.reporting import final_code
from tautwave.summary import summary_of
from tautwave.summary.model import Motors
from tautwave.tables import BAD, GOOD, Cell
from tests.certificate.rigs import rig
from tests.report.rows_of import put

ROWS = 2000
CLAIM = 0.02
KEYS = yaml.safe_load(
    resolved_yaml(rig("master.axes.lever.velocity_limit=3", name="bench-1dof-2khz-noisy"))
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
        Path(), KEYS, "", summary_of({"pairs": pairs, "certificate": {"passed": False}})[0],
        tuple(columns), ROWS, whole=columns, time=np.arange(ROWS) / 2000.0,
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
    after = recheck_run(found).certificate.after_run
    assert after.invalidated  # though nothing was certified
    assert final_code(0, invalidated=True, incomplete=False) == 3
    assert "supplied 50\u202fmJ, more than its claim of 20\u202fmJ" in after.sentences[0]
    assert after.ends["master.lever"].given_j == pytest.approx(0.05)


def test_a_blow_is_reported_and_is_no_part_of_the_claim() -> None:
    """Beyond the limit of 3 rad/s and all that the motor can have made of it in a period."""
    found = run(0.05, 6.0 / 2000.0)
    found.result = recheck_run(found)
    after = found.result.certificate.after_run
    assert not after.invalidated
    assert (
        "50\u202fmJ of it in an impact beyond its velocity limit; its claim is 20\u202fmJ"
        in after.notes[0]
    )
    assert after.notes[0] in verdicts(found)[-1].sentences
    assert only(run(0.05, 3.2 / 2000.0)).blow == 0.0  # its motor may have driven it


def reported(given: float, way: float, true: float | None = 0.03) -> Run:
    """Return a judged run, its claim of true energy as the certificate has it."""
    found = run(given, way)
    put(found, {
        "certificate": {"elements": {"master.lever port": {"true_j": true}}},
        "energy_j": {"motors_net": given, "gross_flow": 1.0, "residual": 0.0},
    })  # fmt: skip
    found.result = recheck_run(found)
    return found


@pytest.mark.parametrize(
    ("given", "way", "row", "line", "status"),
    [
        (
            0.019, 1e-4, ("20 mJ", "30 mJ", "19 mJ", "none", "kept"),
            "master.lever supplied 19 mJ of the 20 mJ that it claims", "ok",
        ),
        (
            0.05, 1e-4, ("20 mJ", "30 mJ", "50 mJ", "none", "not kept"),
            "master.lever supplied 50 mJ, and claims 20 mJ", "bad",
        ),
        (
            0.05, 6.0 / 2000.0, ("20 mJ", "30 mJ", "50 mJ", "50 mJ", "kept"),
            "master.lever supplied 0 J of the 20 mJ that it claims; "
            "master.lever 50 mJ more in an external impact", "ok",
        ),
    ],
    ids=["kept", "broken", "hit"],
)  # fmt: skip
def test_report_and_terminal_show_claim_and_judgement(
    given: float, way: float, row: tuple[str, ...], line: str, status: str
) -> None:
    found = reported(given, way)
    [cells] = claim_table(found).rows
    assert tuple(plain(cell) for cell in cells) == ("master.lever", *row)
    [books] = [one for one in verdicts(found) if one.topic == "Energy books"]
    assert books.status == status
    assert any(plain(line) in plain(sentence) for sentence in books.sentences)
    [section] = [
        one
        for one in summary_sections("rig", found.result, Path(), 0)
        if one.title == "Energy books"
    ]
    [shown] = [one for one in section.rows if one[0] == "claims of the ports"]
    assert shown[1] == (Cell("not kept", BAD) if status == "bad" else Cell("kept", GOOD))
    assert plain(str(shown[2])) == line


def test_a_blow_does_not_count_as_what_the_motors_may_not_deliver() -> None:
    found = reported(0.05, 6.0 / 2000.0)
    assert blows_of(found.result, "lever") == pytest.approx(0.05)
    motors = Motors(worst=0.06, stated_debt=0.04)
    assert exceeds(motors, 0.0)
    assert not exceeds(motors, 0.0, blows_of(found.result, "lever"))


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
    notes = recheck_run(found).certificate.after_run.notes
    said = [note for note in notes if "times the declared (position_noise 9e-05)" in note]
    assert bool(said) == reported
    assert all(note.startswith("master.lever: its position noise is") for note in said)


AXIS = "master.lever"


def shaken(rows: int, keys: dict[str, Any], slow: float = 1e-4) -> float | None:
    """Of a lever that alternates by `slow` [rad] but for one window; `rows` of it are valid."""
    found = run(0.0, 0.0)
    assert found.whole is not None
    columns: Any = found.whole
    amplitude = np.full(ROWS, slow)
    amplitude[810:990] = 0.1
    columns[f"{AXIS}.position"][:] = amplitude * (-1.0) ** np.arange(ROWS)
    columns[f"{AXIS}.valid"][rows:] = 0.0
    return measured_deviation(found, AXIS, keys)


@pytest.mark.parametrize(
    ("quantum", "colour", "variance"),
    [
        (0.0, (), 64.0 / 20.0),
        (1e-4, (), 48.0 / 20.0),
        (1.9e-4, (), (64.0 - 16.0 * 3.61) / 20.0),
        (2.1e-4, (), 0.0),
        (0.0, (0.5, 0.1, 0.05), 64.0 / 6.1),
        (0.0, (0.5,), 64.0 / 5.0),
        (0.0, (0.9,), 0.0),  # no noise is so
    ],
)
def test_noise_is_of_third_differences_beyond_the_step_of_the_encoder(
    quantum: float, colour: tuple[float, ...], variance: float
) -> None:
    """One whose third differences are eight times its amplitude, 1e-4."""
    keys = {"encoder_quantum": quantum, "position_noise_autocorrelation": colour}
    assert shaken(ROWS, keys) == pytest.approx(1e-4 * np.sqrt(variance), rel=1e-9)


@pytest.mark.parametrize("hz", [0.1, 0.5])
def test_a_smooth_motion_is_no_noise_and_hides_none(hz: float) -> None:
    """At 100 Hz, by an encoder without a step: third differences alone would see 57 urad."""
    found = run(0.0, 0.0)
    columns: Any = found.whole
    motion = 0.4 * np.sin(2.0 * np.pi * hz * 0.01 * np.arange(ROWS))
    columns[f"{AXIS}.position"][:] = motion
    smooth = measured_deviation(found, AXIS, {})
    assert smooth is not None
    assert smooth < 1e-6 * (10.0 * hz) ** 5
    noise = np.random.default_rng(5).normal(0.0, 2e-5, ROWS)
    columns[f"{AXIS}.position"][:] = motion + noise
    assert measured_deviation(found, AXIS, {}) == pytest.approx(2e-5, rel=0.12)


def test_noise_needs_two_windows() -> None:
    assert shaken(402, {}) is None
    assert shaken(403, {}) == pytest.approx(1e-4 * np.sqrt(3.2))


def test_lost_samples_are_no_noise() -> None:
    """Across a gap the lever has moved twice as far: 1 mrad more, of 90 urad of noise."""
    found = run(0.0, 1e-3, deviation=9e-5)
    assert found.whole is not None
    columns: Any = found.whole
    columns["master.lever.valid"][::40] = 0.0
    columns["master.lever.position"][::40] = np.nan
    assert not [note for note in recheck_run(found).certificate.after_run.notes
                if "times the declared" in note]  # fmt: skip


def stalling(seconds: int, given: float, leak: float = 1e-3) -> Run:
    """Return a run of 20 s at 100 Hz whose master gives evenly [J] in its first seconds."""
    found = run(0.0, 0.0, claim=1.0)
    time = 0.01 * np.arange(ROWS)
    taken = -given * np.minimum(time, seconds) / 20.0
    columns: Any = dict(found.whole or {})
    columns["lever.port_master.absorbed"] = taken
    port = {"master.lever port": {"reserve_j": 0.01, "leak_w": leak}}
    put(found, {"certificate": {"elements": port}})
    found.whole, found.time = columns, time
    return found


@pytest.mark.parametrize(
    ("seconds", "given", "leak", "passed"),
    [
        (20, 0.5, 1e-3, False),  # a buzz: half of what is claimed for a stall, again and again
        (20, 0.5, 2.6e-2, True),  # all of it its leak
        (4, 0.5, 1e-3, True),  # a bad moment
        (6, 0.5, 1e-3, False),
        (20, 0.019, 1e-3, True),  # within reserve and leak
    ],
)
def test_a_claim_for_a_stall_is_not_for_what_goes_on(
    seconds: int, given: float, leak: float, passed: bool
) -> None:
    end = only(stalling(seconds, given, leak))
    assert end.given < end.claim
    assert end.passed == passed
    if not passed:
        assert "which is for a stall; it went on supplying" in end.sentence
        share = round(100.0 * seconds / 20)
        assert abs(share - int(end.sentence.rpartition("in ")[2].split()[0])) <= 5


STATED = Stated(
    claim_j=CLAIM, prompt_j=0.004, stall_j=0.016, let_go_j=0.016, dead_j=None, kinetic_j=0.008,
    gap_s=0.02, safe_gap_s=0.007,
)  # fmt: skip
"""A claim of 20 mJ that is conditional: a stall gives up to twice what the device has."""


def stalled(given: float, slots: int, stated: Stated = STATED) -> Run:
    """Return a run with one gap of so many slots of 0.5 ms."""
    found = run(given, 1e-4)
    found.whole["skipped_slots"][ROWS // 2] = slots - 1
    put(found, {"pairs": {"lever": {"claims": {"master": stated._asdict()}}}})
    return found


@pytest.mark.parametrize(
    ("given", "slots", "passed", "said"),
    [
        (0.0115, 14, True, ""),
        (0.0115, 20, True, "had no sample for 10\u202fms, and its certificate assumes at most"),
        (0.0125, 14, True, ""),
        (0.0125, 20, False, "more than the 12\u202fmJ claimed without a stall: it had no sample"),
        (0.0205, 14, False, "more than its claim of 20\u202fmJ"),
        (0.0205, 20, False, "more than its claim of 20\u202fmJ"),
    ],
)
def test_the_longest_gap_judges_the_condition_on_the_host(
    given: float, slots: int, passed: bool, said: str
) -> None:
    """After a stall that the certificate does not assume: a prompt host's claim, and K once."""
    found = stalled(given, slots)
    end = only(found)
    assert (end.passed, end.stalled) == (passed, slots == 20)
    assert said in end.sentence if said else end.sentence == ""
    after = recheck_run(found).certificate.after_run
    assert after.invalidated is not passed
    assert after.ends["master.lever"].gap_s == pytest.approx(slots / 2000.0)


def test_a_claim_that_passes_assumes_nothing_of_gaps() -> None:
    end = only(stalled(0.0125, 20, STATED._replace(let_go_j=0.008)))
    assert (end.stalled, end.passed, end.sentence) == (None, True, "")
    servo = only(stalled(0.0125, 20, STATED._replace(kinetic_j=None)))
    assert (servo.stalled, servo.passed) == (None, True)


@pytest.mark.parametrize(
    ("walled", "given"), [(0.03, 0.02), (-0.01, 0.06)], ids=["it took", "it gave"]
)
def test_port_and_wall_of_an_axis_are_one_number(walled: float, given: float) -> None:
    """What the wall took pays for the port, and what it gave is on top; its damping is its own."""
    found = run(0.05, 0.0)
    rise = np.arange(ROWS) / (ROWS - 1)
    found.whole["lever.wall_master.absorbed"] = walled * rise
    found.whole["lever.wall_master.stored"] = np.zeros(ROWS)
    found.whole["master.lever.wall_effort"] = np.ones(ROWS)
    found.columns = tuple(found.whole)
    assert only(found).given == pytest.approx(given)
    found.whole["lever.wall_master.stored"] = -0.004 * rise  # held at the start, and let out
    assert only(found).given == pytest.approx(given - 0.004)
