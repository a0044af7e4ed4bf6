"""Which steps a run takes, and what is said of a scene that is too slow for its rate."""

from __future__ import annotations

import gc
import importlib.util
import math
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.config import load_rig
from tautwave.errors import BusBudgetError
from tautwave.rig import build_rig
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.session import pace as scene_pace
from tautwave_scenes.session.pace import ScenePace, choose_engine, pace_fact, use_engine

GRANULAR = Path(__file__).parents[2] / "configs" / "scene-granular.yaml"


@pytest.fixture
def costs(monkeypatch):
    """Fake the cost of a cycle in shares of a period, by engine; return those measured."""
    share = {"python": 0.3, "compiled": 0.1}
    measured = []

    def pace(rig, engine="python", ways=None):
        measured.append(engine)
        return ScenePace(share[engine] * rig.period_s, rig.period_s, engine)

    monkeypatch.setattr(scene_pace, "scene_pace", pace)
    monkeypatch.setattr(scene_pace, "find_spec", lambda name: share.get(name, True) or None)
    return share, measured


def test_a_cycle_of_milliseconds_is_said_in_milliseconds():
    assert ScenePace(18.7e-3, 1e-3, "python").describe().startswith("18.7 ms a cycle by plain")
    assert ScenePace(187e-6, 1e-3, "python").describe().startswith("187 us a cycle by plain")


def chosen(clock="real", *overrides):
    return choose_engine(load_rig(GRANULAR, overrides), clock)


def test_what_is_alive_is_looked_through_once_for_all_rounds(monkeypatch):
    """Objects that are frozen cost the collections of later rounds nothing."""
    gc.unfreeze()  # what this process froze itself
    freezes = []
    monkeypatch.setattr(gc, "freeze", lambda freeze=gc.freeze: (freezes.append(1), freeze()))
    monkeypatch.setattr(scene_pace, "CYCLES", 3)
    assert scene_pace.scene_pace(load_rig(GRANULAR)).cycle_s > 0.0
    assert len(freezes) == 1
    assert gc.get_freeze_count() == 0
    gc.freeze()  # as tests.conftest left it


def test_plain_python_where_it_keeps_the_rate_compiled_steps_where_not(costs):
    share, measured = costs
    assert chosen().name == "python"
    assert measured == ["python"]
    share["python"] = 0.6
    assert chosen().name == "compiled"
    assert "10% of the period of 45.35 us" in chosen().sentences[0]
    assert chosen("real", "scene.engine=python").name == "python"
    share["numba"] = False
    assert chosen().name == "python"


def test_the_fake_clock_measures_nothing_and_compiles_what_asks_for_it(costs):
    share, measured = costs
    share["python"] = 9.0
    assert chosen("fake") == ("python", ())
    assert chosen("fake", "scene.engine=compiled") == ("compiled", ())
    assert measured == []


def test_a_tight_scene_says_so_and_one_that_is_too_slow_is_refused(costs):
    share, _ = costs
    share.update(python=2.5, compiled=0.9)
    (reported,) = chosen().sentences
    assert reported.endswith(
        "90% of the period of 45.35 us: it may miss cycles; --clock fake, fewer masses, or a "
        "rate_hz of at most 18000"
    )
    assert chosen().warnings() == [reported]
    share["compiled"] = 0.5
    assert chosen().warnings() == []
    share["numba"] = False
    with pytest.raises(BusBudgetError) as caught:
        chosen()
    assert "2.5 periods of 45.35 us, so it cannot keep its rate; --clock fake" in str(caught.value)
    assert str(caught.value).endswith("scene.engine auto with numba: pip install 'tautwave[fast]'")
    share.update(numba=True, compiled=1.2)
    with pytest.raises(BusBudgetError, match=r"1\.2 periods"):
        chosen()


@pytest.mark.slow
def test_a_run_that_is_refused_leaves_nothing_and_exits_4(costs, tmp_path):
    share, _ = costs
    share.update(python=2.0, numba=False)
    out = tmp_path / "run"
    done = CliRunner().invoke(main, ["run", str(GRANULAR), "--out", str(out)])
    assert done.exit_code == 4
    assert "cannot keep its rate" in done.output
    assert not out.exists()


def test_check_says_what_a_cycle_costs(costs):
    share, measured = costs
    rig = load_rig(GRANULAR)
    assert pace_fact(rig).endswith("30% of the period of 45.35 us")
    share["python"] = 1.8
    assert pace_fact(rig).endswith("on the real clock its steps are compiled")
    share["numba"] = False
    assert "on the real clock it cannot keep its rate; --clock fake" in pace_fact(rig)
    assert set(measured) == {"python"}  # nothing is compiled for a check


@pytest.mark.slow
def test_a_cycle_is_measured_with_the_loop_around_it():
    rig = load_rig(GRANULAR)
    whole, alone = scene_pace.scene_pace(rig), scene_pace._step_alone(rig, "python", 20)
    for cost in (whole.cycle_s, alone):
        assert 1e-7 < cost < 1.0
    assert math.isclose(whole.share, whole.cycle_s * rig.rate_hz)


@pytest.mark.slow  # numba compiles for ten seconds and more
@pytest.mark.nightly
@pytest.mark.skipif(importlib.util.find_spec("numba") is None, reason="needs numba")
def test_compiled_steps_change_no_row():
    from tests.scene.test_runs import Rows, run_rig

    _, data, _ = run_rig("granular", 0.03)
    rig = load_rig(GRANULAR)
    built = build_rig(rig, clock="fake", duration_s=0.03)
    built = use_engine(built, "compiled")
    assert type(built.control.scene.model) is not SceneModel
    sink = Rows(len(built.columns))
    loop = scene_pace.Loop(built.clock, built.buses, built.control, built.sources, sink)
    assert loop.run().error is None
    for name, column in zip(built.columns, zip(*sink.rows, strict=True), strict=True):
        assert tuple(data[name]) == column, name
