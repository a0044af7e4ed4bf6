import numpy as np
import pytest

from tests.lab.papers.coupling import (
    LOW,
    SCHEMES,
    coupling_figure,
    sampled_limit,
)
from tests.lab.papers.resonator import bode_figure, nyquist_figure
from tests.lab.papers.resonator_loop import PERIODS_S, critical_couplings, features, table
from tests.lab.papers.resonator_sampled import sampled_boundaries

PERIODS = np.array([1e-4, 1e-3])


def lines(axes):
    return {str(line.get_label()).replace("\n", " "): line for line in axes.lines}


def test_the_bode_plot_is_the_table():
    device, controller, phase, near = bode_figure().axes
    hz = lines(device)["hand and device G"].get_xdata()
    assert (hz[0], hz[-1]) == pytest.approx((1.0, 1000.0))
    rows = table(hz)
    drawn = lines(device)["hand and device G"].get_ydata()
    assert np.array_equal(drawn, [row.device for row in rows])
    drawn = lines(controller)["controller K"].get_ydata()
    assert np.array_equal(drawn, [row.controller for row in rows])
    for axes in (phase, near):
        got = lines(axes)
        assert np.array_equal(got["G"].get_ydata(), [row.device_phase_deg for row in rows])
        ideal = got["K, ideal"].get_ydata()
        assert np.array_equal(ideal, [row.controller_phase_deg for row in rows])
        for at, name in enumerate(("1 ms", "0.1 ms")):
            late = got[f"K half a sample late, T = {name}"].get_ydata()
            assert np.array_equal(late, [row.delayed_phase_deg[at] for row in rows])
        (band,) = axes.patches
        assert (band.get_y(), band.get_height()) == (-90.0, 180.0)


def test_each_panel_of_the_bode_plot_has_its_units_and_range():
    device, controller, phase, near = bode_figure().axes
    assert [axes.get_ylabel() for axes in (device, controller, phase, near)] == [
        "|G| [m/(N s)]", "|K| [N s/m]", "phase [degrees]", "phase [degrees]",
    ]  # fmt: skip
    for axes in (device, controller):
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    for axes in (phase, near):
        assert axes.get_xlabel() == "frequency [Hz]"
        assert list(axes.get_yticks()) == [-270, -180, -90, 0, 90]
    assert (phase.get_xscale(), near.get_xscale()) == ("log", "linear")
    assert phase.get_xlim() == pytest.approx((1.0, 1000.0))
    assert phase.get_ylim() == (-285, 105)
    assert (near.get_xlim(), near.get_ylim()) == ((285, 345), (-195, 105))
    shown = [label.get_text() for label in phase.get_xticklabels() if label.get_visible()]
    assert shown[1:-1] == ["1", "10", "100", "1000"]


def test_the_resonances_are_marked_where_they_are():
    wanted = features()
    for axes in bode_figure().axes:
        got = lines(axes)
        assert got["anti-resonance 299.87 Hz"].get_xdata()[0] == wanted.anti_resonance_hz
        assert got["resonance 330.03 Hz"].get_xdata()[0] == wanted.resonance_hz


@pytest.mark.slow
def test_the_limits_are_those_of_the_analysis():
    prompt, late = (lines(axes) for axes in coupling_figure(PERIODS).axes)
    for drawn, name, share in (
        (prompt, "half a sample of pure delay, eq. 9", 0.5),
        (late, "one and a half samples of pure delay", 1.5),
    ):
        wanted = [critical_couplings(share * t)[0].gain for t in PERIODS]
        assert np.array_equal(drawn[name].get_ydata(), wanted)
        assert drawn["the paper's 3000 N/m"].get_ydata()[0] == 3000.0
    for delay, drawn in enumerate((prompt, late)):
        for scheme, (label, *_) in SCHEMES.items():
            if (name := label.replace("\n", " ")) in drawn:
                wanted = [
                    sampled_boundaries(t, scheme, delay, points=80)[0].coupling for t in PERIODS
                ]
                np.testing.assert_allclose(drawn[name].get_ydata(), wanted, rtol=1e-9)
    points = prompt["eq. 9: 3986 N/m at 1 ms; 15059 N/m at 0.1 ms"]
    assert points.get_xdata() == pytest.approx([1e3 * t for t in PERIODS_S])
    assert points.get_ydata() == pytest.approx([3986.095, 15058.934], rel=1e-6)


def test_a_limit_below_the_range_is_none_and_above_it_infinite():
    assert sampled_limit(1.1e-3, "cordis", 0) == 0.0  # w T > 2 whatever the coupling
    assert not sampled_boundaries(1.1e-3, "cordis", 0, low=LOW, points=20)
    assert sampled_limit(1e-5, "foh", 0) == np.inf


def test_the_loop_s_plot_goes_past_minus_one_at_the_modulus_margin():
    whole, near = nyquist_figure().axes
    assert near.get_xlim() == near.get_ylim() == (-2.5, 2.5)
    assert whole.get_xlim() == whole.get_ylim()
    for axes in (whole, near):
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("Re L", "Im L")
        (point,) = lines(axes)["-1"].get_xydata()
        assert tuple(point) == (-1.0, 0.0)
    for name in ("no delay", "half a sample late, T = 1 ms", "half a sample late, T = 0.1 ms"):
        got = lines(whole)[name]
        distance = np.abs(1.0 + got.get_xdata() + 1j * got.get_ydata())
        assert 0.2 < distance.min() < 0.3
