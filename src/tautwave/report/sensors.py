"""The effort sensors of a run against its motors, where the axes stood still."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from tautwave.analysis.identification.sensor_balance import (
    SensorBalance,
    find_rests,
    most_at_rest,
    sensor_balance,
)
from tautwave.report.run.rundir import SIDES, Run, block, served_rows
from tautwave.report.units import number

WINDOW_S = 0.05
"""[s] Of a rest."""

PLAY = 6.0
"""Standard deviations that positions of an axis at rest may lie apart."""


def sensor_sentences(run: Run) -> Iterator[str]:
    """Yield a sentence on every effort sensor that the motors contradict."""
    for pair in run.pairs:
        for side in SIDES:
            keys = block(run.rig, side, "axes", pair)
            balance = balance_of(run, f"{side}.{pair}", keys)
            if balance is not None:
                yield from _sentence(f"{side}.{pair}", keys, balance)


def greatest_friction(keys: Mapping[str, Any]) -> float:
    """Return what an axis at rest may hold [N m or N]."""
    believed = number(block(keys, "coulomb").get("value")) or 0.0
    return most_at_rest(believed, number(keys.get("effort_limit")) or 0.0)


def balance_of(run: Run, axis: str, keys: Mapping[str, Any]) -> SensorBalance | None:
    """Return what the rests of an axis allow of its sensor; None without sensor or rest.

    An axis that carries a load is left out: what its motor holds is not known here.
    """
    side = axis.split(".", maxsplit=1)[0]
    arms = block(run.rig, side, "arm") or block(run.rig, side, "arms")
    loaded = keys.get("load") is not None or arms
    names = [f"{axis}.{what}" for what in ("position", "commanded", "measured_effort", "valid")]
    if loaded or keys.get("effort_sensor") is None or not set(names) <= set(run.columns):
        return None
    read = run.read(*names)
    served = served_rows(run, axis)
    position, motor, shown, valid = (read[name][served] for name in names)
    noise = number(keys.get("position_noise")) or 0.0
    quantum = number(keys.get("encoder_quantum")) or 0.0
    rests = find_rests(
        position,
        motor,
        np.where(valid > 0.5, shown, np.nan),
        window=max(8, round(WINDOW_S * run.rate_hz)),
        play=2.0 * quantum + PLAY * noise,
        quantum=number(block(keys, "effort_sensor").get("quantum")) or 0.0,
    )
    return sensor_balance(rests, greatest_friction(keys))


def _sentence(axis: str, keys: Mapping[str, Any], balance: SensorBalance) -> Iterator[str]:
    sensor, unit = block(keys, "effort_sensor"), "N m" if keys.get("kind") == "rotary" else "N"
    scale, offset = number(sensor.get("scale")) or 1.0, number(sensor.get("offset")) or 0.0
    friction = f"with a friction of at most {greatest_friction(keys):.3g} {unit}"
    if 1.0 not in balance.scale:
        low, high = balance.scale
        to = f"{low:.3g} to {high:.3g}" if high < 1e6 else f"more than {low:.3g}"
        new = f"{scale * balance.scale.middle:.3g}" if high < 1e6 else f"{scale * low:.3g} or more"
        yield (
            f"{axis}: its effort sensor reads {to} times what its motor held at {balance.rests} "
            f"rests, {friction}: effort_sensor.scale should be about {new}, or effort_limit and "
            "the motor's torque constant are wrong."
        )
    elif 0.0 not in balance.offset:
        yield (
            f"{axis}: at rest and unloaded, its effort sensor reads {balance.offset.lower:.3g} to "
            f"{balance.offset.upper:.3g} {unit} ({balance.rests} rests, {friction}): "
            f"effort_sensor.offset should be about {offset + scale * balance.offset.middle:.3g}."
        )
