"""Positive real or not: thirteen functions, and the object with half a sample of delay.

Source: Berdahl, Smith & Niemeyer, appendices B and D; the functions and their answers, recomputed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tautwave import canvas
from tautwave.analysis.exact.positive_real import positive_real
from tautwave.analysis.exact.rational import Rational, rational
from tautwave.canvas import heading, legend
from tests.lab.papers import Chapter, Row
from tests.lab.papers.resonator_loop import (
    controller_impedance,
    device_admittance,
    features,
    greatest_passive_delay,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BAND_HZ = (1.0, 1000.0)
DELAYS_S = np.geomspace(1e-8, 1e-3, 161)


def functions() -> list[tuple[str, Rational, bool]]:
    """Return name, function and whether it is positive real."""
    pade = rational(["-0.00025", 1], ["0.00025", 1])
    return [
        ("G, eq. 7", device_admittance(), True),
        ("K, eq. 8", controller_impedance(), True),
        ("(s+1)/(s+2)", rational([1, 1], [1, 2]), True),
        ("s/(s²+1)", rational([1, 0], [1, 0, 1]), True),
        ("(s²+s+1)/(s²+s+4), touches 0", rational([1, 1, 1], [1, 1, 4]), True),
        ("(s+1000)/(s(1+s/1000))", rational([1, 1000], ["0.001", 1, 0]), True),
        ("1/s²", rational([1], [1, 0, 0]), False),
        ("-1/s", rational([-1], [1, 0]), False),
        ("(s-1)/(s-2), phase within 90°", rational([1, -1], [1, -2]), False),
        ("(s²+s+1)/(s²+s+4+1e-12)", rational([1, 1, 1], [1, 1, 4 + 1e-12]), False),
        ("1/(s²+s+1)", rational([1], [1, 1, 1]), False),
        ("(s/2+1000)/(s(1+s/1000))", rational(["0.5", 1000], ["0.001", 1, 0]), False),
        ("eq. 9 by Padé, T = 1 ms", controller_impedance() * pade, False),
    ]


def rows() -> list[Row]:
    """Return each verdict (1: positive real), and the longest period passive at low frequencies."""
    listed = [
        Row(f"{name} (1: positive real)", "", float(positive_real(k).positive_real), float(is_real),
            0.0, "recomputed")
        for name, k, is_real in functions()
    ]  # fmt: skip
    period = 2.0 * greatest_passive_delay()
    listed.append(Row("longest passive T at f = 0", "s", period, 2.4566e-7, 5e-12, "recomputed"))
    return listed


def region_figure() -> Figure:
    """Return the regions of frequency and delay where Re K(jw) e^(-jw tau) is not negative."""
    figure, (wide, near) = canvas.panels(
        [2.6], "Where the delayed object is still resistive: Re K ≥ 0", False, columns=2
    )
    low, high = features()[:2]
    for axes, hz in (
        (wide, np.geomspace(*BAND_HZ, 1200)),
        (near, np.linspace(low - 15.0, high + 15.0, 1200)),
    ):
        s = np.asarray(2j * math.pi * hz)
        turned = np.exp(-np.multiply.outer(DELAYS_S, s)) * controller_impedance().at(s)
        axes.contourf(hz, 2e3 * DELAYS_S, turned.real >= 0.0, [0.5, 1.5], colors=[canvas.PASSIVE])
        axes.fill_between([], [], [], color=canvas.PASSIVE, linewidth=0, label="resists")
        axes.set_yscale("log")
        for period, dash in ((1.0, "--"), (0.1, "-.")):
            label = f"the paper's T = {period:g} ms"
            axes.axhline(period, color=canvas.SLAVE, linestyle=dash, linewidth=1.3, label=label)
        axes.axhline(
            2e3 * greatest_passive_delay(), color=canvas.WALL, linewidth=1.3, label="0.25 µs"
        )
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("sampling period T [ms], delay T/2")
    wide.set_xscale("log")
    wide.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    heading(wide, "All frequencies: almost no passive region remains")
    heading(near, "Between the resonances there is one")
    legend(wide)
    return figure


CHAPTER = Chapter(rows, {"positive-real": region_figure})
