"""Numbers that follow from a rig: delays, offsets, limits of its ports."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.config import Rig
from tautwave.laws.admittance import greatest_stiffness
from tautwave.rig import device_impedance, held_share, one_way_delay, pair_scale
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
    """Return what follows for one pair; see `tautwave.rig.one_way_delay`."""
    keys = rig.coupling.pairs[name]
    tau = one_way_delay(rig, name, delays)
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


def admittance_facts(rig: Rig, delays: dict[str, CommandDelay]) -> list[tuple[str, str]]:
    """Return one sentence per admittance axis on how stiff its outside may be."""
    facts = []
    for axis_name, axis in rig.axes.items():
        if axis.causality != "admittance" or rig.coupling.law != "wave":
            continue
        side, name = axis_name.split(".")
        keys = rig.coupling.pairs[name]
        impedance = device_impedance(keys, side, keys.wave_impedance or 0.0)
        period = rig.axis_period_s(axis_name)
        limit = greatest_stiffness(period, impedance, delays[axis_name].periods)
        unit = "N m/rad" if axis.kind == "rotary" else "N/m"
        upper = axis.environment_stiffness_upper
        if upper is None or upper == 0.0:
            text = (
                f"no guarantee: give environment_stiffness_upper; matched, it is stable up to "
                f"{limit:.4g} {unit} (K T / b < {limit * period / impedance:.3g})"
            )
        else:
            ratio = upper * period / impedance
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
