"""What `check` states of each axis before a run: joules, a verdict, and why a number is missing."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.analysis.claim import Stated, stated_claim
from tautwave.config import Rig
from tautwave.rig import axis_claim, coupling_part, end_energy, kinetic_energy, watchdogs
from tautwave.rig.claim_verdict import stall_refusal, terms_of, tuned_state
from tautwave.session.facts import port_claims, stated_claims
from tautwave.session.hooks import session_hooks
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]

OFTEN = "each stall may supply as much again, and nothing counts them beforehand"
UNBOUND = "give velocity_limit or mechanical_range: without either a held effort has no bound"
UNWATCHED = "its drive never acts by itself; mechanical_range, its end stops, would bound it"
IN_PROCESS = "the device is simulated in the process of the host, and ends with it"
UNCERTIFIED = "nothing certifies that the law supplies nothing"
UNENGAGED = "nothing bounds what the ends give that are moved apart as they engage"
STILL = "the axis takes velocities"
UNLIMITED = "the axis has no velocity_limit"


class PortClaim(NamedTuple):
    """What is stated of an axis before a run, and the verdict on it.

    `claim_j` is what it may supply in the run, `kinetic_j` the energy at its velocity limit [J]:
    the claim is inf where nothing bounds it, the other None of an axis without either. `stated`
    has the parts of a law that tells them, `judged` `passed`, `conditional` or `refused`, for the
    reason `refusal`; `absent` says of each number that is missing why.
    """

    axis: str
    claim_j: float
    kinetic_j: float | None
    stated: Stated | None = None
    judged: str = ""
    absent: Mapping[str, str] = {}
    refusal: str = ""

    @property
    def ratio(self) -> float | None:
        """Claim over kinetic energy."""
        return self.claim_j / self.kinetic_j if self.kinetic_j else None

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers as data for JSON, which has no infinity: null, and why in `absent`."""
        data: dict[str, Any] = dict.fromkeys(Stated._fields)
        if self.stated is not None:
            data |= self.stated._asdict()
        data |= {"claim_j": self.claim_j, "kinetic_j": self.kinetic_j, "ratio": self.ratio}
        kept = {key: None if value == math.inf else value for key, value in data.items()}
        kept["absent"] = {key: self.absent.get(key, "") for key in kept if kept[key] is None}
        kept |= {"judged": self.judged} if self.judged else {}
        return kept | ({"refusal": self.refusal} if self.refusal else {})


def claims_of(
    rig: Rig, delays: Delays, elements: Sequence[Mapping[str, Any]] = ()
) -> list[PortClaim]:
    """Return what is stated of every axis of a rig, in its order.

    `elements` are those of the rig's certificate as plain data: a law that is passive by its tuning
    supplies nothing to a prompt host, if it is certified.
    """
    watched = watchdogs(rig)
    if rig.scene is not None:
        claims = _of_scene(rig, delays, watched)
    elif coupling_part(rig).claim:
        claims = _of_ports(rig, delays, watched)
    else:
        claims = _by_tuning(rig, delays, watched, elements)
    return sorted(claims, key=lambda claim: list(rig.axes).index(claim.axis))


def _of_ports(rig: Rig, delays: Delays, watched: Mapping[str, float]) -> Iterator[PortClaim]:
    """Yield the claims of ports: a tank or an account bounds the whole run."""
    for name in rig.coupling.pairs:
        stated = stated_claims(rig, name, dict(delays), watched)
        for side, joules in port_claims(rig, name, dict(delays)).get("claim_j", {}).items():
            axis_name = f"{side}.{name}"
            one, judged = stated.get(axis_name, (None, None))
            keys = terms_of(rig, axis_name, delays)
            absent = {}
            if isinstance(keys, str):
                absent = dict.fromkeys(Stated._fields, f"without {keys} nothing bounds it")
            state, refusal = ("", "") if judged is None else (judged.state, judged.refusal)
            yield _claim(rig, axis_name, joules, one, state, absent)._replace(refusal=refusal)


def _by_tuning(
    rig: Rig, delays: Delays, watched: Mapping[str, float], elements: Sequence[Mapping[str, Any]]
) -> Iterator[PortClaim]:
    """Yield the claims of a law without account: nothing while the host is prompt, or no bound."""
    for name in rig.coupling.pairs:
        for side in rig.own_sides:
            axis_name = f"{side}.{name}"
            prompt, once, why = _prompt(rig, name, axis_name, elements)
            claim = axis_claim(rig, axis_name, delays[axis_name])
            stated = stated_claim(claim, rig.claimed_s, watched.get(axis_name))
            stated = stated._replace(prompt_j=prompt, claim_j=math.inf)
            judged = refusal = ""
            if prompt < math.inf:
                judged = tuned_state(rig, axis_name, claim, prompt, once)
            if judged == "refused":
                refusal = stall_refusal(rig, axis_name, claim) or _refusal(
                    name, axis_name, elements
                )
            absent = {"prompt_j": why, "claim_j": why or OFTEN}
            whole = _claim(rig, axis_name, math.inf, stated, judged, absent)
            yield whole._replace(refusal=refusal)


def _refusal(pair: str, axis_name: str, elements: Sequence[Mapping[str, Any]]) -> str:
    """Return why what an axis may supply to a prompt host is refused, as its certificate says."""
    said = {
        (one["kind"], one["axis"]): one["numbers"]["refused"]
        for one in elements
        if "refused" in one["numbers"]
    }
    return str(said.get(("claim", axis_name)) or said.get(("coupling", pair), ""))


def _prompt(
    rig: Rig, pair: str, axis_name: str, elements: Sequence[Mapping[str, Any]]
) -> tuple[float, float, str]:
    """Return what an axis of a law without account supplies to a prompt host, and at once [J].

    Why, if they are inf.
    """
    once, leak, certified = 0.0, 0.0, False
    for one in elements:
        of_pair = (one["kind"], one["axis"]) == ("coupling", pair)
        if one["kind"] == "claim" or (not of_pair and one["axis"] != axis_name):
            continue
        numbers = one["numbers"]
        if not one["passive"]["passed"] and "refused" not in numbers:
            return math.inf, math.inf, one["passive"]["reason"]
        certified = certified or of_pair
        if numbers.get("engage_j", 0.0) is None:
            return math.inf, math.inf, UNENGAGED
        engaging = numbers.get("engage_j", 0.0)
        once += end_energy(rig, axis_name, engaging) if of_pair else engaging
        leak += numbers.get("noise_w", 0.0)
    if not certified:
        return math.inf, math.inf, UNCERTIFIED
    return once + leak * rig.claimed_s, once, ""


def _of_scene(rig: Rig, delays: Delays, watched: Mapping[str, float]) -> Iterator[PortClaim]:
    """Yield what is stated of the axes of a scene; the bound for a prompt host is of all of them.

    A run stops when its efforts, held for a period each, created more than `scene.hold_limit_j`.
    """
    together = session_hooks().prompt_claim(rig, delays)
    for axis_name in rig.own_axes:
        claim = axis_claim(rig, axis_name, delays[axis_name])
        stated = stated_claim(claim, rig.claimed_s, watched.get(axis_name))
        stated = stated._replace(prompt_j=together, claim_j=math.inf)
        absent = {"prompt_j": UNLIMITED, "claim_j": OFTEN}
        yield _claim(rig, axis_name, math.inf, stated, "", absent)


def _claim(
    rig: Rig,
    axis_name: str,
    joules: float,
    stated: Stated | None,
    judged: str,
    absent: Mapping[str, str],
) -> PortClaim:
    kinetic = kinetic_energy(rig, axis_name)
    slow = rig.axes[axis_name].inertia is None
    why = {
        "stall_j": UNBOUND,
        "let_go_j": UNBOUND,
        "dead_j": IN_PROCESS if stated is None or stated.dead_j is None else UNWATCHED,
        "kinetic_j": STILL if slow else UNLIMITED,
        "ratio": "it has no claim or no kinetic energy to compare",
    }
    known = None if math.isinf(kinetic) else kinetic
    return PortClaim(axis_name, joules, known, stated, judged, {**why, **absent})
