"""Reference motions of a simulated hand, sampled once before a run; set-up code, not a model."""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError
from tautwave.models.reference import minimum_jerk, minimum_jerk_position, ramp_gain, sine_position
from tautwave.recordings.stated import UNSTATED, Stated

Array = npt.NDArray[np.float64]

_HALF_WIDTH = 32  # zero crossings of the windowed sinc on each side
_KAISER = 9.0  # some -90 dB beyond the transition band
_EDGE = 0.92  # of the new Nyquist frequency: where a low-pass ends when going down
_KEPT = 1_000_000  # samples of a motion that is cached for the next run
_EXTRA = 2.5  # slots beyond its end that a recording is held for, not repeated
_GAP_S, _GAP = 0.05, 20.0  # longest gap in a recording that is played, or this many steps of it
_SEAM_S = 0.5  # longest blend from the end of a recording into its beginning


def reference_positions(
    reference: Mapping[str, Any], rate_hz: float, samples: int, base_directory: Path
) -> Array:
    """Positions of a hand's reference at slots 0 to `samples`, `samples + 1` values.

    Parameters
    ----------
    reference
        The rig's `reference` block: `type` is minimum_jerk, multisine, hold, recording or intent,
        which also has its hand's `grip`.
    rate_hz
        Slots per second.
    base_directory
        Base of a recording's relative `file`: the rig file's directory.

    Raises
    ------
    ConfigError
        For an unknown type, waypoints out of order, or a recording that cannot be used.
    """
    kind = reference.get("type")
    if kind in ("minimum_jerk", "multisine") and samples <= _KEPT:
        return _kept_positions(json.dumps(reference), rate_hz, samples)
    return _sampled(reference, rate_hz, samples, base_directory)


@functools.lru_cache(maxsize=8)
def _kept_positions(reference: str, rate_hz: float, samples: int) -> Array:
    """Return a cached hand motion: a sweep needs the same one 100 000 times."""
    positions = _sampled(json.loads(reference), rate_hz, samples, Path())
    positions.flags.writeable = False
    return positions


def _sampled(
    reference: Mapping[str, Any], rate_hz: float, samples: int, base_directory: Path
) -> Array:
    kind = reference.get("type")
    times = np.arange(samples + 1, dtype=np.float64) / rate_hz
    if kind == "hold":
        return np.full(samples + 1, float(reference["position"]))
    if kind == "minimum_jerk":
        return waypoint_positions(reference["waypoints"], times)
    if kind == "multisine":
        return multisine_positions(
            reference["components"],
            float(reference.get("offset", 0.0)),
            float(reference.get("ramp_s", 0.0)),
            times,
        )
    if kind == "recording":
        path = base_directory / str(reference["file"])
        recorded, (values,) = _played(
            path, [str(reference["column"])], str(reference.get("time_column", "time_s")),
            _stated(reference),
        )  # fmt: skip
        scaled = values * float(reference.get("scale", 1.0)) + float(reference.get("offset", 0.0))
        return recorded_positions(recorded, scaled, times, bool(reference.get("repeat", True)))
    if kind == "intent":
        return _intended(base_directory / str(reference["file"]), reference, times)
    raise ConfigError(
        f"reference type {kind!r} is unknown; known are hold, minimum_jerk, multisine, recording "
        "and intent"
    )


def _stated(reference: Mapping[str, Any]) -> Stated:
    given = {name: reference[name] for name in Stated._fields if reference.get(name) is not None}
    return Stated(**given)


def _intended(path: Path, reference: Mapping[str, Any], times: Array) -> Array:
    """What a recorded hand wanted, at new times, with the `grip` (mass, damping, stiffness)."""
    names = [str(reference[key]) for key in ("position", "effort")]
    clock = str(reference.get("time_column", "time_s"))
    recorded, columns = _played(path, names, clock, _stated(reference))
    grid = np.linspace(recorded[0], recorded[-1], len(recorded))
    position, effort = (np.interp(grid, recorded, values) for values in columns)
    effort = effort * float(reference.get("effort_scale", 1.0))
    wanted = wanted_motion(
        position,
        effort + float(reference.get("effort_offset", 0.0)),
        float(grid[1] - grid[0]),
        *(float(value) for value in reference["grip"]),
        filter_hz=float(reference.get("filter_hz", 20.0)),
    )
    return recorded_positions(grid, wanted, times, bool(reference.get("repeat", True)))


def _played(
    path: Path, names: Sequence[str], time_column: str, stated: Stated
) -> tuple[Array, list[Array]]:
    """Return times and columns of a recording without gaps, over which a motion would be made up.

    Raises
    ------
    ConfigError
        It cannot be read, or has a gap.
    """
    from tautwave.recordings.columns import read_columns  # eight readers, where a file is read
    from tautwave.recordings.readers.shared import MEND

    read = read_columns(path, names, time_column, stated=stated)
    times = read[time_column]
    steps = np.diff(times)
    at = int(np.argmax(steps))
    if steps[at] > longest_step(times):
        raise ConfigError(
            f"{path}: row {at + 2}: nothing was recorded for {steps[at]:.3g} s, from "
            f"{times[at]:.6g} s on; {MEND}"
        )
    return times, [read[name] for name in names]


def longest_step(times: Array) -> float:
    """Return the longest time between two samples of a recording that is no gap in it [s]."""
    return max(_GAP_S, _GAP * float(np.median(np.diff(times))))


def wanted_motion(
    position: Array,
    effort: Array,
    period: float,
    mass: float,
    damping: float,
    stiffness: float,
    *,
    filter_hz: float,
) -> Array:
    """Where the hand wanted to be, from where it was and the effort it exerted.

    With w = wanted - position, a grip exerts K w + B w' on its own mass and on the device, so
    K w + B w' = effort + mass * position''. Both are smoothed alike by a Gaussian, which delays
    nothing; w lags the right-hand side by B / K, as in the simulated hand.

    Parameters
    ----------
    position, effort
        [rad or m], [N m or N]; even in time; the effort of the hand on the device.
    period, mass, damping, stiffness
        [s], and the grip in SI of the axis; stiffness > 0.
    filter_hz
        Where the smoothing has half its gain [Hz].
    """
    width = math.sqrt(2.0 * math.log(2.0)) / (2.0 * math.pi * filter_hz * period)
    reach = min(max(1, math.ceil(4.0 * width)), len(position) - 1)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    window /= window.sum()

    def smooth(values: Array) -> Array:
        ends = 2.0 * values[0] - values[reach:0:-1], 2.0 * values[-1] - values[-2 : -reach - 2 : -1]
        return np.convolve(np.concatenate([ends[0], values, ends[1]]), window, "valid")

    speed = np.gradient(smooth(position), period)
    pull = (smooth(effort) + mass * np.gradient(speed, period)) / stiffness
    if damping == 0.0:
        return np.asarray(position + pull)
    keep = math.exp(-period * stiffness / damping)
    ahead = np.empty_like(pull)
    state = float(pull[0])
    for at, value in enumerate(pull.tolist()):
        ahead[at] = state = keep * state + (1.0 - keep) * value
    return np.asarray(position + ahead)


def recorded_efforts(
    path: Path,
    column: str,
    time_column: str,
    times: Array,
    *,
    repeat: bool,
    stated: Stated = UNSTATED,
) -> Array:
    """Efforts of a recording at new times; without `repeat` none after its end."""
    recorded, (values,) = _played(path, [column], time_column, stated)
    efforts = recorded_positions(recorded, values, times, repeat)
    if not repeat:
        efforts[times > recorded[-1] - recorded[0]] = 0.0
    return efforts


def waypoint_positions(waypoints: Sequence[Sequence[float]], times: Array) -> Array:
    """Minimum-jerk moves through `[t_s, position]` waypoints, at rest in each; held outside."""
    if len(waypoints) == 0:
        raise ConfigError("minimum_jerk needs at least one waypoint [t_s, position]")
    points = [(float(t), float(x)) for t, x in waypoints]
    for (t0, _), (t1, _) in itertools.pairwise(points):
        if not t1 > t0:
            raise ConfigError(f"minimum_jerk waypoint times must increase: {t1:g} s after {t0:g} s")
    starts = np.array([t for t, _ in points])
    legs = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, max(len(points) - 2, 0))
    result: Array = np.full_like(times, points[-1][1])  # an hour is mostly after the last
    for i in np.flatnonzero(times < starts[-1]):
        t0, x0 = points[legs[i]]
        t1, x1 = points[min(legs[i] + 1, len(points) - 1)]
        result[i] = minimum_jerk_position(float(times[i]), t0, x0, t1, x1)
    return result


def multisine_positions(
    components: Sequence[Sequence[float]], offset: float, ramp_s: float, times: Array
) -> Array:
    """`offset` plus a sum of `[hz, amplitude, phase_rad]`, faded in over `ramp_s` [s]."""
    parts = [(float(f), float(a), float(p)) for f, a, p in components]
    return np.array(
        [
            offset
            + ramp_gain(float(t), ramp_s)
            * math.fsum(sine_position(float(t), f, a, p) for f, a, p in parts)
            for t in times
        ]
    )


def recorded_positions(times: Array, values: Array, new_times: Array, repeat: bool) -> Array:
    """Sample a recording at `new_times` (from 0): once and then held, or repeated.

    When repeated, the last part (at most 0.5 s or a quarter of the recording) is blended into the
    first with a minimum-jerk weight, so position, velocity and acceleration are continuous.
    """
    clock = times - times[0]
    length = float(clock[-1])
    rate = _rate(new_times)
    last = length + _EXTRA / rate if rate > 0.0 else length
    if new_times[-1] <= last or not repeat:
        return resample(clock, values, np.minimum(new_times, length), rate)
    seam = min(_SEAM_S, 0.25 * length)
    period = length - seam
    turns = np.floor(new_times / period)
    phase = new_times - turns * period
    head = resample(clock, values, phase, rate)
    blend = (turns >= 1.0) & (phase < seam)
    tail = resample(clock, values, np.minimum(phase[blend] + period, length), rate)
    weight = np.array([minimum_jerk(float(s)) for s in phase[blend] / seam])
    head[blend] = (1.0 - weight) * tail + weight * head[blend]
    return head


def _rate(times: Array) -> float:
    """Mean sampling rate [Hz] of times that may be uneven; 0 if there is only one."""
    steps = np.diff(times)
    steps = steps[steps > 0.0]
    return float(1.0 / np.median(steps)) if steps.size else 0.0


def resample(
    times: npt.ArrayLike, values: npt.ArrayLike, new_times: npt.ArrayLike, new_rate: float = 0.0
) -> Array:
    """Band-limited value of a recording at new times, with a low-pass when the rate goes down.

    Windowed sinc (Kaiser, 32 zero crossings a side) about the straight line from the first to the
    last value; the remainder is continued point-symmetrically beyond the ends, so linear trends
    and both end values are kept. Where the rates agree and times coincide the values are returned
    unchanged. Unevenly spaced recordings are first laid on an even grid by local cubics.

    Parameters
    ----------
    times, values
        Recording; times [s] increase.
    new_times
        Any order, inside the recording (held at its ends outside).
    new_rate
        Rate [Hz] the result is to be sampled at; 0 takes it from `new_times`.
    """
    t = np.asarray(times, dtype=np.float64)
    y = np.asarray(values, dtype=np.float64)
    wanted = np.clip(np.asarray(new_times, dtype=np.float64), t[0], t[-1])
    count = len(t)
    step = float(t[-1] - t[0]) / (count - 1)
    even = t[0] + step * np.arange(count)
    if np.max(np.abs(t - even)) > 1e-3 * step:
        y = _cubic(t, y, even)
    rate = new_rate if new_rate > 0.0 else _rate(np.sort(wanted))
    ratio = rate * step
    place = (wanted - t[0]) / step
    cut = 1.0 if ratio >= 1.0 - 1e-6 or rate == 0.0 else _EDGE * ratio
    nearest = np.rint(place)
    snapped = np.abs(place - nearest) < 1e-6
    place = np.where(snapped, nearest, place)
    line = y[0] + (y[-1] - y[0]) * (np.arange(count) / (count - 1))
    rest = y - line
    result: Array = np.interp(place, np.arange(count), line).astype(np.float64)
    reach = math.ceil(_HALF_WIDTH / cut)
    offsets = np.arange(-reach + 1, reach + 1)
    block = max(1, 2**20 // len(offsets))  # some 30 MB, whatever the ratio
    for begin in range(0, len(place), block):
        part = place[begin : begin + block]
        centre = np.floor(part).astype(np.int64)
        index = centre[:, None] + offsets[None, :]
        distance = part[:, None] - index
        inside = np.sqrt(np.maximum(0.0, 1.0 - (distance / reach) ** 2))
        weights = np.sinc(cut * distance) * np.i0(_KAISER * inside)
        weights[np.abs(distance) >= reach] = 0.0
        weights /= weights.sum(axis=1, keepdims=True)
        result[begin : begin + block] += np.sum(weights * _continued(rest, index), axis=1)
    if cut == 1.0:
        result[snapped] = y[nearest[snapped].astype(np.int64)]
    return result


def _continued(rest: Array, index: npt.NDArray[np.int64]) -> Array:
    """Values beyond the ends, mirrored in the end points, where `rest` is zero."""
    last = len(rest) - 1
    wrapped = np.mod(index, 2 * last)
    mirrored = wrapped > last
    place = np.where(mirrored, 2 * last - wrapped, wrapped)
    return np.asarray(np.where(mirrored, -rest[place], rest[place]), dtype=np.float64)


def _cubic(t: Array, y: Array, wanted: Array) -> Array:
    """Hermite cubics with three-point slopes: keeps the order of a jittering recording."""
    if len(t) < 3:
        return np.asarray(np.interp(wanted, t, y), dtype=np.float64)
    slope = np.gradient(y, t, edge_order=2)
    i = np.clip(np.searchsorted(t, wanted, side="right") - 1, 0, len(t) - 2)
    width = t[i + 1] - t[i]
    s = (wanted - t[i]) / width
    rise = y[i + 1] - y[i]
    a = width * slope[i] - rise
    b = rise - width * slope[i + 1]
    bend = (1.0 - s) * a + s * b
    return np.asarray(y[i] + s * rise + s * (1.0 - s) * bend, dtype=np.float64)
