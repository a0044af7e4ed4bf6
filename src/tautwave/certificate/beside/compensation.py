"""How friction and inertia of the devices are spent: what is compensated is not for others."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.analysis.claim import Claim, joules
from tautwave.certificate.belief import (
    assumed,
    broken_coulomb,
    broken_damping,
    broken_delay,
    broken_inertia,
)
from tautwave.certificate.data import Element, PairLoop, Verdict
from tautwave.config import Rig
from tautwave.rig import axis_allowance, axis_claim, axis_params
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def compensation_elements(rig: Rig, delays: Delays) -> Iterator[Element]:
    """Yield the compensation of each axis, with the budget of its friction."""
    for name, axis in rig.axes.items():
        keys = axis.compensation
        if keys is None or not keys.friction:
            continue
        has = axis_allowance(rig, name, delays[name])
        coulomb, viscous = has.compensated_coulomb, has.compensated_damping
        effort, damping = ("N m", "N m s/rad") if axis.kind == "rotary" else ("N", "N s/m")
        head = f"compensation of {name}"
        reason = (
            f"{head}: passive by proof with the device's own friction, of which it takes "
            f"{coulomb:.3g} of {has.coulomb:.3g} {effort} and {viscous:.3g} of "
            f"{has.damping:.3g} {damping}; the rest is available to "
            "walls, ports and couplings."
        )
        conditions = assumed(axis, name, damping=viscous > 0.0, coulomb=coulomb > 0.0)
        verdict = Verdict(True, reason, tuple(conditions))
        broken = (broken_coulomb(rig, name), broken_damping(rig, name))
        for text in broken:
            if text is not None:
                verdict = Verdict(False, f"{head}: {text}")
        numbers = {
            "coulomb": [coulomb, has.coulomb],
            "damping": [viscous, has.damping],
            "holds": "by proof",
        }
        yield Element(head, "compensation", name, verdict, verdict, numbers, (verdict.reason,))


def inertia_claim(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what inertia compensation may supply, or the key without which it is unbounded."""
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    has = axis_allowance(rig, axis_name, delays[axis_name])
    if math.isinf(has.velocity):
        return "velocity_limit"
    if math.isinf(has.effort_rate):
        return "effort_rate_limit"
    own = axis_params(rig, axis_name, delays[axis_name], 0).site.inertia
    return axis_claim(rig, axis_name, delays[axis_name])._replace(
        reserve=0.5 * (own.account.reserve + own.account.debt),
        effort=own.most,
        stop_damping=0.0,
        release=0.0,
        bounded=math.inf,
    )


def inertia_elements(rig: Rig, delays: Delays) -> Iterator[Element]:
    """Yield what takes inertia off each axis, with the budget of its inertia."""
    for name, axis in rig.axes.items():
        keys = axis.compensation
        if keys is None or keys.inertia == 0.0:
            continue
        assert axis.inertia is not None
        head = f"inertia of {name}"
        claim = inertia_claim(rig, name, delays)
        if isinstance(claim, str):
            verdict = Verdict(False, f"{head}: its energy output is unbounded; give {claim}")
            yield Element(head, "inertia", name, verdict, verdict, {}, (verdict.reason,))
            continue
        has = axis_allowance(rig, name, delays[name])
        taken, paying = keys.inertia * has.inertia, has.paying_coulomb
        mass, effort = ("kg m^2", "N m") if axis.kind == "rotary" else ("kg", "N")
        reason = (
            f"{head}: passive by account: {taken:.3g} of {has.inertia:.3g} {mass} are "
            f"compensated below {keys.inertia_hz:g} Hz, which supplies at most "
            f"{joules(claim.seen(rig.claimed_s))} as seen by its encoder, beyond what "
            f"{paying:.3g} of {has.coulomb:.3g} {effort} of friction dissipate (reserve "
            f"{joules(2.0 * claim.reserve)}, {joules(claim.under_way)} in transit)."
        )
        conditions = assumed(axis, name, inertia=True, coulomb=paying > 0.0)
        conditions.append(f"the port's claim at {name} assumes its full inertia")
        verdict = Verdict(True, reason, tuple(conditions))
        broken = [broken_inertia(rig, name), broken_delay(rig, name, delays[name])]
        broken.append(broken_coulomb(rig, name) if paying > 0.0 else None)
        for text in broken:
            if text is not None:
                verdict = Verdict(False, f"{head}: {text}")
        numbers = {
            **claim._asdict(),
            "inertia": [taken, has.inertia],
            "coulomb": [paying, has.coulomb],
            "holds": "by account",
            "seen_j": claim.seen(rig.claimed_s),
            "true_j": claim.true(rig.claimed_s),
        }
        yield Element(head, "inertia", name, verdict, verdict, numbers, (verdict.reason,))


def lightened_loop(rig: Rig, loop: PairLoop) -> PairLoop:
    """Return a pair's stability; no claim is made where inertia is compensated."""
    for side in rig.own_sides:
        keys = rig.axes[f"{side}.{loop.pair}"].compensation
        if keys is not None and keys.inertia > 0.0:
            reason = (
                f"pair {loop.pair}: no stability claim, because inertia is compensated on "
                f"{side}.{loop.pair} and the linear model does not include that. If it "
                f"oscillates, lower inertia_hz ({keys.inertia_hz:g}); the account bounds the "
                "energy"
            )
            return loop._replace(verdict=Verdict(False, reason))
    return loop
