"""Precision of a scene: its network run again along the recorded port positions.

At the run's own rate this must reproduce the recorded efforts; half and double the rate show the
effect of sampling; many times smaller steps make the oracle. The ports' motion is given, so hand
and device are not part of it. A scene with many contacts is chaotic: two runs diverge, however
small the step, and errors are counted up to that point. Units are SI.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.report.figures.envelope import Floats
from tautwave.report.figures.resampling import resampled
from tautwave.report.run.rundir import Run
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Network
from tautwave_scenes.report.inputs import Inputs, Model, Stage, inputs_of, stage_of
from tautwave_scenes.rig.network import scene_of
from tautwave_scenes.simulation.playing import Played, is_kept, play

SECONDS = {"compiled": 4.0, "python": 4.0}
"""Approximate CPU time limit of all replays together [s]."""

FINE = {"compiled": 16, "python": 8}
"""Steps of the oracle per period; half as many give its uncertainty."""

APART = 0.1
"""Share of the travel: two runs whose nodes are farther apart than this, rms, have diverged."""

FELT = 0.01
"""Share of the greatest effort: a shortened replay begins where it is first exceeded."""

_BLOCK = 256
FACTORS = {"half": 0.5, "double": 2.0}


def scene_precision(run: Run, rig: Rig) -> dict[str, Any]:
    """Return the precision of a scene's run, as plain numbers.

    Raises
    ------
    TautwaveError
        The rig cannot be replayed.
    """
    stage = stage_of(rig)
    inputs = inputs_of(run, rig, stage)
    if inputs is None or len(inputs.ports) < 4:
        return {"error": "the ports were not recorded, or almost no rows were"}
    in_3d = not isinstance(stage.network, Network)
    engine = "compiled" if is_kept(scene3d=in_3d) else "python"
    budget = SECONDS[engine]
    model = _model(stage, rig.period_s, inputs)
    base, kept = base_run(model, inputs, engine, 0.4 * budget)
    # The cost of each replay is that of the base run times its number of steps.
    fine = FINE[engine]
    replays = 0.5 + 2.0 + 1.5 * fine
    each = base.cpu_s / max(len(base.efforts), 1)
    afford = max(64, int(0.6 * budget / (replays * max(each, 1e-8))))
    first, last = _window(base, afford, kept)
    if kept:
        model = _model(stage, rig.period_s, inputs, kept[first // _BLOCK])
    window = inputs.part(first, last)
    own = base._replace(efforts=base.efforts[first:last], places=base.places[first:last])
    result: dict[str, Any] = {
        "kind": "scene",
        "scheme": stage.scheme,
        "span_s": len(window.ports) * rig.period_s,
        "begins_s": first * rig.period_s,
        "whole": first == 0 and last == len(inputs.ports),
        "engine": engine,
        "space": in_3d,
        "replayed_equal": _equal(run, base, inputs),
        "replayed": _greatest(base.efforts - inputs.asked[: len(base.efforts)]),
    }
    result["travel"] = float(np.ptp(own.places, axis=0).max()) if own.places.size else 0.0
    result["effort"] = _greatest(own.efforts)
    replay = _Replay(rig, stage, window, model, engine)
    oracle, doubted = replay.fine(fine), replay.fine(fine // 2)
    apart = _apart(own, oracle, result["travel"])
    known = _apart(doubted, oracle, result["travel"])
    result["oracle"] = _differences(oracle, own, result["travel"], rig.period_s)
    result["oracle"]["scheme"] = stage.oracle
    result["oracle"]["steps"] = fine
    result["doubt"] = _differences(oracle, doubted, result["travel"], rig.period_s, apart)
    if known is not None:
        result["doubt"]["apart_s"] = known * rig.period_s
    for name, factor in FACTORS.items():
        result[name] = _differences(own, replay.at_rate(factor), result["travel"], rig.period_s)
    pitches = pitches_of(rig)
    if pitches:
        result["strings"] = pitches
    return result


class _Replay(NamedTuple):
    """Runs a window of a scene again, with different steps."""

    rig: Rig
    stage: Stage
    window: Inputs
    model: Model
    engine: str

    def fine(self, steps: int) -> Played:
        """Return the run with several steps per period, its ports moving within the period."""
        strings = tuple(
            # Enough more samples to keep the run's pitch, which is not an error of its step.
            string._replace(
                near=steps * (string.near + 1) - 1,
                far=steps * (string.far + 1) - 1,
                smoothing=1.0 - (1.0 - string.smoothing) ** (1.0 / steps),
            )
            for string in self.stage.strings
        )
        stage = self.stage
        if strings and isinstance(stage.network, Network):
            stage = stage._replace(network=stage.network._replace(strings=strings))
        # Symplectic steps use the forces at their start, all others those at their middle.
        within = 0.0 if stage.oracle == "symplectic" else 0.5
        return self._play(stage, stage.oracle, steps, within, steps)

    @property
    def lag(self) -> float:
        """Slots by which a row is earlier: rk4 steps end at their sample, others begin there."""
        return 1.0 if self.stage.scheme == "rk4" else 0.0

    def at_rate(self, factor: float) -> Played:
        """Return the run at another rate, one row of efforts and positions per slot."""
        other = self.rig.model_copy(update={"rate_hz": factor * self.rig.rate_hz})
        stage = stage_of(other)
        played = self._play(stage, self.stage.scheme, factor, self.lag, max(1, round(factor)))
        if factor >= 1.0:
            return played
        held = round(1.0 / factor)
        efforts = np.repeat(played.efforts, held, axis=0)
        # Only every second slot has positions of its own.
        places = np.repeat(played.places, held, axis=0)
        places[np.arange(len(places)) % held != held - 1] = np.nan
        return played._replace(efforts=efforts, places=places)

    def _play(self, stage: Stage, scheme: str, factor: float, within: float, stride: int) -> Played:
        """Run `factor` steps per slot; ports are sampled `within` a step after its start."""
        slots = len(self.window.ports)
        steps = int(slots * factor)
        slot = np.asarray((np.arange(steps) + within) / factor - self.lag, dtype=np.float64)
        given = np.arange(slots, dtype=np.float64)
        ports = np.stack([resampled(slot, given, at) for at in self.window.ports.T], axis=1)
        pushes = np.zeros((steps, self.window.pushes.shape[1]))
        for at, push in enumerate(self.window.pushes.T):
            pushes[:, at] = np.interp(slot, given, push)
        model = stage.model(scheme, self.rig.period_s / factor)
        model.reset(self.window.ports[0].tolist())
        _take_state(model, self.model)
        return play(model, ports, pushes, engine=self.engine, stride=stride)


def _model(stage: Stage, period: float, inputs: Inputs, state: Any = None) -> Model:
    model = stage.model(stage.scheme, period)
    model.reset(inputs.ports[0].tolist())
    if state is not None:
        model.arrays = state
    return model


def _take_state(model: Model, other: Model) -> None:
    """Start a model in the state of another one with the same masses and links."""
    if not _strings(model):
        model.arrays = _copy(other.arrays)


def _copy(arrays: Any) -> Any:
    """Return arrays as lists of their own; those of tissues are a tuple of lists inside."""
    return type(arrays)(
        *(_copy(part) if isinstance(part, tuple) else list(part) for part in arrays)
    )


def _strings(model: Model) -> bool:
    return isinstance(model, SceneModel) and bool(model.strings)


def base_run(model: Model, inputs: Inputs, engine: str, seconds: float) -> tuple[Played, list[Any]]:
    """Return the run at its own rate, and in plain Python its states every `_BLOCK` slots."""
    if engine == "compiled" or _strings(model):
        return play(model, inputs.ports, inputs.pushes, engine=engine, seconds=seconds), []
    parts: list[Played] = []
    states: list[Any] = []
    spent = 0.0
    for first in range(0, len(inputs.ports), _BLOCK):
        states.append(_copy(model.arrays))
        part = inputs.part(first, first + _BLOCK)
        parts.append(play(model, part.ports, part.pushes, engine=engine))
        spent += parts[-1].cpu_s
        if spent > seconds:
            break
    efforts = np.concatenate([part.efforts for part in parts])
    places = np.concatenate([part.places for part in parts])
    return Played(efforts, places, parts[-1].ledger, model.start, spent), states


def _window(base: Played, afford: int, kept: Sequence[Any]) -> tuple[int, int]:
    """Return the slots to replay: all, or as many from the first touch on as time allows."""
    there = len(base.efforts)
    if there <= afford:
        return 0, there
    first = 0
    if kept:
        felt = np.abs(base.efforts).max(axis=1)
        touched = int(np.argmax(felt > FELT * felt.max()))
        first = min(touched, there - afford) // _BLOCK * _BLOCK
    return first, first + afford


def _equal(run: Run, base: Played, inputs: Inputs) -> bool | None:
    """Return whether the replayed efforts are the recorded ones; None on a real clock."""
    if run.result.clock != "fake":
        return None
    gap = base.efforts - inputs.asked[: len(base.efforts)]
    scale = max(_greatest(base.efforts), 1e-300)
    return _greatest(gap) <= 4e-16 * scale


def _greatest(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.abs(known).max()) if known.size else 0.0


def _rms(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known * known))) if known.size else 0.0


def _gap(one: Played, other: Played) -> Floats:
    """Return the distance of two runs' nodes over their common rows, rms over the nodes."""
    rows = min(len(one.places), len(other.places))
    gap = other.places[:rows] - one.places[:rows]
    if gap.shape[1] == 0:
        return np.zeros(rows)
    return np.asarray(np.sqrt(np.mean(gap * gap, axis=1)))


def _apart(one: Played, other: Played, travel: float) -> int | None:
    """Return the row at which two runs have diverged."""
    far = np.flatnonzero(_gap(one, other) > APART * travel)
    return int(far[0]) if far.size and travel > 0.0 else None


def _differences(
    base: Played, other: Played, travel: float, period: float, until: int | None = None
) -> dict[str, Any]:
    """Return the distance of two runs, up to where they diverge [SI].

    `level_db` compares the rms efforts of all rows, which two diverged runs still share.
    """
    apart = _apart(base, other, travel)
    rows = min(len(base.efforts), len(other.efforts))
    parted = [row for row in (apart, until) if row is not None]
    to = max(1, min([rows, *parted]))
    gap = _gap(base, other)[:to]
    effort = other.efforts[:to] - base.efforts[:to]
    errors: dict[str, Any] = {
        "position": _greatest(gap),
        "position_rms": _rms(gap),
        "effort": _greatest(effort),
        "effort_rms": _rms(effort),
        "level_db": None,
        "apart_s": None if apart is None else apart * period,
    }
    levels = _rms(base.efforts[:rows]), _rms(other.efforts[:rows])
    if min(levels) > 0.0:
        errors["level_db"] = 20.0 * math.log10(levels[1] / levels[0])
    return errors


def pitches_of(rig: Rig) -> dict[str, dict[str, float]]:
    """Return the pitch of each string [Hz]: as specified, and at the run's rate and others.

    A line of whole samples and its low-pass at each end: 2 (near + far) + 4 samples, and
    (1 - g)/g for each filter at low frequencies.
    """
    pitches: dict[str, dict[str, float]] = {}
    rates = {"own": 1.0, **FACTORS}
    for rate, factor in rates.items():
        other = rig.model_copy(update={"rate_hz": factor * rig.rate_hz})
        for string in stage_of(other).strings:
            asked = scene_of(rig).strings[string.name].frequency_hz
            late = 2.0 * (1.0 - string.smoothing) / string.smoothing
            samples = 2.0 * (string.near + string.far) + 4.0 + late
            pitch = pitches.setdefault(string.name, {"asked_hz": asked})
            pitch[rate] = other.rate_hz / samples
    return pitches
