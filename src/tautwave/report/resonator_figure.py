"""Figures of the worked example: `python -m tautwave.report.resonator_figure DIR` draws both.

Bode plot of hand and controller with and without half a sample of delay, and how far the coupling
spring may go over the sampling period. Every number is that of `tautwave.analysis.resonator` and
`tautwave.analysis.resonator_sampled`; nothing is computed here.

Source: Berdahl, Smith & Niemeyer (the second seed), eqs 7-9.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.analysis import resonator
from tautwave.analysis.axis import curve
from tautwave.analysis.resonator import COUPLING, PERIODS_S, Floats
from tautwave.analysis.resonator_sampled import Scheme, sampled_boundaries, sampled_poles
from tautwave.errors import RecordingError, TautwaveError
from tautwave.report import canvas
from tautwave.report.canvas import heading, legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BODE, COUPLINGS = "resonator-bode.png", "resonator-coupling.png"
GRID_S = np.unique(np.r_[np.geomspace(5e-5, 4e-4, 13), np.geomspace(4e-4, 2e-3, 41), PERIODS_S])
LOW, HIGH = 500.0, 40_000.0
"""Couplings [N/m] that are searched for a limit."""
SCHEMES: dict[Scheme, tuple[str, str, str]] = {
    "zoh": ("zero-order hold", canvas.SLAVE, "-"),
    "foh": ("first-order hold", canvas.WALL, "--"),
    "tustin": ("trapezoidal (Tustin)", canvas.MASTER, "-."),
    "cordis": ("explicit (CORDIS)", canvas.LINE, ":"),
    "cordis_late": ("the same, object's\nposition a sample old", canvas.FILTER, "-"),
}
_DELAYED = ((canvas.SLAVE, "--"), (canvas.LINE, "-."))
_JUMP = 1.3  # up from one period to the next: the first unstable band is gone


def draw_resonator(directory: Path, periods_s: Floats = GRID_S) -> list[Path]:
    """Write both figures into a directory, made if need be; some fifteen seconds.

    Parameters
    ----------
    periods_s : sampling periods [s] of the second figure, rising

    Raises
    ------
    RecordingError
        If the directory or a file in it cannot be written.
    """
    paths = [directory / BODE, directory / COUPLINGS]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        paths[0].write_bytes(canvas.png(bode_figure(), dpi=1000 / 9.8))
        paths[1].write_bytes(canvas.png(coupling_figure(periods_s), dpi=1000 / 9.8))
    except OSError as err:
        raise RecordingError(f"{directory}: cannot be written: {err.strerror}") from err
    return paths


def bode_figure() -> Figure:
    """Return G and K over frequency: magnitudes, phases, and the phases around the resonance."""
    figure, (device, controller, phase, near) = canvas.panels(
        [1.5, 1.5, 2.4, 2.4],
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
    heading(phase, "Phase: only the delayed controllers leave the band, at low frequencies already")
    near.set_xlim(285, 345)
    near.set_ylim(-195, 105)
    heading(near, "The same around anti-resonance and resonance")
    phase.tick_params(labelbottom=True)
    phase.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    _mark_resonances((device, controller, phase, near))
    for axes in (device, controller, phase, near):
        legend(axes)
    return figure


def coupling_figure(periods_s: Floats = GRID_S) -> Figure:
    """Return the greatest stable coupling spring over the sampling period [s], by scheme."""
    figure, (prompt, late) = canvas.panels(
        [3.4, 3.4], "How stiff the coupling spring may be before the loop is unstable", False
    )
    for axes, delay, name in (
        (prompt, 0, "half a sample of\npure delay, eq. 9"),
        (late, 1, "one and a half\nsamples of pure delay"),
    ):
        axes.set_xscale("log")
        axes.set_yscale("log")
        pure = [pure_limit((0.5 + delay) * t) for t in periods_s]
        axes.plot(1e3 * periods_s, pure, color=canvas.INK, linewidth=2.4, label=name)
        for scheme, (label, colour, dash) in SCHEMES.items():
            if scheme == "cordis_late" and delay:
                continue  # its object is a sample late already
            limits = np.array([sampled_limit(t, scheme, delay) for t in periods_s])
            _plot_limits(axes, 1e3 * periods_s, limits, color=colour, linestyle=dash, label=label)
        axes.axhline(
            COUPLING, color=canvas.SOFT, dashes=(5, 2), label=f"the paper's {COUPLING:g} N/m"
        )
        axes.set_ylim(1e3, HIGH)
        axes.set_yticks([1e3, 3e3, 1e4, 3e4])
        axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
        axes.minorticks_off()
        for way in (axes.xaxis, axes.yaxis):
            way.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("sampling period T [ms]")
        axes.set_ylabel("critical k_c [N/m]")
    points = [pure_limit(0.5 * t) for t in PERIODS_S]
    text = "eq. 9: " + "\n".join(
        f"{k:.0f} N/m, {1e3 * t:g} ms" for k, t in zip(points, PERIODS_S, strict=True)
    )
    dots: Any = {"color": canvas.DAMPER, "markeredgecolor": canvas.INK, "markersize": 8}
    prompt.plot(1e3 * np.array(PERIODS_S), points, "o", zorder=4, label=text, **dots)
    heading(
        prompt,
        "Force held from the sample on; a gap: the first unstable range ends, the next is higher",
    )
    heading(late, "Force a whole sample later still")
    for axes in (prompt, late):
        legend(axes)
    return figure


def pure_limit(delay: float) -> float:
    """Return the first critical k_c [N/m] with a pure delay [s]."""
    return resonator.critical_couplings(delay)[0].gain


def sampled_limit(period: float, scheme: Scheme, delay: int) -> float:
    """Return the first k_c [N/m] that is unstable: 0 if `LOW` is, infinite if none to `HIGH`."""
    if np.abs(sampled_poles(LOW, period, scheme, delay)).max() >= 1.0:
        return 0.0
    found = sampled_boundaries(period, scheme, delay, LOW, HIGH, points=40)
    return found[0].coupling if found else math.inf


def _mark_resonances(bode: tuple[Axes, ...]) -> None:
    low, high = resonator.features()[:2]
    for axes in bode:
        for hz, dash, name in ((low, ":", "anti-resonance"), (high, "--", "resonance")):
            style: Any = {"color": canvas.SOFT, "linewidth": 1.0, "linestyle": dash}
            axes.axvline(hz, label=f"{name}\n{hz:.2f} Hz", zorder=1.5, **style)


def _plot_limits(axes: Axes, x: Floats, limits: Floats, **style: Any) -> None:
    found = np.where(np.isfinite(limits), np.maximum(limits, LOW), np.nan)
    jumps = np.flatnonzero(found[1:] > _JUMP * found[:-1]) + 1
    shown = np.insert(found, jumps, np.nan)
    axes.plot(np.insert(x, jumps, x[jumps]), shown, linewidth=1.8, **style)


def main() -> int:
    """Draw both figures into the directory in argv[1]."""
    if len(sys.argv) != 2:
        sys.stderr.write("usage: python -m tautwave.report.resonator_figure DIR\n")
        return 2
    try:
        for path in draw_resonator(Path(sys.argv[1])):
            sys.stdout.write(f"{path}\n")
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
