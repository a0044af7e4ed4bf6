"""`identify RECORDING --lever`: a device from how it moved under the effort of its motor."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.analysis.identification.device_model import DeviceFit, fit_device
from tautwave.analysis.identification.moving_encoder import moving_noise, moving_step
from tautwave.analysis.identification.plausible import implausible
from tautwave.analysis.identification.regression import Estimate
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.session.identification.identifying import device_numbers, device_snippet
from tautwave.session.identification.recorded_columns import (
    Series,
    changing,
    motor_column,
    read_positions,
    read_series,
    too_little,
    with_beside,
)

FILTER_HZ = 20.0
DELAYS = (0.0, 1.0, 2.0)
"""Periods after which a logged effort may act: the one that explains most is taken."""

DOUBTFUL = 0.9

WEIGHT = ("cosine", "sine")
WEIGHED = 0.2
"""Share of a weight by which it may be wrong."""

WRONG, WILD = 0.1, 4.0
"""Greatest error of a sensor's scale without a note; factor at which no rig should believe it."""


class LeverResult(NamedTuple):
    """A lever: its fit, its encoder, and how the effort in the file acts."""

    series: Series
    outside_name: str | None
    fit: DeviceFit
    quantum: float
    noise: Estimate
    delay: float
    turned: bool
    notes: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        fit, series = self.fit, self.series
        names = ["inertia", "damping", "coulomb", "bias"]
        names += ["outside"] if fit.outside is not None else []
        weight = {} if fit.weight is None else dict(zip(WEIGHT, fit.weight, strict=True))
        offset = self.sensor_offset
        return {
            "kind": "lever",
            "source": series.source,
            "position": series.position_name,
            "effort": series.effort_name,
            "outside_effort": self.outside_name,
            "axis_kind": {True: "rotary", False: "linear", None: None}[series.rotary],
            "samples": len(series.position),
            "rate_hz": 1.0 / series.period,
            "effort_turned": self.turned,
            "delay_periods": self.delay,
            "parameters": {name: getattr(fit, name)._asdict() for name in names}
            | {name: estimate._asdict() for name, estimate in weight.items()},
            "sensor_offset": None if offset is None else offset._asdict(),
            "encoder_quantum": self.quantum,
            "position_noise": self.noise._asdict(),
            "residual_rms": fit.residual_rms,
            "explained": fit.explained,
            "peak_velocity": fit.peak_velocity,
            "snippet": self.snippet,
            "notes": self.notes,
        }

    @property
    def sensor_offset(self) -> Estimate | None:
        """What the sensor shows without an effort, if the lever weighs nothing [N m or N]."""
        fit = self.fit
        if fit.outside is None or fit.outside.value == 0.0:
            return None
        unit, bias = fit.outside, fit.bias
        value = -bias.value / unit.value
        half = 0.5 * math.hypot(
            bias.upper - bias.lower, value * (unit.upper - unit.lower)
        ) / abs(unit.value)  # fmt: skip
        return Estimate(value, value - half, value + half)

    @property
    def snippet(self) -> str:
        """Lines for the axis in the rig file."""
        if self.implausible:
            return f"# {self.series.position_name}: nothing here is credible, see the notes"
        noise = f"position_noise: {self.noise.value:.3g}"
        step = [f"encoder_quantum: {self.quantum:.5g}"] if self.quantum > 0.0 else []
        sensor, offset = [], self.sensor_offset
        if offset is not None and self.fit.outside is not None and self.fit.outside.value > 0.0:
            scale = 1.0 / self.fit.outside.value
            sensor = [f"effort_sensor: {{offset: {offset.value:.3g}, scale: {scale:.3g}}}"]
        return "\n".join([*self._device, *step, noise, *sensor, *self._load])

    @property
    def _load(self) -> list[str]:
        weight = self.fit.weight
        if weight is None:
            return []
        if not self.knows_weight:
            return ["# load: not known from this, see the notes"]
        cosine, sine = (f"{one.value:.4g}" for one in weight)
        return [f"load: {{constant: {self.fit.bias.value:.4g}, cosine: {cosine}, sine: {sine}}}"]

    @property
    def knows_weight(self) -> bool:
        """Whether the weight is known to a fifth of itself, or negligible beside the friction."""
        assert self.fit.weight is not None
        size = math.hypot(*(one.value for one in self.fit.weight))
        doubt = max(one.upper - one.value for one in (*self.fit.weight, self.fit.bias))
        return doubt < max(WEIGHED * size, self.fit.coulomb.value)

    @property
    def implausible(self) -> list[str]:
        """A sentence for each number that is outside physics."""
        series = self.series
        moved = float(np.ptp(series.position[series.known]))
        values = device_numbers(self.fit) | {
            "position": moved, "position_noise": self.noise.value,
        }  # fmt: skip
        return implausible(values, series.rotary)

    @property
    def _device(self) -> list[str]:
        scale = 1.0 if self.fit.outside is None else abs(self.fit.outside.value)
        wild = not 1.0 / WILD < scale < WILD  # a mass in units of a sensor, not of the motor
        if self.fit.inertia.lower <= 0.0 or pushes(self.fit) or wild:
            return [f"# {self.series.position_name}: inertia and friction are not known from this"]
        return [device_snippet(self.series.position_name, self.fit)]


def identify_lever(
    source: Path,
    *,
    position: str | None = None,
    effort: str | None = None,
    outside: str | None = None,
    gravity: bool = False,
    time: str | None = None,
    axis: str | None = None,
    filter_hz: float | None = None,
    begin_s: float | None = None,
    end_s: float | None = None,
    stated: Stated = UNSTATED,
) -> LeverResult:
    """Fit inertia, friction and encoder of a lever that its motor moved.

    Parameters
    ----------
    position, effort : str, optional
        Columns of the position and of the motor's effort, of either sign.
    outside : str, optional
        Column of an effort sensor between the lever and what it touched; its scale and sign are
        found as well. Without it nothing may have touched the lever.
    gravity : bool
        Whether the lever has a weight that its position turns; it is found as a rig's `load`.
    time, axis : str, optional
        Column of the time, and axis, if they do not follow from the names.
    filter_hz : float, optional
        Cut-off of the filter on all signals [Hz]; default 20, at most rate / 25.
    begin_s, end_s : float, optional
        Part of the recording [s on its own clock].
    stated : Stated
        What the file does not say itself.

    Raises
    ------
    ConfigError, RecordingError
        Not readable, ambiguous columns, too short, or the lever did not move.
    """
    part = (begin_s, end_s)
    effort = motor_column(source, axis, effort, stated)
    series = changing(read_series(source, position, effort, time, axis, part, stated))
    if gravity and series.rotary is False:
        raise ConfigError(
            f"--gravity: {series.position_name} is linear, and its weight is the same everywhere: "
            "the constant external effort"
        )
    felt = None
    if outside is not None:
        series, felt = with_beside(series, source, outside, time, axis, stated)
    cutoff = min(filter_hz or FILTER_HZ, 0.04 / series.period)
    best: tuple[DeviceFit, float, bool] | None = None
    for delay in DELAYS:
        for sign in (1.0, -1.0):
            try:
                fit = fit_device(
                    series.position,
                    sign * series.effort,
                    series.period,
                    cutoff_hz=cutoff,
                    delay=delay,
                    known=series.known,
                    outside=felt,
                    weighs=gravity,
                )
            except ValueError as err:
                raise too_little(series, err) from err
            if fit.coulomb.value + fit.damping.value * fit.peak_velocity < 0.0:
                continue  # the effort's sign is the other way round
            if best is None or fit.explained > best[0].explained:
                best = fit, delay, sign < 0.0
    if best is None:
        raise RecordingError(
            f"{source}: {series.effort_name} does not move {series.position_name} against friction "
            "with either sign; name the motor's effort with --effort, and with --outside what "
            "touched the lever"
        )
    fit, delay, turned = best
    raw = read_positions(source, series.position_name, time, axis, part, stated)
    step = moving_step(raw.position[raw.known])
    noise = moving_noise(raw.position, step, raw.known)
    result = LeverResult(series, outside, fit, step, noise, delay, turned, [])
    return result._replace(notes=[*series.notes, *result.implausible, *_doubts(result)])


def pushes(fit: DeviceFit) -> bool:
    """Return whether friction would help the motion, which no friction does."""
    return fit.coulomb.upper < 0.0 or fit.damping.upper < 0.0


def _doubts(result: LeverResult) -> list[str]:
    fit = result.fit
    notes = []
    if result.turned:
        notes.append(
            f"{result.series.effort_name} counts against the position: its sign was inverted."
        )
    if fit.explained < DOUBTFUL or fit.inertia.lower <= 0.0:
        heavy = "" if fit.weight is not None else "--gravity finds a weight; "
        notes.append(
            f"Doubtful: inertia and friction explain {fit.explained:.0%} of the effort; something "
            f"else (a hand, a contact, a weight) acts on the lever. {heavy}name its sensor with "
            "--outside, or choose a free part with --from and --to."
        )
    elif pushes(fit):
        notes.append(
            f"Doubtful: friction comes out negative, so {result.series.effort_name} is not what "
            "moved the lever. Choose a part or a recording in which it is."
        )
    if fit.weight is not None and not result.knows_weight:
        moved = float(np.ptp(result.series.position[result.series.known]))
        notes.append(
            f"Doubtful: over {moved:.2g} rad a weight that turns is not told from a constant "
            "effort; move the lever farther, at best through a whole turn."
        )
    if fit.outside is not None:
        one = fit.outside
        if one.lower <= 0.0 <= one.upper:
            notes.append(
                f"{result.outside_name} explains nothing: its scale is not "
                "distinguishable from zero."
            )
        elif abs(abs(one.value) - 1.0) > WRONG:
            notes.append(
                f"By the motor's effort, one unit of {result.outside_name} is {one.value:.3g} "
                "units: one of both scales (or the sign) is wrong."
            )
        offset = result.sensor_offset
        if offset is not None and abs(offset.value) > max(fit.coulomb.value, 0.0):
            notes.append(
                f"{result.outside_name} reads {offset.value:.3g} at zero effort, or the lever has "
                "that weight: more than friction can hold at rest."
            )
    if float(np.max(np.abs(fit.effort))) > 0.0 and fit.damping.lower <= 0.0:
        notes.append("The damping is not distinguishable from zero: its lower bound is 0.")
    return notes
