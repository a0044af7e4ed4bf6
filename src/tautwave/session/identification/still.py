"""`identify --noise`: what an encoder makes of a lever that stands still."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.analysis.identification.encoder_noise import (
    MIN_SAMPLES,
    NoiseFit,
    fit_noise,
)
from tautwave.analysis.identification.plausible import implausible
from tautwave.config import Rig
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.rig.arms import without_carrying
from tautwave.session.identification.identifying import record_excitation
from tautwave.session.identification.recorded_columns import Series, read_positions

MAX_ERROR = 0.1
"""Of a lag, without a doubt."""


class NoiseResult(NamedTuple):
    """The encoder's noise in a recording, and doubts about it."""

    series: Series
    fit: NoiseFit
    notes: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        series, fit = self.series, self.fit
        return {
            "kind": "noise",
            "source": series.source,
            "position": series.position_name,
            "axis_kind": {True: "rotary", False: "linear", None: None}[series.rotary],
            "samples": fit.samples,
            "rate_hz": 1.0 / series.period,
            "encoder_quantum": fit.quantum,
            "position_noise": fit.deviation._asdict(),
            "position_noise_autocorrelation": fit.autocorrelation,
            "lag_error": fit.lag_error,
            "drift": fit.drift,
            "levels": fit.levels,
            "snippet": self.snippet,
            "notes": self.notes,
        }

    @property
    def snippet(self) -> str:
        """Lines for the axis in the rig file."""
        if self.implausible:
            return f"# {self.series.position_name}: nothing here is credible, see the notes"
        return noise_snippet(self.fit)

    @property
    def implausible(self) -> list[str]:
        """A sentence for a number that is outside physics."""
        return implausible({"position_noise": self.fit.deviation.value}, self.series.rotary)


def identify_noise(
    source: Path,
    *,
    position: str | None = None,
    time: str | None = None,
    axis: str | None = None,
    begin_s: float | None = None,
    end_s: float | None = None,
    stated: Stated = UNSTATED,
) -> NoiseResult:
    """Measure the noise of an encoder in a recording of a lever that stands still.

    Parameters
    ----------
    position, time, axis : str, optional
        Columns and axis, if they do not follow from the names.
    begin_s, end_s : float, optional
        Part of the recording [s on its own clock].
    stated : Stated
        What the file does not say itself.

    Raises
    ------
    ConfigError, RecordingError
        Not readable, an ambiguous column, too short, or the lever moved.
    """
    series = read_positions(source, position, time, axis, (begin_s, end_s), stated)
    try:
        fit = fit_noise(series.position, series.period, series.known)
    except ValueError as err:
        remedy = (
            "record longer"
            if series.known.sum() < MIN_SAMPLES
            else "clamp the lever with its motor off, or choose a still part with --from and --to"
        )
        raise RecordingError(f"{source}: {series.position_name}: {err}; {remedy}") from err
    result = NoiseResult(series, fit, [])
    return result._replace(notes=[*series.notes, *result.implausible, *_doubts(series, fit)])


def identify_still(
    rig: Rig,
    *,
    axis: str | None,
    out: Path,
    duration_s: float,
    progress: Callable[[float, str], None] | None = None,
    **ways: Any,
) -> NoiseResult:
    """Record the axes of a rig without coupling and effort, and measure the noise of one.

    Parameters are those of `identify_device`.

    Raises
    ------
    TautwaveError
        The rig is refused, the run ended in a fault, or the lever moved.
    """
    if axis is None and len(rig.axes) > 1:
        raise ConfigError(f"{rig.name}: choose an axis with --axis: {', '.join(rig.axes)}")
    name = next(iter(rig.axes)) if axis is None else axis
    if name not in rig.axes:
        raise ConfigError(f"{rig.name}: there is no axis {name!r}; there are {', '.join(rig.axes)}")
    run = record_excitation(
        without_carrying(rig), name, {}, out=out, duration_s=duration_s, progress=progress, **ways
    )
    with run.heard.raised():
        result = identify_noise(out / "recording.mcap", axis=name)
    return result._replace(notes=[*run.notes, *result.notes])


def _doubts(series: Series, fit: NoiseFit) -> list[str]:
    if fit.quantum is None:
        return [
            "The position never changes, so its noise is below the step, and the step is unknown: "
            "take encoder_quantum from the data sheet."
        ]
    notes = []
    if fit.autocorrelation is None:
        notes.append(
            "The noise is below half a step and cannot be distinguished from it; its colour stays "
            "unknown, so the worst case is assumed."
        )
    else:
        notes.append(
            f"A lag is one sample at {1.0 / series.period:.6g} Hz: measure again when the rate of "
            "the axis changes."
        )
    if fit.lag_error > MAX_ERROR:
        notes.append(
            f"Doubtful: the lags are known only to within {fit.lag_error:.2g}; record longer."
        )
    if fit.quantum == 0.0:
        notes.append("Any step of the values is hidden by the noise.")
    return notes


def noise_snippet(fit: NoiseFit) -> str:
    """Return the lines to paste under the axis in the rig file."""
    lines = []
    if fit.quantum is not None:
        lines.append(f"encoder_quantum: {fit.quantum:.4g}")
    lines.append(f"position_noise: {fit.deviation.value:.3g}")
    if fit.autocorrelation is not None:
        lags = ", ".join(f"{lag:.4g}" for lag in fit.autocorrelation)
        lines.append(f"position_noise_autocorrelation: [{lags}]")
    return "\n".join(lines)
