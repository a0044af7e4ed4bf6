"""The resonator behind its coupling spring: Bode and Nyquist plots, features and poles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave import canvas
from tautwave.analysis.exact.rational import Delayed
from tautwave.canvas import heading, legend
from tests.analysis.reference.curves import curve
from tests.lab.papers import Chapter, Row, relative
from tests.lab.papers import resonator_loop as resonator
from tests.lab.papers.loops import modulus_margin, revised_bode
from tests.lab.papers.resonator_loop import PERIODS_S, closed_loop_poles, features

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAPER, AGAIN = "Berdahl et al.", "recomputed"
_DELAYED = ((canvas.SLAVE, "--"), (canvas.LINE, "-."))
_TURN = 2.0 * math.pi


def rows() -> list[Row]:
    """Return frequencies, decay and peak of the object, and the poles of hand and object."""
    found = features()
    listed = [
        relative("anti-resonance", "Hz", found.anti_resonance_hz, 299.871, 1e-6, PAPER),
        relative("resonance, device blocked", "Hz", found.resonance_hz, 330.031, 1e-6, PAPER),
        relative("decay of the ring", "s", found.decay_s, 0.8, 1e-6, PAPER),
        relative("peak of |K|", "N s/m", found.peak, 209.302, 5e-5, AGAIN),
    ]
    for delay, name, poles in (
        (0.0, "no delay", (-1.26393389 + 2074.52998j, -17.46858 + 144.07973j)),
        (5e-4, "T = 1 ms", (-0.493804 + 2074.10339j, -13.12204 + 144.38184j)),
        (5e-5, "T = 0.1 ms", (-1.171746 + 2074.52667j, -17.03602 + 144.12983j)),
    ):
        for got, pole in zip(closed_loop_poles(delay=delay), poles, strict=False):
            which = "object" if abs(pole) > 1e3 else "hand"
            listed += [
                Row(f"{which}'s pole, {name}: growth", "1/s", got.real, pole.real, 1e-5, AGAIN),
                relative(f"{which}'s pole, {name}", "rad/s", got.imag, pole.imag, 1e-6, AGAIN),
            ]
    for period in PERIODS_S:
        verdict = revised_bode(_loop(0.5 * period)).stable
        name = f"stable at k_c = 3 N/mm, T = {1e3 * period:g} ms (1: yes)"
        listed.append(Row(name, "", float(verdict), 1.0, 0.0, PAPER))
    return listed


def bode_figure() -> Figure:
    """Return G and K over frequency: magnitudes, phases, and the phases around the resonance."""
    figure, (device, controller, phase, near) = canvas.panels(
        [1.3, 1.3, 1.9, 1.9],
        "A resonator behind a coupling spring: hand G and controller K",
        [True, True, True, False],
    )
    hz = curve(resonator.controller_impedance(), 1.0, 1000.0).frequency_hz
    rows = resonator.table(hz)
    device.loglog(hz, [row.device for row in rows], color=canvas.WALL, label="hand and device G")
    device.set_ylabel("|G| [m/(N s)]")
    heading(device, "Magnitude of the hand's admittance, eq. 7")
    controller.loglog(
        hz, [row.controller for row in rows], color=canvas.MASTER, label="controller K"
    )
    controller.set_ylabel("|K| [N s/m]")
    heading(controller, "Magnitude of the controller's impedance, eq. 8; a delay does not alter it")
    for axes in (phase, near):
        axes.axhspan(
            -90.0, 90.0, color=canvas.WALL_SHADE, alpha=0.45, linewidth=0, label="±90° band"
        )
        for at, (period, (colour, dash)) in enumerate(zip(PERIODS_S, _DELAYED, strict=True)):
            late = [row.delayed_phase_deg[at] for row in rows]
            name = f"K half a sample late,\nT = {1e3 * period:g} ms"
            axes.plot(hz, late, color=colour, linestyle=dash, label=name)
        ideal = [row.controller_phase_deg for row in rows]
        axes.plot(hz, ideal, color=canvas.MASTER, label="K, ideal")
        axes.plot(hz, [row.device_phase_deg for row in rows], color=canvas.WALL, label="G")
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("phase [degrees]")
        axes.set_yticks([-270, -180, -90, 0, 90])
    phase.set_ylim(-285, 105)
    heading(phase, "Phase: only the delayed controllers leave the band, even at low frequencies")
    near.set_xlim(285, 345)
    near.set_ylim(-195, 105)
    heading(near, "The same around anti-resonance and resonance")
    phase.tick_params(labelbottom=True)
    phase.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    _mark_resonances((device, controller, phase, near))
    for axes in (device, controller, phase, near):
        legend(axes)
    return figure


def nyquist_figure() -> Figure:
    """Return L = G K in the plane, ideal and half a sample late, whole and around -1."""
    figure, (whole, near) = canvas.panels(
        [3.0], "The loop L = G K: does it encircle -1?", False, columns=2
    )
    hz = np.unique(np.concatenate([np.geomspace(0.5, 2000.0, 3000), np.linspace(320, 345, 4000)]))
    s = np.asarray(1j * _TURN * hz)
    ideal = resonator.device_admittance().at(s) * resonator.controller_impedance().at(s)
    curves = [(0.0, canvas.MASTER, "-", "no delay")]
    curves += [
        (0.5 * period, colour, dash, f"half a sample late, T = {1e3 * period:g} ms")
        for period, (colour, dash) in zip(PERIODS_S, _DELAYED, strict=True)
    ]
    for axes, reach in ((whole, 1.1), (near, 0.0)):
        for delay, colour, dash, label in curves:
            at = ideal * np.exp(-s * delay)
            axes.plot(at.real, at.imag, color=colour, linestyle=dash, label=label, linewidth=1.2)
        axes.plot([-1.0], [0.0], "P", color=canvas.INK, markersize=9, label="-1", zorder=5)
        axes.axhline(0.0, color=canvas.SOFT, linewidth=0.8)
        axes.axvline(0.0, color=canvas.SOFT, linewidth=0.8)
        axes.set_xlabel("Re L")
        axes.set_ylabel("Im L")
        side = reach * float(np.abs(ideal).max()) if reach else 2.5
        axes.set_xlim(-side, side)
        axes.set_ylim(-side, side)
    heading(whole, "Whole")
    margins = [
        modulus_margin(_loop(delay), _TURN * 0.5, _TURN * 2000.0).margin for delay, *_ in curves
    ]
    distances = ", ".join(f"{value:.2g}" for value in margins)
    heading(near, f"Around -1; distances {distances}")
    legend(whole)
    return figure


def _loop(delay: float) -> Delayed:
    held = resonator.device_admittance() * resonator.controller_impedance()
    return Delayed(held, delay)


def _mark_resonances(bode: tuple[Axes, ...]) -> None:
    low, high = resonator.features()[:2]
    for axes in bode:
        for hz, dash, name in ((low, ":", "anti-resonance"), (high, "--", "resonance")):
            style: Any = {"color": canvas.SOFT, "linewidth": 1.0, "linestyle": dash}
            axes.axvline(hz, label=f"{name}\n{hz:.2f} Hz", zorder=1.5, **style)


CHAPTER = Chapter(rows, {"resonator-bode": bode_figure, "resonator-nyquist": nyquist_figure})
