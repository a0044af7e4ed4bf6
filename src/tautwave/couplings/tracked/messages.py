"""What `check` and the report say of law wave; figures are SI of the device or of the master."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.config import Rig
from tautwave.couplings.tracked.from_keys import port_impedance
from tautwave.couplings.tracked.keys import WaveCoupling
from tautwave.couplings.tracked.standing import standing
from tautwave.laws.admittance import greatest_stiffness
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, PlanLine


def _keys(rig: Rig) -> WaveCoupling:
    assert isinstance(rig.coupling, WaveCoupling)
    return rig.coupling


def _coupling(rig: Rig) -> str:
    return f"wave line, {rig.coupling.delay_s:g} s each way ({rig.delay_samples} samples)"


def _plan(rig: Rig) -> list[PlanLine]:
    corner = _keys(rig).wave_filter_hz
    return [PlanLine("wave filter", corner is not None, f"low-pass at {corner} Hz")]


def _pair_plan(rig: Rig, name: str) -> Iterator[PlanLine]:
    keys = _keys(rig).pairs[name]
    for side, matched in (("master", keys.matched_master), ("slave", keys.matched_slave)):
        yield PlanLine(f"matching damper of {side}.{name}", matched, "matched end")
    for side in ("master", "slave"):
        divisor = rig.axis_divisor(f"{side}.{name}")
        what = f"its bus is served every {divisor} cycles"
        same = "its bus is served every cycle"
        yield PlanLine(f"rate converter of {side}.{name}", divisor > 1, what, same)


def _facts(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[tuple[str, str]]:
    """Yield a sentence per admittance axis on how stiff its outside may be."""
    for axis_name, axis in rig.axes.items():
        if axis.causality != "admittance":
            continue
        side, name = axis_name.split(".")
        impedance = port_impedance(_keys(rig).pairs[name], side)
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
        yield f"admittance port of {axis_name}", text


def _hints(rig: Rig) -> list[tuple[str, str]]:
    coarse = [
        name for name, axis in rig.axes.items() if axis.encoder_quantum or axis.position_noise
    ]
    keys = _keys(rig)
    matched = [pair for pair in keys.pairs.values() if pair.matched_slave]
    if coarse and keys.wave_filter_hz is None and len(matched) < len(keys.pairs):
        return [
            (
                "hint",
                "encoder steps and noise ring in a line that loses nothing; "
                f"coupling.wave_filter_hz: {0.1 * rig.rate_hz:g} takes them away",
            )
        ]
    return []


def describe_pair(
    settings: Mapping[str, Any], effort: str, position: str, number: Callable[[Any], str]
) -> str:
    """Return one line on a pair from its keys, empty without an impedance."""
    impedance = settings.get("wave_impedance")
    if impedance is None:
        return ""
    return f"wave coupling, impedance b = {number(impedance)} {effort} s/{position}"


messages = CouplingMessages(
    coupling=_coupling,
    plan=_plan,
    pair_plan=_pair_plan,
    facts=_facts,
    hints=_hints,
    standing=standing,
    pair=describe_pair,
    offset_caption="Dotted in the error: the standing offset of the effort F, F τ / b of a line of "
    "delay τ and impedance b, and the part of the velocity filters. The rest is what the devices' "
    "own dynamics cost.",
    offset_cause="its line of {delay}",
)
