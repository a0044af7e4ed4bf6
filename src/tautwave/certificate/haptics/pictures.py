"""Z-width, felt impedance and limit cycles as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.analysis.walls.limit_cycle import REST, UNBOUNDED, trace_limit_cycle
from tautwave.canvas import (
    INK,
    LIMIT,
    LINE,
    MASTER,
    PAPER,
    PASSIVE,
    SHADE,
    SLAVE,
    SOFT,
    STABLE,
    WALL,
    heading,
    legend,
    panels,
    plain,
    save_figure,
    text_panel,
)
from tautwave.certificate.haptics import Haptics
from tautwave.certificate.haptics.cycles import SAMPLES, WallCycle
from tautwave.certificate.haptics.transparency import Felt
from tautwave.certificate.haptics.width import AxisWidth
from tautwave.certificate.panels import decades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, FELT, CYCLES = "z-width.png", "transparency.png", "limit-cycle.png"
SHOWN_CYCLES = 4

WIDTH_WORDS = (
    "The stiffest wall over its virtual damping: passive for any hand, or only stable with the "
    "stated hand (a slave: with none)."
)
FELT_WORDS = (
    "Impedance felt by the hand: an ideal rig shows exactly what the slave touches. Absolute "
    "stability: where Llewellyn's margin is not negative, in the linear regime, the rig is stable "
    "between any passive hand and environment; grey is too close to 0 for a verdict on a sampled "
    "rig. Where the margin is negative, a port's tank has to intervene."
)
CYCLE_WORDS = (
    "The bare device pressed against the wall by a constant force. Depth is proportional to the "
    "force; the frequency is independent of it."
)


def draw_haptics(name: str, haptics: Haptics, directory: Path) -> list[Path]:
    """Write a PNG of each non-empty kind, SVG and PDF beside it; return the paths of the PNGs.

    Raises
    ------
    WritingError
        A file cannot be written.
    """
    drawn = []
    for file, made in (
        (WIDTH, width_figure(name, haptics.widths) if haptics.widths else None),
        (FELT, felt_figure(name, haptics.felt) if haptics.felt else None),
        (
            CYCLES,
            cycle_figure(name, bounding(haptics.cycles)) if bounding(haptics.cycles) else None,
        ),
    ):
        if made is not None:
            drawn.append(save_figure(made, directory / file))
    return drawn


def bounding(cycles: tuple[WallCycle, ...]) -> tuple[WallCycle, ...]:
    """Return the bounded limit cycles, which can be drawn."""
    return tuple(one for one in cycles if one.predicted != UNBOUNDED)


def width_figure(name: str, widths: tuple[AxisWidth, ...]) -> Figure:
    """Return K over B of every impedance axis, two per row."""
    rows = (len(widths) + 1) // 2
    title = f"{name}: the stiffest walls (Z-width)"
    figure, axes = panels([2.3] * rows + [0.1], title, False, columns=2)
    text_panel(axes[-2], [(SOFT, WIDTH_WORDS)])
    axes[-1].set_axis_off()
    for panel in axes[len(widths) : -2]:
        panel.set_axis_off()
    for panel, one in zip(axes, widths, strict=False):
        _width(panel, one)
    return figure


def felt_figure(name: str, felt: tuple[Felt, ...]) -> Figure:
    """Return felt impedance and Llewellyn's margin of every pair."""
    title = f"{name}: what the hand feels (transparency)"
    figure, axes = panels([2.3] * len(felt) + [0.1], title, False, columns=2)
    text_panel(axes[-2], [(SOFT, FELT_WORDS)])
    axes[-1].set_axis_off()
    for at, one in enumerate(felt):
        _felt(axes[2 * at], one)
        _margin(axes[2 * at + 1], one)
    return figure


def cycle_figure(name: str, cycles: tuple[WallCycle, ...]) -> Figure:
    """Return a few simulated periods of every limit cycle with the prediction."""
    title = f"{name}: limit cycles of walls that are not passive"
    figure, axes = panels([2.0] * len(cycles) + [0.1], title, False)
    text_panel(axes[-1], [(SOFT, CYCLE_WORDS)])
    for panel, one in zip(axes, cycles, strict=False):
        _cycle(panel, one)
    return figure


def _width(panel: Axes, one: AxisWidth) -> None:
    spring, damper = ("N m/rad", "N m s/rad") if one.rotary else ("N/m", "N s/m")
    # The first B is 0: on a logarithmic axis draw it at the next one, at the left end.
    across = one.dampings[1:]
    passive, stable = one.passive[1:], one.stable[1:]
    finite = np.concatenate([values[np.isfinite(values) & (values > 0)] for values in
                             (passive, stable, np.array([one.best()[0]]))])  # fmt: skip
    high = 3.0 * float(finite.max()) if len(finite) else 1.0
    low = high * 1e-6 if not len(finite) else max(1e-5 * high, 0.03 * float(finite.min()))
    if one.best()[0] > 0.0:
        low = min(low, 0.1 * one.best()[0])
    panel.set_xscale("log")
    panel.set_yscale("log")
    ceiling = 1e3 * high
    panel.fill_between(
        across, low, np.clip(stable, low, ceiling), color=STABLE, linewidth=0, label="stable"
    )
    panel.fill_between(
        across, low, np.clip(passive, low, ceiling), color=PASSIVE, linewidth=0, label="passive"
    )
    who = "with the stated hand" if one.hand is not None else "without a hand"
    panel.plot(across, _shown(stable, ceiling), color=MASTER, linestyle="--", label=who)
    panel.plot(across, _shown(passive, ceiling), color=WALL, label="for any hand")
    if one.wall is not None:
        style: Any = {"markersize": 8, "markeredgecolor": PAPER, "zorder": 4, "clip_on": False}
        at = max(one.wall[1], float(across[0]))
        passes = one.wall[0] <= np.interp(one.wall[1], one.dampings, one.passive) * (1.0 + 1e-6)
        colour = WALL if passes else SLAVE
        panel.plot(at, one.wall[0], "o", color=colour, label="its own wall", **style)
        high = max(high, 3.0 * one.wall[0])
        low = min(low, 0.3 * one.wall[0])
    panel.set(xlabel=f"virtual damping B [{damper}]", ylabel=f"stiffness K [{spring}]")
    panel.set_xlim(float(across[0]), float(across[-1]))
    panel.set_ylim(low, high)
    heading(panel, plain(one.axis))
    legend(panel)


def _shown(values: Any, ceiling: float) -> Any:
    return np.where(values > 0.0, np.minimum(values, ceiling), np.nan)


def _felt(panel: Axes, one: Felt) -> None:
    unit = "N m s/rad" if one.rotary else "N s/m"
    curves = [
        (one.blocked, SLAVE, "-", "slave clamped"),
        (one.free, MASTER, "-", "slave free"),
        (one.device, SOFT, ":", "the master alone"),
    ]
    if one.touching is not None and one.ideal is not None:
        curves += [
            (one.touching, WALL, "-", f"touching {one.contact}"),
            (one.ideal, INK, "--", "the same, ideal"),
        ]
    for values, colour, dash, label in curves:
        if np.abs(values).max() > 0.0:
            panel.loglog(
                one.hertz, np.abs(values), dash, color=colour, label=plain(label), linewidth=1.3
            )
    panel.set(xlabel="frequency [Hz]", ylabel=f"|Z| [{unit}]")
    decades(panel)
    heading(panel, f"{plain(one.pair)}: impedance felt by the hand")
    legend(panel)


def _margin(panel: Axes, one: Felt) -> None:
    panel.axhline(0.0, color=LIMIT, linewidth=1.2, label="limit")
    panel.fill_between(one.hertz, -one.blur, one.blur, color=SHADE, alpha=0.6, linewidth=0)
    colour = WALL if one.stable else SLAVE
    panel.semilogx(one.hertz, one.margin, color=colour, label="Llewellyn's margin")
    panel.set(xlabel="frequency [Hz]", ylabel="margin")
    top = max(0.05, 1.1 * float(one.margin.max()))
    panel.set_ylim(min(-0.1 * top, 1.2 * float(one.margin.min())), top)
    decades(panel)
    heading(panel, f"{plain(one.pair)}: absolute stability")
    legend(panel)


def _cycle(panel: Axes, one: WallCycle) -> None:
    place = "rad" if one.rotary else "m"
    predicted = one.predicted
    hertz = one.simulated.frequency or (predicted.frequency if predicted is not None else 0.0)
    period = one.wall.period
    shown = min(round(SHOWN_CYCLES / hertz / period), 4000) if hertz > 0.0 else 400
    time, depth, _ = trace_limit_cycle(
        one.wall, one.device, one.bias, samples=SAMPLES, shown=max(shown, 20), fall=one.fall
    )
    at_rest = one.bias / one.wall.stiffness
    reach = max(
        float(np.abs(depth).max()),
        at_rest,
        *((predicted.depth, predicted.height) if predicted is not None else ()),
    )
    power = int(3 * np.floor(np.log10(reach) / 3.0)) if reach < 0.1 else 0
    factor, unit = {-3: (1e3, f"m{place}"), -6: (1e6, f"µ{place}")}.get(power, (1.0, place))
    simulated = one.simulated
    ends = [factor * float(value) for value in (depth.max(), at_rest, depth.min(), 0.0)]
    top, bottom = max(ends), min(ends)
    if predicted is not None:
        top, bottom = max(top, factor * predicted.depth), min(bottom, -factor * predicted.height)
    top, bottom = top + 0.08 * (top - bottom), bottom - 0.08 * (top - bottom)
    panel.axhspan(0.0, top, color=PASSIVE, alpha=0.6, linewidth=0, label="in the wall")
    seen = "simulated, at rest" if simulated == REST else f"simulated, {simulated.frequency:.3g} Hz"
    panel.plot(1e3 * time, factor * depth, color=MASTER, label=seen)
    panel.axhline(factor * at_rest, color=SOFT, linestyle=":", label="resting depth F / K")
    if predicted is not None and predicted != REST:
        label = f"predicted, {predicted.frequency:.3g} Hz"
        panel.axhline(factor * predicted.depth, color=LINE, linestyle="--", label=label)
        panel.axhline(-factor * predicted.height, color=LINE, linestyle="--")
    panel.set(xlabel="time [ms]", ylabel=f"depth [{unit}]")
    panel.set_ylim(bottom, top)
    push = "N m" if one.rotary else "N"
    heading(panel, f"{plain(one.name)}, pressed with {one.bias:.3g} {push}")
    legend(panel)
