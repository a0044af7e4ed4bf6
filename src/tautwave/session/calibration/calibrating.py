"""`calibrate RIG`: what a person shows by hand and what devices say, written beside the rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError, RecordingError
from tautwave.files import refuse_unwritable
from tautwave.session.calibration.by_hand import (
    DIRECTION,
    IDENTIFY,
    ZERO,
    Measured,
    measure_by_hand,
)
from tautwave.session.calibration.by_stop import find_stops
from tautwave.session.calibration.file import read_calibration, write_calibration
from tautwave.session.calibration.identify import Shaking, identify_axes
from tautwave.session.guided.running import Conversation, Ways, run_guided

Axes = dict[str, dict[str, Any]]


class Asked(NamedTuple):
    """What is to be calibrated: axes, steps, stops by axis [rad or m from zero], identify [s]."""

    axes: Sequence[str]
    steps: Sequence[str]
    stops: Mapping[str, float]
    identify_s: float


def calibrate(
    path: Path,
    asked: Asked,
    talk: Conversation,
    *,
    out: Path,
    ways: Ways,
    progress: Callable[[float, str], None] | None = None,
) -> tuple[Path, Axes]:
    """Calibrate the axes of a rig file; return the calibration file and its contents.

    What is not measured this time stays as an earlier calibration has it.

    Parameters
    ----------
    out : Path
        Directory of the recordings.

    Raises
    ------
    TautwaveError
        The rig is refused, a device failed, or nobody answers.
    """
    rig = load_to_calibrate(path, talk.say)
    _check(path, rig, asked)
    bare = uncalibrated(rig)
    axes = read_calibration(rig, path)
    done = run_guided(
        bare,
        lambda control: measure_by_hand(bare, asked.axes, asked.steps, control),
        talk,
        out=out / "by-hand",
        torque=False,
        guarded=False,
        ways=ways,
    )
    measured: dict[str, Measured] = done.result
    for name in asked.axes:
        axes.setdefault(name, {"zero": 0.0, "direction": 1})
        measured[name] = _with_ends(measured[name], axes[name])
        axes[name]["device"] = dict(done.identities.get(name, {}))
        _take(axes[name], measured[name], asked)
    if asked.stops:
        away = {
            name: axes[name]["direction"] * (1 if at > 0.0 else -1)
            for name, at in asked.stops.items()
        }
        stops = run_guided(
            bare,
            lambda control: find_stops(bare, away, control),
            talk,
            out=out / "stops",
            torque=True,
            guarded=False,
            ways=ways,
        ).result
        for name, at in asked.stops.items():
            axes[name]["zero"] = stops[name] - axes[name]["direction"] * at
    for name in asked.axes:
        _take_range(axes[name], measured[name])
    file = write_calibration(path, rig.name, _rounded(axes))
    if IDENTIFY in asked.steps:
        _identify(path, asked, axes, talk, out, ways, progress)
    load_rig(path, choose=False)  # what was written is a rig
    return file, axes


def load_to_calibrate(path: Path, say: Callable[[str], None], *, choose: bool = True) -> Rig:
    """Return the rig; a calibration that is refused is left out, and `say` gets the reason."""
    try:
        return load_rig(path, choose=choose)
    except ConfigError as err:
        if not any("calibration" in problem for problem in err.problems):
            raise
        rig = load_rig(path, ["calibration=null"], choose=choose)
        say(f"begins anew: {err}")
        return rig


def uncalibrated(rig: Rig) -> Rig:
    """Return the rig as its devices count: without calibration and ranges."""
    sides = {
        side: getattr(rig, side).model_copy(
            update={
                "axes": {
                    name: axis.model_copy(update={"position_range": None})
                    for name, axis in getattr(rig, side).axes.items()
                }
            }
        )
        for side in ("master", "slave")
    }
    return rig.model_copy(update={"calibration": None, **sides})


def _check(path: Path, rig: Rig, asked: Asked) -> None:
    unknown = [name for name in (*asked.axes, *asked.stops) if name not in rig.axes]
    if unknown:
        raise ConfigError(f"calibrate: no axis {unknown[0]!r}; axes: {', '.join(rig.axes)}")
    for name, at in asked.stops.items():
        if at == 0.0:
            raise ConfigError(f"calibrate: --stop {name}=0 does not give the direction of the stop")
    refuse_unwritable([path, path.parent], "calibrate", "the calibration")


def _with_ends(measured: Measured, found: Mapping[str, Any]) -> Measured:
    """Return the ends of an earlier range, as the device counts, where none were measured now."""
    if measured.low is not None or "position_range" not in found:
        return measured
    low, high = sorted(found["zero"] + found["direction"] * end for end in found["position_range"])
    return measured._replace(low=low, high=high)


def _take(found: dict[str, Any], measured: Measured, asked: Asked) -> None:
    if DIRECTION in asked.steps and measured.direction is not None:
        found["direction"] = measured.direction
    if ZERO in asked.steps and measured.pose is not None:
        found["zero"] = measured.pose


def _take_range(found: dict[str, Any], measured: Measured) -> None:
    if measured.low is not None and measured.high is not None:
        ends = (measured.low, measured.high)
        found["position_range"] = sorted(found["direction"] * (end - found["zero"]) for end in ends)


def _identify(
    path: Path,
    asked: Asked,
    axes: Axes,
    talk: Conversation,
    out: Path,
    ways: Ways,
    progress: Callable[[float, str], None] | None,
) -> None:
    """Measure inertia and friction, beginning in the middle of each range; write each at once.

    Raises
    ------
    RecordingError
        Axes were left out: which, what is kept, and how to go on.
    """
    rig = load_rig(path)
    able = [name for name in asked.axes if rig.axes[name].causality == "impedance"]
    middle = run_guided(
        rig,
        lambda control: control.ask(
            "identify: bring every axis to the middle of its range, let go of everything, keep "
            "clear; then press Enter: they are excited in turn, a master together with its slave"
        ),
        talk,
        out=out / "middle",
        torque=False,
        guarded=False,
        ways=ways,
    )
    assert middle.result is not None
    kept: list[str] = []

    def keep(name: str, believed: Mapping[str, Any]) -> None:
        axes[name] |= believed
        write_calibration(path, rig.name, _rounded(axes))  # the next one may fail
        kept.append(name)

    how = Shaking(asked.identify_s, out, ways, progress)
    try:
        failed = identify_axes(rig, able, talk, how, keep)
    except BaseException:
        talk.say(_left(path, kept, [name for name in able if name not in kept]))
        raise
    if failed:
        reasons = [f"{name}: {why}" for name, why in failed.items()]
        raise RecordingError("\n".join([*reasons, _left(path, kept, list(failed))]))


def _left(path: Path, kept: Sequence[str], left: Sequence[str]) -> str:
    """Return what is kept of the axes, and the command for those that are left."""
    words = "".join(f" --axis {name}" for name in left)
    return (
        f"kept: {', '.join(kept) or 'none'}; left: {', '.join(left)}; go on with: "
        f"tautwave calibrate {path} --steps identify{words}"
    )


def _rounded(axes: Axes) -> Axes:
    """Return numbers rounded to a microradian or micrometre."""
    return {
        name: {
            key: round(value, 6)
            if isinstance(value, float)
            else [round(end, 6) for end in value]
            if isinstance(value, list)
            else value
            for key, value in keys.items()
        }
        for name, keys in axes.items()
    }
