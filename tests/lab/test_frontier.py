"""The frontier of error over motor noise: its points, its table, its figure, and the command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave import canvas
from tests.lab.command import lab
from tests.lab.couplings.frontier import (
    BEST,
    KEPT,
    LAB,
    SETTINGS,
    Point,
    Score,
    frontier,
    run_hand,
)
from tests.lab.couplings.frontier_suite import BARS, each_hand, frontier_figure
from tests.lab.couplings.recorded import controllers
from tests.lab.port.hands import CONTACTS, recorded_hands, synthetic_hands

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"


def test_the_first_setting_is_the_laboratorys_and_the_best_is_one_of_them() -> None:
    assert SETTINGS[0].family == LAB
    assert BEST in SETTINGS
    assert set(BARS) == set(CONTACTS)


def test_a_recording_is_measured_by_the_law_that_made_it() -> None:
    names = ("m1_a_foam", "m2_d_rigid", "Set3-E-Free", "m1_c_spring", "multisine_foam")
    assert [controllers(name) for name in names] == ["ad", "ad", "be", "cf", ""]


@pytest.mark.slow
def test_without_recordings_the_laboratorys_law_is_the_measure() -> None:
    hands = synthetic_hands(1.6)[:2]
    found = frontier(
        hands, 1.5e-5, settings=(SETTINGS[0], BEST), engine="python", tell=lambda _: None
    )
    assert list(found) == [hand.contact for hand in hands]
    for hand, (ours, best) in zip(hands, found.values(), strict=True):
        assert (ours.share, ours.over_lab) == (1.0, 1.0)
        [score] = best.scores
        assert (score.hand, score.error, score.share) == (hand.name, best.error, best.share)
        assert score.known == score.lab == ours.error
        assert 0.1 < best.share < 0.7
        assert not best.ended


def test_each_hand_stands_in_a_table_beside_the_law_that_moved_it() -> None:
    score = Score("m1_c_foam", 4e-3, 3.5e-3, 3e-3, 1e-3, 0.75, 1.1, ended=False)
    points = [Point(it, 0.01, 0.004, 0.5, 1.0, 0, (score,)) for it in SETTINGS]
    table = each_hand({"foam": points}, 1.5e-5)
    [[name, *numbers]] = table.rows
    assert name == "m1_c_foam"
    assert numbers == pytest.approx([4.0, 3.5, 3.0, 0.75, 1.1])
    assert len(table.columns) == len(table.rows[0])


@pytest.mark.slow
def test_the_figure_shows_every_family_and_what_is_asked_for() -> None:
    points = {
        contact: [Point(it, 0.01, 0.004, 0.1 + 0.1 * at, 0.5 + 0.2 * at, 0)
                  for at, it in enumerate(SETTINGS)]
        for contact in CONTACTS
    }  # fmt: skip
    figure = frontier_figure(points, 1.5e-5)
    places = {(it.over_lab, it.share) for it in points[next(iter(CONTACTS))] if it.setting == BEST}
    for panel in figure.axes[: len(CONTACTS)]:
        circled = [line for line in panel.lines if line.get_label() == "one setting for all"]
        assert {(*line.get_xdata(), *line.get_ydata()) for line in circled} == places
        named = {text.get_text() for text in panel.texts}
        assert named == {it.name for it in SETTINGS if it.family == LAB}
    drawn = canvas.svg(figure, "frontier")
    for said in ("wave", "position, account", "laboratory", "one setting for all", *CONTACTS):
        assert f">{said}<" in drawn


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(120)
@pytest.mark.skipif(not DATA.is_dir(), reason="no recordings")
def test_one_setting_halves_the_error_of_the_laboratory_in_free_motion_and_foam() -> None:
    hands = [it for it in recorded_hands(DATA, 2.0) if it.name in ("m2_a_free_motion", "m2_a_foam")]
    found = frontier(
        hands, 1.5e-5, settings=(SETTINGS[0], BEST), engine="python", tell=lambda _: None
    )
    for contact in ("free", "foam"):
        best = found[contact][1]
        assert best.share <= BARS[contact]


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="no recordings")
@pytest.mark.nightly
def test_a_spring_is_given_back_at_the_master_without_chatter(tmp_path: Path) -> None:
    """All that the master's tank gives is what the slave's, full of the spring's energy, sends."""
    [hand] = [it for it in recorded_hands(DATA) if it.name == "m2_a_spring"]
    [setting] = [it for it in SETTINGS if it.family.startswith("four_") and it.name == "K 10"]
    old = setting._replace(block=setting.block.replace(KEPT, "{}"))
    (error, calm, _), (before, loud, _) = (
        run_hand(it, hand, 1.5e-5, tmp_path, "python") for it in (setting, old)
    )
    assert calm < 0.2 * loud
    assert error < before


def test_the_command_says_what_it_compares(tmp_path: Path) -> None:
    """A folder without recordings is refused before anything runs."""
    ran = CliRunner().invoke(
        lab, ["couplings", "--frontier", "--recordings", str(tmp_path), "--json"]
    )
    assert ran.exit_code == 2
    assert "has no recording" in json.dumps(ran.output)
