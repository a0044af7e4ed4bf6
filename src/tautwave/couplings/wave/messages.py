"""What `check` and the report say of law observed_wave; figures are SI of device or master."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.config import Rig
from tautwave.couplings.wave.keys import WavePair
from tautwave.couplings.wave.standing import standing
from tautwave.wording import CouplingMessages, PlanLine


def _coupling(rig: Any) -> str:
    return (
        f"wave line between observed ports, {rig.coupling.delay_s:g} s each way "
        f"({rig.delay_samples} samples)"
    )


def _pair_plan(rig: Rig, name: str) -> Iterator[PlanLine]:
    keys = rig.coupling.pairs[name]
    assert isinstance(keys, WavePair)
    corner = keys.wave_filter_hz
    yield PlanLine(f"wave filters of {name}", corner is not None, f"low-pass at {corner} Hz")
    for side in ("master", "slave"):
        pole = keys.pole(side)
        yield PlanLine(f"observer of {side}.{name}", pole is not None, f"pole {pole}", "plain")
        matched = keys.matched_master if side == "master" else keys.matched_slave
        yield PlanLine(f"matching damper of {side}.{name}", matched, "matched end")
        divisor = rig.axis_divisor(f"{side}.{name}")
        what = f"its bus is served every {divisor} cycles"
        same = "its bus is served every cycle"
        yield PlanLine(f"rate converter of {side}.{name}", divisor > 1, what, same)


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
    pair_plan=_pair_plan,
    standing=standing,
    pair=describe_pair,
    offset_caption="Dotted in the error: the standing offset of the effort F, F τ / b of a line of "
    "delay τ and impedance b, a period and the wave filters' lag counted in. The rest is what the "
    "devices' own dynamics cost.",
    offset_cause="its line of {delay}",
)
