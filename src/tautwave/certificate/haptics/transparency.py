"""What the hand feels through a pair: impedance free, blocked, in contact; Llewellyn's margin.

The pair as it is implemented, in its linear regime: tanks full, nothing clipped, local
walls not touched, no samples missing. The devices have the rig's best estimates; absolute stability
is judged with the lower bounds of mass and damping. The ideal rig is massless: its felt impedance
is zero when free, infinite when blocked, and in contact that of the environment, in the master's
units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave import registry
from tautwave.analysis.ports.loop_modes import least_damped
from tautwave.analysis.ports.sampled_port import HIGHEST, Body, sampled_response
from tautwave.analysis.ports.two_port import (
    Ends,
    Hybrid,
    Response,
    destabilising_ends,
    llewellyn,
)
from tautwave.analysis.ports.z_width import (
    Environment,
    Width,
    greatest_impedance,
    least_impedance,
    transmitted,
    z_width,
)
from tautwave.certificate.belief import (
    SIDES,
    delay_in_periods,
    drive_lag,
    stated_environment,
)
from tautwave.certificate.couplings import is_silent
from tautwave.certificate.loops import STABLE, believed_end, believed_parts
from tautwave.config import Rig
from tautwave.rig import coupling_part, line_delay
from tautwave.types import CommandDelay

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]

LOWEST_HZ = 0.1
POINTS = 400
CLOSE_DB = 3.0
"""Limit up to which the felt impedance counts as that of the environment."""

WIDTH_HZ = 10.0
"""Limit up to which free and blocked are compared: deliberate motion is no faster."""

Delays = Mapping[str, CommandDelay]


class Felt(NamedTuple):
    """Impedances at the master [N s/m or N m s/rad] over frequency, and the two-port's margin.

    Attributes
    ----------
    pair, rotary : str, bool
    hertz : ndarray of shape (n,)
        From `LOWEST_HZ` to `HIGHEST` of the rate.
    free, blocked, device : ndarray of shape (n,), complex
        Felt with the slave free and clamped; the master alone.
    touching, ideal : ndarray of shape (n,), complex, optional
        Felt with the simulation's environment pressed, and what it would be without the rig.
    contact : str
        What is touched.
    width : Width
        Mean distance of `free` and `blocked` up to `WIDTH_HZ`.
    margin : ndarray of shape (n,)
        The least of Llewellyn's three conditions, each over the magnitudes in it; stable from 0 on.
    ends : Ends, optional
        A passive hand and environment that the exact sampled loop is unstable with.
    """

    pair: str
    rotary: bool
    hertz: Floats
    free: Complexes
    blocked: Complexes
    device: Complexes
    touching: Complexes | None
    ideal: Complexes | None
    contact: str
    width: Width
    margin: Floats
    ends: Ends | None

    @property
    def mass(self) -> float:
        """Mass felt in free motion at the low end of the band [kg or kg m^2]."""
        return float(self.free[0].imag / (2.0 * math.pi * self.hertz[0]))

    @property
    def damping(self) -> float:
        """Damping felt in free motion at the low end of the band [N s/m or N m s/rad]."""
        return float(self.free[0].real)

    @property
    def stiffness(self) -> float:
        """Stiffness felt against the clamp at the low end of the band [N/m or N m/rad]."""
        return float(-self.blocked[0].imag * 2.0 * math.pi * self.hertz[0])

    @property
    def faithful_hz(self) -> float | None:
        """Where what is felt in contact first leaves the ideal by `CLOSE_DB`; None: nowhere."""
        if self.touching is None or self.ideal is None:
            return None
        off = np.flatnonzero(np.abs(20.0 * np.log10(np.abs(self.touching / self.ideal))) > CLOSE_DB)
        return float(self.hertz[off[0]]) if len(off) else None

    def sentences(self) -> list[str]:
        """Return the message of the plot."""
        spring, damper = ("N m/rad", "N m s/rad") if self.rotary else ("N/m", "N s/m")
        mass = "kg m^2" if self.rotary else "kg"
        top, name = self.hertz[-1], f"pair {self.pair}"
        lines = [
            f"{name}: at {self.hertz[0]:g} Hz free motion feels like {self.mass:.3g} {mass} and "
            f"{self.damping:.3g} {damper} (ideal: nothing), a clamped slave like "
            f"{self.stiffness:.3g} {spring} (ideal: rigid).",
            f"{name}: up to {min(top, WIDTH_HZ):g} Hz the two differ by {self.width.decibels:.3g} "
            "dB on average.",
        ]
        if self.touching is not None:
            at = self.faithful_hz
            where = f"within {CLOSE_DB:g} dB of the ideal up to {top if at is None else at:.3g} Hz"
            if at == self.hertz[0]:
                where = f"more than {CLOSE_DB:g} dB from the ideal above {at:g} Hz"
            lines.append(f"{name}: touching {self.contact}, it feels {where}.")
        at = int(np.argmin(self.margin))
        least = f"least margin {self.margin[at]:.2g} at {self.hertz[at]:.3g} Hz"
        if self.stable:
            near = " nearly lossless:" if self.margin[at] <= self.blur[at] else ""
            lines.append(f"{name}: absolutely stable (Llewellyn) up to {top:g} Hz,{near} {least}.")
            return lines
        text = f"{name}: fails Llewellyn's condition in its linear regime: {least}"
        if self.ends is not None:
            m, b, k = self.ends.hand
            text += f"; a hand of {m:.3g} {mass}, {b:.3g} {damper} and {k:.3g} {spring} on it and "
            m, _, k = self.ends.environment
            load = f"a mass of {m:.3g} {mass}" if m else f"a spring of {k:.3g} {spring}"
            text += f"{load if m or k else 'nothing'} at the slave together are unstable"
        return [*lines, f"{text}."]

    @property
    def stable(self) -> bool:
        """Llewellyn's verdict, up to the uncertainty of a response at one frequency.

        It neglects the power of a hold at multiples of the rate: a share of (w T)^2 / 12.
        """
        return self.ends is None and bool(np.all(self.margin >= -self.blur))

    @property
    def blur(self) -> Floats:
        """Uncertainty of `margin` from a response at one frequency, (w T)^2 / 12."""
        return np.asarray((2.0 * math.pi * HIGHEST * self.hertz / self.hertz[-1]) ** 2 / 12.0)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        curves = {"free": self.free, "blocked": self.blocked, "device": self.device}
        if self.touching is not None and self.ideal is not None:
            curves |= {"touching": self.touching, "ideal": self.ideal}
        return {
            "free_mass": self.mass,
            "free_damping": self.damping,
            "blocked_stiffness": self.stiffness,
            "z_width_db": self.width.decibels,
            "contact": self.contact or None,
            "faithful_hz": self.faithful_hz,
            "llewellyn": {
                "stable": self.stable,
                "margin": self.margin.tolist(),
                "least_margin": float(self.margin.min()),
                "at_hz": float(self.hertz[np.argmin(self.margin)]),
                "ends": None if self.ends is None else self.ends._asdict(),
            },
            "hertz": self.hertz.tolist(),
            "impedance": {
                name: {"magnitude": np.abs(z).tolist(), "phase_deg": np.angle(z, deg=True).tolist()}
                for name, z in curves.items()
            },
        }


def pair_felt(rig: Rig, pair: str, delays: Delays) -> Felt | str:
    """Return what the hand feels through a pair, or a sentence why it is unknown."""
    if is_silent(rig) or not coupling_part(rig).linear:
        return f"pair {pair}: law {rig.coupling.law} has no linear model (its part names none)"
    if max(rig.axis_divisor(f"{side}.{pair}") for side in SIDES) > 1:
        return (
            f"pair {pair}: its sides run at different rates; set divisor 1 "
            "on both buses to evaluate it"
        )
    ends = [believed_end(rig, f"{side}.{pair}", delays, "value") for side in SIDES]
    if any(end.push is None for end in ends):
        return f"pair {pair}: the linear model of law {rig.coupling.law} has no force inputs"
    best, certain = (_response(rig, pair, delays, bound) for bound in ("value", "lower"))
    hertz = np.geomspace(LOWEST_HZ, HIGHEST * rig.rate_hz, POINTS)
    s = np.asarray(2j * math.pi * hertz)
    h = best(s)
    axis = rig.axes[f"master.{pair}"]
    device = np.zeros_like(s)
    if axis.inertia is not None:
        device = axis.inertia.value * s + axis.damping.value
    touching = ideal = None
    contact = stated_environment(rig, pair)
    if contact is not None:
        load = Environment(0.0, contact.damping, contact.stiffness).impedance(s)
        # Scale from slave to master: both transmissions at low frequency.
        ratio = float((-h.h12 * h.h21)[0].real)
        touching, ideal = transmitted(h, load), ratio * load
    low, high = (float(2.0 * math.pi * hertz[at]) for at in (0, -1))
    margin = _margin(certain(s))
    felt = Felt(
        pair,
        axis.kind == "rotary",
        hertz,
        least_impedance(h),
        greatest_impedance(h),
        device,
        touching,
        ideal,
        "" if contact is None else contact.text,
        z_width(best, low, min(high, 2.0 * math.pi * WIDTH_HZ)),
        margin,
        None,
    )
    worst = int(np.argmin(margin))
    if margin[worst] >= 0.0:
        return felt
    passive = destabilising_ends(certain, 2.0 * math.pi * float(hertz[worst]))
    if passive is None or not _is_unstable(rig, pair, delays, passive):
        return felt
    return felt._replace(ends=passive)


def _is_unstable(rig: Rig, pair: str, delays: Delays, ends: Ends) -> bool:
    """Return whether the exact sampled loop is unstable between a hand and an environment."""
    law = registry.load_named(coupling_part(rig).linear)
    keys = rig.coupling.pairs[pair]
    loop = []
    for side, (mass, damping, stiffness) in zip(SIDES, ends, strict=True):
        if rig.axes[f"{side}.{pair}"].inertia is None:
            return False  # a drive's passivity covers external springs only
        device, site = believed_parts(rig, f"{side}.{pair}", delays, "lower")
        held = device._replace(
            mass=device.mass + mass, damping=device.damping + damping, stiffness=stiffness
        )
        loop.append(law(keys, side, held, site))
    mode = least_damped(loop[0], loop[1], line_delay(rig).samples, rig.period_s)
    return mode.radius > 1.0 + STABLE


def _response(rig: Rig, pair: str, delays: Delays, bound: str) -> Response:
    ends, bodies = [], []
    for side in SIDES:
        name = f"{side}.{pair}"
        axis, late = rig.axes[name], delay_in_periods(rig, delays[name])
        damping = getattr(axis.damping, bound)
        ends.append(believed_end(rig, name, delays, bound, damping=damping))
        mass = 0.0 if axis.inertia is None else getattr(axis.inertia, bound)
        bodies.append(Body(mass, damping, drive_lag(rig, name) or 0.0, late))
    return sampled_response(
        (ends[0], ends[1]), (bodies[0], bodies[1]), line_delay(rig).samples, rig.period_s
    )


def _margin(h: Hybrid) -> Floats:
    cross = np.abs(h.h12 * h.h21)
    least = llewellyn(h)[0] * cross / (np.abs(h.h11 * h.h22) + cross)
    for own in (h.h11, h.h22):
        least = np.minimum(least, own.real / np.abs(own))
    return np.asarray(least)
