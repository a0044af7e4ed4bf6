"""One port as the certificate sees it: the class of its device, the spring that it bears."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import NamedTuple

from tautwave.analysis.wave_port.device_class import (
    ClassGain,
    DeviceClass,
    class_gain,
    contracting,
    stiffest_spring,
    suggested_spring,
    wall_spring,
)
from tautwave.certificate.belief import stated_contact
from tautwave.config import Rig, local_wall
from tautwave.couplings.wave.from_keys import bare_port, observer_of
from tautwave.couplings.wave.keys import PLAIN, POLES, WavePair
from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]
SOFTER = 40
"""Greatest factor by which a smaller impedance is looked for."""

TENTH = 1.1

MORE = (1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Factors on what a device or a rig has that are tried where no key of the pair helps."""


class DevicePort(NamedTuple):
    """One port as the certificate sees it, with the class of its device."""

    port: PortParams
    observer: ObserverParams
    delay: int
    devices: DeviceClass

    @property
    def gain(self) -> ClassGain:
        """The greatest share of a wave that it returns on its class [1]."""
        return _gain(*self)

    @property
    def contracting(self) -> bool:
        """Whether it returns no more than arrives."""
        return _contracting(*self)

    def stiffest(self) -> float:
        """Return the stiffest spring up to which it returns no more than arrives."""
        return _stiffest(*self)

    def suggested(self, from_: float = 0.0, to: float = math.inf) -> float:
        """Return the stiffest spring that frequencies of a grid allow; no proof."""
        return _suggested(*self, from_, to)


_gain = functools.lru_cache(maxsize=512)(class_gain)
_contracting = functools.lru_cache(maxsize=512)(contracting)
_stiffest = functools.lru_cache(maxsize=512)(stiffest_spring)
_suggested = functools.lru_cache(maxsize=512)(suggested_spring)


def pair_of(rig: Rig, axis_name: str) -> WavePair:
    """Return the keys of an axis' pair."""
    keys = rig.coupling.pairs[axis_name.split(".")[1]]
    assert isinstance(keys, WavePair)
    return keys


def port_of(
    rig: Rig,
    axis_name: str,
    delays: Delays,
    damping: float,
    keys: WavePair | None = None,
    *,
    sooner: int = 0,
    heavier: float = 1.0,
) -> DevicePort:
    """Return the port of an axis.

    Parameters
    ----------
    rig, axis_name, delays : Rig, str, Mapping
        The axis and its command delay.
    damping : float
        What its wall leaves of the device's [N m s/rad or N s/m]. To an observer, which does
        not know it, the wall is a part of the contact.
    keys : WavePair, optional
        Instead of the rig's.
    sooner, heavier : int, float
        Periods less of command delay, and a factor on the least mass.
    """
    side = axis_name.split(".")[0]
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    pair = pair_of(rig, axis_name) if keys is None else keys
    period, delay = rig.axis_period_s(axis_name), delays[axis_name].periods - sooner
    mass = heavier * axis.inertia.lower
    contact, wall = stated_contact(rig, axis_name), local_wall(rig, axis_name)
    stiffness = max(
        axis.environment_stiffness_upper or 0.0, 0.0 if contact is None else contact.stiffness
    )
    if wall is not None and pair.pole(side) is not None:
        stiffness += wall_spring(wall.stiffness, wall.damping, period)
    return DevicePort(
        bare_port(pair, side, period, mass, delay, reserve=1.0),
        observer_of(pair, side, period, mass),
        delay,
        DeviceClass(mass, damping, stiffness),
    )


def binding(rig: Rig, axis_name: str, delays: Delays, damping: float) -> str:
    """Return which belief most limits the stiffest spring, as a clause; "" if none does.

    Each is made better by a tenth, the command delay by a period and counted for its share.
    """
    keys = pair_of(rig, axis_name)
    now = port_of(rig, axis_name, delays, damping)
    before = now.suggested()
    if before <= 0.0:
        return ""
    better = {
        "10 % more inertia.lower": port_of(rig, axis_name, delays, damping, heavier=TENTH),
        "10 % more damping.lower": port_of(rig, axis_name, delays, TENTH * damping),
    }
    if isinstance(keys.wave_filter_hz, float):
        softer = keys.model_copy(update={"wave_filter_hz": keys.wave_filter_hz / TENTH})
        lower = port_of(rig, axis_name, delays, damping, softer)
        better["a 10 % lower wave filter"] = lower
    shares = [(_share(port, before), _share(port, before), what) for what, port in better.items()]
    if now.delay > 0:
        share = _share(port_of(rig, axis_name, delays, damping, sooner=1), before)
        weighed = share * math.log(TENTH) / math.log((now.delay + 1.0) / now.delay)
        shares.append((weighed, share, "one period less command delay"))
    _, share, what = max(shares)
    if share < 0.005:
        return ""
    return f"{what} raises that by {100.0 * math.expm1(share):.0f} %"


def _share(port: DevicePort, before: float) -> float:
    return math.log(max(port.suggested(before, 4.0 * before), before) / before)


def remedy_of(rig: Rig, axis_name: str, delays: Delays, left: float) -> str:
    """Return the pole, the filter or the impedance that would pass."""
    side = axis_name.split(".")[0]
    keys = pair_of(rig, axis_name)

    def passes(**update: object) -> bool:
        other = keys.model_copy(update=update)
        return port_of(rig, axis_name, delays, left, other).contracting

    for pole in POLES:
        if passes(**{f"pole_{side}": pole}):
            return f"set pole_{side} to {pole}"
    filtered = keys.wave_filter_hz
    rate = 1.0 / rig.axis_period_s(axis_name)
    first, word = (filtered, "lower") if isinstance(filtered, float) else (0.15 * rate, "set")
    corners = [float(f"{first / factor:.3g}") for factor in (1.5, 2, 4)]
    for corner in corners:
        if passes(wave_filter_hz=corner):
            return f"{word} wave_filter_hz to {corner:g}"
    factor = 1.25
    while factor < SOFTER:
        lower = float(f"{keys.impedance / factor:.3g}")
        if passes(wave_impedance=lower):
            return f"lower wave_impedance to {lower:g}"
        if passes(wave_impedance=lower, **{f"pole_{side}": PLAIN}):
            return f"set pole_{side} to plain and lower wave_impedance to {lower:g}"
        factor *= 1.25
    for corner in corners:
        for pole in POLES:
            if passes(wave_filter_hz=corner, **{f"pole_{side}": pole}):
                return f"{word} wave_filter_hz to {corner:g} and pole_{side} to {pole}"
    return _more_of_the_device(rig, axis_name, delays, left)


def _more_of_the_device(rig: Rig, axis_name: str, delays: Delays, left: float) -> str:
    """Return how much more rate, mass or damping would pass, each alone; tried up to eightfold."""
    belief = rig.axes[axis_name].inertia
    assert belief is not None
    for factor in MORE:
        rate = factor * rig.rate_hz
        faster = rig.model_copy(update={"rate_hz": rate})
        ways = {
            f"a rate of {rate:g} Hz": port_of(faster, axis_name, delays, left),
            f"an inertia of at least {factor * belief.lower:.3g}": port_of(
                rig, axis_name, delays, left, heavier=factor
            ),
            f"a damping of at least {factor * left:.3g}": port_of(
                rig, axis_name, delays, factor * left
            ),
        }
        enough = [what for what, port in ways.items() if port.contracting]
        if enough:
            return f"no key of the pair is enough; {' or '.join(enough)} is"
    return "no key of the pair is enough, nor is eight times the rate, the inertia or the damping"
