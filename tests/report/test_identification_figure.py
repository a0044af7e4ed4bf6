"""The figure of an identified device: units, and a fit that does not hide what was measured."""

import numpy as np
import pytest

from tautwave.analysis.identification.device_model import DeviceFit
from tautwave.analysis.identification.regression import Estimate
from tautwave.canvas import png
from tautwave.report.figures.identification import device_figure


@pytest.mark.parametrize(
    ("units", "named"),
    [(("rad", "N m"), ("kg m²", "N m s/rad", "N m")), (("m", "N"), ("kg", "N s/m", "N"))],
)
def test_what_was_found_has_units(units, named):
    time = np.linspace(0.0, 1.0, 200)
    effort = 1e-3 * np.sin(9.0 * time)
    some = Estimate(0.5, 0.4, 0.6)
    fit = DeviceFit(some, some, some, some, 1e-6, 1.0, 0.0, 1.0, time, effort, 0.999 * effort)
    figure = device_figure(fit, "master.wrist", units)
    png(figure, 600)
    above = figure.axes[0]
    reported = " ".join(above.get_title(loc="left").split())
    assert reported == "inertia 0.5 ± 0.1 {}, damping 0.5 ± 0.1 {}, Coulomb 0.5 ± 0.1 {}".format(
        *named
    )
    measured, fitted = above.lines
    assert measured.get_linewidth() > 2.0 * fitted.get_linewidth()
