"""What `check` and the report say of law wave; figures are SI of device or master."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from tautwave.analysis.claim import Claim, short, watts
from tautwave.analysis.wave_port.chatter import step_effort
from tautwave.config import Axis, Rig
from tautwave.couplings.wave.claim import allowance_of, claim_of, standing
from tautwave.couplings.wave.from_keys import bare_port, observer_of, port_impedance
from tautwave.couplings.wave.keys import WavePair
from tautwave.laws.ramp import ramp_bound, ramp_params
from tautwave.laws.servo.admittance import greatest_stiffness
from tautwave.types import CommandDelay
from tautwave.wording import CouplingMessages, Hint, PlanLine

MAX_STEP = 0.1
"""Of the effort limit: a held force chatters by about as much as one step changes the effort."""

MAX_LEAK = 0.01
"""Of effort limit times velocity limit."""


def _follower_facts(axis: Axis) -> str:
    """Return what the port of a follower does, as a sentence without a full stop."""
    assert axis.follower is not None
    stiffness, lag = axis.follower.stiffness, axis.follower.lag_s
    rotary = axis.kind == "rotary"
    place, damping = ("rad", "N m s/rad") if rotary else ("m", "N s/m")
    return (
        f"it is position-controlled: the hand feels a spring of {stiffness:.4g} "
        f"{'N m/rad' if rotary else 'N/m'} from its goal to the device, at most "
        f"{axis.effort_limit / stiffness:.3g} {place} long, and {stiffness * lag:.3g} {damping} "
        f"of drag from its lag of {1e3 * lag:.3g} ms; its effect on what it touches is not "
        "measured, and no claim is made about it"
    )


def _coupling(rig: Any) -> str:
    if rig.link is not None:
        return "waves over a network"
    return f"wave line, {rig.coupling.delay_s:g} s each way ({rig.delay_samples} samples)"


def _pair_plan(rig: Rig, name: str) -> Iterator[PlanLine]:
    keys = rig.coupling.pairs[name]
    assert isinstance(keys, WavePair)
    corner = keys.wave_filter_hz
    yield PlanLine(f"wave filters of {name}", corner is not None, f"low-pass at {corner} Hz")
    for side in ("master", "slave"):
        axis_name = f"{side}.{name}"
        pole = keys.pole(side)
        takes_effort = rig.axes[axis_name].causality == "impedance"
        why_not = "plain" if takes_effort else "its axis is velocity-controlled"
        used = takes_effort and pole is not None
        yield PlanLine(f"observer of {axis_name}", used, f"pole {pole}", why_not)
        yield PlanLine(f"matching damper of {axis_name}", keys.is_matched(side), "matched end")
        divisor = rig.axis_divisor(axis_name)
        what = f"its bus is served every {divisor} cycles"
        same = "its bus is served every cycle"
        yield PlanLine(f"rate converter of {axis_name}", divisor > 1, what, same)


def _facts(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[tuple[str, str]]:
    """Yield a sentence per admittance axis on how stiff its outside may be, and the hints."""
    for axis_name, axis in rig.axes.items():
        if axis.causality != "admittance":
            continue
        side, name = axis_name.split(".")
        keys = rig.coupling.pairs[name]
        assert isinstance(keys, WavePair)
        impedance = port_impedance(keys, side)
        period = rig.axis_period_s(axis_name)
        limit = greatest_stiffness(period, impedance, delays[axis_name].periods)
        unit = "N m/rad" if axis.kind == "rotary" else "N/m"
        upper = axis.environment_stiffness_upper
        if axis.follower is not None:
            yield f"follower at {axis_name}", _follower_facts(axis)
            continue
        if upper is None or upper == 0.0:
            text = (
                f"no guarantee: give environment_stiffness_upper; matched, it is stable up to "
                f"{limit:.4g} {unit} (K T / b < {limit * period / impedance:.3g})"
            )
        else:
            ratio = upper * period / impedance
            text = (
                f"passive for an external spring up to {upper:.4g} {unit} (K T / b = {ratio:.3g}) "
                "if the velocity is reached within a period; no claim is made beyond that, nor "
                "for an external damper"
            )
        yield f"admittance port of {axis_name}", text
    yield from noise_hints(rig, delays)
    yield from ramp_hints(rig, delays)


def noise_hints(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Hint]:
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
        has = allowance_of(rig, axis_name, delays)
        share = step / has.shared_effort
        if share > MAX_STEP:
            softer = port_impedance(keys, "master") * MAX_STEP / share
            yield Hint(
                f"hint on {axis_name}",
                f"one encoder step changes the effort by {share:.0%} of effort_limit, and a held "
                f"force chatters by about that much; wave_impedance up to {softer:.2g} keeps it "
                f"below {MAX_STEP:.0%}",
                f"coupling.pairs.{name}.wave_impedance={softer:.2g}",
            )
        share = has.quantum / has.shared_effort
        if share > MAX_STEP:
            yield Hint(
                f"hint on {axis_name}",
                f"one step of its drive is {share:.0%} of effort_limit, so its effort constantly "
                "jumps by that much; use a drive or mode with finer steps",
            )
        claim = claim_of(rig, axis_name, delays)
        if not isinstance(claim, Claim):
            continue
        noise = claim.leak - claim.lag - claim.steps
        if noise > MAX_LEAK * claim.effort * claim.velocity:
            colour = ""
            loud = axis.position_noise > 0.5 * axis.encoder_quantum
            if loud and axis.position_noise_autocorrelation is None:
                colour = ", or declare the noise's colour, which identify --noise measures"
            yield Hint(
                f"hint on {axis_name}",
                f"encoder step and noise drain {watts(noise)} from the port, "
                f"{noise / (claim.effort * claim.velocity):.1%} of what the motor can supply, and "
                f"its claim grows accordingly; lower wave_impedance{colour}",
            )


def ramp_hints(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Hint]:
    """Yield a hint on the axis whose slow effort leaves it least of its limit at rest."""
    ranked = []
    for axis_name, axis in rig.axes.items():
        claim = claim_of(rig, axis_name, delays)
        has = allowance_of(rig, axis_name, delays)
        if axis.inertia is None or math.isinf(has.effort_rate) or not isinstance(claim, Claim):
            continue
        limit, period, mass = has.shared_effort, has.period, has.inertia
        held = ramp_bound(ramp_params(period, mass, has.shared_rate), claim.reserve, 0.0)
        if held < limit:
            enough = limit * limit / (period * limit + 2.0 * math.sqrt(2.0 * mass * claim.reserve))
            enough *= has.effort_rate / has.shared_rate  # a carried load has its share
            ranked.append((held / limit, axis_name, held, limit / has.shared_rate, enough))
    if not ranked:
        return
    share, axis_name, held, fall, enough = min(ranked)
    unit = "N m" if rig.axes[axis_name].kind == "rotary" else "N"
    others, more = len(ranked) - 1, ""
    if others:
        which = "one more axis holds" if others == 1 else f"{others} more axes hold"
        more = f"; {which} less than the limit as well"
    yield Hint(
        f"hint on {axis_name}",
        f"its effort takes {short(1e3 * fall)} ms to fall from effort_limit to zero, and its port "
        "holds no more than its tank can pay for in that time: at rest a full tank holds about "
        f"{held:.2g} {unit}, {share:.0%} of effort_limit; with effort_rate_limit "
        f"{ceiled(enough)} it holds all of it{more}",
        f"{axis_name.replace('.', '.axes.')}.effort_rate_limit={ceiled(enough)}",
    )


def ceiled(value: float) -> str:
    """Return a number rounded up to two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{float(f'{math.ceil(value / step) * step:.2g}'):g}"


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
    facts=_facts,
    standing=standing,
    pair=describe_pair,
    offset_caption="Dotted in the error: the standing offset of the effort F, F τ / b of a line "
    "of delay τ and impedance b, including one period and the lag of the wave "
    "filters. The rest is due to the devices' own dynamics.",
    offset_cause="its line of {delay}",
)
