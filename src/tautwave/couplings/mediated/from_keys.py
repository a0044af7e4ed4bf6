"""From the keys of a mediated pair to the constants of one end, SI of each device."""

from __future__ import annotations

import math

from tautwave.config.keys.coupling import chosen
from tautwave.contracts import CoupledAxis
from tautwave.couplings.mediated.contact import ContactParams
from tautwave.couplings.mediated.fit import FitParams
from tautwave.couplings.mediated.keys import MediatedPair
from tautwave.couplings.mediated.model import ModelParams
from tautwave.couplings.mediated.records import MediatedEndParams
from tautwave.couplings.mediated.signals import SignalParams
from tautwave.couplings.outside import outside_effort
from tautwave.errors import ConfigError

APART = 5.0
"""Memories 1 / (1 - p) of the filter from one sample of the fit to the next: three low-passes then
keep a tenth of white noise."""

SMOOTHED_S = 3e-3
"""Time over which velocities are smoothed [s]: a twentieth of a period of the spring, 16 Hz."""

PRESSES = 2.5
"""Times `touch`, which a slave in contact presses with whatever the master renders: enough to learn
from, and more than what begins a first estimate (`contact.FELT`)."""

LEAD = 1.3
"""Times what the master renders, which it presses with beyond that. More than 1, so that it does
not get stuck on a friction that it takes for a contact."""

STEADY = 2.0
"""Rendered damping over what a spring on a device without friction needs: K T (1/2 + n)."""


def end_constants(pair: MediatedPair, side: str, axis: CoupledAxis) -> MediatedEndParams:
    """Return the constants of one end.

    Raises
    ------
    ConfigError
        `effort: measured`, and the slave has no sensor.
    """
    follows = side == "slave"
    measures = follows and pair.effort == "measured"
    if measures and not axis.senses:
        raise ConfigError(
            "effort: measured: the slave has no effort_sensor; add one, or use effort: observed"
        )
    outside = outside_effort(axis, pair.observer_hz)
    pole = outside.observer.pole
    every = math.ceil(APART / (1.0 - pole))
    stiffest = chosen(pair, "stiffest")
    press = PRESSES * chosen(pair, "touch")
    scale = pair.position_scale
    late = axis.delay + (1 if axis.late > 0.0 else 0)
    span = STEADY * axis.period * (0.5 + late)
    return MediatedEndParams(
        follows=follows,
        measures=measures,
        stiffness=pair.in_device_units(side, chosen(pair, "stiffness")) if follows else 0.0,
        damping=pair.in_device_units(side, chosen(pair, "damping")) if follows else 0.0,
        force=pair.force_gain if follows else 0.0,
        press=press if follows else press / pair.effective_force_scale,
        lead=LEAD,
        read_stiffness=scale,
        read_damping=pair.sign * scale * scale / pair.effective_force_scale,
        stiffest=pair.in_device_units(side, stiffest),
        outside=outside,
        signals=SignalParams(pole, 0.5 / axis.period),
        contact=ContactParams(
            fit=FitParams(math.exp(-every * axis.period / pair.memory_s)),
            touch=chosen(pair, "touch"),
            every=every,
            sure=pair.sure,
            resolution=axis.encoder_quantum + 2.0 * axis.position_noise,
        ),
        model=ModelParams(
            share=-math.expm1(-axis.period / pair.adopt_s), span=span, most=span * stiffest
        ),
        smoothing=axis.period / SMOOTHED_S,
    )
