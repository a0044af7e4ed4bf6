"""Figures of an identification: force over position with the fit, over time, and the residual."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tautwave.analysis.identification.contact_model import ContactFit
from tautwave.analysis.identification.device_model import DeviceFit
from tautwave.analysis.identification.encoder_noise import NoiseFit
from tautwave.analysis.identification.regression import Array
from tautwave.canvas import FILTER, INK, LINE, SLAVE, SOFT, heading, legend, panels, png
from tautwave.files import make_directory, write_bytes
from tautwave.models.noise_colour import spectrum
from tautwave.report.figures.canvas import shade
from tautwave.report.run.contacts import Contact
from tautwave.report.units import quantity, scale_for, significant, within

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "identification.png"
UNDER = 2.6  # width of a line drawn under another one [pt]
MAX_POINTS = 4000


def contact_figure(
    chosen: ContactFit,
    track_s: Array,
    track: Array,
    *,
    title: str,
    start_s: float,
    units: tuple[str, str],
) -> Figure:
    """Force over position and over time with the chosen fit, its residual, stiffness over time."""
    place, effort = units
    figure, (loop, time, rest, trace) = panels(
        [2.6, 1.3, 1.0, 1.3], title, [False, False, False, False]
    )
    for axes in (rest, trace):
        axes.sharex(time)
    loop.margins(x=0.03)
    thin = slice(None, None, max(1, len(chosen.time_s) // MAX_POINTS))
    loop.plot(
        chosen.position[thin], chosen.effort[thin], color=FILTER, linewidth=UNDER, label="measured"
    )
    loop.plot(
        chosen.position[thin], chosen.model[thin], color=INK, linewidth=0.9,
        label=f"fitted:\n{chosen.name.replace('_', '-')}",
    )  # fmt: skip
    if "surface" in chosen.parameters:
        surface = chosen.parameters["surface"]
        loop.axvspan(surface.lower, surface.upper, color=SLAVE, alpha=0.25, linewidth=0)
        loop.axvline(surface.value, color=SLAVE, linewidth=1.0, label="surface")
    offset = chosen.parameters["offset"].value
    if chosen.side:
        loop.axhline(offset, color=SOFT, linewidth=0.9, linestyle=(0, (4, 3)), label="offset")
    loop.set_xlabel(f"position [{place}]")
    loop.set_ylabel(f"effort [{effort}]")
    heading(loop, _sentence(chosen, units))
    t = start_s + chosen.time_s
    time.plot(t[thin], chosen.effort[thin], color=FILTER, linewidth=UNDER, label="measured")
    time.plot(t[thin], chosen.model[thin], color=INK, linewidth=0.9, label="fitted")
    time.set_ylabel(f"effort [{effort}]")
    heading(time, "Over time; grey: in contact" if chosen.side else "Over time")
    residual = (chosen.effort - chosen.model)[thin]
    factor, unit = scale_for(float(np.nanmax(np.abs(residual), initial=0.0)), effort)
    rest.plot(t[thin], factor * residual, color=SLAVE, linewidth=0.8)
    rest.set_ylabel(f"residual [{unit}]")
    heading(
        rest,
        f"Residual: {significant(chosen.residual_rms, 3)} {effort} rms, "
        f"{1.0 - chosen.explained:.2%} of the variance",
    )
    trace.plot(
        start_s + track_s, track, color=LINE, linewidth=1.2, label="recursive,\nforgets in 1 s"
    )
    _band(trace, chosen)
    trace.set_xlabel("time [s]")
    trace.set_ylabel("stiffness" + ("" if chosen.name == "hunt_crossley" else f" [{_per(units)}]"))
    heading(trace, "Stiffness estimate over time")
    if chosen.side:
        for axes in (time, rest, trace):
            shade(axes, _contacts(t, chosen))
    for axes in (loop, time, trace):
        legend(axes)
    return figure


def _band(axes: Axes, fit: ContactFit) -> None:
    """Fit to all samples with its 95 % interval; the view is limited to plausible values."""
    level = fit.working_stiffness if fit.name == "hunt_crossley" else fit.parameters["stiffness"]
    axes.axhspan(level.lower, level.upper, color=SOFT, alpha=0.25, linewidth=0)
    axes.axhline(level.value, color=INK, linewidth=0.9, label="all samples,\n95 % interval")
    half = max(4.0 * (level.upper - level.lower), 0.5 * level.value)
    axes.set_ylim(min(level.value - half, level.lower), max(level.value + half, level.upper))


def _contacts(t: Array, fit: ContactFit) -> list[Contact]:
    """Intervals of rows in contact."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], fit.touching.astype(int), [0]])))
    last = len(t) - 1
    return [
        Contact(
            float(t[begin]),
            float(t[min(end, last)] - t[begin]),
            math.nan,
            math.nan,
            begin,
            min(end, last),
        )
        for begin, end in edges.reshape(-1, 2).tolist()
    ]


def _per(units: tuple[str, str]) -> str:
    return f"{units[1]}/{units[0]}" if units[0] else "effort per position"


def _sentence(fit: ContactFit, units: tuple[str, str]) -> str:
    level = fit.working_stiffness
    what = "Stiffness deep in contact" if fit.name == "hunt_crossley" else "Stiffness"
    half = 0.5 * (level.upper - level.lower)
    return f"{what} {within(level.value, half)} {_per(units)}"


def device_figure(fit: DeviceFit, axis: str, units: tuple[str, str]) -> Figure:
    """Filtered effort over time with the model's, and the residual."""
    figure, (time, rest) = panels([1.9, 1.2], f"Identification of {axis}", True)
    thin = slice(None, None, max(1, len(fit.time_s) // MAX_POINTS))
    factor, unit = scale_for(float(np.max(np.abs(fit.effort))), units[1])
    measured = factor * fit.effort[thin]
    time.plot(fit.time_s[thin], measured, color=FILTER, linewidth=UNDER, label="commanded")
    fitted = "fitted: inertia, damping, Coulomb friction"
    time.plot(fit.time_s[thin], factor * fit.model[thin], color=INK, linewidth=0.8, label=fitted)
    time.set_ylabel(f"effort [{unit}]")
    parameters = ", ".join(
        f"{word} {within(e.value, 0.5 * (e.upper - e.lower), 4)} {unit_of}"
        for word, e, unit_of in (
            ("inertia", fit.inertia, "kg m²" if units[0] == "rad" else "kg"),
            ("damping", fit.damping, f"{units[1]} s/{units[0]}"),
            ("Coulomb", fit.coulomb, units[1]),
        )
    )
    heading(time, parameters)
    legend(time)
    rest_of = fit.effort - fit.model
    factor, unit = scale_for(float(np.max(np.abs(rest_of))), units[1])
    rest.plot(fit.time_s[thin], factor * rest_of[thin], color=SLAVE, linewidth=0.8)
    rest.set_ylabel(f"residual [{unit}]")
    rest.set_xlabel("time [s]")
    heading(rest, f"Residual: {quantity(fit.residual_rms, units[1], 3)} rms")
    return figure


def noise_figure(fit: NoiseFit, period: float, unit: str) -> Figure:
    """Noise over time, and its spectrum as the declared lags have it."""
    figure, (time, density) = panels([1.9, 1.5], "Encoder of a lever at rest", [False, False])
    factor, scaled = scale_for(float(np.max(np.abs(fit.residual))), unit)
    thin = slice(None, None, max(1, len(fit.residual) // MAX_POINTS))
    times = period * np.arange(len(fit.residual))
    time.plot(times[thin], factor * fit.residual[thin], color=SLAVE, linewidth=0.6)
    time.set_xlabel("time [s]")
    time.set_ylabel(f"position [{scaled}]")
    heading(time, f"Noise of {quantity(fit.deviation.value, unit, 3)}, without drift")
    if fit.autocorrelation is not None:
        theta = np.linspace(0.0, math.pi, 400)
        shape = [spectrum(fit.autocorrelation, at) for at in theta.tolist()]
        density.plot(theta / (2.0 * math.pi * period), shape, color=INK, linewidth=1.0)
        density.axhline(1.0, color=SOFT, linewidth=0.9, label="white")
        density.set_ylim(0.0, 1.1 * max(shape))
        legend(density)
    density.set_xlabel("frequency [Hz]")
    density.set_ylabel("density over its mean")
    heading(density, "Colour" if fit.autocorrelation is not None else "Colour: unknown")
    return figure


def write_figure(figure: Figure, directory: Path) -> Path:
    """Write identification.png; return its path."""
    path = directory / NAME
    make_directory(directory)
    write_bytes(path, png(figure))
    return path
