"""What is outside physics is doubtful, with its reason, and no line to paste."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.analysis.identification.plausible import BOUNDS, bound_of, implausible
from tautwave.analysis.identification.regression import Estimate
from tautwave.recordings.stated import Stated
from tautwave.session.identification.lever import identify_lever
from tautwave.session.identification.recorded import identify_recording
from tautwave.session.identification.still import identify_noise
from tautwave.session.identification.weighing import Weight, implausible_weights

T = 1e-3 * np.arange(6000)
PHASE = 2.0 * np.pi * 1.3 * T
PLACE = 0.4 * np.sin(PHASE) + 0.1 * np.sin(2.7 * PHASE)
SPEED = np.gradient(PLACE, T)
PUSH = 2e-3 * np.gradient(SPEED, T) + 5e-3 * SPEED + 1e-3 * np.sign(SPEED)


def log(path: Path, **columns: Any) -> Path:
    head = ",".join(columns)
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, "%.12g", ",", header=head, comments="")
    return path


def test_the_same_lever_is_believed_in_its_own_units(tmp_path: Path) -> None:
    path = log(tmp_path / "a.csv", t=T, angle_rad=PLACE, motor_nm=PUSH)
    found = identify_lever(path)
    assert "inertia: {value: 0.00" in found.snippet
    assert not any("outside" in note for note in found.notes)


@pytest.mark.parametrize(
    ("time", "place", "push", "said"),
    [
        (1e6, 1.0, 1.0, "inertia"),  # nanoseconds read as milliseconds
        (1e-6, 1.0, 1.0, "peak velocity"),
        (1.0, 1e-8, 1.0, "position"),
        (1.0, 1.0, 1e9, "coulomb"),  # counts of a converter, or a mistaken exponent
        (1.0, 1e8, 1.0, "inertia"),
    ],
)
def test_a_wrong_unit_of_a_lever_gives_no_line(
    tmp_path: Path, time: float, place: float, push: float, said: str
) -> None:
    path = log(tmp_path / "a.csv", t=time * T, angle_rad=place * PLACE, motor_nm=push * PUSH)
    found = identify_lever(path, stated=Stated("s"), filter_hz=20.0 / time)
    assert any(note.startswith("Doubtful: ") and said in note for note in found.notes), found.notes
    assert found.snippet.startswith("# ")
    assert "\n" not in found.snippet


def test_a_contact_outside_physics_gives_no_block(tmp_path: Path) -> None:
    force = 300.0 * PLACE
    path = log(tmp_path / "a.csv", t=T, angle_rad=PLACE, torque_nm=force)
    good = identify_recording(path, model="spring")
    assert good.as_dict()["snippet"] is not None
    path = log(tmp_path / "b.csv", t=T, angle_rad=PLACE, torque_nm=1e9 * force)
    found = identify_recording(path, model="spring")
    assert found.as_dict()["snippet"] is None
    assert any("stiffness 3e+11 N m/rad is outside" in note for note in found.notes)


def test_the_noise_of_a_clock_is_no_encoders(tmp_path: Path) -> None:
    steps = np.random.default_rng(3).normal(0.0, 500.0, len(T))
    found = identify_noise(log(tmp_path / "a.csv", t=T, angle_rad=steps))
    assert found.snippet.startswith("# ")
    assert any("position noise" in note and "Doubtful" in note for note in found.notes)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("mass", -2.0, "a mass of -2 kg is impossible"),
        ("mass", 8e6, "link mass 8e+06 kg is outside"),
        ("centre x", 400.0, "centre 400 m is outside"),
        ("constant", 1e9, "bias 1e+09 N m is outside"),
        ("mass", 2.0, None),
        ("centre x", 0.1, None),
    ],
)
def test_weights_of_links_are_bounded(name: str, value: float, said: str | None) -> None:
    estimate = Estimate(value, value - 0.01 * abs(value), value + 0.01 * abs(value))
    found = implausible_weights([Weight("elbow", name, 1.0, estimate)], rotary=True)
    assert [said in one for one in found] == [True] if said else not found


@pytest.mark.parametrize("rotary", [True, False])
def test_each_bound_refuses_what_is_beyond_it_and_nothing_inside(rotary: bool) -> None:
    for name, (turns, slides) in BOUNDS.items():
        bound = turns if rotary else slides
        inside = [bound.least, bound.greatest, -bound.greatest]
        assert not [s for value in inside for s in implausible({name: value}, rotary)]
        assert len(implausible({name: 1.01 * bound.greatest}, rotary)) == 1
        assert len(implausible({name: 0.99 * bound.least}, rotary)) == (bound.least > 0.0)
        both = bound_of(name, None)
        assert both is not None
        assert both.least <= bound.least <= bound.greatest <= both.greatest
