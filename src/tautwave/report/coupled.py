"""What the coupling of a pair generated in a run: its rows brought to the books of `analysis.rise`.

For laws whose ends are those of one spring (`Law.alike`). Everything is in the pair's units.
Left out is what is no work of the coupling's: rows in which a stop acts, or a ramp holds the effort
below what the spring asks for, and of an operated rig all that is not engaged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.rise import (
    Floats,
    Rise,
    Rows,
    clipped_potential,
    damping_work,
    feigned_by_noise,
    rise_of,
)
from tautwave.certificate.belief import SIDES, declared_delays
from tautwave.certificate.tuning.conditions import stall_joules
from tautwave.config import Rig
from tautwave.controller.answer import sample_gain
from tautwave.laws.limit import RAMPED, STOPPED
from tautwave.report.noise import measured_deviation
from tautwave.report.run.rundir import Run, block, engaged_rows, served_rows
from tautwave.rig import axis_allowance, pair_scale
from tautwave.rig.controller import axis_params, coupling_law, end_constants, pair_params
from tautwave.rig.scales import scaled

Places = npt.NDArray[np.int64]

TUNED = 1e-9
"""Of a tuned ceiling: an effort as near to it is held by it and by no ramp."""


class End(NamedTuple):
    """One end of a spring, in its device's units.

    `weight`: energy of the pair per that of the device; `ceiling` of its effort, where none is
    tuned; `damping` is what is left of the device's for the coupling, `answer` by how much the
    effort that acts changes with its newest sample.
    """

    weight: float
    ceiling: float
    damping: float
    answer: float


class Spring(NamedTuple):
    """A spring between two devices and its clip, as the master feels them, and its ends."""

    stiffness: float
    clip: float
    ends: tuple[End, End]


def is_spring(rig: Rig) -> bool:
    """Return whether a rig's coupling is a spring that both ends send alike."""
    return rig.scene is None and coupling_law(rig).alike


def spring_of(rig: Rig, pair: str) -> Spring:
    """Return the spring of a pair, as the controller has it."""
    delays = declared_delays(rig)
    names = [f"{side}.{pair}" for side in SIDES]
    axes = [axis_params(rig, name, delays[name], 0) for name in names]
    law, between = coupling_law(rig), pair_params(rig, pair, names, 0)
    ends = []
    for name, p in zip(names, axes, strict=True):
        gain = 0.0
        if p.delay == 0:
            mass = 0.5 * p.site.period / p.site.half_mobility
            end = end_constants(rig, name, delays[name])
            gain = sample_gain(law, end, between.link, p.site.period, p.site.gain, mass)
        damping = axis_allowance(rig, name, delays[name]).coupling_damping
        ends.append(End(p.weight, p.ceiling, damping, (1.0 - p.late) * gain))
    assert law.spring is not None
    return Spring(law.spring(between, *axes), axes[0].site.clip, (ends[0], ends[1]))


def stall_claim(rig: Rig, pair: str) -> float:
    """Return what held efforts of a spring may give in one stall at both ends [J, the pair's].

    Nothing is claimed without velocity limits, for nothing bounds it.
    """
    joules = stall_joules(rig, pair, declared_delays(rig))
    if joules is None:
        return 0.0
    return joules[0] + joules[1] / pair_scale(rig.coupling.pairs[pair]).power


def coupled_rise(run: Run, rig: Rig, pair: str) -> Rise | None:
    """Return what the coupling of a pair generated, None where its rows do not say."""
    names = [f"{side}.{pair}" for side in SIDES]
    own = [f"{pair}.coupler.absorbed", f"{pair}.position_error"]
    needed = [*own, *(f"{name}.{what}" for name in names for what in ("position", "valid"))]
    read = run.read(*needed, "skipped_slots", "operation.scale")
    if run.rows < 2 or any(name not in read for name in needed):
        return None
    at = np.flatnonzero(both_sampled(run, names, read))
    if len(at) < 2:
        return None
    skipped = read.get("skipped_slots", np.zeros(run.rows))
    time = np.cumsum(1.0 + np.nan_to_num(skipped))[at] / run.rate_hz
    lasted = np.diff(time)
    absorbed, stretch = (read[name][at] for name in own)
    acts = coupled_gaps(run, names, at, absorbed)
    scale = read.get("operation.scale", np.ones(run.rows))[at]
    acts &= scale[1:] == scale[:-1]
    supplied, damped, feigned = (np.zeros(len(lasted)) for _ in range(3))
    for factor in np.unique(scale):
        spring = spring_of(rig if factor == 1.0 else scaled(rig, float(factor)), pair)
        here = scale[:-1] == factor
        stored = clipped_potential(spring.stiffness, _clip(run, names, at, spring), stretch)
        supplied += np.where(here, np.diff(stored) - np.diff(absorbed), 0.0)
        for name, end in zip(names, spring.ends, strict=True):
            moved = np.diff(read[f"{name}.position"][at])
            variance = _variance(run, name, moved)
            damped += np.where(here, end.weight * damping_work(end.damping, moved, lasted), 0.0)
            feints = feigned_by_noise(end.damping, end.answer, variance, lasted)
            feigned += np.where(here, end.weight * feints, 0.0)
    flow = float(np.sum(np.abs(np.diff(absorbed))) + np.sum(np.abs(supplied)))
    return rise_of(time, supplied, damped, feigned, acts, flow)


def both_sampled(run: Run, names: Sequence[str], read: Mapping[str, Floats]) -> Rows:
    """Return the rows in which each of some axes has a fresh sample, (rows,)."""
    good = np.ones(run.rows, bool)
    for name in names:
        served = np.zeros(run.rows, bool)
        served[served_rows(run, name)] = True
        fresh = read[f"{name}.valid"] > 0.5
        good &= served & fresh & np.isfinite(read[f"{name}.position"])
    return good


def coupled_gaps(run: Run, names: Sequence[str], at: Places, absorbed: Floats) -> Rows:
    """Return between which of the rows `at` the coupling alone acted, (len(at) - 1,)."""
    engaged = engaged_rows(run)
    if engaged is None:
        begun = np.flatnonzero(absorbed != absorbed[0])
        acts = np.arange(len(at) - 1) >= (begun[0] - 1 if len(begun) else len(at))
    else:
        times = run.read("operation.engagement")["operation.engagement"]
        acts = engaged[at[1:]] & engaged[at[:-1]] & (times[at[1:]] == times[at[:-1]])
    for name in names:
        bits = run.read(f"{name}.limited").get(f"{name}.limited")
        if bits is None:
            continue
        kept = np.nan_to_num(bits).astype(np.int64)
        left = kept & (RAMPED | STOPPED)
        tuned = run.read(f"tuning.{name}.effort_ceiling", f"{name}.commanded")
        if len(tuned) == 2:
            ceiling, sent = tuned.values()
            left[(left == RAMPED) & (np.abs(sent) >= (1.0 - TUNED) * ceiling)] = 0
        acts &= np.bitwise_or.reduceat(left, at)[:-1] == 0
    return acts


def _variance(run: Run, axis: str, moved: Floats) -> Floats:
    """Return the noise of an encoder in its displacements, half their variance, (gaps,).

    Of white noise the deviation that was measured, or declared where that is less: a device that
    buzzes is no noise. An encoder's step shows where the device moves.
    """
    side, _, name = axis.partition(".")
    keys = block(run.rig, side, "axes", name)
    declared = float(keys.get("position_noise") or 0.0)
    noise = 0.0
    if declared > 0.0:
        noise = min(declared, measured_deviation(run, axis, keys) or 0.0)
    follows = (keys.get("position_noise_autocorrelation") or (0.0,))[0]
    step = float(keys.get("encoder_quantum") or 0.0)
    return noise**2 * (1.0 - follows) + np.where(moved != 0.0, step**2 / 12.0, 0.0)


def _clip(run: Run, names: Sequence[str], at: Places, spring: Spring) -> float | Floats:
    """Return the clip of the spring: tuned ceilings lower it at both ends by the lower share."""
    share: float | Floats = 1.0
    for name, end in zip(names, spring.ends, strict=True):
        tuned = run.read(f"tuning.{name}.effort_ceiling").get(f"tuning.{name}.effort_ceiling")
        if tuned is not None:
            share = np.minimum(share, tuned[at] / end.ceiling)
    return spring.clip * share
