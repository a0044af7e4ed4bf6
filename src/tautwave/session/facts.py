"""Numbers that follow from a rig: delays, offsets, limits of its ports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from tautwave.config import Rig, count_velocity
from tautwave.registry import coupling_messages as words_of
from tautwave.registry import load_named
from tautwave.rig import coupling_part, one_way_delay, pair_scale
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
    """Return the messages of a rig's coupling law."""
    return words_of(rig.coupling.law)


def pair_facts(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> PairFacts:
    """Return the derived numbers of one pair; see `tautwave.rig.one_way_delay`."""
    tau = one_way_delay(rig, name, delays)
    standing = coupling_messages(rig).standing(rig, name, delays, tau)
    power = pair_scale(rig.coupling.pairs[name]).power
    return PairFacts(tau, standing.offset, power, standing.held_share)


def port_claims(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> dict[str, Any]:
    """Return what each end of a pair may deliver in a run [J] as `claim_j`, by side.

    Empty for a law that claims nothing beforehand.
    """
    named = coupling_part(rig).claim
    if not named:
        return {}
    claim = load_named(named)
    return {"claim_j": {side: claim(rig, f"{side}.{name}", delays) for side in ("master", "slave")}}


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


PAIR_HEADS = ("pair", ">one-way delay", ">standing offset", ">share given held still")
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
    for name, axis in rig.axes.items():
        effort, speed = ("N m", "rad/s") if axis.kind == "rotary" else ("N", "m/s")
        impedance = axis.causality == "impedance"
        reads = count_velocity(rig, name, axis.encoder_quantum)
        limit = "none" if axis.velocity_limit is None else f"{axis.velocity_limit:g} {speed}"
        rows.append(
            (
                name,
                f"{axis.bus} {axis.id}",
                "effort" if impedance else "velocity",
                f"{axis.effort_limit:g} {effort}" if impedance else limit,
                f"{reads:.3g} {speed}" if axis.encoder_quantum else "no step",
                limit,
            )
        )
    return rows


def count_words(rig: Rig, axis_name: str) -> str:
    """Return the velocity of one encoder count, as text after a `;`; "" without an encoder step."""
    axis = rig.axes[axis_name]
    if axis.encoder_quantum == 0.0:
        return ""
    unit = "rad/s" if axis.kind == "rotary" else "m/s"
    reads = count_velocity(rig, axis_name, axis.encoder_quantum)
    limit = "no limit" if axis.velocity_limit is None else f"limit {axis.velocity_limit:g}"
    return f"; one encoder count reads as {reads:.3g} {unit} ({limit})"
