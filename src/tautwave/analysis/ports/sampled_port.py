"""Two-port of a pair as it is implemented: what hand and environment feel of a sampled rig.

Both act all the time, the controller once a period. A sine of either meets three things: the
device in between, exactly; the controller, which sees samples and is run as it is, on the ends of
`tautwave.analysis.ports.sampled_loop`; and the hold of what it commands, of which the share at the
sine's own frequency counts. The rest, at multiples of the rate, is left out: this is the response
at one frequency, fit for a band well below half the rate, and there the hold's lag is in it.

    [F_m; -v_s] = H [v_m; F_s]    as in `tautwave.analysis.ports.two_port`; SI of each device

Source: written here; the hold's describing share is textbook (Franklin, Powell & Workman, Digital
Control of Dynamic Systems).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.sampled_loop import LinearEnd
from tautwave.analysis.ports.two_port import Hybrid, Response
from tautwave.analysis.walls.sampled import split_delay
from tautwave.errors import ConfigError
from tautwave.models.linear import flow_rows

Complexes = npt.NDArray[np.complex128]

HIGHEST = 0.1
"""Share of the rate up to which the response at one frequency says what is felt."""


class Body(NamedTuple):
    """What moves at a port; SI, linear or rotary.

    Attributes
    ----------
    mass, damping : float
        Of a device that takes effort [kg or kg m^2, N s/m or N m s/rad]; not used of a drive.
    lag_s : float
        Time constant of a drive that takes velocity [s].
    command_delay : float
        Until a command acts [periods], with a fraction.
    """

    mass: float = 0.0
    damping: float = 0.0
    lag_s: float = 0.0
    command_delay: float = 0.0


def sampled_response(
    ends: tuple[LinearEnd, LinearEnd], bodies: tuple[Body, Body], samples: int, period: float
) -> Response:
    """Return H of a pair over s = j w, w up to `HIGHEST` of the rate.

    Parameters
    ----------
    ends : tuple of LinearEnd
        Master and slave, free, without a wall; both with `push`.
    bodies : tuple of Body
        The devices in them.
    samples : int
        Delay of the line each way [periods].
    period : float
        [s]

    Raises
    ------
    ConfigError
        An end does not say what a force from outside does to it.
    """
    if ends[0].push is None or ends[1].push is None:
        raise ConfigError("the law's linear model has no input for an external force")

    def response(s: Complexes) -> Hybrid:
        s = np.asarray(s, np.complex128)
        flat = s.ravel()
        law = _law(ends, samples, np.exp(flat * period))
        mobility = _mobility(ends, bodies, law, flat, period).reshape(*s.shape, 2, 2)
        y11, y12 = mobility[..., 0, 0], mobility[..., 0, 1]
        y21, y22 = mobility[..., 1, 0], mobility[..., 1, 1]
        # The environment's F_s acts against the slave: [v_m; v_s] = Y [F_m; -F_s].
        return Hybrid(1.0 / y11, y12 / y11, -y21 / y11, y22 - y12 * y21 / y11)

    return response


def held_position(body: Body, period: float, z: Complexes) -> Complexes:
    """Return position per held effort [m/N or rad/(N m)] of a free device, command delay included.

    Parameters
    ----------
    z : points off the unit's 1
    """
    whole, late = split_delay(body.command_delay)
    steps = []
    for span in (late * period, (1.0 - late) * period):
        row = flow_rows(0.0, body.damping, body.mass, span) if span > 0.0 else (0.0,) * 5
        xv, xn, _, vv, vn = row[:5]
        steps.append((xv - xn * body.damping, 1.0 + vv - vn * body.damping, xn, vn))
    (early_x, early_v, early_xn, early_vn), (later_x, later_v, xn, vn) = steps
    xv, vv = early_x + later_x * early_v, later_v * early_v
    x_push = xn + (early_xn + later_x * early_vn) / z
    v_push = vn + later_v * early_vn / z
    return np.asarray((x_push + xv * v_push / (z - vv)) / (z - 1.0) / z**whole)


def _law(ends: tuple[LinearEnd, LinearEnd], samples: int, z: Complexes) -> Complexes:
    """Return what both motors are commanded per what both controllers see; shape (n, 2, 2).

    Found by pushing at either end in turn: what is commanded depends on what is seen alone.
    """
    across = z**-samples
    answers = [_end(end, z) for end in ends]
    seen, given = np.zeros((2, len(z), 2, 2), np.complex128)
    loop = 1.0 - answers[0].reflected * answers[1].reflected * across**2
    for at in (0, 1):
        here, far = answers[at], answers[1 - at]
        leaving = here.left / loop
        # What arrives at the far end, and what comes back.
        there, back = across * leaving, across**2 * far.reflected * leaving
        given[:, at, at] = here.command_push + here.command_wave * back
        seen[:, at, at] = here.seen_push + here.seen_wave * back
        given[:, 1 - at, at] = far.command_wave * there
        seen[:, 1 - at, at] = far.seen_wave * there
    return np.asarray(given @ np.linalg.inv(seen))


class _End(NamedTuple):
    """Responses of one end to an arriving wave and to a push."""

    reflected: Complexes
    left: Complexes
    command_wave: Complexes
    command_push: Complexes
    seen_wave: Complexes
    seen_push: Complexes


def _end(end: LinearEnd, z: Complexes) -> _End:
    push = end.push
    assert push is not None
    shifted = z[:, None, None] * np.eye(len(end.b)) - end.a
    both = np.broadcast_to(np.stack([end.b, push.state], axis=1), (len(z), len(end.b), 2))
    states = np.linalg.solve(shifted, both)
    waves, pushed = states[:, :, 0], states[:, :, 1]
    command = end.states.index(push.command)
    if push.measured:  # the sample is taken at the slot's end, and is all that it is seen by
        seen_wave, seen_push = np.zeros_like(z), 1.0 / z
    else:
        seen_wave = waves @ push.observed / (z - 1.0)
        seen_push = (pushed @ push.observed + push.direct) / (z - 1.0)
    return _End(
        waves @ end.c,
        pushed @ end.c + push.leaving,
        np.asarray(waves[:, command], np.complex128),
        np.asarray(pushed[:, command], np.complex128),
        seen_wave,
        seen_push,
    )


def _mobility(
    ends: tuple[LinearEnd, LinearEnd],
    bodies: tuple[Body, Body],
    law: Complexes,
    s: Complexes,
    period: float,
) -> Complexes:
    """Return velocity per force of both ports at one frequency; shape (n, 2, 2)."""
    z = np.exp(s * period)
    sees, sampled, moves, held = np.zeros((4, len(s), 2, 2), np.complex128)
    for at, (end, body) in enumerate(zip(ends, bodies, strict=True)):
        hold = -np.expm1(-s * period) / (s * period) * np.exp(-s * period * body.command_delay)
        assert end.push is not None
        if end.push.measured:
            sees[:, at, at] = 1.0
            held[:, at, at] = -hold / (1.0 + s * body.lag_s)
        else:
            free = 1.0 / (body.mass * s + body.damping)
            sees[:, at, at] = free / s
            sampled[:, at, at] = held_position(body, period, z)
            moves[:, at, at] = free
            held[:, at, at] = free * hold
    seen = np.linalg.solve(np.eye(2) + sampled @ law, sees)
    return np.asarray(moves - held @ law @ seen)
