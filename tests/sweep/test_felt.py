"""What a hand felt in a simulation of a sweep, and the figure with a column for each contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.analysis.felt import FELT, felt_measures
from tautwave.errors import ConfigError
from tautwave.report.figures.across import across_drawing, looks_of
from tautwave.sweep.file import load_sweep

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
