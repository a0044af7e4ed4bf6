"""What `check` and the report say of law observed_wave; figures are SI of device or master."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.analysis.wave_port.chatter import step_effort
from tautwave.config import Rig
from tautwave.couplings.wave.claim import Claim, claim_of
from tautwave.couplings.wave.from_keys import bare_port, observer_of, port_impedance
from tautwave.couplings.wave.keys import WavePair
from tautwave.couplings.wave.standing import standing
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, PlanLine

GREATEST_STEP = 0.1
"""Of the effort limit: a held force chatters by about as much as one step changes the effort."""

GREATEST_LEAK = 0.01
"""Of effort limit times velocity limit."""


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


def noise_hints(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[tuple[str, str]]:
    """Yield a hint for each axis whose step is felt, or whose noise costs much of its claim."""
    for axis_name, axis in rig.axes.items():
        side, name = axis_name.split(".")
        keys = rig.coupling.pairs[name]
        assert isinstance(keys, WavePair)
        if axis.inertia is None:
            continue
        period, mass = rig.axis_period_s(axis_name), axis.inertia.lower
        late = delays[axis_name].periods + delays[axis_name].remainder_s / period
        port = bare_port(keys, side, period, mass, late)
        step = step_effort(port, observer_of(keys, side, period, mass), axis.encoder_quantum)
        share = step / axis.effort_limit
        if share > GREATEST_STEP:
            softer = port_impedance(keys, "master") * GREATEST_STEP / share
            yield (
                f"hint on {axis_name}",
                f"one encoder step changes the effort by {share:.0%} of effort_limit, and a held "
                f"force chatters by about as much; wave_impedance up to {softer:.2g} keeps it "
                f"below {GREATEST_STEP:.0%}",
            )
        claim = claim_of(rig, axis_name, delays)
        if not isinstance(claim, Claim):
            continue
        if claim.leak > GREATEST_LEAK * claim.effort * claim.velocity:
            colour = ""
            loud = axis.position_noise > 0.5 * axis.encoder_quantum
            if loud and axis.position_noise_autocorrelation is None:
                colour = ", or declare the noise's colour, which identify --noise measures"
            yield (
                f"hint on {axis_name}",
                f"step and noise of its encoder take {1e3 * claim.leak:.3g} mW from the port, "
                f"{claim.leak / (claim.effort * claim.velocity):.1%} of what the motor can give, "
                f"and its claim grows by that; lower wave_impedance{colour}",
            )


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
    facts=noise_hints,
    standing=standing,
    pair=describe_pair,
    offset_caption="Dotted in the error: the standing offset of the effort F, F τ / b of a line of "
    "delay τ and impedance b, a period and the wave filters' lag counted in. The rest is what the "
    "devices' own dynamics cost.",
    offset_cause="its line of {delay}",
)
