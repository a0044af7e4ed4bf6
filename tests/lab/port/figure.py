"""A held force over a minute, before and after: a starved port, and one that holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from tautwave import canvas
from tautwave.canvas import heading, legend
from tests.lab.port.hold import Held

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Float = npt.NDArray[np.float64]

POINTS = 600


def held_figure(before: Held, after: Held, lab: Held) -> Figure:
    """Return the slave's effort and the error over time, of each law."""
    title = "0.3 N m held against 250 N m/rad, encoder noise 9e-5 rad at 2 kHz"
    figure, (effort, error) = canvas.panels([2.2, 2.2], title, True)
    shown = (
        (after, canvas.SLAVE, "with tank and reserve"),
        (lab, canvas.WALL, "laboratory's PD"),
        (before, canvas.MASTER, "without a reserve"),
    )
    for run, colour, name in shown:
        size = max(len(run.time) // POINTS, 1)
        count = len(run.time) // size

        def mean(values: Float, size: int = size, count: int = count) -> Float:
            averaged: Float = values[: size * count].reshape(count, size).mean(axis=1)
            return averaged

        effort.plot(mean(run.time), -1e3 * mean(run.efforts), color=colour, label=name)
        error.plot(mean(run.time), 1e3 * mean(run.errors), color=colour, label=name)
    effort.set_ylabel("slave's effort [mN m]")
    heading(effort, "The force that the slave presses with")
    legend(effort)
    error.set_ylabel("master - slave [mrad]")
    error.set_xlabel("time [s]")
    heading(error, "How far apart the levers are")
    legend(error)
    return figure
