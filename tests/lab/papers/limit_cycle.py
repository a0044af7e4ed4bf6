"""The bounce of a device pressed against a sampled wall: predicted by its mode, and simulated.

Source: Colgate & Schenkel's slides (a bias force, b < K T / 2); they show the bounce without
numbers, so the reference is the prediction, compared with the simulation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tautwave import canvas
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.limit_cycle import (
    VOLUNTARY_HZ,
    predict_limit_cycle,
    simulate_limit_cycle,
    trace_limit_cycle,
)
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.canvas import heading, legend
from tests.lab.papers import Chapter, Row, relative

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WALL, MASS, BIAS = SampledWall(1000.0, 0.0, 1e-3), 0.1, 1.0
DAMPINGS = (0.1, 0.3, 0.45)
SAMPLES = 20_000
SHARE = 0.03


def rows() -> list[Row]:
    """Return depth, frequency and peak effort of three devices, simulated and predicted."""
    listed = []
    for damping in DAMPINGS:
        device = Device(MASS, damping)
        said = predict_limit_cycle(WALL, device, BIAS)
        seen = simulate_limit_cycle(
            WALL, device, BIAS, samples=SAMPLES, fall=1.3 * said.height * WALL.stiffness / BIAS
        )
        name = f"b = {damping:g} N s/m"
        for what, unit, got, wanted in (
            ("depth", "m", seen.depth, said.depth),
            ("frequency", "Hz", seen.frequency, said.frequency),
            ("peak effort", "N", seen.peak_effort, said.peak_effort),
        ):
            listed.append(relative(f"{name}: {what}", unit, got, wanted, SHARE, "predicted"))
    return listed


def cycle_figure() -> Figure:
    """Return three bounces in time, and the frequency over the device's damping."""
    title = "Pressed with 1 N against K = 1 N/mm at 1 kHz, 0.1 kg"
    figure, (bounce, pitch) = canvas.panels([2.4, 2.0], title, False)
    colours = (canvas.SLAVE, canvas.MASTER, canvas.WALL)
    for damping, colour in zip(DAMPINGS, colours, strict=True):
        device = Device(MASS, damping)
        said = predict_limit_cycle(WALL, device, BIAS)
        time, depth, _ = trace_limit_cycle(
            WALL, device, BIAS, samples=SAMPLES, shown=500,
            fall=1.3 * said.height * WALL.stiffness / BIAS,
        )  # fmt: skip
        label = f"b = {damping:g} N s/m, predicted {said.frequency:.3g} Hz"
        bounce.plot(1e3 * time, 1e3 * depth, color=colour, label=label)
        bounce.axhline(1e3 * said.depth, color=colour, linestyle=":", linewidth=1.0)
    bounce.axhline(0.0, color=canvas.INK, linewidth=0.8)
    bounce.set_xlabel("time [ms]")
    bounce.set_ylabel("depth [mm]")
    heading(bounce, "Simulated motion; dotted: predicted greatest depth")
    legend(bounce)
    share = np.linspace(0.05, 0.49, 60)
    hertz = [predict_limit_cycle(WALL, Device(MASS, b), BIAS).frequency for b in share.tolist()]
    pitch.plot(share, hertz, color=canvas.MASTER, label="predicted")
    seen = [
        simulate_limit_cycle(
            WALL, Device(MASS, b), BIAS, samples=SAMPLES,
            fall=1.3 * predict_limit_cycle(WALL, Device(MASS, b), BIAS).height * 1e3,
        ).frequency
        for b in DAMPINGS
    ]  # fmt: skip
    pitch.plot(DAMPINGS, seen, "o", color=canvas.SLAVE, label="simulated")
    pitch.axhspan(0.0, VOLUNTARY_HZ, color=canvas.BAND, alpha=0.3, linewidth=0, label="a hand can")
    pitch.set_xlabel("damping of the device b [N s/m]; passive from 0.5 on")
    pitch.set_ylabel("frequency [Hz]")
    pitch.set_ylim(0.0, None)
    heading(pitch, "Faster than deliberate hand motion: caused by the interface")
    legend(pitch)
    return figure


CHAPTER = Chapter(rows, {"limit-cycle": cycle_figure})
