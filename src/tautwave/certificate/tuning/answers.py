"""What a law of positions answers to a sample, asked of its own steps in its own controller."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.clipped_spring import Asked
from tautwave.config import Rig
from tautwave.laws.limit import NO_LIMITS
from tautwave.rig import coupling_law, make_control, pair_scale
from tautwave.types import CommandDelay, JointState

Floats = npt.NDArray[np.float64]

LONGEST = 40000
"""Slots after which an answer that does not die away is given up."""

QUIET = 1e-16
LOUDEST = 1e15
"""Effort per sample [N m/rad or N/m] beyond which a law runs away by itself."""

DECAY = 1e-3
"""Relative: how much slower than its filter's pole the end of an answer may seem to decay."""


def asked_of_law(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> Asked | None:
    """Return the answers of the bare law of a pair in the master's units; None if one stays.

    Nothing is sent but what is asked about: what a law makes of its own efforts is in `to_effort`.
    Answers of a law that can be certified end, or decay by the filters' poles.
    """
    alike = coupling_law(rig).alike
    poles = (_pole(rig, f"master.{pair}"), _pole(rig, f"slave.{pair}"))
    answers = []
    for what in ("position", "effort"):
        each = [_answer(rig, pair, delays, side, what) for side in (0, 1)]
        for one, pole in zip(each, poles, strict=True):
            if one is None or (alike and not _ends(one, pole)):
                return None
        size = max(len(one) for one in each if one is not None)
        both = np.zeros((size, 2, 2))
        for side, one in enumerate(each):
            assert one is not None
            both[: len(one), :, side] = one
        answers.append(both)
    scale = pair_scale(rig.coupling.pairs[pair])
    ratio, force = scale.sign * scale.scale, scale.sign / scale.force_scale
    efforts = np.array([1.0, force])[:, None]
    return Asked(
        answers[0] * efforts * np.array([1.0, ratio]),
        answers[1] * efforts * np.array([1.0, 1.0 / force]),
        poles,
    )


def reads_sensors(rig: Rig, pair: str, delays: Mapping[str, CommandDelay]) -> bool:
    """Return whether the law of a pair answers what an effort sensor of its axes shows."""
    for side, name in enumerate(("master", "slave")):
        if rig.axes[f"{name}.{pair}"].effort_sensor is not None:
            answer = _answer(rig, pair, delays, side, "sensor")
            if answer is None or bool(np.any(answer != 0.0)):
                return True
    return False


def _pole(rig: Rig, axis_name: str) -> float:
    """Return the pole of the filter on an axis' velocity [1]."""
    filter_s = rig.axes[axis_name].velocity_filter_s
    return filter_s / (rig.axis_period_s(axis_name) + filter_s)


def _ends(answer: Floats, pole: float) -> bool:
    """Return whether an answer has ended, or decays no slower than by its filter's pole."""
    last = np.max(np.abs(answer[-4:]), axis=1)
    gone = last[1:] <= QUIET * QUIET * np.max(np.abs(answer))
    return bool(np.all(gone | (last[1:] <= (1.0 + DECAY) * pole * last[:-1])))


def _answer(
    rig: Rig, pair: str, delays: Mapping[str, CommandDelay], side: int, what: str
) -> Floats | None:
    """Return both efforts asked for after one number of a side was off by 1, of shape (n, 2).

    `what`: its position, what its effort sensor shows, or the effort that was sent.
    """
    bare = rig.model_copy(update={"coupling": rig.coupling.model_copy(update={"account": None})})
    control = make_control(bare, delays, 2 * LONGEST)
    control.params = [
        p._replace(
            site=p.site._replace(
                limit=NO_LIMITS,
                has_wall=False,
                compensates=False,
                compensates_inertia=False,
                clip=math.inf,
            ),
            ceiling=math.inf,
        )
        for p in control.params
    ]
    control.run = control.run._replace(engage_cycles=0)
    q = control.pairs[control.pair_names.index(pair)]
    ends = (q.master, q.slave)
    efforts: list[tuple[float, float]] = []
    greatest, still = 0.0, 0
    patience = 2 * rig.delay_samples + max(delay.periods for delay in delays.values()) + 8
    for slot in range(LONGEST):
        for which in range(len(control.params)):
            off = 1.0 if slot == 1 and which == ends[side] else 0.0
            zero = control.params[which].sensor_zero
            position, shown = off * (what == "position"), off * (what == "sensor")
            control.take(which, JointState(position, math.nan, zero + shown, True, 0), slot)
        control.step(slot, 0)
        now = tuple(control.axes[end].port_effort for end in ends)
        for which, axis in enumerate(control.axes):
            sent = 1.0 if what == "effort" and slot == 1 and which == ends[side] else 0.0
            axis.total = axis.port_effort = sent
        if slot == 0:
            continue
        efforts.append((now[0], now[1]))
        size = max(abs(now[0]), abs(now[1]))
        if not size <= LOUDEST:
            return None
        greatest = max(greatest, size)
        still = still + 1 if size <= QUIET * greatest else 0
        if still > patience:
            return np.array(efforts)
    return None
