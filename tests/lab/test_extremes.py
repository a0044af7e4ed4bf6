"""Stiff and extreme cases, small: finite or refused, and no energy out of nothing."""

from __future__ import annotations

import importlib
import json
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.bench import extremes as extremes_rigs
from tautwave.bench.rigs import ONE_PAIR
from tautwave.models.integrators.schemes import EXACT, SCHEMES, SYMPLECTIC_EULER
from tests.lab.command import lab
from tests.lab.extremes import bounce
from tests.lab.extremes import long as extremes_long
from tests.lab.extremes.kernel import run_bounces

suite_module = importlib.import_module("tests.lab.extremes.suite")  # the name is its function's
CASES = list(
    bounce.conservative_cases(
        stiffnesses=(1.0, 1e5, 1e9), masses=(1e-6, 100.0), steps=(0.1, 1.0, 10.0)
    )
)
LOSSY = list(bounce.damped_cases(stiffnesses=(1.0, 1e9), masses=(1e-6, 100.0)))[::3]
QUICK = (
    "simulation.hand.lever.reference={type: minimum_jerk, waypoints: "
    "[[0.0, 0.0], [0.1, 0.3], [0.2, 0.3], [0.35, -0.4]]}"
)
"""Into the surroundings and both local walls within a third of a second."""

ERROR = {"exact": 1e-13, "discrete_gradient": 1e-13, "dormand_prince": 1e-8}
"""Worst error of the exit speed; the others' is that of their bounds."""


@pytest.mark.parametrize("name", SCHEMES)
def test_no_contact_explodes(name: str) -> None:
    cases = CASES[::7] if name == "dormand_prince" else CASES
    worst = bounce.measure(cases, SCHEMES[name], fast=False)
    assert worst.run + worst.refused == len(cases)
    assert worst.not_finite == 0
    assert worst.stuck == 0
    assert worst.run >= 9
    assert worst.speed_error < ERROR.get(name, 0.02)
    assert worst.gained < 2.0 * ERROR.get(name, 0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["exact", "discrete_gradient"])
def test_dampers_only_take(name: str) -> None:
    worst = bounce.measure(LOSSY, SCHEMES[name], fast=False)
    assert worst.run == len(LOSSY)
    assert worst.not_finite == 0
    assert worst.gained < 1e-8
    assert worst.books < 1e-7
    if name == "exact":
        assert worst.speed_error < 1e-12


def test_a_scheme_beyond_its_bound_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    case = bounce.Case(1e9, 1.0, 0.1, 0.0, 1e-3, 0.11)
    reason = bounce.refused(case, SYMPLECTIC_EULER)
    assert "holds a contact of at most" in reason
    assert "1e+09" in reason
    monkeypatch.setattr(bounce, "refused", lambda *_: "")
    worst = bounce.measure([case], SYMPLECTIC_EULER, fast=False)
    assert worst.speed_error > 10.0
    assert worst.gained > 10.0


def test_what_is_not_finite_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    case = bounce.Case(1e300, 3.0, 1e-300, 0.0, 1e200, 0.11)
    monkeypatch.setattr(bounce, "refused", lambda *_: "")
    assert bounce.measure([case], SYMPLECTIC_EULER, fast=False).not_finite == 1


@pytest.mark.parametrize(
    ("zeta", "speed"), [(0.05, 0.8587581018), (0.2, 0.5717400276), (0.5, 0.2984360592)]
)
def test_restitution_is_the_closed_form(zeta: float, speed: float) -> None:
    damping = 2.0 * zeta * math.sqrt(1000.0 * 0.1)
    case = bounce.Case(1000.0, 1.0, 0.1, damping, 1e-3, 0.3)
    assert bounce.restitution(case) == pytest.approx(speed, abs=1e-10)


def test_restitution_has_no_seam() -> None:
    def at(zeta: float) -> float:
        return bounce.restitution(bounce.Case(1.0, 1.0, 1.0, 2.0 * zeta, 1e-3, 0.3))

    for zeta in (1.0, 1e6):
        assert at(zeta * (1.0 - 1e-7)) == pytest.approx(at(zeta * (1.0 + 1e-7)), rel=1e-5)


def test_contact_time_is_that_of_hertz() -> None:
    assert bounce.contact_time(1e6, 1.5, 0.01) == pytest.approx(2.03046204e-3, rel=1e-8)


@pytest.mark.slow
def test_rigs_at_their_extremes_stay_finite() -> None:
    ends = set()
    for group in extremes_rigs.groups(ONE_PAIR.load()):
        for overrides in {group.rigs[0], group.rigs[-1]}:
            rig = (QUICK, *overrides)
            found = extremes_rigs.try_rig(ONE_PAIR.path(), rig, duration_s=0.4, engine="python")
            assert found.not_finite == 0, (group.name, overrides)
            assert found.end == "finished" or found.why, group.name
            assert found.residual < 1e-6, (group.name, overrides)
            ends.add(found.end)
            if found.end == "refused":  # the coarsest encoder: a count beyond the velocity limit
                assert "encoder" in found.why or "in size" in found.why, found.why
    assert ends == {"finished", "stopped", "refused"}


def test_what_is_too_light_is_refused_with_its_number() -> None:
    found = extremes_rigs.try_rig(
        ONE_PAIR.path(),
        ["simulation.axes.slave.lever.inertia=1e-100"],
        duration_s=0.1,
        engine="python",
    )
    assert found.end == "refused"
    assert "slave.lever.inertia: 1e-100" in found.why
    assert "use 1e-30 or more" in found.why


def test_energy_stays_over_many_steps() -> None:
    for name, scene in extremes_long.long_bounces(20_000).items():
        end = run_bounces([scene], fast=False)[0]
        assert end.finite
        assert end.steps == 20_000
        assert end.energy / end.least - 1.0 < 2e-11, name
        assert scene.exact == (name.startswith("exact"))
    assert EXACT < 0


@pytest.mark.slow
@pytest.mark.nightly
def test_command(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(suite_module, "STEPS", 1000)
    monkeypatch.setattr("shutil.which", lambda *_: None)  # compiling is not what is tested
    few = [bounce.Case(1e5, 1.5, 0.1, 0.0, 1e-3, 0.3)]
    monkeypatch.setattr(bounce, "conservative_cases", lambda: iter(few))
    monkeypatch.setattr(bounce, "damped_cases", lambda: iter(few))
    group = extremes_rigs.Group("one", (("coupling.delay_s=0.5",), ("coupling.delay_s=-1",)))
    monkeypatch.setattr(extremes_rigs, "groups", lambda _: iter([group]))
    monkeypatch.setattr(suite_module, "RIG_S", 0.05)
    done = CliRunner().invoke(lab, ["extremes", "--json", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    reported = json.loads(done.stdout)
    rigs = next(table for table in reported["tables"] if table["title"] == "Whole rigs")["rows"]
    assert (rigs[0]["finished"], rigs[0]["refused"]) == (1, 1)
    assert reported["goals"][0]["measured"] == 0.0
    assert len(list(tmp_path.glob("extremes-*.csv"))) == len(reported["tables"])
