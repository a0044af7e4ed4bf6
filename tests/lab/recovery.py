"""What the friction by which an emptied tank recovers does to recorded hands, by splits.

The master's motion is imposed as it was recorded, from where it was recorded: a slave that engages
in front of a loaded spring is where tanks are emptied. Shown are the slave's error over that of the
laboratory's own recording. The slope of the friction is chosen on half of the recordings, by the
greatest error, and reported on the others, over all ways of halving them.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Mapping
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any

import click
import numpy as np

from tautwave.config import load_rig
from tautwave.config.shipped import find_example
from tautwave.laws import port
from tautwave.simulation import simulate
from tests.lab.port.hands import PERIOD, Hand, recorded_hands
from tests.lab.port.rigs import CONTACTS, IMPOSED
from tests.lab.port.tracking import SETTLED_S, rms

SLOPES = (0.0, 1.0, 2.0, 3.0, 4.0)
"""Of m over the time constant; 0: no friction, the leak alone recovers."""


@contextmanager
def slope_of(value: float) -> Any:
    """Let ports be built with another slope."""
    kept = port.RECOVERY_SLOPE
    port.RECOVERY_SLOPE = value
    try:
        yield
    finally:
        port.RECOVERY_SLOPE = kept


def share(hand: Hand, folder: Path, slope: float, impedance: float) -> float:
    """Return the slave's error over the laboratory's [1]; infinite for a run that ended early."""
    path = folder / f"{hand.name}.csv"
    if not path.exists():
        rows = np.column_stack([np.arange(len(hand.positions)) * PERIOD, hand.positions])
        np.savetxt(path, rows, delimiter=",", header="time_s,hand", comments="")
    reference = f"{{type: recording, file: {path}, column: hand, repeat: false}}"
    changes = [
        f"coupling.pairs.lever.wave_impedance={impedance}",
        f"simulation.hand.lever={{{IMPOSED}, reference: {reference}}}",
        f"simulation.environment.lever={CONTACTS[hand.contact]}",
        f"duration_s={len(hand.positions) * PERIOD}",
    ]
    with slope_of(slope):
        run = simulate(load_rig(find_example("bench-1dof-2khz").path, changes), engine="python")
    if run.error is not None or hand.recorded is None:
        return float("inf")
    first = round(SETTLED_S / PERIOD)
    count = min(len(run), len(hand.recorded)) - round(0.3 / PERIOD)
    return rms(run["lever.position_error"][first:count]) / rms(hand.recorded[first:count])


def splits(found: Mapping[str, Mapping[float, float]]) -> tuple[list[float], dict[float, int]]:
    """Return the greatest shares on the other halves, and how often each slope was chosen."""
    names = sorted(found)
    worst, chosen = [], dict.fromkeys(SLOPES, 0)
    for half in combinations(names, len(names) // 2):
        others = [name for name in names if name not in half]
        best = min(SLOPES, key=lambda one: max(found[name][one] for name in half))
        chosen[best] += 1
        worst.append(max(found[name][best] for name in others))
    return worst, chosen


@click.command()
@click.option("--recordings", type=click.Path(path_type=Path, exists=True), required=True)
@click.option("--impedance", type=float, default=0.05, show_default=True)
def recovery(recordings: Path, impedance: float) -> None:
    """Replay recorded hands with and without the friction by which a tank recovers."""
    found: dict[str, dict[float, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for hand in recorded_hands(recordings):
            shares = {one: share(hand, Path(folder), one, impedance) for one in SLOPES}
            found[hand.name] = shares
            line = "  ".join(f"{value:5.2f}" for value in shares.values())
            click.echo(f"{hand.name:20s} {line}", err=False)
    worst, chosen = splits(found)
    click.echo(f"greatest on the other half: median {statistics.median(worst):.2f}, ", nl=False)
    click.echo(f"at most {max(worst):.2f} in {len(worst)} ways of halving")
    click.echo("chosen: " + ", ".join(f"slope {one:g}: {n}" for one, n in chosen.items() if n))
