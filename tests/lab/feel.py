"""Pictures of the rigs `feel-*`, and what is felt of each: `python -m tests.lab feel --out DIR`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tautwave import canvas
from tautwave.canvas import heading, legend
from tautwave.certificate.haptics import Feel
from tautwave.certificate.haptics.feel import rig_feel
from tautwave.config import load_rig
from tautwave.config.shipped import examples
from tautwave.files import make_directory, write_text
from tautwave.simulation import Simulation, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 500


def feel_figure(title: str, run: Simulation) -> Figure:
    """Return the motion of both levers over time, and hand and contact over where each lever is."""
    figure, (motion, force) = canvas.panels([2.4], title, False, columns=2)
    step = max(len(run) // POINTS, 1)
    sides = (("master", "hand", 1.0, canvas.MASTER), ("slave", "environment", -1.0, canvas.SLAVE))
    for side, whose, sign, colour in sides:
        at = 1e3 * run[f"true.{side}.lever.position"][::step]
        effort = sign * 1e3 * run[f"true.{side}.lever.{whose}_effort"][::step]
        motion.plot(run["time_s"][::step], at, color=colour, label=side)
        force.plot(at, effort, color=colour, label="hand" if side == "master" else "contact")
    motion.set_xlabel("time [s]")
    motion.set_ylabel("position [mrad]")
    heading(motion, "Where the levers are")
    legend(motion)
    force.set_xlabel("position [mrad]")
    force.set_ylabel("effort [mN m]")
    heading(force, "What the hand feels, what is there")
    legend(force)
    return figure


def row_of(name: str, one: Feel) -> str:
    """Return a line of the table in docs/start/feel.md."""
    felt = "-" if one.stiffness is None else f"{one.stiffness:.3g}"
    return f"| `{name}` | {felt} | {'-' if one.drag is None else f'{1e3 * one.drag:.0f}'} |"


@click.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of pictures.")
def feel(out: Path) -> None:
    """Draw the rigs `feel-*`, and print what is felt of a wall of 250 N m/rad and when free."""
    make_directory(out)
    for example in examples():
        if example.name.startswith("feel-"):
            rig = load_rig(example.path)
            figure = feel_figure(example.summary, simulate(rig, engine="python"))
            drawn = canvas.alone(canvas.svg(figure, example.name, example.summary))
            write_text(out / f"{example.name}.svg", drawn)
            click.echo(row_of(example.name, rig_feel(rig)[0][0]))
