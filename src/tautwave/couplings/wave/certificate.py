"""Why a wave line is passive, as far as it is, and how many joules that is.

Two things of each port. On the class of devices given in the rig it returns no more of a wave
than arrives (`analysis.wave_port.device_class`): behind any passive line the pair is stable. And
whatever device, hand or noise there is, it supplies no more than its claim.

Ports of devices that take velocities or positions have verdicts of their own
(`admittance_element`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial

from tautwave.analysis.claim import Claim, joules, watts
from tautwave.analysis.wave_port.device_class import LATEST
from tautwave.certificate.belief import (
    assumed,
    broken_damping,
    broken_delay,
    broken_inertia,
    drive_lag,
    stated_contact,
)
from tautwave.certificate.data import CouplingVerdict, Element, Verdict
from tautwave.certificate.rates import converter_element
from tautwave.config import Rig, simulation_of
from tautwave.couplings.wave.claim import claim_of, claimed_sentence
from tautwave.couplings.wave.device_port import DevicePort, binding, pair_of, port_of, remedy_of
from tautwave.couplings.wave.from_keys import coarsest_step, port_impedance
from tautwave.couplings.wave.keys import WavePair
from tautwave.laws.port import plain_drain
from tautwave.laws.receiver import RESERVE
from tautwave.registry import load_simulator
from tautwave.rig import at_axis_rate, axis_allowance, coupled_axis, judge_claim, pair_scale
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def _at_axis(rig: Rig, axis_name: str, delays: Delays, damping: float) -> Iterator[Element]:
    """Yield the port of an axis and, on a slow bus, its rate converter."""
    if rig.axes[axis_name].causality == "admittance":
        yield admittance_element(rig, axis_name, delays, _unfiltered(rig, axis_name))
    else:
        yield _impedance_port(rig, axis_name, delays, damping)
    converter = converter_element(rig, axis_name, delays)
    if converter is not None:
        yield converter


def _impedance_port(rig: Rig, axis_name: str, delays: Delays, damping: float) -> Element:
    """Return the port of an axis that takes effort."""
    left = axis_allowance(rig, axis_name, delays[axis_name]).free_damping - damping
    name = f"{axis_name} port"
    claim = claim_of(rig, axis_name, delays)
    passive = _passive(rig, axis_name, delays, left, claim, damping)
    sentences = [passive.reason]
    numbers: dict[str, object] = {
        "impedance": port_impedance(pair_of(rig, axis_name), axis_name.split(".")[0]),
        "damping_left": left,
        "damping_of_wall": damping,
    }
    quantised = passive
    if isinstance(claim, Claim):
        seconds = rig.claimed_s
        numbers |= {**claim._asdict(), "seen_j": claim.seen(seconds), "true_j": claim.true(seconds)}
        sentences.append(claimed_sentence(axis_name, claim, seconds))
        if claim.nonlinearity > 0.0:
            hidden = joules(claim.hidden(claim.strongest * seconds))
            sentences.append(
                f"{name}: its encoder's nonlinearity hides {100.0 * claim.hidden(1.0):.3g} % of "
                f"the transferred energy, at most {hidden} in {seconds:g} s; a run cannot detect "
                "it."
            )
        noise = claim.leak - claim.lag
        if passive.passed and noise > 0.0:
            quantised = Verdict(
                False,
                f"{name}: steps and noise drain its tank; the {watts(noise)} that compensate for "
                "this may be supplied.",
                margin=-noise,
            )
    more = None
    if left > 0.0:
        port = port_of(rig, axis_name, delays, left)
        numbers |= {"gain": port.gain.greatest, **port.devices._asdict()}
        if port.observer.pole < 0.0 and isinstance(claim, Claim):
            share = numbers["drain"] = plain_drain(port.port)
            sentences.append(
                f"{name}: without an observer its tank covers {100.0 * share:.3g} % of the "
                f"transferred work; {joules(claim.reserve / share)} in one direction empties it."
            )
        if passive.passed and not _is_augmented(rig, axis_name):
            more = partial(_tolerated, rig, axis_name, delays, port, damping)
    return Element(name, "port", axis_name, passive, quantised, numbers, tuple(sentences), more)


def _tolerated(
    rig: Rig, axis_name: str, delays: Delays, port: DevicePort, damping: float
) -> tuple[dict[str, float], tuple[str]]:
    """Return the stiffest spring that a port tolerates, and a sentence on it."""
    stiffest, unit = port.stiffest(), "N m/rad" if rig.axes[axis_name].kind == "rotary" else "N/m"
    walled = damping > 0.0 and port.observer.pole >= 0.0
    binds = binding(rig, axis_name, delays, port.devices.damping)
    return {"stiffest": stiffest}, (
        f"{axis_name} port: it tolerates springs up to {stiffest:.4g} {unit}"
        f"{', its own wall counted' if walled else ''}"
        f"{'; ' if binds else ''}{binds}.",
    )


def _unfiltered(rig: Rig, axis_name: str) -> str | None:
    """Return a sentence if noise would collect in a line that loses nothing."""
    axis, keys = rig.axes[axis_name], pair_of(rig, axis_name)
    unquiet = axis.encoder_quantum or axis.position_noise
    if not unquiet or keys.wave_filter_hz is not None or keys.matched_master or keys.matched_slave:
        return None
    pair = axis_name.split(".")[1]
    slowest = max(rig.axis_period_s(f"{side}.{pair}") for side in ("master", "slave"))
    return (
        f"{axis_name} port: encoder steps and noise would ring in a line that loses nothing; add "
        f"coupling.pairs.{pair}.wave_filter_hz: {0.1 / slowest:.3g}"
    )


def _unreachable(rig: Rig, axis_name: str) -> str | None:
    """Return a sentence if the wave filter's corner is above half the rate of the axis."""
    corner, half = pair_of(rig, axis_name).wave_filter_hz, 0.5 / rig.axis_period_s(axis_name)
    if not isinstance(corner, float) or corner <= half:
        return None
    return (
        f"{axis_name} port: wave_filter_hz {corner:g} is above half the rate of its bus, "
        f"{half:g} Hz; lower it"
    )


def _passive(
    rig: Rig,
    axis_name: str,
    delays: Delays,
    left: float,
    claim: Claim | str,
    taken: float,
) -> Verdict:
    axis, delay = rig.axes[axis_name], delays[axis_name]
    assert axis.inertia is not None
    name = f"{axis_name} port"
    if isinstance(claim, str):
        return Verdict(False, f"{name}: its energy output is unbounded; give {claim}")
    if delay.remainder_s > 0.0:
        return Verdict(False, f"{name}: {whole_periods(delay)}")
    if delay.periods > LATEST:
        return Verdict(
            False,
            f"{name}: its commands act {delay.periods} periods late, and the proof covers up to "
            f"{LATEST}; lower rate_hz, or raise the divisor of its bus",
        )
    broken = (
        _unfiltered(rig, axis_name) or _unreachable(rig, axis_name),
        broken_inertia(rig, axis_name),
        broken_delay(at_axis_rate(rig, axis_name), axis_name, delay),
        broken_damping(rig, axis_name),
    )
    for text in broken:
        if text is not None:
            return Verdict(False, text if text.startswith(name) else f"{name}: {text}")
    unit = "N m s/rad" if axis.kind == "rotary" else "N s/m"
    free = axis_allowance(rig, axis_name, delay).free_damping
    if free <= 0.0:
        return Verdict(
            False,
            f"{name}: the device's damping is unknown; give damping.lower, however small",
        )
    if claim.leak > claim.effort * claim.velocity:
        return Verdict(
            False,
            f"{name}: its tank would need {claim.leak:.3g} W for the declared noise, more than the "
            f"motor can give; check position_noise, encoder_quantum and the limits, or lower "
            "wave_impedance",
        )
    step = axis.effort_quantum
    coarsest = coarsest_step(
        pair_of(rig, axis_name), axis_name.split(".")[0], coupled_axis(rig, axis_name, delay)
    )
    if step > coarsest:
        effort = "N m" if axis.kind == "rotary" else "N"
        stiffer = pair_of(rig, axis_name).impedance * step / coarsest
        return Verdict(
            False,
            f"{name}: its drive's effort has steps of {step:g} {effort} (effort_quantum), but at "
            f"most {coarsest:.3g} works: half of the port's resistance at the velocity limit. Use "
            f"a drive or mode with finer steps, or raise wave_impedance to {stiffer:.3g}",
        )
    if left <= 0.0:
        return Verdict(
            False,
            f"{name}: wall and load use {taken:.4g} {unit} of the device's guaranteed "
            f"{free:.4g}, but a port needs some; soften the wall, or raise rate_hz",
        )
    judged = judge_claim(rig, axis_name, claim)
    refused = Verdict(False, f"{name}: {judged.refusal}")
    conditions = tuple(assumed(axis, axis_name, inertia=True, damping=True))
    if _is_augmented(rig, axis_name) and judged.refusal:
        return refused
    if _is_augmented(rig, axis_name):
        return Verdict(
            True,
            f"{name}: passive by account: its tank covers the force added to its wave, and its "
            "claim is the same as without; no statement is made about its damping.",
            (*conditions, *judged.conditions),
        )
    port = port_of(rig, axis_name, delays, left)
    d = port.devices
    spring, weight = ("N m/rad", "kg m^2") if axis.kind == "rotary" else ("N/m", "kg")
    whom = (
        f"device of at least {d.mass:g} {weight} and {d.damping:.4g} {unit}, held by a passive "
        f"hand or environment no stiffer than a spring of {d.stiffness:.4g} {spring}"
    )
    if not port.contracting:
        gain = port.gain.greatest
        return Verdict(
            False,
            f"{name}: with a {whom}, {_excess(gain)}; {remedy_of(rig, axis_name, delays, left)}",
            margin=1.0 - gain if math.isfinite(gain) else None,
        )
    if judged.refusal:
        return refused
    return Verdict(
        True,
        f"{name}: returns no more of a wave than arrives, with any {whom}.",
        (*conditions, *judged.conditions),
        0.0,
    )


def _is_augmented(rig: Rig, axis_name: str) -> bool:
    """Return whether a port sends more than its own motor's effort."""
    return axis_name.startswith("slave.") and pair_of(rig, axis_name).force_gain > 0.0


def _excess(gain: float) -> str:
    if gain > 100.0:
        return "it may be unstable"
    if gain == 1.0:
        return (
            "it is not proved to return no more of a wave than arrives, although no "
            "counterexample was found"
        )
    much = f"{gain:.4g}" if gain > 1.001 else f"1 + {gain - 1.0:.2g}"
    return f"it may return {much} times the wave that arrives"


def _between(rig: Rig, pair: str, delays: Delays) -> Iterator[Element]:
    """Yield the line, the filters of its ports and its scaling."""
    coupling = rig.coupling
    if rig.link is not None:
        yield from _network(pair)
    if rig.delay_samples:
        yield _fine(
            f"line of {pair}",
            "line",
            pair,
            f"a constant delay of {coupling.delay_s:g} s each way is lossless and stores the "
            "waves in transit (Niemeyer and Slotine 1991)",
        )
    keys = coupling.pairs[pair]
    assert isinstance(keys, WavePair)
    if keys.wave_filter_hz is not None:
        yield _fine(
            f"wave filters of {pair}",
            "filter",
            pair,
            f"|H| <= 1 at every frequency ({keys.wave_filter_hz:g} Hz)",
        )
    scale = pair_scale(keys)
    if abs(scale.power - 1.0) > 1e-12:
        yield _fine(
            f"scaling of {pair}",
            "scaling",
            pair,
            f"power scaled by {scale.power:g}, the waves by its root: passive for a hand and an "
            "environment that touch each other through the rig only",
        )
    elif scale.scale != 1.0 or scale.sign < 0.0:
        yield _fine(f"scaling of {pair}", "scaling", pair, "keeps power")


def _network(pair: str) -> Iterator[Element]:
    """Yield the receivers of a pair; what is between them only loses, delays and repeats."""
    for side in ("master", "slave"):
        yield _fine(
            f"receiver of {side}.{pair}",
            "receiver",
            pair,
            f"supplies no more than was sent to it plus {joules(RESERVE)}, compared in whole "
            "quanta at every tick, whatever the network loses, delays or repeats",
            reserve_j=RESERVE,
        )


def _fine(name: str, kind: str, pair: str, why: str, **numbers: object) -> Element:
    result = Verdict(True, f"{name}: {why}.")
    return Element(name, kind, pair, result, result, numbers, (result.reason,))


def _remedy(rig: Rig, pair: str) -> str:
    keys = rig.coupling.pairs[pair]
    assert isinstance(keys, WavePair)
    return f"Lower wave_impedance {keys.impedance:g}, or change the poles."


def follower_verdict(
    rig: Rig, axis_name: str, delay: CommandDelay, upper: float, broken: str | None
) -> Verdict:
    """Return whether a follower's port is passive; `broken`: why it cannot pass, if known."""
    follower = rig.axes[axis_name].follower
    assert follower is not None
    name = f"{axis_name} port"
    fault = broken or _contradicted(rig, axis_name)
    if fault is not None:
        return Verdict(False, fault)
    if delay.remainder_s > 0.0:
        return Verdict(False, f"{name}: {whole_periods(delay)}")
    return Verdict(
        True,
        f"{name}: at the goal of a follower, passive by the proof in tautwave.laws.servo.follower "
        f"for a device that lags by up to {1e3 * follower.lag_s:.3g} ms and does not overshoot. "
        f"What {axis_name} does to what it touches is not certified, because "
        "its own drive determines that.",
        (
            f"{axis_name} follows its goal without overshoot, {1e3 * follower.lag_s:.3g} ms late "
            "at most, whatever it touches",
            f"the energy that the device of {axis_name} exchanges with what it touches is not "
            "measured and not part of any claim",
        ),
    )


def whole_periods(delay: CommandDelay) -> str:
    """Say why a command delay of no whole number of periods is refused."""
    return (
        f"its commands act {delay.remainder_s * 1e3:.3g} ms later than a whole number of periods, "
        "but the proof covers whole periods only; choose a rate_hz whose period divides the delay "
        "that the driver declares"
    )


def _contradicted(rig: Rig, axis_name: str) -> str | None:
    """Return a sentence if a simulated position loop is not as the rig believes."""
    axis = rig.axes[axis_name]
    if rig.simulation is None or axis.follower is None:
        return None
    if not load_simulator(rig.buses[axis.bus].driver).loops:
        return None
    truth = simulation_of(rig, axis_name)
    damping = truth.damping + truth.servo_damping
    lag, least = (
        damping / truth.servo_stiffness,
        2.0 * math.sqrt(truth.servo_stiffness * truth.inertia),
    )
    if lag > axis.follower.lag_s * (1.0 + 1e-9):
        return (
            f"{axis_name} port: the simulated device lags by {1e3 * lag:.3g} ms, more than "
            f"follower.lag_s {axis.follower.lag_s:.4g}; raise that to {lag:.3g}"
        )
    if damping < least * (1.0 - 1e-9):
        return (
            f"{axis_name} port: the simulated device overshoots its goal, because its damping "
            f"{damping:.3g} is below {least:.3g}; raise follower.lag_s to "
            f"{least / truth.servo_stiffness:.3g}, or lower its inertia"
        )
    return None


REACHED = 5.0
"""Time constants after which a drive counts as having reached its velocity."""


def admittance_element(rig: Rig, axis_name: str, delays: Delays, broken: str | None) -> Element:
    """Return the port of an axis that takes velocity; `broken`: why it cannot pass, if known."""
    axis = rig.axes[axis_name]
    side, pair = axis_name.split(".")
    keys = rig.coupling.pairs[pair]
    assert isinstance(keys, WavePair)
    name = f"{axis_name} port"
    upper = axis.outside_stiffness
    claim = claim_of(rig, axis_name, delays)
    assert isinstance(claim, Claim)
    numbers = {
        "impedance": port_impedance(keys, side),
        "environment_stiffness_upper": upper,
        "drive_lag_s": drive_lag(rig, axis_name),
        "command_delay_periods": delays[axis_name].periods,
        **claim._asdict(),
        "seen_j": claim.seen(rig.claimed_s),
    }
    kind, judge = "admittance port", _admittance_verdict
    if axis.follower is not None:
        kind, judge = "follower", follower_verdict
        numbers["follower_lag_s"] = axis.follower.lag_s
    passive = judge(at_axis_rate(rig, axis_name), axis_name, delays[axis_name], upper, broken)
    quantised = passive
    if passive.passed and claim.leak > 0.0:
        quantised = Verdict(
            False,
            f"{name}: encoder step and noise look like losses; its tank receives "
            f"{1e3 * claim.leak:.3g} mW for them, which may be released.",
            margin=-claim.leak,
        )
    sentences = (passive.reason, claimed_sentence(axis_name, claim, rig.claimed_s))
    return Element(name, kind, axis_name, passive, quantised, numbers, sentences)


def _admittance_verdict(
    rig: Rig, axis_name: str, delay: CommandDelay, upper: float, broken: str | None
) -> Verdict:
    name = f"{axis_name} port"
    unit = "N m/rad" if rig.axes[axis_name].kind == "rotary" else "N/m"
    lag, contact = drive_lag(rig, axis_name), stated_contact(rig, axis_name)
    if broken is not None:
        return Verdict(False, broken)
    if upper == 0.0:
        return Verdict(False, f"{name}: no guarantee without environment_stiffness_upper; set it")
    if contact is not None and contact.stiffness > upper:
        return Verdict(
            False,
            f"{name}: {contact.text} has {contact.stiffness:.4g} {unit}, more than "
            f"environment_stiffness_upper {upper:.4g}; raise that",
        )
    if contact is not None and contact.damping > 0.0:
        return Verdict(
            False,
            f"{name}: the proof assumes a pure spring as environment; {contact.text} has a "
            "damper. Require coupled_stable",
        )
    if delay.remainder_s > 0.0:
        return Verdict(False, f"{name}: {whole_periods(delay)}")
    if lag is not None and REACHED * lag > rig.period_s:
        return Verdict(
            False,
            f"{name}: the proof needs a drive that reaches its velocity within one period of "
            f"{1e3 * rig.period_s:.3g} ms; the simulated one has a time constant of "
            f"{1e3 * lag:.3g} ms. Require coupled_stable, or make the drive faster",
        )
    return Verdict(
        True,
        f"{name}: passive by the proof in tautwave.laws.servo.admittance for an external "
        f"stiffness up to {upper:.4g} {unit}.",
        (
            f"the drive of {axis_name} reaches its velocity within one period",
            f"what {axis_name} touches is a spring without a damper",
            f"the effort at {axis_name} is known from its samples only, and so is the energy "
            "that it claims",
        ),
    )


verdict = CouplingVerdict(
    _between,
    _at_axis,
    _remedy,
    contracting=True,
    picture="",
)
