"""Numbers that follow from a rig: delays, offsets, limits of its ports."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import Claim, Stated, stated_claim
from tautwave.config import Axis, Rig, count_velocity
from tautwave.config.inputs.chains import chain_notes, weighs
from tautwave.registry import load_named
from tautwave.rig import (
    allowances,
    coupling_part,
    one_way_delay,
    pair_scale,
    watchdogs,
)
from tautwave.rig.arms import (
    beyond_file,
    carried_axes,
    felt_axes,
    greatest_loads,
    joint_names,
)
from tautwave.rig.claim_verdict import Judged, judge_claim, terms_of
from tautwave.rig.rates import load_offset
from tautwave.session.scales import greatest, times
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages


class PairFacts(NamedTuple):
    """Statics of one pair: effective one-way delay tau [s], samples included; steady-state offset.

    While the master holds an effort F and nothing moves, it is ahead of the slave by F
    `offset_per_effort` (`tautwave.rig.standing_offset`) [rad per N m or m per N]. A device that is
    held still gets `held_share` of the line's effort, the smaller of master's and slave's; of a
    position coupling it is the share of its stiffness that acts.
    """

    coupling_delay_s: float
    offset_per_effort: float
    power_ratio: float
    held_share: float


def coupling_messages(rig: Rig) -> CouplingMessages:
    """Return the messages of a rig's coupling law, in an account if there is one."""
    named = coupling_part(rig).messages
    messages: CouplingMessages = load_named(named) if named else CouplingMessages()
    return messages


def pair_facts(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> PairFacts:
    """Return the derived numbers of one pair; see `tautwave.rig.one_way_delay`."""
    tau = one_way_delay(rig, name, delays)
    standing = coupling_messages(rig).standing(rig, name, delays, tau)
    power = pair_scale(rig.coupling.pairs[name]).power
    return PairFacts(tau, standing.offset, power, standing.held_share)


def stated_claims(
    rig: Rig, name: str, delays: dict[str, CommandDelay], watched: Mapping[str, float]
) -> dict[str, tuple[Stated, Judged]]:
    """Return, by axis, what is stated of the ends of a pair that have a bound, and the verdict.

    `watched` are the rig's `watchdogs`.
    """
    claims = {}
    for side in rig.own_sides:
        axis_name = f"{side}.{name}"
        claim = terms_of(rig, axis_name, delays)
        if isinstance(claim, Claim):
            stated = stated_claim(claim, rig.claimed_s, watched.get(axis_name))
            claims[axis_name] = stated, judge_claim(rig, axis_name, claim)
    return claims


def port_claims(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> dict[str, Any]:
    """Return what each end of a pair may deliver in a run [J] as `claim_j`, by side.

    Empty for a law that claims nothing beforehand.
    """
    named = coupling_part(rig).claim
    if not named:
        return {}
    claim = load_named(named)
    return {"claim_j": {side: claim(rig, f"{side}.{name}", delays) for side in rig.own_sides}}


def summary_claims(
    rigs: Sequence[Rig], name: str, delays: dict[str, CommandDelay], count: int
) -> dict[str, Any]:
    """Return what the ends of a pair claim in `count` engagements, by side.

    `claim_j` as `port_claims`, and in `claims` what is stated of each, of a law that tells; the
    greatest of those of `rigs`, a rig at its scales.
    """
    most = times(greatest([port_claims(rig, name, delays) for rig in rigs]), count)
    claims: dict[str, dict[str, Any]] = {}
    for rig in rigs:
        for axis_name, (one, judged) in stated_claims(rig, name, delays, watchdogs(rig)).items():
            all_of = one._replace(claim_j=count * one.claim_j, prompt_j=count * one.prompt_j)
            side = axis_name.partition(".")[0]
            if side not in claims or all_of.claim_j > claims[side]["claim_j"]:
                claims[side] = {**all_of._asdict(), "judged": judged.state}
    return most | ({"claims": claims} if claims else {})


def pair_sentence(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> str:
    """Return `pair_facts` as a sentence."""
    tau = one_way_delay(rig, name, delays)
    standing = coupling_messages(rig).standing(rig, name, delays, tau)
    unit = "rad per N m" if rig.master.axes[name].kind == "rotary" else "m per N"
    text = f"one-way delay {tau:.4g} s in all; standing offset {standing.offset:.4g} {unit}"
    return f"{text}; held still, {standing.text}" if standing.text else text


def offset_costs(rig: Rig, delays: dict[str, CommandDelay]) -> Iterator[tuple[str, str]]:
    """Yield of each pair what its standing offset is made of, where its law says so."""
    for name in rig.coupling.pairs:
        tau = one_way_delay(rig, name, delays)
        cost = coupling_messages(rig).standing(rig, name, delays, tau).cost
        if cost:
            yield f"offset of {name}", cost


def load_facts(rig: Rig, delays: dict[str, CommandDelay]) -> Iterator[tuple[str, str]]:
    """Yield of each axis that carries a load how much, and what that costs or would cost."""
    felt = felt_axes(rig)
    for side in ("master", "slave"):
        carried, joints = carried_axes(rig, side), joint_names(rig, side)
        for arm in rig.arms(side):
            said = f"arm of the {side}" if arm.name == side else f"arm {arm.name}"
            if not weighs(arm.keys):
                yield said, "no link has a mass: a kinematic chain, without a load"
            for note in chain_notes(arm.keys):
                yield said, note
            if wider := beyond_file(rig, arm):
                file = Path(str(arm.keys.urdf)).name
                yield f"limits of {arm.name}", f"wider than in {file}: {'; '.join(wider)}"
        for name, most in greatest_loads(rig, side).items():
            pair = name.partition(".")[2]
            rotary = rig.axes[name].kind == "rotary"
            unit, place = ("N m", "rad") if rotary else ("N", "m")
            limit = rig.axes[name].effort_limit
            text = f"up to {most:.3g} {unit} in its range, of {limit:g}"
            if name in felt:
                text = (
                    f"up to {most:.3g} {unit}, of {limit:g}, with what {felt[name]} weighs, which "
                    "the hand feels (reflect_load)"
                )
            elif pair in rig.coupling.pairs:
                each = load_offset(rig, name, delays)
                would = (
                    "compensated for outside the coupling; otherwise it would set"
                    if name in carried
                    else ""
                )
                text += (
                    f"; {would or 'carried by the coupling: it sets'} the pair {each:.3g} {place} "
                    f"apart per {unit}, {each * most:.3g} {place} in all"
                )
            yield f"load of {name}", f"joint {joints[name]}, {text}" if name in joints else text


PAIR_HEADS = ("pair", ">one-way delay", ">standing offset", ">effort passed on")
AXIS_HEADS = ("axis", "on", "takes", ">up to", ">one count reads as", ">limit")


def pair_rows(rig: Rig, delays: dict[str, CommandDelay]) -> list[tuple[str, ...]]:
    """Return `pair_facts` of every pair as rows under `PAIR_HEADS`."""
    rows: list[tuple[str, ...]] = []
    for name in rig.coupling.pairs:
        known = pair_facts(rig, name, delays)
        unit = "rad/(N m)" if rig.master.axes[name].kind == "rotary" else "m/N"
        rows.append(
            (
                name,
                f"{1e3 * known.coupling_delay_s:.4g} ms",
                f"{known.offset_per_effort:.4g} {unit}",
                f"{known.held_share:.1%}",
            )
        )
    return rows


def axis_rows(rig: Rig) -> list[tuple[str, ...]]:
    """Return every axis as a row under `AXIS_HEADS`."""
    rows: list[tuple[str, ...]] = []
    for name, axis in rig.own_axes.items():
        effort, speed = ("N m", "rad/s") if axis.kind == "rotary" else ("N", "m/s")
        impedance = axis.causality == "impedance"
        takes = "effort" if impedance else "velocity" if axis.follower is None else "position"
        reads = count_velocity(rig, name, axis.encoder_quantum)
        limit = "none" if axis.velocity_limit is None else f"{axis.velocity_limit:g} {speed}"
        rows.append(
            (
                name,
                f"{axis.bus} {axis.id}",
                takes,
                f"{axis.effort_limit:g} {effort}" if impedance else limit,
                _one_count(axis, f"{reads:.3g} {speed}"),
                limit,
            )
        )
    return rows


ALLOWANCE_HEADS = (
    "axis", "", ">has", ">load", ">wall", ">compensation", ">coupling, for certain",
)  # fmt: skip


def allowance_rows(rig: Rig, delays: Mapping[str, CommandDelay]) -> list[tuple[str, ...]]:
    """Return who gets what each axis has, as rows under `ALLOWANCE_HEADS`; alike axes once.

    What is unlimited, or not there, has no row.
    """
    alike: dict[tuple[tuple[str, ...], ...], list[str]] = {}
    for name, has in allowances(rig, delays).items():
        if name in rig.own_axes and rig.axes[name].causality == "impedance":
            rows = tuple(_allowance(has, rotary=rig.axes[name].kind == "rotary"))
            alike.setdefault(rows, []).append(name)
    return [
        (", ".join(names) if at == 0 else "", *row)
        for rows, names in alike.items()
        for at, row in enumerate(rows)
    ]


def _allowance(has: AxisAllowance, *, rotary: bool) -> Iterator[tuple[str, ...]]:
    effort, damping = ("N m", "N m s/rad") if rotary else ("N", "N s/m")
    paid = has.compensated_coulomb + has.paying_coulomb
    shares = {
        f"effort [{effort}]": (
            has.effort, has.load_effort, has.wall_effort, has.compensation_effort,
            has.coupling_effort,
        ),
        f"rate [{effort}/s]": (
            has.effort_rate, has.load_rate, has.wall_rate, has.compensation_rate, has.coupling_rate,
        ),
        f"damping [{damping}]": (
            has.damping, has.load_damping, has.wall_damping, has.compensated_damping,
            has.coupling_damping,
        ),
        f"Coulomb friction [{effort}]": (
            has.coulomb, has.load_coulomb, 0.0, paid, has.coupling_coulomb,
        ),
    }  # fmt: skip
    for what, (most, *spent, left) in shares.items():
        if 0.0 < most < math.inf:
            given = (f"{share:.4g}" if share else "-" for share in spent)
            yield what, f"{most:.4g}", *given, f"{left:.4g}"
    yield "unseen for [ms]", f"{1e3 * has.blind:.3g}", "", "", "", ""


def _one_count(axis: Axis, reads: str) -> str:
    if axis.follower is not None:
        step = axis.follower.stiffness * axis.encoder_quantum
        return f"{step:.3g} {'N m' if axis.kind == 'rotary' else 'N'}"
    return reads if axis.encoder_quantum else "no step"


def count_words(rig: Rig, axis_name: str) -> str:
    """Return the velocity of one encoder count, as text after a `;`; "" without an encoder step."""
    axis = rig.axes[axis_name]
    if axis.encoder_quantum == 0.0 or axis.follower is not None:
        return ""
    unit = "rad/s" if axis.kind == "rotary" else "m/s"
    reads = count_velocity(rig, axis_name, axis.encoder_quantum)
    limit = "no limit" if axis.velocity_limit is None else f"limit {axis.velocity_limit:g}"
    return f"; one encoder count reads as {reads:.3g} {unit} ({limit})"
