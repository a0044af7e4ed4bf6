"""`identify RECORDING`: the impedance of the environment, or of the hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.analysis.identification.contact_model import (
    AUTOMATIC,
    MIN_ELASTIC,
    ContactFit,
    choose,
    fit_contact,
)
from tautwave.analysis.identification.contact_motion import motion_of
from tautwave.analysis.identification.hand_model import fit_hand
from tautwave.analysis.identification.plausible import implausible
from tautwave.analysis.identification.regression import Array, RecursiveLeastSquares
from tautwave.analysis.identification.sensor_lag import Recorded, fit_lagged
from tautwave.errors import RecordingError
from tautwave.files import make_directory, write_text
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.session.identification.recorded_columns import (
    Series,
    changing,
    read_series,
    too_little,
    with_beside,
)

DEFAULT_FILTER_HZ = 40.0
FORGETTING_S = 1.0


class ContactResult(NamedTuple):
    """The identified environment: all fitted models, the chosen one, and warnings.

    `track` is the chosen model's stiffness by recursive least squares, forgetting within 1 s;
    `track_s` its times.
    """

    series: Series
    fits: list[ContactFit]
    chosen: ContactFit
    filter_hz: float
    found: bool
    notes: list[str]
    track_s: Array
    track: Array

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        series = self.series
        return {
            "kind": "contact",
            "source": series.source,
            "position": series.position_name,
            "effort": series.effort_name,
            "axis_kind": {True: "rotary", False: "linear", None: None}[series.rotary],
            "samples": len(series.position),
            "rate_hz": 1.0 / series.period,
            "filter_hz": self.filter_hz,
            "contact_found": self.found,
            "model": self.chosen.name,
            "parameters": _parameters(self.chosen),
            "working_stiffness": self.chosen.working_stiffness._asdict(),
            "residual_rms": self.chosen.residual_rms,
            "explained": self.chosen.explained,
            "effort_sense": self.chosen.sense,
            "side": {1: "above", -1: "below", 0: None}[self.chosen.side],
            "models": {
                fit.name: {
                    "parameters": _parameters(fit),
                    "working_stiffness": fit.working_stiffness._asdict(),
                    "residual_rms": fit.residual_rms,
                    "explained": fit.explained,
                    "elastic_share": fit.elastic_share,
                    "contact_share": fit.contact_share,
                }
                for fit in self.fits
            },
            "snippet": (
                contact_snippet(self.chosen) if self.found and not self.implausible else None
            ),
            "notes": self.notes,
        }

    @property
    def implausible(self) -> list[str]:
        """A sentence for each number that is outside physics."""
        series, fit = self.series, self.chosen
        names = ["damping", "mass", "offset", "preload", "lag"]
        if fit.name != "hunt_crossley":  # whose stiffness is per metre to a power
            names.append("stiffness")
        values = {name: fit.parameters[name].value for name in names if name in fit.parameters}
        values["position"] = float(np.ptp(series.position[series.known]))
        if not self.found:  # then a stiffness is none, and may be anything
            values = {"position": values["position"]}
        return implausible(values, series.rotary)


def _parameters(fit: ContactFit) -> dict[str, dict[str, float]]:
    return {name: estimate._asdict() for name, estimate in fit.parameters.items()}


def identify_recording(
    source: Path,
    *,
    position: str | None = None,
    effort: str | None = None,
    time: str | None = None,
    axis: str | None = None,
    model: str = "auto",
    filter_hz: float | None = None,
    begin_s: float | None = None,
    end_s: float | None = None,
    intent: str | None = None,
    stated: Stated = UNSTATED,
) -> ContactResult:
    """Fit the environment to a run directory, an MCAP recording of tautwave or a CSV file.

    Parameters
    ----------
    position, effort, time, axis : str, optional
        Columns and axis, if they do not follow from the names.
    model : str
        One of `contact_model.MODELS`, or `auto`: the simplest whose residual is within a tenth of
        the best.
    filter_hz : float, optional
        Cut-off of the filter on force and motion [Hz]; default 40, at most rate / 25.
    begin_s, end_s : float, optional
        Part of the recording [s on its own clock].
    intent : str, optional
        Column with the position that the hand wanted: the fit is then that of its grip.
    stated : Stated
        What the file does not say itself.

    Raises
    ------
    ConfigError, RecordingError
        Not readable, ambiguous columns, or too short.
    """
    series = changing(read_series(source, position, effort, time, axis, (begin_s, end_s), stated))
    wanted = None
    if intent is not None:
        series, wanted = with_beside(series, source, intent, time, axis, stated)
    cutoff = min(filter_hz or DEFAULT_FILTER_HZ, 0.04 / series.period)
    try:
        motion = motion_of(
            series.position, series.effort, series.period, cutoff_hz=cutoff, known=series.known
        )
    except ValueError as err:
        raise too_little(series, err) from err
    names = AUTOMATIC if model == "auto" else (model,)
    if wanted is not None:
        fits = [fit_hand(motion, wanted)]
    else:
        fits = [fit for name in names if (fit := fit_contact(motion, name)) is not None]
    if not fits:
        raise RecordingError(f"{source}: the position never changes, so no contact can be fitted")
    chosen = choose(fits)
    damping = chosen.parameters.get("damping")
    if intent is None and damping is not None and damping.upper < 0.0:
        seen = Recorded(series.position, series.effort, series.period, cutoff, series.known)
        lagged = fit_lagged(seen, chosen)
        if lagged is not None:
            fits = [*fits, lagged]
            chosen = lagged
    is_elastic = chosen.elastic_share >= MIN_ELASTIC and chosen.working_stiffness.lower > 0.0
    track_s, track = _track(chosen)
    result = ContactResult(series, fits, chosen, cutoff, is_elastic, [], track_s, track)
    return result._replace(notes=[*series.notes, *result.implausible, *_doubts(chosen, is_elastic)])


def _track(fit: ContactFit) -> tuple[Array, Array]:
    """Stiffness over time by recursive least squares that forgets within a second."""
    size = np.sqrt(np.mean(fit.columns**2, axis=0))
    step = float(np.median(np.diff(fit.time_s)))
    kept = max(1, len(fit.time_s) // 4000)
    recursive = RecursiveLeastSquares(
        fit.columns.shape[1], float(np.exp(-step * kept / FORGETTING_S)), size.tolist()
    )
    values = [
        recursive.update(row, float(target))[1]
        for row, target in zip(fit.columns[::kept], fit.effort[::kept], strict=True)
    ]
    track = np.array(values)
    track *= np.sign(fit.sense * (fit.side or 1))
    return fit.time_s[::kept], np.where(track == 0.0, np.nan, track)


def _doubts(fit: ContactFit, found: bool) -> list[str]:
    """Sentences on the force's sign, and warnings about the numbers."""
    notes = []
    if fit.sense > 0:
        notes.append(
            "Force is positive as exerted by the device on its environment; stiffness is positive."
        )
    if not found:
        notes.append(
            f"No contact found: stiffness explains only {fit.elastic_share:.0%} of the force's"
            " variance; the rest may be inertia or friction of the setup."
        )
    elif fit.explained < 0.9:
        notes.append(
            f"The model explains {fit.explained:.0%} of the force's variance; the non-repeating "
            f"rest is included in the intervals."
        )
    damping = fit.parameters.get("damping") or fit.parameters.get("loss")
    stiffness = fit.parameters["stiffness"].value
    lag = fit.parameters.get("lag")
    if lag is not None:
        notes.append(
            f"The force lags the motion by {1e3 * lag.value:.2g} ms (a filter in the sensor, or "
            "bending in front of it); stiffness and damping are those behind that lag."
        )
    if damping is not None and damping.upper < 0.0 and "damping" in fit.parameters and found:
        notes.append(
            f"The damping comes out negative: the force lags the motion by"
            f" {-1e3 * damping.value / stiffness:.2g} ms (a filter in the sensor, or bending in"
            " front of it), so the damping cannot be estimated."
        )
    elif damping is not None and damping.lower <= 0.0 and found:
        notes.append("The damping is not distinguishable from zero.")
    if fit.name in ("spring", "mass"):
        notes.append(
            "The contact never opened, so the sensor's offset and the spring's rest position cannot"
            " be separated; the offset is the force at position 0."
        )
    if fit.name == "mass":
        notes.append("This assumes that the other end (a hand's reference) does not move.")
    return notes


def contact_snippet(fit: ContactFit) -> str | None:
    """Return the block of a rig's `simulation` from this fit; None if there is none."""
    value = {name: estimate.value for name, estimate in fit.parameters.items()}
    side = "above" if fit.side > 0 else "below"
    damping = max(value.get("damping", 0.0), 0.0)
    if fit.name == "spring":
        rest = -fit.sense * value["offset"] / value["stiffness"]
        return f"{{type: spring, stiffness: {value['stiffness']:.4g}, position: {rest:.4g}}}"
    if fit.name == "hunt_crossley":
        return (
            f"{{type: foam, stiffness: {value['stiffness']:.4g}, "
            f"exponent: {value['exponent']:.4g}, loss: {max(value['loss'], 0.0):.4g}, "
            f"position: {value['surface']:.4g}, side: {side}}}"
        )
    if fit.name in ("mass", "hand"):
        return (
            f"{{mass: {max(value['mass'], 0.0):.4g}, damping: {damping:.4g}, "
            f"stiffness: {value['stiffness']:.4g}, lever_arm: 1}}"
        )
    surface = value["surface"]
    surface -= fit.side * value.get("preload", 0.0) / value["stiffness"]
    return (
        f"{{type: wall, stiffness: {value['stiffness']:.4g}, damping: {damping:.4g}, "
        f"position: {surface:.4g}, side: {side}}}"
    )


def save_result(result: dict[str, Any], directory: Path) -> Path:
    """Write identification.json; return its path."""
    path = directory / "identification.json"
    make_directory(directory)
    write_text(path, json.dumps(result, indent=2, ensure_ascii=False) + "\n")
    return path
