"""What the motors of a run gave, against the truth of a simulation, and against what they may."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tautwave.cli.terminal.summary import summary_sections
from tautwave.config import Rig, resolved_yaml
from tautwave.couplings.wave import port
from tautwave.couplings.wave.claim import claimed_joules
from tautwave.laws.port import port_close
from tautwave.report.claims import exceeds
from tautwave.report.motors import motor_energy
from tautwave.report.run.rebuild import rebuild_summary
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import verdicts
from tautwave.rig import command_delays
from tautwave.session.facts import pair_facts, port_claims
from tautwave.summary import Summary, summary_of
from tautwave.summary.model import Motors
from tautwave.tables import BAD, Cell
from tests.certificate.rigs import NO_QUANTUM, NO_WALLS, rig
from tests.report.rows_of import put
from tests.report.synthetic import make_columns
from tests.report.synthetic import rig as rig_keys
from tests.rigs.running import run_rig

QUIET = (*NO_QUANTUM, *NO_WALLS, "duration_s=1.5", "coupling.release_ramp_s=0")
SCALED = ("coupling.pairs.lever.position_scale=0.8", "coupling.pairs.lever.force_scale=1.5")


def ran(loaded: Rig) -> Run:
    """Run a rig and return what a report would read of it."""
    done = run_rig(loaded)
    delays = command_delays(loaded)
    facts = {
        **pair_facts(loaded, "lever", delays)._asdict(),
        **port_claims(loaded, "lever", delays),
    }
    columns: Any = {name: done.table[:, at] for at, name in enumerate(done.columns)}
    rows = len(done.table)
    keys = yaml.safe_load(resolved_yaml(loaded))
    return Run(
        Path(), keys, "", summary_of({"pairs": {"lever": facts}})[0], tuple(columns), rows,
        whole=columns, time=np.arange(rows) / loaded.rate_hz,
    )  # fmt: skip


def true_work(run: Run, weight: float) -> np.ndarray[Any, Any]:
    """What both motors did to their devices, by the plant's own books [J]."""
    done = run.read("plant.master.lever.motor_work", "plant.slave.lever.motor_work")
    master, slave = done.values()
    return np.asarray(master - master[0] + weight * (slave - slave[0]))


@pytest.mark.sparse(2)
@pytest.mark.parametrize("changes", [(), SCALED])
def test_what_the_motors_gave_is_their_work_on_the_devices(changes: tuple[str, ...]) -> None:
    loaded = rig(*QUIET, *changes)
    run = ran(loaded)
    work = true_work(run, 1.0 / (run.result.pairs["lever"].power_ratio or 1.0))
    reported = motor_energy(run, "lever")
    assert abs(reported["net"]) > 1e-4
    assert reported["net"] == pytest.approx(work[-1], rel=1e-9)
    assert reported["worst"] == pytest.approx(work.max(), abs=1e-12)
    assert reported["worst_at_s"] == pytest.approx(1e-3 * int(np.argmax(work)))
    assert not exceeds(Motors(**reported), 1.0)
    energy = rebuild_summary(run)["energy_j"]
    assert energy["motors_net"] == reported["net"]
    assert energy["stated_debt"] == reported["stated_debt"]


def test_the_stated_debt_is_what_the_ends_claim() -> None:
    loaded = rig(*QUIET)
    delays = command_delays(loaded)
    claims = [claimed_joules(loaded, f"{side}.lever", delays) for side in ("master", "slave")]
    assert motor_energy(ran(loaded), "lever")["stated_debt"] == pytest.approx(sum(claims))


def test_a_port_that_gives_without_an_account_exceeds_what_it_may(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def generous(p: Any, account: float, *rest: float) -> Any:
        leaving, account, *others = port_close(p, account, *rest)
        return 1.2 * leaving, account + 1.0, *others

    monkeypatch.setattr(port, "port_close", generous)
    run = ran(rig(*QUIET, "loop.missing_limit=1", "loop.overrun_limit=1"))
    reported = motor_energy(run, "lever")
    assert reported["worst"] > reported["stated_debt"]
    put(run, rebuild_summary(run))
    sections = summary_sections("x", run.result, Path(), 0)
    shown = next(one for one in sections if one.title == "Energy books")
    [row] = [row for row in shown.rows if row[0] == "at the worst moment"]
    assert isinstance(row[1], Cell)
    assert row[1].level == BAD
    assert "exceeded" in row[2].text  # type: ignore[union-attr]
    [books] = [one for one in verdicts(run) if one.topic == "Energy books"]
    assert books.status == "bad"
    assert any("more than the" in sentence for sentence in books.sentences)


def test_what_no_rig_states_is_no_debt_and_nothing_exceeds_it() -> None:
    columns = make_columns(rows=500)
    keys = rig_keys(("wrist",), 20)
    run = Run(
        Path(), keys, "", Summary(), tuple(columns), 500, whole=columns, time=columns["time_s"]
    )  # type: ignore[arg-type]
    reported = motor_energy(run, "wrist")
    given = -sum(columns[f"{side}.wrist.port_energy"] for side in ("master", "slave"))
    assert reported["net"] == pytest.approx(given[-1] - given[0])
    assert "stated_debt" not in reported
    assert not exceeds(Motors(**{**reported, "worst": 1e3}), 1.0)


@pytest.mark.parametrize(("worst", "status"), [(0.9e-3, "ok"), (1.1e-3, "bad")])
def test_books_that_close_are_bad_where_motors_gave_more_than_the_debt(
    worst: float, status: str
) -> None:
    motors = {"worst": worst, "worst_at_s": 1.0, "stated_debt": 1e-3}
    energy = {"gross_flow": 1.0, "residual": 0.0, "motors_net": 1e-4, "generated": 0.0}
    summary = {"energy_j": energy, "pairs": {"wrist": {"motors": motors}}}
    run = Run(Path(), {}, "", summary_of(summary)[0])
    [books] = [one for one in verdicts(run) if one.topic == "Energy books"]
    assert books.status == status
    assert any("more than the" in sentence for sentence in books.sentences) == (status == "bad")


@pytest.mark.parametrize(
    ("residual", "gross", "held", "status"),
    [
        (1e-14, 0.0, 0.0, "ok"),  # nothing moved
        (1e-14, 1e-9, 0.0, "ok"),
        (2e-12, 0.0, 0.0, "bad"),
        (2e-9, 1.0, 0.0, "bad"),
        (2e-9, 1.0, 100.0, "ok"),  # 100 J held for a million cycles: their last bits
        (float("inf"), 1.0, 0.0, "bad"),
    ],
)
def test_books_close_as_far_as_doubles_can(
    residual: float, gross: float, held: float, status: str
) -> None:
    energy = {"gross_flow": gross, "residual": residual, "generated": 0.0}
    pairs = {"a": {"elements": {"line": {"held": held}}}}
    summary = {"energy_j": energy, "pairs": pairs, "cycles": 1_000_000}
    run = Run(Path(), {}, "", summary_of(summary)[0])
    [found] = [one for one in verdicts(run) if one.topic == "Energy books"]
    assert found.status == status
