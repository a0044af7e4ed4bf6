"""What an end of a pair with an account may supply, in joules known before the run.

The bound is that of a wave port, `analysis.claim`, with E0 + D for its 2 E0. The
effort that acts is held, limited and faded by the same controller, so W is the same sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.analysis.claim import Claim, joules, short, stall_words, watts
from tautwave.certificate.belief import assumed, broken_delay, broken_inertia
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.certificate.tuning.two_port import tuning
from tautwave.certificate.tuning.verdict import tuning_sentence
from tautwave.config import Rig, local_wall
from tautwave.contracts import CoupledAxis
from tautwave.couplings.account.steps import noise_share
from tautwave.laws.account import CALM_SHARE, AccountParams
from tautwave.rig import (
    axis_allowance,
    axis_claim,
    coupled_axis,
    end_constants,
    judge_claim,
    wall_params,
)
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def claim_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what the end at an axis may supply, or the key without which it is unbounded."""
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    for key in ("velocity_limit", "effort_rate_limit"):
        if getattr(axis, key) is None:
            return key
    known = coupled_axis(rig, axis_name, delays[axis_name])
    account = end_constants(rig, axis_name, delays[axis_name]).account
    return axis_claim(rig, axis_name, delays[axis_name])._replace(
        reserve=0.5 * (account.reserve + account.debt),
        leak=account.income / known.period,
        owed=0.0
        if local_wall(rig, axis_name) is None
        else wall_params(rig, axis_name, delays[axis_name]).reserve,
    )


def claimed_joules(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what an end may supply in a run, as seen by its encoder [J]; inf: no claim."""
    claim = claim_of(rig, axis_name, delays)
    return claim.seen(rig.claimed_s) if isinstance(claim, Claim) else math.inf


def held_facts(rig: Rig, delays: Delays) -> Iterator[tuple[str, str]]:
    """Yield for each axis what its account holds while nothing moves, and what noise takes of it.

    A force F at rest needs (1 + n) F**2 T**2 / m of the funds that the gate plans with: it expects
    the last command and the n under way to move the device that something holds. How long a press
    lasts is not stated: the approach spends of the reserve, and with a delay a law of positions
    takes more than noise does (`four_channel` at 20 ms some microwatts, with the hand at rest).
    """
    for axis_name, axis in rig.axes.items():
        known = coupled_axis(rig, axis_name, delays[axis_name])
        account = end_constants(rig, axis_name, delays[axis_name]).account
        assert known.inertia is not None
        most = axis_allowance(rig, axis_name, delays[axis_name]).shared_effort
        planned = CALM_SHARE * account.share * account.reserve
        force = math.sqrt(known.inertia * planned / (1 + known.delay)) / known.period
        unit = "N m" if axis.kind == "rotary" else "N"
        text = f"at rest its reserve of {joules(account.reserve)} holds "
        if force < most:
            full = account.reserve * (most / force) ** 2
            text += f"{force:.3g} {unit}, and {most:.3g} with {joules(full)}"
        else:
            text += f"{most:.3g} {unit}"
        lost = flicker_taken(known, account) / known.period
        if lost > 0.0:
            text += (
                f"; a reading that flickers between two encoder steps may take {watts(lost)} more "
                f"than noise is given, so all of it in {short(account.reserve / lost)} s"
            )
        else:
            text += "; noise as declared takes nothing of it"
        text += "; what contact and the law itself take comes on top"
        yield f"held force at {axis_name}", text


def flicker_taken(axis: CoupledAxis, account: AccountParams) -> float:
    """Return what noise, and at worst a flicker of a step, take beyond the income [J per period].

    Errors of +-q/2 by turns take G q**2 / 2.
    """
    noise = noise_share(axis) * axis.position_noise**2
    return account.gain * (noise + 0.5 * axis.encoder_quantum**2) - account.income


def _at_axis(rig: Rig, axis_name: str, delays: Delays, damping: float) -> Iterator[Element]:
    """Yield the account of an axis."""
    name = f"account of {axis_name}"
    axis, claim = rig.axes[axis_name], claim_of(rig, axis_name, delays)
    if isinstance(claim, str):
        verdict = Verdict(False, f"{name}: its energy output is unbounded; give {claim}")
        yield Element(name, "account", axis_name, verdict, verdict, {}, (verdict.reason,))
        return
    seconds = rig.claimed_s
    broken = (broken_inertia(rig, axis_name), broken_delay(rig, axis_name, delays[axis_name]))
    reason = (
        f"{name}: passive by account: whatever the law commands, in {seconds:g} s it gives out at "
        f"most {joules(claim.seen(seconds))} as its encoder sees it (reserve and "
        f"debt {joules(2.0 * claim.reserve)}, {stall_words(claim)}, "
        f"{watts(claim.leak)}), {joules(claim.true(seconds))} in fact, if the noise is white "
        "and as declared."
    )
    judged = judge_claim(rig, axis_name, claim)
    conditions = (*assumed(axis, axis_name, inertia=True), *judged.conditions)
    passive = Verdict(True, reason, conditions)
    if judged.refusal:
        passive = Verdict(False, f"{name}: {judged.refusal}")
    for text in broken:
        if text is not None:
            passive = Verdict(False, f"{name}: {text}")
    steps = passive
    if passive.passed and claim.leak > 0.0:
        steps = Verdict(
            False,
            f"{name}: noise drains it; the {watts(claim.leak)} that "
            "compensate for this may be supplied.",
            margin=-claim.leak,
        )
    numbers = {
        **claim._asdict(),
        "holds": "by account",
        "seen_j": claim.seen(seconds),
        "true_j": claim.true(seconds),
    }
    yield Element(name, "account", axis_name, passive, steps, numbers, (passive.reason,))


def _between(rig: Rig, pair: str, delays: Delays) -> Iterator[Element]:
    """Yield what passes between the accounts."""
    name = f"credits of {pair}"
    text = (
        f"{name}: an end draws only what the other end sent, as a cumulative counter, so delay, "
        "loss and reordering add nothing."
    )
    fine = Verdict(True, text)
    yield Element(name, "credits", pair, fine, fine, {}, (text,))
    tuned = tuning(rig, pair, delays)
    if tuned is not None:
        bare = f"law of {pair}, bare: {tuning_sentence(rig, pair, tuned)}"
        aside = Verdict(True, bare)
        yield Element(f"law of {pair}", "law", pair, aside, aside, tuned._asdict(), (bare,))


def _remedy(rig: Rig, pair: str) -> str:
    return (
        "Lower the law's stiffness or the delay, or use law wave: an account makes a law passive, "
        "but not well damped."
    )


verdict = CouplingVerdict(
    _between, _at_axis, _remedy, picture="an account bounds energy: no picture"
)
