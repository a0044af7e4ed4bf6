"""What a hand felt in a simulation of a sweep, and the figure with a column for each contact."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tautwave.analysis.felt import FELT, felt_measures
from tautwave.errors import ConfigError
from tautwave.report.figures.across import across_drawing, looks_of
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
    text = text.replace("across: simulation", "across: simulatio")
    text = text.replace("beside: position_force", "beside: position_forc")
    file = tmp_path / "wrong.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as err:
        load_sweep(file)
    said = "\n".join(err.value.problems)
    assert "does not vary 'simulatio.environment.lever'" in said
    assert "there is no such case" in said


@pytest.mark.slow
def test_the_shipped_comparison_is_valid_and_its_figure_has_a_column_for_each_contact() -> None:
    plan = load_sweep(SHIPPED)
    assert len(plan.points.firsts()) == len(plan.sweep.cases)
    looks = looks_of(plan.sweep)
    assert looks["position"].colour == looks["position_bare"].colour
    assert looks["position_bare"].dashed
    assert not looks["position"].dashed
    rows = [
        {**plan.points.row(at), **dict.fromkeys(plan.sweep.measures, "0.1")}
        for at in range(0, len(plan.points), 7)  # 7 divides the length of no key: all values come
    ]
    assert plan.sweep.figure is not None
    drawn = across_drawing(plan.sweep, plan.sweep.figure, rows)
    assert len(drawn.axes) >= 4 * len(plan.sweep.figure.panels)


def test_each_curve_of_a_figure_has_the_points_of_its_case_column_and_condition() -> None:
    figure = Figure.model_validate_json(json.dumps(
        {
            "title": "Delays", "x": "delay", "label": "delay [ms]", "factor": 1000.0,
            "across": "wall", "labels": ["free"], "where": {"loss": 0}, "marked": {"loss": 0.5},
            "panels": [{"measures": ["energy_made"], "label": "error [rad]"}],
        }
    ))  # fmt: skip
    case = SimpleNamespace(label=None, beside=None)
    cases = {"one": case, "two": SimpleNamespace(label="bare", beside="one")}
    sweep = SimpleNamespace(name="s", cases=cases)

    def error(case: str, wall: str, loss: float, delay: float) -> float:
        return (case == "two") + 10.0 * (wall == "rigid") + 100.0 * loss + delay

    rows = [
        {"case": name, "wall": wall, "loss": repr(loss), "delay": repr(delay),
         "energy_made": repr(error(name, wall, loss, delay))}
        for delay in (0.2, 0.1)
        for name in cases
        for wall in ("none", "rigid")
        for loss in (0.0, 0.5)
    ]  # fmt: skip
    drawn = across_drawing(sweep, figure, [*rows, {**rows[0], "delay": "0.3", "energy_made": ""}])
    assert len(drawn.axes) == 2
    assert drawn.axes[0].get_ylim() == drawn.axes[1].get_ylim()
    for axis, wall in zip(drawn.axes, ("none", "rigid"), strict=True):
        curves = [line for line in axis.lines if len(line.get_xdata())]
        for name, line, marks in zip(cases, curves[::2], curves[1::2], strict=True):
            for curve, loss in ((line, 0.0), (marks, 0.5)):
                assert list(curve.get_xdata()) == [100.0, 200.0]
                wanted = [error(name, wall, loss, delay) for delay in (0.1, 0.2)]
                assert list(curve.get_ydata()) == pytest.approx(wanted)
            assert (line.get_linestyle() == "--") is (name == "two")
            assert line.get_label() == ("bare" if name == "two" else "one")
            assert marks.get_linestyle() == "None"
            assert line.get_linewidth() == (1.0 if name == "two" else 1.5)
            hollow = marks.get_markerfacecolor() != marks.get_color()
            assert hollow is (name == "two")
