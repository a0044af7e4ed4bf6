"""The constructed hand: a passive one that drives eq. 9 unstable, by a root and by a motion.

Source: the necessity proof omitted by Berdahl, Smith & Niemeyer, by construction; numbers
recomputed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tautwave import canvas
from tautwave.analysis.ports.necessity import Counterexample, destabilising_hand
from tautwave.canvas import heading, legend
from tests.analysis.reference.delay_loops import verified_unstable
from tests.lab.papers import Chapter, Row, relative
from tests.lab.papers.necessity_motion import simulate_hand
from tests.lab.papers.resonator_loop import PERIODS_S, delayed_controller

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TUNED_HZ = 20.0
PUBLISHED = {
    1e-3: (0.62909242, 0.61814393, 7464.29483, 0.49096165 + 125.66275812j),
    1e-4: (0.62787107, 0.06171675, 7440.17561, 0.04913780 + 125.66369660j),
}


def constructed(period: float) -> Counterexample:
    """Return the hand tuned to 20 Hz against eq. 9 at a sampling period [s]."""
    controller = delayed_controller(0.5 * period)
    found = destabilising_hand(controller, 2.0 * math.pi * TUNED_HZ)
    assert found is not None
    return found


def rows() -> list[Row]:
    """Return the hand and its growing root, at both periods; the root is counted again."""
    listed = []
    for period in PERIODS_S:
        found, name = constructed(period), f"T = {1e3 * period:g} ms"
        mass, damping, stiffness, root = PUBLISHED[period]
        listed += [
            relative(f"{name}: mass", "kg", found.hand.mass, mass, 2e-5, "recomputed"),
            relative(f"{name}: damping", "N s/m", found.hand.damping, damping, 2e-5, "recomputed"),
            relative(f"{name}: spring", "N/m", found.hand.stiffness, stiffness, 2e-5, "recomputed"),
            relative(f"{name}: growth", "1/s", found.root.real, root.real, 2e-5, "recomputed"),
            relative(f"{name}: swing", "rad/s", found.root.imag, root.imag, 2e-5, "recomputed"),
        ]
        counted = verified_unstable(found, delayed_controller(0.5 * period))
        listed.append(Row(f"{name}: unstable (1: yes)", "", float(counted), 1.0, 0.0, "recomputed"))
    return listed


def motion_figure() -> Figure:
    """Return the simulated motion of the hand beside the growth of its root."""
    figure, panels = canvas.panels(
        [2.2], "A passive hand that the delayed object drives into oscillation", False, columns=2
    )
    for axes, period in zip(panels, PERIODS_S, strict=True):
        # At 0.1 ms growth at 20 Hz takes a minute to be visible: use the fastest growing one there.
        quick = destabilising_hand(delayed_controller(0.5 * period))
        found = quick if quick is not None and period < 1e-3 else constructed(period)
        seen = simulate_hand(found, delayed_controller(0.5 * period), growth_times=3.0)
        said = seen.amplitude[-1] * np.exp(found.root.real * (seen.time - seen.time[-1]))
        axes.semilogy(seen.time, seen.amplitude, color=canvas.MASTER, label="simulated")
        label = f"its root grows e-fold in {found.growth_time:.3g} s"
        axes.semilogy(seen.time, said, "--", color=canvas.SLAVE, label=label)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("amplitude, relative")
        m, r, k = found.hand
        axes.plot([], [], " ", label=f"{m:.3g} kg, {r:.2g} N s/m, {k:.4g} N/m")
        heading(axes, f"T = {1e3 * period:g} ms, {found.root.imag / (2.0 * math.pi):.3g} Hz")
        legend(axes)
    return figure


CHAPTER = Chapter(rows, {"constructed-hand": motion_figure})
