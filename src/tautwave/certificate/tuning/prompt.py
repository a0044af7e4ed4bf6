"""What an axis without account may supply to a prompt host in all: no term says that by itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from tautwave.analysis.claim import joules, short
from tautwave.certificate.data import Element, Verdict
from tautwave.certificate.tuning.conditions import engagement_joules
from tautwave.certificate.walls import noise_power, wall_verdict
from tautwave.config import Rig, local_wall, replace_wall
from tautwave.rig import at_axis_rate, coupling_part, end_energy, kinetic_energy
from tautwave.rig.claim_verdict import PROMPT_PASSES, PROMPT_REFUSED
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]
Remedy = Callable[[float], str]
"""What makes a term no more than so many joules, in words; "" if nothing does."""

BISECTIONS = 20
SAID = 0.01
"""Share of the sum from which on a term is named."""


class Term(NamedTuple):
    """A part of what a prompt host may be supplied with: joules of the device, and its cause.

    `lasting`: it comes with the time of a run, else at once.
    """

    energy: float
    words: str
    lasting: bool
    remedy: Remedy


def sum_elements(rig: Rig, delays: Delays, elements: Sequence[Element]) -> Iterator[Element]:
    """Yield an element for each axis of which only the sum of its terms says what it supplies.

    Of a law without account that is certified. A coupling says by itself if an engagement is too
    much (`conditions.engagement_condition`).
    """
    if coupling_part(rig).claim:
        return
    for pair in rig.coupling.pairs:
        for axis_name in (f"{side}.{pair}" for side in rig.own_sides):
            terms = terms_of(rig, delays, pair, axis_name, elements)
            most = kinetic_energy(rig, axis_name)
            verdict = judge_sum(rig, axis_name, terms, most)
            if verdict is None:
                continue
            name = f"prompt host of {axis_name}"
            numbers = {
                "prompt_j": math.fsum(term.energy for term in terms),
                "at_once_j": math.fsum(term.energy for term in terms if not term.lasting),
                "kinetic_j": most,
            } | ({} if verdict.passed else {"refused": verdict.reason})
            yield Element(name, "claim", axis_name, verdict, verdict, numbers, (verdict.reason,))


def terms_of(
    rig: Rig, delays: Delays, pair: str, axis_name: str, elements: Sequence[Element]
) -> list[Term]:
    """Return what the elements of an axis may supply while the host is prompt, the most first.

    Nothing of one that is not certified, or that nothing bounds: those say so.
    """
    terms = []
    for one in elements:
        of_pair = (one.kind, one.axis) == ("coupling", pair)
        if not of_pair and one.axis != axis_name:
            continue
        engaging = one.numbers.get("engage_j", 0.0)
        if not one.passive.passed or engaging is None:
            return []
        if of_pair and engaging > 0.0:
            slope = one.numbers["stiffness"]
            terms.append(_moved_apart(rig, delays, pair, axis_name, slope, engaging))
        elif engaging > 0.0:
            words = "as the weight that it renders is ramped in or out"
            terms.append(Term(engaging, words, False, lambda _: ""))
        noise = one.numbers.get("noise_w", 0.0)
        if noise > 0.0:
            terms.append(_noisy_wall(rig, delays, axis_name, noise))
    return sorted(terms, key=lambda term: -term.energy)


def judge_sum(rig: Rig, axis_name: str, terms: Sequence[Term], most: float) -> Verdict | None:
    """Return the verdict on a sum of terms; None if it is little, or one term is said elsewhere.

    `most` is the axis' kinetic energy at its velocity limit [J].
    """
    once = math.fsum(term.energy for term in terms if not term.lasting)
    whole = math.fsum(term.energy for term in terms)
    if not most > 0.0 or not whole > PROMPT_PASSES * most:
        return None
    seconds = rig.claimed_s
    if once > PROMPT_REFUSED * most:
        terms = [term for term in terms if not term.lasting]
        said = _said(axis_name, once, most, terms, "at once")
        return Verdict(False, f"{said}; {_less(rig, axis_name, terms, PROMPT_REFUSED * most)}")
    if once == whole and len(terms) == 1:
        return None
    said = _said(axis_name, whole, most, terms, f"in {seconds:g} s")
    said = f"{said}; {_less(rig, axis_name, terms, PROMPT_PASSES * most)}"
    return Verdict(True, said, (said,))


def _said(axis_name: str, energy: float, most: float, terms: Sequence[Term], when: str) -> str:
    parts = [f"{joules(t.energy)} {t.words}" for t in terms if t.energy >= SAID * energy]
    return (
        f"{axis_name} may supply {joules(energy)} {when} while the host is prompt, "
        f"{short(energy / most)} times the {joules(most)} that it has at its velocity limit: "
        f"{', '.join(parts)}"
    )


def _less(rig: Rig, axis_name: str, terms: Sequence[Term], most: float) -> str:
    """Return what makes a sum no more than `most` [J]: one change, if need be one for each term."""
    whole = math.fsum(term.energy for term in terms)
    for term in terms:
        left = most - (whole - term.energy)
        if left > 0.0 and (change := term.remedy(left)):
            return f"{change} would do"
    able = [term for term in terms if term.remedy(term.energy)]
    left = most - math.fsum(term.energy for term in terms if term not in able)
    each = [term.remedy(left / len(able)) for term in able] if left > 0.0 else []
    if each and all(each):
        return f"{' with '.join(each)} would do"
    return "give the actual limits of device and motor"


def _moved_apart(
    rig: Rig, delays: Delays, pair: str, axis_name: str, stiffness: float, engaging: float
) -> Term:
    """Return the term of an engagement; a shorter ramp makes it less."""

    def shorter(left: float) -> str:
        def given(ramp: float) -> float:
            coupling = rig.coupling.model_copy(update={"engage_ramp_s": ramp})
            trial = rig.model_copy(update={"coupling": coupling})
            return end_energy(rig, axis_name, engagement_joules(trial, pair, stiffness, delays))

        low, high = 0.0, rig.coupling.engage_ramp_s
        if given(low) > left:
            return ""
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if given(middle) <= left else (low, middle)
        return f"coupling.engage_ramp_s of {_rounded(low):g} s or less"

    words = "as its ends may be moved apart while it engages"
    return Term(end_energy(rig, axis_name, engaging), words, False, shorter)


def _noisy_wall(rig: Rig, delays: Delays, axis_name: str, noise: float) -> Term:
    """Return the term of a wall under noise; a softer one generates less."""
    seconds = rig.claimed_s
    wall = local_wall(rig, axis_name)
    assert wall is not None

    def softer(left: float) -> str:
        def given(stiffness: float) -> float:
            changed = wall.model_copy(update={"stiffness": stiffness})
            own = at_axis_rate(replace_wall(rig, axis_name, changed), axis_name)
            softened = wall_verdict(own, axis_name, changed, delays, {})
            if not softened.passive:
                return math.inf
            return noise_power(own, axis_name, softened) * seconds

        stiffness = wall.stiffness * math.sqrt(min(left / (noise * seconds), 1.0))
        for _ in range(BISECTIONS):
            stiffness = _rounded(stiffness)
            if given(stiffness) <= left:
                return f"wall_{axis_name.partition('.')[0]}.stiffness of {stiffness:g} or less"
        return ""

    return Term(noise * seconds, f"by noise at its wall in {seconds:g} s", True, softer)


def _rounded(value: float) -> float:
    """Return a value with two digits, and somewhat less."""
    return float(f"{0.95 * value:.2g}")
