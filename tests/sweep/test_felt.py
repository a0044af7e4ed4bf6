"""What a hand felt in a simulation of a sweep, and the figure with a panel for each question."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tautwave.analysis.felt import FELT, felt_measures
from tautwave.errors import ConfigError
from tautwave.report.figures.sweep import curves_of, sweep_drawing
from tautwave.sweep.file import Figure, load_sweep

SHIPPED = Path(__file__).parents[2] / "configs" / "sweeps" / "compare-couplings.yaml"
TIME = np.arange(2000) * 1e-3


def columns(stiffness: float, ratio: float, power: float, swing: float) -> dict[str, np.ndarray]:
    """A slave that follows exactly and presses on a spring, and motors that give 0.3 J at most."""
    moved = 0.1 * np.sin(2.0 * np.pi * swing * TIME)
    return {
        "true.master.a.position": moved,
        "true.slave.a.position": ratio * moved,
        "true.master.a.hand_effort": stiffness * moved + 0.02,
        "true.slave.a.environment_effort": -stiffness * moved * power / ratio,
        "plant.master.a.motor_work": -0.1 * TIME,
        "plant.slave.a.motor_work": power * np.minimum(0.4 * TIME, 0.4),
    }


@pytest.mark.parametrize(("ratio", "power"), [(1.0, 1.0), (-2.0, 6.0)])
def test_closed_forms_in_master_units(ratio: float, power: float) -> None:
    found = felt_measures("a", columns(8.0, ratio, power, 1.0), 1e-3, ratio=ratio, power=power)
    assert set(found) == set(FELT)
    assert found["rendered_stiffness"] == pytest.approx(8.0, rel=1e-6)
    assert found["force_error_rms"] == pytest.approx(0.02)
    assert found["energy_made"] == pytest.approx(0.3, rel=1e-2)
    assert found["fast_share"] < 0.01
    fast = felt_measures("a", columns(8.0, ratio, power, 20.0), 1e-3, ratio=ratio, power=power)
    assert fast["fast_share"] > 0.9


def test_without_a_contact_no_stiffness_is_rendered() -> None:
    found = felt_measures("a", columns(0.0, 1.0, 1.0, 1.0), 1e-3, ratio=1.0, power=1.0)
    assert np.isnan(found["rendered_stiffness"])
    assert found["hand_effort_rms"] == pytest.approx(0.02)


def test_a_figure_and_a_case_name_what_there_is(tmp_path: Path) -> None:
    text = SHIPPED.read_text().replace("../", f"{SHIPPED.parents[1]}/")
    text = text.replace("where: {simulation.", "where: {simulatio.", 1)
    text = text.replace("cases: [wave, position,", "cases: [wave, positio,", 1)
    text = text.replace("beside: position_force", "beside: position_forc")
    file = tmp_path / "wrong.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as err:
        load_sweep(file)
    said = "\n".join(err.value.problems)
    assert "does not vary 'simulatio.environment.lever'" in said
    assert said.count("there is no such case") == 2


@pytest.mark.slow
def test_the_shipped_comparison_asks_a_question_in_each_panel_and_answers_it() -> None:
    plan = load_sweep(SHIPPED)
    figure = plan.sweep.figure
    assert len(plan.points.firsts()) == len(plan.sweep.cases)
    assert figure is not None
    assert all(panel.title.endswith("?") for panel in figure.panels)
    rows = [
        {**plan.points.row(at), **dict.fromkeys(plan.sweep.measures, "0.1")}
        for at in range(len(plan.points))
    ]
    curves = {curve.case: curve for curve in curves_of(plan.sweep, figure, rows)}
    assert curves["position"].colour == curves["position_bare"].colour
    assert curves["position_bare"].dashed
    assert not curves["position"].dashed
    drawn = sweep_drawing(figure, list(curves.values()))
    delays = len(plan.sweep.grid["link.delay_s"])
    for axis, panel in zip(drawn.axes, figure.panels, strict=False):
        points = [len(line.get_xdata()) for line in axis.lines if len(line.get_xdata()) > 2]
        assert points == [delays] * len(panel.cases)


def test_each_curve_of_a_panel_has_the_points_of_its_case_and_condition() -> None:
    figure = Figure.model_validate_json(json.dumps(
        {
            "title": "Delays", "x": "delay", "label": "delay [ms]", "factor": 1000.0,
            "columns": 2, "where": {"loss": 0},
            "panels": [
                {"measures": ["energy_made"], "label": "[J]", "where": {"wall": "none"}},
                {"measures": ["energy_made"], "label": "[J]", "scale": "log", "cases": ["two"],
                 "where": {"wall": "rigid", "loss": 0.5}},
                {"measures": ["energy_made"], "label": "[J]", "where": {"wall": "foam"}},
            ],
        }
    ))  # fmt: skip
    case = SimpleNamespace(label=None, beside=None)
    cases = {"one": case, "two": SimpleNamespace(label="bare", beside="one")}
    sweep = SimpleNamespace(name="s", cases=cases)

    def energy(case: str, wall: str, loss: float, delay: float) -> float:
        return (case == "two") + 10.0 * (wall == "rigid") + 100.0 * loss + delay

    rows = [
        {"case": name, "wall": wall, "loss": repr(loss), "delay": repr(delay),
         "energy_made": repr(energy(name, wall, loss, delay))}
        for delay in (0.2, 0.1)
        for name in cases
        for wall in ("none", "rigid")
        for loss in (0.0, 0.5)
    ]  # fmt: skip
    unseen = [{**rows[0], "delay": "0.3", "energy_made": ""},
              {**rows[-1], "delay": "0.3", "energy_made": "-1.0"}]  # fmt: skip
    drawn = sweep_drawing(figure, curves_of(sweep, figure, [*rows, *unseen]))
    free, rigid, empty, *rest = drawn.axes
    assert not any(axis.axison for axis in rest)
    assert not [line for line in empty.lines if len(line.get_xdata()) and line.get_marker() == "o"]
    assert {axis.get_xlabel() for axis in (rigid, empty)} == {"delay [ms]"}
    for axis, wanted in (
        (free, {"-": ("one", "none", 0.0), "--": ("two", "none", 0.0)}),
        (rigid, {"--": ("two", "rigid", 0.5)}),
    ):
        shown = {line.get_linestyle(): line for line in axis.lines if len(line.get_xdata()) == 2
                 and list(line.get_ydata()) != [0.0, 0.0]}  # fmt: skip
        assert set(shown) == set(wanted)
        for style, line in shown.items():
            assert list(line.get_xdata()) == [100.0, 200.0]
            energies = [energy(*wanted[style], delay) for delay in (0.1, 0.2)]
            assert list(line.get_ydata()) == pytest.approx(energies)
