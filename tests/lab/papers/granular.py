"""Granular synthesis: ten grains between linear springs on the floor and squared ones on the bar.

Source: Berdahl, Smith & Niemeyer; masses, gap and stiffnesses, which the paper does not give, are
those of `configs/scene-granular.yaml`. The paper gives no numbers: the reference is physics,
conserved energy without losses and a bar pushed by the sum of the grains.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from tautwave import canvas
from tautwave.canvas import heading, legend
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tests.lab.papers import Chapter, Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GRAINS, RATE_HZ = 10, 44_100
FLOOR, BAR, SWING = -0.02, -0.012, 0.004
"""[m] Floor, height of the bar, and how far the hand swings it in the figure."""
SWINGS_HZ = 8.0
Floats = npt.NDArray[np.float64]


def network(loss: float) -> Network:
    """Return the grains with Hunt and Crossley's loss [s/m] in every contact."""
    masses = tuple(Mass(f"grain{i}", 1e-3, FLOOR) for i in range(GRAINS))
    links = [
        Link(f"floor{i}", "contact", f"grain{i}", "floor", stiffness=1e4, loss=loss)
        for i in range(GRAINS)
    ]
    links += [
        Link(f"bar{i}", "contact", "bar", f"grain{i}", stiffness=1e7, exponent=2.0, loss=loss)
        for i in range(GRAINS)
    ]
    grounds = (("ground", 0.0), ("floor", FLOOR))
    return Network(masses, tuple(links), ("bar",), grounds, gravity=9.81)


def thrown(loss: float) -> SceneModel:
    """Return a model whose grains fly up at 0.9 m/s from ten heights, with its books started."""
    model = SceneModel(network(loss), "discrete_gradient", 1.0 / RATE_HZ)
    model.reset([BAR])
    for grain in range(GRAINS):
        model.arrays.x[grain] += 0.002 + 3e-4 * grain
        model.arrays.v[grain] = 0.9
    model.start = model.ledger()
    return model


def rows() -> list[Row]:
    """Return energy kept and forces balanced over 6000 steps with the bar at rest."""
    model = thrown(0.0)
    kept = balance = 0.0
    knocks = 0
    for _ in range(6000):
        (effort,) = model.advance([BAR])
        pulls = [
            float(pull)
            for pull, name in zip(model.arrays.tension, model.compiled.links, strict=True)
            if name.startswith("bar")
        ]
        balance = max(balance, abs(effort - sum(pulls)))
        kept = max(kept, abs(model.ledger().energy - model.start.energy))
        knocks += effort != 0.0
    return [
        Row("energy lost or gained, no losses", "J", kept, 0.0, 1e-12, "physics"),
        Row("bar's force minus the sum of the grains'", "N", balance, 0.0, 1e-12, "Newton 3"),
        Row("the grains reach the bar (1: yes)", "", float(knocks > 50), 1.0, 0.0, "the paper"),
    ]


def play(seconds: float = 0.5) -> tuple[Floats, Floats, Floats, Floats]:
    """Return time [s], bar [m], grains [m] and force on the bar [N] while the bar swings.

    Shapes (n,), (n,), (n, `GRAINS`), (n,).
    """
    model = thrown(0.1)
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    bar = BAR - SWING * np.sin(2.0 * np.pi * SWINGS_HZ * time)
    grains, force = np.empty((len(time), GRAINS)), np.empty(len(time))
    for at, place in enumerate(bar.tolist()):
        (force[at],) = model.advance([place])
        grains[at] = model.arrays.x[:GRAINS]
    return time, bar, grains, force


def granular_figure() -> Figure:
    """Return bar and grains over time, the force on the bar, and its spectrum."""
    figure, (flight, push, sound) = canvas.panels(
        [2.4, 1.4, 1.8], "Ten grains that a swinging bar throws at the floor", [True, True, False]
    )
    time, bar, grains, force = play()
    for at in range(GRAINS):
        flight.plot(
            1e3 * time, 1e3 * grains[:, at], color=canvas.WALL, linewidth=0.7, alpha=0.8,
            label="grains" if at == 0 else "_",
        )  # fmt: skip
    flight.plot(1e3 * time, 1e3 * bar, color=canvas.MASTER, label="bar, held by the hand")
    flight.axhline(1e3 * FLOOR, color=canvas.INK, linewidth=1.0, label="floor")
    flight.set_ylabel("height [mm]")
    heading(flight, "Flight between floor and bar")
    legend(flight)
    push.plot(1e3 * time, force, color=canvas.MASTER, linewidth=0.8)
    push.set_ylabel("force [N]")
    push.set_xlabel("time [ms]")
    heading(push, "What the hand feels; its fast part is the sound")
    power = np.abs(np.fft.rfft(force * np.hanning(len(force))))[1:]
    hertz = np.fft.rfftfreq(len(force), 1.0 / RATE_HZ)[1:]
    level = 20.0 * np.log10(np.maximum(power / power.max(), 1e-9))
    sound.semilogx(hertz, level, color=canvas.MASTER, linewidth=0.6)
    sound.set_xlabel("frequency [Hz]")
    sound.set_ylabel("level [dB]")
    sound.set_xlim(20.0, 20_000.0)
    sound.set_ylim(-100.0, 5.0)
    sound.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    heading(sound, "Spectrum of that force")
    return figure


CHAPTER = Chapter(rows, {"granular": granular_figure})
