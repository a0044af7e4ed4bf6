"""How stiff the coupling spring may be: the paper's pure delay, and the schemes that sample it.

Sources: Berdahl, Smith & Niemeyer, eq. 9; Cadoz, Luciani & Florens 1993 (`cordis`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave import canvas
from tautwave.canvas import heading, legend
from tests.lab.papers import Chapter, Row, relative
from tests.lab.papers import resonator_loop as resonator
from tests.lab.papers.resonator_loop import COUPLING, PERIODS_S, Floats
from tests.lab.papers.resonator_sampled import Scheme, sampled_boundaries, sampled_poles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GRID_S = np.unique(np.r_[np.geomspace(5e-5, 4e-4, 13), np.geomspace(4e-4, 2e-3, 41), PERIODS_S])
LOW, HIGH = 500.0, 40_000.0
"""Range of couplings [N/m] searched for a limit."""
SCHEMES: dict[Scheme, tuple[str, str, str]] = {
    "zoh": ("zero-order hold", canvas.SLAVE, "-"),
    "foh": ("first-order hold", canvas.WALL, "--"),
    "tustin": ("trapezoidal (Tustin)", canvas.MASTER, "-."),
    "cordis": ("explicit (CORDIS)", canvas.LINE, ":"),
    "cordis_late": ("the same, object's\nposition one sample old", canvas.FILTER, "-"),
}
SAMPLED: tuple[tuple[Scheme, float, int, float], ...] = (
    ("zoh", 1e-3, 0, 6319.753), ("zoh", 1e-3, 1, 5274.678),
    ("tustin", 1e-3, 0, 3584.589), ("tustin", 1e-3, 1, 3781.477),
    ("cordis", 1e-3, 0, 1779.968),
    ("zoh", 1e-4, 0, 9492.788), ("tustin", 1e-4, 0, 15039.569),
    ("cordis", 1e-4, 0, 15025.919), ("cordis", 1e-4, 1, 7326.028),
)  # fmt: skip
_JUMP = 1.3  # a rise from one period to the next: the first unstable band has vanished


def rows() -> list[Row]:
    """Return the critical springs: eq. 9, and by the scheme that renders the object."""
    listed = []
    for period, coupling, hz in ((1e-3, 3986.095, 339.472), (1e-4, 15058.934, 432.038)):
        first = resonator.critical_couplings(0.5 * period)[0]
        name = f"eq. 9, T = {1e3 * period:g} ms"
        listed += [
            relative(f"{name}: k_c", "N/m", first.gain, coupling, 1e-5, "Berdahl et al."),
            relative(
                f"{name}: where", "Hz", first.frequency / (2 * math.pi), hz, 1e-5, "recomputed"
            ),
        ]
    for scheme, period, delay, coupling in SAMPLED:
        found = sampled_boundaries(period, scheme, delay, points=40)[0].coupling
        name = f"{scheme}, T = {1e3 * period:g} ms, {delay} samples late: k_c"
        listed.append(relative(name, "N/m", found, coupling, 1e-5, "recomputed"))
    return listed


def coupling_figure(periods_s: Floats = GRID_S) -> Figure:
    """Return the greatest stable coupling spring over the sampling period [s], by scheme."""
    figure, (prompt, late) = canvas.panels(
        [2.7, 2.7], "How stiff the coupling spring may be before the loop becomes unstable", False
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
                continue  # its object is already one sample late
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
    text = "eq. 9: " + "; ".join(
        f"{k:.0f} N/m at {1e3 * t:g} ms" for k, t in zip(points, PERIODS_S, strict=True)
    )
    dots: Any = {"color": canvas.DAMPER, "markeredgecolor": canvas.INK, "markersize": 8}
    prompt.plot(1e3 * np.array(PERIODS_S), points, "o", zorder=4, label=text, **dots)
    heading(
        prompt,
        "Force held from the sample on; at a gap the first unstable range ends and the next is "
        "higher",
    )
    heading(late, "Force delayed by one more sample")
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


def _plot_limits(axes: Axes, x: Floats, limits: Floats, **style: Any) -> None:
    found = np.where(np.isfinite(limits), np.maximum(limits, LOW), np.nan)
    jumps = np.flatnonzero(found[1:] > _JUMP * found[:-1]) + 1
    shown = np.insert(found, jumps, np.nan)
    axes.plot(np.insert(x, jumps, x[jumps]), shown, linewidth=1.8, **style)


CHAPTER = Chapter(rows, {"resonator-coupling": coupling_figure})
