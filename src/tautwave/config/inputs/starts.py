"""Where simulated devices begin that move or are pushed as recorded: where the recording does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tautwave.config.keys.coupling import Pair
from tautwave.config.keys.simulation import Hand, Intent, Recorded, Recording, Simulation
from tautwave.recordings.stated import stated_in
from tautwave.types import Imposed


def recorded_starts(
    pairs: Mapping[str, Pair], simulation: Simulation, motions: Mapping[str, Imposed]
) -> dict[str, float]:
    """Return the first position [rad or m] of each axis that a recording gives one.

    The other axis of a pair begins where the coupling would have it.

    Raises
    ------
    ConfigError
        A recording cannot be read.
    """
    starts = {
        name: _first(one, one.position) * one.scale + one.offset for name, one in motions.items()
    }
    for name, hand in simulation.hand.items():
        reference = hand.reference if isinstance(hand, Hand) else None
        if isinstance(reference, Recording):
            first = _first(reference, reference.column)
            starts.setdefault(f"master.{name}", first * reference.scale + reference.offset)
        elif isinstance(reference, Intent):
            first = _first(reference, reference.position)
            starts.setdefault(f"master.{name}", first)
    for name, keys in simulation.environment.items():
        if isinstance(keys, Recorded) and keys.position is not None:
            first = _first(keys, keys.position)
            starts.setdefault(f"slave.{name}", first)
    for name, pair in pairs.items():
        gain = pair.sign * pair.position_scale
        apart = 0.0 if isinstance(pair.offset, str) else pair.offset
        master, slave = f"master.{name}", f"slave.{name}"
        if master in starts:
            starts.setdefault(slave, gain * (starts[master] - apart))
        elif slave in starts:
            starts[master] = starts[slave] / gain + apart
    return starts


def _first(keys: Imposed | Recording | Intent | Recorded, column: str) -> float:
    from tautwave.recordings.columns import read_column  # not to import NumPy for every rig

    _, values = read_column(Path(keys.file), column, keys.time_column, stated_in(keys))
    return float(values[0])
