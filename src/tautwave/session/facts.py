"""Numbers that follow from a rig: delays, offsets, limits of its ports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from tautwave.config import Rig, count_velocity
from tautwave.registry import coupling_messages as words_of
from tautwave.registry import load_named
from tautwave.rig import DebtRates, coupling_part, debt_rates, one_way_delay, pair_scale
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


def port_debts(rig: Rig, name: str, delays: dict[str, CommandDelay]) -> dict[str, Any]:
    """Return the allowed debt of each wave port of a pair; empty for other couplings.

    `claim_j` [J] by side, where the law claims joules beforehand. Else `port_debt`: by side, in the
    device's own units, `per_speed_squared` [kg m^2 or kg] and `per_flow` [1] as in
    `tautwave.rig.debt_rates`, and the `exchanges` until a port has let go. An admittance port has
    no allowed debt.
    """
    if coupling_part(rig).carries != "waves":
        return {}
    named = coupling_part(rig).claim
    if named:
        claim = load_named(named)
        return {
            "claim_j": {side: claim(rig, f"{side}.{name}", delays) for side in ("master", "slave")}
        }
    debts = {}
    for side in ("master", "slave"):
        axis_name = f"{side}.{name}"
        delay = delays[axis_name]
        late = 1 if delay.remainder_s > 0.0 else 0
        rates = DebtRates(0.0, 0.0)
        if rig.axes[axis_name].causality == "impedance":
            rates = debt_rates(rig, axis_name, delays)
        debts[side] = {
            "per_speed_squared": rates.debt_per_speed_squared,
            "per_flow": rates.debt_per_flow,
            "exchanges": 1 + delay.periods + late,
        }
    return {"port_debt": debts}


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
