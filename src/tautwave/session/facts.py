"""Numbers that follow from a rig: delays, offsets, limits of its ports."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.config import Rig
from tautwave.laws.admittance import greatest_stiffness
from tautwave.laws.wave import filter_gain
from tautwave.rig import device_impedance, pair_scale
from tautwave.types import CommandDelay


class PairFacts(NamedTuple):
    """Of one pair: one-way delay tau [s] as it acts, all samples counted, and tau / b.

    With the wave's effort F held, the master stands ahead of the slave by F tau / b. A device
    that is held still by a hand or a wall gets `held_share` of F: the port's prediction takes
    the effort it gives itself for a motion, and 1 / (1 + b T (1 + d) / m) is what is left of it
    (d: command delay in periods, m: the inertia's lower bound). The
    smaller of master's and slave's.
    """

    coupling_delay_s: float
    offset_per_effort: float
    power_ratio: float
    held_share: float


def pair_facts(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> PairFacts:
    """Return what follows for one pair.

    A wave that left for a period is on the line `delay_s`, was closed one period late and acts
    one command delay later; a wave filter adds (1-a)/a periods.
    """
    keys = rig.coupling.pairs[name]
    period = rig.period_s
    mean = 0.0
    for side in ("master", "slave"):
        delay = delays[f"{side}.{name}"]
        mean += 0.5 * (delay.periods * period + delay.remainder_s)
    tau = rig.delay_samples * period + period + mean
    if rig.coupling.law == "wave" and rig.coupling.wave_filter_hz is not None:
        gain = filter_gain(rig.coupling.wave_filter_hz, period)
        tau += (1.0 - gain) / gain * period
    offset = 0.0
    share = 1.0
    if keys.wave_impedance is not None:
        offset = tau / keys.wave_impedance
        share = min(
            held_share(rig, f"{side}.{name}", delays[f"{side}.{name}"])
            for side in ("master", "slave")
        )
    elif keys.stiffness is not None:
        offset = 1.0 / keys.stiffness
    return PairFacts(tau, offset, pair_scale(keys).power, share)


def held_share(rig: Rig, axis_name: str, delay: CommandDelay) -> float:
    """Return effort given per effort of the wave when held still; see `PairFacts`."""
    side, name = axis_name.split(".")
    axis = rig.axes[axis_name]
    keys = rig.coupling.pairs[name]
    if axis.inertia is None or keys.wave_impedance is None:
        return 1.0
    impedance = device_impedance(keys, side, keys.wave_impedance)
    ratio = impedance * rig.period_s * (1.0 + delay.periods) / axis.inertia.lower
    return 1.0 / (1.0 + ratio)


def admittance_facts(rig: Rig, delays: dict[str, CommandDelay]) -> list[tuple[str, str]]:
    """Return one sentence per admittance axis on how stiff its outside may be."""
    facts = []
    for axis_name, axis in rig.axes.items():
        if axis.causality != "admittance" or rig.coupling.law != "wave":
            continue
        side, name = axis_name.split(".")
        keys = rig.coupling.pairs[name]
        impedance = device_impedance(keys, side, keys.wave_impedance or 0.0)
        limit = greatest_stiffness(rig.period_s, impedance, delays[axis_name].periods)
        unit = "N m/rad" if axis.kind == "rotary" else "N/m"
        upper = axis.environment_stiffness_upper
        if upper is None or upper == 0.0:
            text = (
                f"no guarantee: give environment_stiffness_upper; matched, it is stable up to "
                f"{limit:.4g} {unit} (K T / b < {limit * rig.period_s / impedance:.3g})"
            )
        else:
            ratio = upper * rig.period_s / impedance
            text = (
                f"passive for an outside spring up to {upper:.4g} {unit} (K T / b = {ratio:.3g})"
                " if the velocity is reached within a period; nothing is claimed beyond, "
                "and nothing for an outside damper"
            )
        facts.append((f"admittance port of {axis_name}", text))
    return facts


def hints(rig: Rig) -> list[tuple[str, str]]:
    """Return what experience says of a rig that is right, but will not feel right."""
    coarse = [
        name for name, axis in rig.axes.items() if axis.encoder_quantum or axis.position_noise
    ]
    matched = [keys for keys in rig.coupling.pairs.values() if keys.matched_slave]
    if (
        rig.coupling.law == "wave"
        and coarse
        and rig.coupling.wave_filter_hz is None
        and len(matched) < len(rig.coupling.pairs)
    ):
        return [
            (
                "hint",
                "encoder steps and noise ring in a line that loses nothing; "
                f"coupling.wave_filter_hz: {0.1 * rig.rate_hz:g} takes them away",
            )
        ]
    return []
