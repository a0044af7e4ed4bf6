"""The figure of both sites: the sessions that both recorded, with a gap between them."""

from __future__ import annotations

import numpy as np

from tautwave.report.figures.joined import joined_figure

NONE = np.zeros(0)
TIME = np.linspace(0.0, 1.0, 50)


def test_there_is_none_without_a_session_that_both_recorded() -> None:
    assert joined_figure("lever", "rad", [], []) is None
    assert joined_figure("lever", "rad", [NONE], [(NONE, NONE)]) is None


def test_sessions_are_drawn_in_the_masters_units_apart_from_each_other() -> None:
    swing = 0.3 * np.sin(6.0 * TIME)
    lines = [(swing, swing - 0.01), (NONE, NONE), (swing, swing + 0.02)]
    figure = joined_figure("lever", "rad", [TIME, NONE, TIME + 4.0], lines)
    assert figure is not None
    above, below = figure.axes
    master, slave = (line for line in above.lines if len(line.get_xdata()) > 2)
    error = next(line for line in below.lines if len(line.get_xdata()) > 2)
    assert [line.get_label() for line in (master, slave)] == ["master", "slave"]
    assert above.get_ylabel() == "position [mrad]"
    assert below.get_ylabel() == "error [mrad]"
    assert np.nanmax(master.get_ydata()) == np.nanmax(1e3 * swing)
    shown = np.asarray(error.get_ydata(), float)
    assert sorted(set(np.round(shown[np.isfinite(shown)], 6))) == [-20.0, 10.0]
    assert np.isnan(shown).any()  # the line does not run from one session into the next
