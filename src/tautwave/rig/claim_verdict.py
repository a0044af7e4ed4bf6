"""Whether what an axis may supply means something to a person: measured by its own motion.

K is the kinetic energy of a device at its velocity limit, which it may have anyway. While the host
is prompt an axis may supply twice that, and as much in a stall, to a device that is let go. Beyond,
the verdict depends on a condition in words; far beyond there is none, and a key is named that
lowers the claim.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from tautwave.analysis.claim import Claim, joules, short, watts
from tautwave.config import Rig
from tautwave.registry import load_named
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.claims import kinetic_energy, stall_energy
from tautwave.rig.parts import coupling_part
from tautwave.types import CommandDelay
from tautwave.wording import Hint

PROMPT_PASSES, PROMPT_REFUSED = 2.0, 10.0
"""Times K that a prompt host may supply without a condition, and at all."""

STALL_PASSES, STALL_REFUSED = 1.0, 100.0
"""Times K of a stall without a condition, and at all."""

LEAST = 2
"""Periods without a sample, or skipped slots: with fewer every single one ends a run."""

Delays = Mapping[str, CommandDelay]


class Judged(NamedTuple):
    """What becomes of a claim: a refusal, "" if there is none, and conditions in words."""

    refusal: str = ""
    conditions: tuple[str, ...] = ()

    @property
    def state(self) -> str:
        """`passed`, `conditional` or `refused`."""
        if self.refusal:
            return "refused"
        return "conditional" if self.conditions else "passed"


def judge_claim(rig: Rig, axis_name: str, claim: Claim) -> Judged:
    """Return the verdict on a claim; nothing is said of a device without kinetic energy."""
    most = claim.kinetic
    if not most > 0.0:
        return Judged()
    prompt, once, stall = claim.prompt(rig.claimed_s), claim.at_once(), claim.let_go
    if refusal := prompt_refusal(once, most):
        return Judged(f"{refusal}; {less_at_once(rig, axis_name, claim)}")
    if refusal := stall_refusal(rig, axis_name, claim):
        return Judged(refusal)
    conditions = []
    if prompt > PROMPT_PASSES * most:
        conditions.append(
            f"{joules(prompt)} in {rig.claimed_s:g} s, {short(prompt / most)} times the "
            f"{joules(most)} that {axis_name} has at its velocity limit, may be supplied while "
            f"the host is prompt: {prompt_cause(claim, rig.claimed_s)}"
        )
    if stall > STALL_PASSES * most:
        safe = claim.safe_gap()
        lasts = safe > 1.5 * claim.period  # a period is no stall
        when = f"never stalls for more than {_ms(safe)}" if lasts else "never misses a sample"
        conditions.append(
            f"the host {when} ({axis_name} may supply {joules(stall)} in one of {_ms(claim.gap)}, "
            f"{short(stall / most)} times the {joules(most)} that it has at its velocity limit)"
        )
    return Judged(conditions=tuple(conditions))


def prompt_refusal(once: float, most: float) -> str:
    """Return why what an axis may supply at once [J] is too much for any condition; "" if not.

    `most` is its kinetic energy at the velocity limit [J].
    """
    if not once > PROMPT_REFUSED * most > 0.0:
        return ""
    return (
        f"it may supply {joules(once)} at once while the host is prompt, {short(once / most)} "
        f"times the {joules(most)} that it has at its velocity limit"
    )


def stall_refusal(rig: Rig, axis_name: str, claim: Claim) -> str:
    """Return why what an axis may supply in a stall is too much for any condition; "" if not.

    An axis without a velocity limit has no kinetic energy to compare: it is not refused.
    """
    most, stall = claim.kinetic, claim.let_go
    if math.isinf(most) or not stall > STALL_REFUSED * most > 0.0:
        return ""
    return (
        f"in one stall of {_ms(claim.gap)} it may supply {joules(stall)}, "
        f"{short(stall / most)} times the {joules(most)} that it has at its velocity limit; "
        f"{shorter_stall(rig, axis_name, claim)}"
    )


def tuned_state(rig: Rig, axis_name: str, claim: Claim, prompt: float, once: float) -> str:
    """Return the verdict on an axis of a law without account, as `Judged.state`.

    `prompt` is what it may supply in a run without stalls, `once` what of it at once [J].
    """
    most = claim.kinetic
    if prompt_refusal(once, most) or stall_refusal(rig, axis_name, claim):
        return "refused"
    passed = prompt <= PROMPT_PASSES * most and claim.let_go <= STALL_PASSES * most
    return "passed" if passed else "conditional"


def prompt_cause(claim: Claim, seconds: float) -> str:
    """Return what most of a prompt host's claim is made of, in words."""
    ramp = claim.held(claim.late + 1.0) - claim._replace(rate=math.inf).held(claim.late + 1.0)
    late = claim.held(claim.late + 1.0) - ramp - claim._replace(rate=math.inf).held(1.0)
    parts = {
        f"its noise and effort steps leak {watts(claim.leak)}": claim.leak * seconds,
        "its effort takes long to fall (effort_rate_limit)": ramp,
        f"its commands act {claim.late:g} periods late": late,
        f"each effort acts for {_ms(claim.period)} unseen": claim._replace(rate=math.inf).held(1.0),
        "its port has a large reserve (wave_impedance)": 2.0 * claim.reserve,
    }
    return max(parts, key=lambda words: parts[words])


def less_at_once(rig: Rig, axis_name: str, claim: Claim) -> str:
    """Return what makes the claim of a prompt host one that is not refused, in words.

    One limit of the axis, where that is enough, with the value from which on it is.
    """
    most = PROMPT_REFUSED * claim.kinetic
    faster, weaker = claim._replace(rate=math.inf), claim._replace(effort=0.0)
    if faster.at_once() <= most:
        rate = claim.rate
        while claim._replace(rate=rate).at_once() > most:
            rate *= 1.5
        return f"effort_rate_limit of {float(f'{rate:.2g}') * 1.1:.2g} or more would do"
    if weaker.at_once() <= most:
        effort = claim.effort
        while claim._replace(effort=effort).at_once() > most:
            effort /= 1.5
        return f"effort_limit of {0.9 * effort:.2g} or less would do"
    limits = "give the actual limits of device and motor"
    keys = rig.coupling.pairs[axis_name.partition(".")[2]]
    return f"lower wave_impedance, and {limits}" if hasattr(keys, "wave_impedance") else limits


def lowering_key(rig: Rig, axis_name: str, claim: Claim) -> str:
    """Return the change that most lowers a claim, in words."""
    less = changed_claims(rig, axis_name, claim)
    return min(less, key=lambda words: less[words].seen(rig.claimed_s))


def changed_claims(rig: Rig, axis_name: str, claim: Claim) -> dict[str, Claim]:
    """Return what a claim would be with one key changed, by the change."""
    less = {
        "lower wave_impedance": claim._replace(reserve=0.0, leak=0.0),
        "lower effort_limit": claim._replace(effort=0.5 * claim.effort),
        "raise effort_rate_limit": claim._replace(rate=math.inf),
    }
    limits = {"overrun_limit": rig.overrun_limit, "missing_limit": rig.loop.missing_limit}
    for key, value in limits.items():
        if value > LEAST:
            less[f"lower loop.{key}"] = with_limit(rig, axis_name, claim, key, LEAST)
    return less


def with_limit(rig: Rig, axis_name: str, claim: Claim, key: str, value: int) -> Claim:
    """Return a claim with another limit of the loop."""
    if key == "missing_limit":
        return claim._replace(blind=claim.blind - rig.loop.missing_limit + value)
    divisor = rig.axis_divisor(axis_name)
    fewer = math.ceil(rig.overrun_limit / divisor) - math.ceil(value / divisor)
    return claim._replace(blind=claim.blind - fewer)


def shorter_stall(rig: Rig, axis_name: str, claim: Claim) -> str:
    """Return what makes the claim of a stall one that is not refused, in words.

    Both limits of the loop count in it: where neither is enough alone, both are named.
    """
    limits = {"overrun_limit": rig.overrun_limit, "missing_limit": rig.loop.missing_limit}
    most, done, words = STALL_REFUSED * claim.kinetic, claim, []
    for key in sorted(limits, key=lambda key: -limits[key]):
        value = limits[key]
        while value > LEAST and with_limit(rig, axis_name, done, key, value).let_go > most:
            value = max(LEAST, value // 2)
        if value < limits[key]:
            done = with_limit(rig, axis_name, done, key, value)
            words.append(f"loop.{key} to {value}")
        if done.let_go <= most:
            break
    if done.let_go > most:
        return "its limits are too loose: give the actual limits of device and motor"
    stops = ", or give mechanical_range, its end stops" if math.isinf(claim.travel) else ""
    return f"lower {' and '.join(words)}{stops}"


def terms_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return the terms of what an end may supply, or the key without which it is unbounded.

    "" of a law that tells none.
    """
    named = coupling_part(rig).claim_terms
    if not named:
        return ""
    terms: Claim | str = load_named(named)(rig, axis_name, delays)
    return terms


def claim_hints(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Hint]:
    """Yield hints on axes whose stall gives more than their devices have at the velocity limit."""
    causes: dict[str, dict[str, Claim]] = {}
    for axis_name in rig.axes:
        claim = terms_of(rig, axis_name, delays)
        if isinstance(claim, Claim) and claim.kinetic > 0.0 and claim.let_go > claim.kinetic:
            causes.setdefault(lowering_key(rig, axis_name, claim), {})[axis_name] = claim
    limits = {
        "lower loop.overrun_limit": ("overrun_limit", rig.overrun_limit),
        "lower loop.missing_limit": ("missing_limit", rig.loop.missing_limit),
    }
    for change, claims in causes.items():
        who = "" if len(causes) == 1 else f"{', '.join(claims)}: "
        now = max(claim.let_go / claim.kinetic for claim in claims.values())
        much = f"{who}a stall gives {short(now)} times the kinetic energy at the velocity limit"
        if change not in limits:
            yield Hint("hint on claims", f"{much}; {change}")
            continue
        key, limit = limits[change]
        value, left = _lower_limit(rig, claims, delays, key, limit)
        text = f"{much}, most of it from loop.{key} {limit}; with {value} it is {short(left)} times"
        if left > 1.0:
            text = f"{text}, and with stall_energy_j: auto at most 1, at the cost of effort"
        yield Hint("hint on claims", text, f"loop.{key}={value}")


NOTHING_LEFT = "no effort left on"
"""Begins the subject of a hint on an axis that carries its load, and can do nothing else."""

NOTHING = 0.05
"""Share of what an axis' load leaves of its effort below which its pair does not get through."""

STEP = 1.1
"""Factor between the energies that are tried as a remedy."""


def bound_hints(rig: Rig, delays: Delays) -> Iterator[Hint]:
    """Yield what `stall_energy_j` leaves of an axis' effort at rest, where that is not all.

    What its load takes is not left: an axis that carries it may have nothing for its pair. Each
    remedy has been computed with its value.
    """
    for axis_name in rig.axes:
        has = axis_allowance(rig, axis_name, delays[axis_name])
        left = _left_at_rest(rig, axis_name, delays)
        if left is None or left >= has.shared_effort:
            continue
        unit = "N m" if rig.axes[axis_name].kind == "rotary" else "N"
        share = left / has.shared_effort
        change, enough = _shorter_stall(rig, axis_name, delays)
        if share < NOTHING and not change:
            change, enough = _more_energy(rig, axis_name, delays)
        beside = f" beside the {has.load_effort:.3g} {unit} of its load" if has.load_effort else ""
        if share < NOTHING:
            much = f"stall_energy_j leaves it {left:.2g} of {has.shared_effort:.3g} {unit}{beside}"
            text = f"{much}: it does not follow{enough}"
            yield Hint(f"{NOTHING_LEFT} {axis_name}", text, change)
            continue
        of = "what its load leaves of effort_limit" if beside else "effort_limit"
        yield Hint(
            f"hint on {axis_name}",
            f"stall_energy_j leaves {left:.3g} {unit} of its effort at rest{beside}, "
            f"{share:.0%} of {of}, and less while it moves{enough}",
            change,
        )


def _left_at_rest(rig: Rig, axis_name: str, delays: Delays) -> float | None:
    """Return what a stall leaves an axis at rest beside its load [N m or N], None: no bound."""
    claim = terms_of(rig, axis_name, delays)
    if not isinstance(claim, Claim) or math.isinf(claim.bounded):
        return None
    return claim.effort - axis_allowance(rig, axis_name, delays[axis_name]).load_effort


def _has_all(rig: Rig, axis_name: str, delays: Delays) -> bool:
    """Return whether a stall leaves an axis all that its load leaves of its effort."""
    left = _left_at_rest(rig, axis_name, delays)
    return left is None or left >= axis_allowance(rig, axis_name, delays[axis_name]).shared_effort


def _shorter_stall(rig: Rig, axis_name: str, delays: Delays) -> tuple[str, str]:
    """Return the greatest `overrun_limit` that leaves an axis all its effort, and words for it."""

    def falls_short(value: int) -> bool:
        return not _has_all(_with_loop(rig, "overrun_limit", value), axis_name, delays)

    tried = range(LEAST, rig.overrun_limit)
    enough = bisect.bisect_left(tried, True, key=falls_short)
    if not enough:
        return "", ""
    value = tried[enough - 1]
    return f"loop.overrun_limit={value}", f"; with loop.overrun_limit {value} all of it"


def _more_energy(rig: Rig, axis_name: str, delays: Delays) -> tuple[str, str]:
    """Return a `stall_energy_j` that leaves an axis all its effort, and words for it."""
    side, _, name = axis_name.partition(".")
    kinetic = kinetic_energy(rig, axis_name)

    def enough(energy: float) -> bool:
        block = getattr(rig, side)
        axis = block.axes[name].model_copy(update={"stall_energy_j": energy})
        block = block.model_copy(update={"axes": {**block.axes, name: axis}})
        return _has_all(rig.model_copy(update={side: block}), axis_name, delays)

    energy = stall_energy(rig, axis_name)
    while energy < STALL_REFUSED * kinetic / STEP:
        energy = float(f"{STEP * energy:.3g}")
        if enough(energy):
            text = f"; with {energy:g} J all of it, and a stall may then give as much: "
            text += f"{short(energy / kinetic)} times what it has at velocity_limit"
            return f"{side}.axes.{name}.stall_energy_j={energy:g}", text
    return "", "; its load is too heavy, or its velocity_limit too low, for its effort_rate_limit"


def _lower_limit(
    rig: Rig, names: Iterable[str], delays: Delays, key: str, limit: int
) -> tuple[int, float]:
    """Return the greatest lower limit of the loop with which a stall gives no more than it may.

    And what it then gives, over the kinetic energy; of the least limit where none is low enough. A
    longer stall never gives less, so not each of some thousand limits is tried.
    """

    def left(value: int) -> float:
        lower = _with_loop(rig, key, value)
        return max(_let_go(lower, name, delays) for name in names)

    tried = range(LEAST, limit)
    value = tried[max(bisect.bisect_right(tried, 1.0, key=left) - 1, 0)]
    return value, left(value)


def _with_loop(rig: Rig, key: str, value: int) -> Rig:
    """Return a rig with another limit of the loop."""
    return rig.model_copy(update={"loop": rig.loop.model_copy(update={key: value})})


def _let_go(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what a stall gives, over the kinetic energy."""
    claim = terms_of(rig, axis_name, delays)
    assert isinstance(claim, Claim)
    return claim.let_go / claim.kinetic


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"
