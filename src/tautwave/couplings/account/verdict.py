"""The verdict on a pair with an account: what each end may give, by account, in joules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.analysis.claim import joules, stall_words, watts
from tautwave.certificate.belief import assumed, broken_delay, broken_inertia
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.certificate.tuning.two_port import tuning
from tautwave.certificate.tuning.verdict import tuning_sentence
from tautwave.config import Rig
from tautwave.couplings.account.claim import claim_of
from tautwave.rig import judge_claim
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


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
