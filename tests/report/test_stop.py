"""Where a run was stopped: found, marked, and shown against its limit."""

import numpy as np
import pytest

from tautwave.canvas import LIMIT, Style, png, styled
from tautwave.report.figures.books import period_axis, timing_figure
from tautwave.report.figures.overview import overview_figure, velocity_figure
from tautwave.report.figures.pair import contact_figure, effort_figure, tracking_figure
from tautwave.report.run.loading import load_run
from tautwave.report.run.stop import stop_of
from tautwave.report.run.tables import watch_table
from tautwave.report.run.views import view_pair
from tests.report.synthetic import make_run, rig


@pytest.fixture
def stopped(tmp_path, columns):
    """A run of two seconds whose slave ran away."""
    few = {name: values[:2000].copy() for name, values in columns.items()}
    few["slave.wrist.velocity"][1500:] += np.linspace(0.0, 1.6, 500)
    reported = rig(("wrist",), 20)
    axes = {"wrist": {**reported["slave"]["axes"]["wrist"], "velocity_limit": 0.8}}
    top = {"master": {"axes": axes}, "slave": {"axes": axes}}

    def make(kind="safety_stop", **reported):
        place = {"at_s": 1.741, "axis": "slave.wrist", "reason": "velocity_limit", **reported}
        outcome = {"kind": kind, "sentence": "it was stopped", **place}
        make_run(tmp_path, columns=few, rig_top=top, outcome=outcome)
        return load_run(tmp_path)

    return make


def marks(panel):
    return [
        line for line in panel.lines if line.get_color() == LIMIT and line.get_linestyle() == "-"
    ]


def test_the_outcome_says_when_where_and_why(stopped):
    stop = stop_of(stopped())
    assert (stop.at_s, stop.side, stop.pair) == (1.741, "slave", "wrist")
    assert stop.reason == "slave.wrist exceeded its velocity limit"
    assert stop_of(stopped(kind="finished")) is None
    assert stop_of(stopped(at_s=None)) is None


def test_a_stop_that_is_no_axis_doing_is_marked_without_one(stopped):
    stop = stop_of(stopped(axis=None, reason="overrun"))
    assert (stop.side, stop.pair, stop.reason) == ("", "", "")
    assert stop.label(reason=True) == "safety stop at 1.741 s"
    late = stopped(kind="fault", at_s=99.0)
    assert stop_of(late).at_s == late.time[-1]


def test_a_velocity_stop_shows_velocity_limit_mark_and_reason(stopped):
    view = view_pair(stopped(), "wrist")
    figure = velocity_figure(view)
    assert len(figure.axes) == 3  # master, slave, around the stop
    for panel in figure.axes:
        (mark,) = marks(panel)
        assert mark.get_xdata()[0] == 1.741
    slave, close = figure.axes[1:]
    for panel in (slave, close):
        labels = [str(line.get_label()) for line in panel.lines]
        assert any("velocity limit, 800" in label for label in labels)
    assert any("exceeded its velocity limit" in str(line.get_label()) for line in slave.lines)
    low, high = close.lines[0].get_xdata()[[0, -1]]
    assert high - low < 0.51
    for figure in (tracking_figure(view), effort_figure(view)):
        assert all(marks(panel) for panel in figure.axes)
    assert marks(overview_figure([view]).axes[0])


def test_a_run_that_ended_well_has_neither(tmp_path, columns):
    make_run(tmp_path, columns=columns)
    view = view_pair(load_run(tmp_path), "wrist")
    assert velocity_figure(view) is None
    assert not marks(tracking_figure(view).axes[0])


def test_contacts_have_colours_of_their_own(tmp_path, columns):
    from tautwave.canvas import CONTACTS, MASTER, SLAVE, WALL

    make_run(tmp_path, columns=columns)
    loop = contact_figure(view_pair(load_run(tmp_path), "wrist")).axes[0]
    used = [line.get_color() for line in loop.lines]
    assert used
    assert set(used) <= set(CONTACTS)
    assert not set(used) & {MASTER, SLAVE, WALL}
    assert len(set(used)) == len(used)


def test_one_slow_cycle_does_not_squeeze_the_histogram(tmp_path, columns):
    late = {**columns, "lateness_us": columns["lateness_us"].copy()}
    late["lateness_us"][700] = 48_000.0
    make_run(tmp_path, columns=late)
    period = timing_figure(load_run(tmp_path)).axes[0]
    assert period.get_xlim()[1] < 4000.0
    reported = " ".join(text.get_text() for text in period.texts)
    assert "1 beyond the axis, up to 49" in reported


@pytest.mark.slow
def test_what_is_beyond_at_both_ends_collides_in_no_paper(tmp_path, columns):
    late = {**columns, "lateness_us": columns["lateness_us"].copy()}
    late["lateness_us"][[700, 1400]] = 48_000.0, -900.0
    make_run(tmp_path, columns=late)
    for style in (Style(), Style(84.0 / 25.4, 8.0, titled=False)):
        with styled(style):
            figure = timing_figure(load_run(tmp_path))
        png(figure, 600)
        one, two = (text.get_window_extent() for text in figure.axes[0].texts)
        assert not one.overlaps(two)
        assert all(text.get_fontsize() < style.size for text in figure.axes[0].texts)


def test_the_axis_of_periods_holds_what_was_asked_for():
    low, high = period_axis(np.full(1000, 500.0), 1000.0)
    assert low <= 500.0
    assert high >= 1000.0


def test_what_devices_do_when_the_host_stops_and_who_confirmed_to_be_off(tmp_path, columns):
    stops = {
        "watchdog_s": {"slave.a": 0.06},
        "unwatched": {"slave.b": "keeps its last command"},
        "unconfirmed": {"slave.a": "no answer"},
    }
    make_run(tmp_path, columns=columns, buses={"can": stops, "hand": {"notes": []}})
    assert watch_table(load_run(tmp_path)).rows == (
        ("slave.a", "stops after 60\u202fms", "not confirmed: no answer"),
        ("slave.b", "keeps its last command", "confirmed"),
    )
