"""What runs generated, judged from their rows alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave import Stepper, load_rig, simulate
from tautwave.certificate.belief import declared_delays
from tautwave.config import Rig
from tautwave.report.coupled import coupled_rise, stall_claim
from tautwave.report.run.complete import complete_summary
from tautwave.report.run.judging import Judged, judged_of
from tautwave.report.run.warnings import warnings_of
from tautwave.rig import controller, coupling_part, pair_scale
from tautwave.session.facts import pair_facts
from tautwave.simulation import Simulation
from tests.report.rows_of import run_of
from tests.rigs.running import Tree, rig_of, tree

MEASURED = {"source": "measured"}


def axis(at: int, mass: float, damping: float, limit: float) -> Tree:
    return {
        "bus": "x", "id": at, "kind": "linear", "effort_limit": limit, "position_range": [-2, 2],
        "inertia": {"value": mass, "lower": mass, **MEASURED},
        "damping": {"value": damping, "lower": damping, **MEASURED},
    }  # fmt: skip


BUZZING: Tree = {
    "name": "position-missing",
    "rate_hz": 1000,
    "duration_s": 20,
    "seed": 1,
    "loop": {"missing_limit": 20},
    "buses": {"x": {"driver": "loopback"}},
    "master": {"axes": {"a": axis(1, 0.2, 1.0, 5.0)}},
    "slave": {"axes": {"a": axis(2, 0.2, 1.0, 5.0)}},
    "coupling": {
        "law": "position", "delay_s": 0, "pairs": {"a": {"stiffness": 1000, "damping": 0.0}},
    },
    "simulation": {
        "hand": {
            "a": {
                "mass": 0.05, "damping": 0.1, "stiffness": 50.0,
                "reference": {"type": "minimum_jerk", "waypoints": [[0.5, 0.0], [1.0, 0.05]]},
            }
        }
    },
}  # fmt: skip
"""A spring at the very edge of what its dampers allow; it leaves no room for a lost sample."""


def lost(share: float) -> Tree:
    return {"simulation.faults": {"missing_probability": share}}


def stalled(share: float, slots: int = 5) -> Tree:
    faults = {"overrun_probability": share, "overrun_slots": slots}
    return {"simulation.faults": faults, "loop.overrun_limit": 20}


def judged(rig: Rig, rows: Simulation) -> Judged:
    [found] = judged_of(run_of(rig, rows), rig)
    return found


def judged_run(rig: Rig, duration_s: float | None = None) -> Judged:
    return judged(rig, simulate(rig, engine="python", duration_s=duration_s))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "least", "most", "passed"),
    [
        ({}, 0.0, 1e-15, True),
        (lost(0.001), 0.0, 1e-10, True),
        (lost(0.01), 0.0, 1e-6, True),
        (lost(0.1), 0.05, 0.2, False),
        (lost(0.5), 0.3, 1.2, False),
        (stalled(0.02), 0.08, 0.2, False),
        (stalled(0.001), 0.0, 1e-6, True),
        ({**lost(0.1), "coupling.pairs.a.stiffness": 500}, 0.0, 1e-9, True),
    ],
    ids=["whole", "0.1 %", "1 %", "10 %", "50 %", "2 % stalls", "0.1 % stalls", "half as stiff"],
)
def test_lost_samples_break_a_spring_without_room_for_them(
    change: Tree, least: float, most: float, passed: bool
) -> None:
    found = judged_run(rig_of(tree(change, base=BUZZING)))
    assert (found.rule, found.passed) == ("spring", passed)
    assert least <= found.rise.given <= most
    assert found.rise.lasting == (not passed)
    assert bool(found.sentence) == (not passed)


def test_ten_percent_lost_go_on_giving_whatever_is_claimed() -> None:
    """Four seconds of the table above; with a velocity limit the ends claim a joule for a stall."""
    limit = {f"{side}.axes.a.velocity_limit": 2.0 for side in ("master", "slave")}
    rig = rig_of(
        tree(lost(0.1), limit, {"simulation.hand.a.reference.waypoints": HASTY}, base=BUZZING)
    )
    found = judged_run(rig, 8.0)
    assert found.claim == stall_claim(rig, "a") == pytest.approx(1.0, rel=0.3)
    assert found.rise.floor < found.rise.given < found.claim
    assert not found.passed
    assert "claims" in found.sentence
    assert "% of the seconds" in found.sentence
    assert stall_claim(rig_of(BUZZING), "a") == 0.0


HASTY = [[0.1, 0.0], [0.4, 0.05]]


UNEQUAL = tree(
    {
        "duration_s": 12.0,
        "master.axes.a": axis(1, 0.5, 2.0, 20.0),
        "slave.axes.a": axis(2, 0.5, 2.0, 1.0),
        "coupling.engage_ramp_s": 0.0,
        "coupling.release_ramp_s": 0.0,
        "coupling.pairs.a.damping": 0.1,
        "simulation": {},
    },
    base=BUZZING,
)
"""A master whose motor is twenty times the slave's: each end clips by itself."""


def carried(rig: Rig) -> Simulation:
    """Stretch the spring beyond the weak end's limit, carry both out, let go and come back."""
    rest, out = np.full(100, 0.0), 0.5 * np.sin(np.linspace(0.0, np.pi / 2, 500)) ** 2
    lag = np.linspace(0.0, 0.03, 100)
    master = np.concatenate([rest, rest, out, np.full(100, 0.5), out[::-1]])
    slave = np.concatenate([rest, lag, out + 0.03, 0.53 - lag, out[::-1]])
    with Stepper(rig, outside=("master", "slave")) as stepper:
        for _ in range(3):
            for x, y in zip(master, slave, strict=True):
                stepper.step({"master.a": x, "slave.a": y})
        return stepper.rows


def test_ends_that_clip_apart_generate_and_alike_they_do_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Seven joules a cycle where 20 N and 1 N clip their own end; with 1 N at both, nothing."""
    rig = rig_of(UNEQUAL)
    with monkeypatch.context() as apart:
        apart.setattr(controller, "clips", lambda *_, **__: (math.inf, math.inf))
        rows = carried(rig)
    found = judged(rig, rows)
    assert found.rise.given > 15.0
    assert not found.passed
    alike = judged(rig, carried(rig))
    assert alike.rise.given <= alike.rise.floor
    assert alike.passed


@pytest.mark.slow
def test_a_delay_beyond_what_damping_pays_for_generates() -> None:
    """A second of delay, certified once for an alias: 184 J until the device leaves its range."""
    change = {
        "rate_hz": 4096, "coupling.delay_s": 1.0, "coupling.engage_ramp_s": 0.0,
        "coupling.pairs.a": {"stiffness": 100, "damping": 0.0},
        "master.axes.a": axis(1, 0.5, 0.5, 20.0), "slave.axes.a": axis(2, 0.5, 0.5, 20.0),
        "simulation.hand.a": {
            "mass": 0.1, "damping": 0.5, "stiffness": 10.0,
            "reference": {"type": "minimum_jerk", "waypoints": [[0.1, 0.0], [0.6, 0.01]]},
        },
    }  # fmt: skip
    found = judged_run(rig_of(tree(change, base=BUZZING)))
    assert found.rise.given > 100.0
    assert found.rise.lasting


@pytest.mark.parametrize("scale", [{}, {"position_scale": 2.0, "sign": -1, "force_scale": 0.5}])
def test_scales_change_nothing_of_what_is_judged(scale: dict[str, Any]) -> None:
    """The slave's units, turned round and doubled: the same energies of the pair."""
    pair = {"stiffness": 400.0, "damping": 0.0, **scale}
    rig = rig_of(tree({"coupling.pairs.a": pair}, base=BUZZING))
    power = pair_scale(rig.coupling.pairs["a"]).power
    slave = rig.slave.axes["a"].damping.lower
    rows = simulate(rig, engine="python", duration_s=1.5)
    found = coupled_rise(run_of(rig, rows), rig, "a")
    assert found is not None
    moved = {side: np.diff(rows[f"{side}.a.position"]) for side in ("master", "slave")}
    taken = (np.sum(moved["master"] ** 2) + slave / power * np.sum(moved["slave"] ** 2)) / 1e-3
    assert found.taken == pytest.approx(taken, rel=5e-3)  # but for the ramp
    assert found.given <= found.floor


def test_what_a_stop_and_a_ramp_do_is_not_the_coupling_s() -> None:
    """The hand carries the stretched axes out of their range while the engage ramp still rises."""
    change = {
        "coupling.engage_ramp_s": 1.0, "coupling.release_ramp_s": 0.3,
        "master.axes.a.position_range": [-1.0, 0.04],
        "simulation.hand.a.stiffness": 2000.0,
        "simulation.hand.a.reference.waypoints": HASTY,
        "simulation.environment": {"a": {"type": "spring", "position": 0.0, "stiffness": 5000.0}},
    }  # fmt: skip
    rig = rig_of(tree(change, base=BUZZING))
    rows = simulate(rig, engine="python", duration_s=1.0)
    assert "left its position range" in str(rows.error)
    run = run_of(rig, rows)
    found = coupled_rise(run, rig, "a")
    assert found is not None
    assert found.given <= found.floor
    run.whole = None
    blind = run_of(rig, Simulation(tuple(
        name.replace("limited", "unknown") for name in rows.columns
    ), rows.data, None))  # fmt: skip
    without = coupled_rise(blind, rig, "a")
    assert without is not None
    assert without.given > without.floor


def test_a_law_without_a_mutual_spring_is_judged_by_its_sum() -> None:
    pair = {"stiffness": 300.0, "damping": 1.0}
    change = {
        "require": "coupled_stable",
        "coupling": {"law": "position_force", "pairs": {"a": pair}},
    }
    found = judged_run(rig_of(tree(change, base=BUZZING)), 1.0)
    assert found.rule == "sum"
    assert found.claim == 0.0


SHIPPED = [
    path
    for path in sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
    if "\nsimulation:" in (text := path.read_text())
    and "\n  arm:\n" not in text.partition("\nsimulation:")[2]
    and "dimension: 3" not in text
]


@pytest.mark.slow
@pytest.mark.parametrize("path", SHIPPED, ids=[path.stem for path in SHIPPED])
def test_shipped_rigs_generate_nothing_and_need_no_warning(path: Path) -> None:
    """Each is judged by a rule; one that requires no more than stability may generate."""
    rig = load_rig(path)
    rows = simulate(rig, engine="python", duration_s=min(rig.duration_s, 4.0))
    delays = declared_delays(rig)
    facts = {pair: pair_facts(rig, pair, delays)._asdict() for pair in rig.coupling.pairs}
    run = run_of(rig, rows, {"pairs": facts, "duration_s": rig.duration_s})
    run.result = complete_summary(run)
    found = list(judged_of(run, rig))
    assert found or coupling_part(rig).claim
    assert all(one.passed for one in found) or rig.require == "coupled_stable"
    warned = {one.kind for one in warnings_of(run)}
    assert warned <= set(rig.expect)
    assert set(rig.expect) <= warned, "what does not happen need not be expected"
