"""What a wave pair takes for its `auto` keys, and what bounds it.

wave_filter_hz: 50 Hz, ten times what a hand moves by will, or a fifteenth of the slower axis' rate
if that is lower; none where neither axis has noise or a step and the certificate takes the ports
without. What friction and contacts do to the efforts passes it, and is most of a pair's chatter.

pole_master, pole_slave: the first of `POLES` on which the certificate calls the port contracting,
held by the stated contact; plain, which bears the stiffest contacts, where it takes none: then the
certificate refuses the rig and says what would pass.

wave_impedance: a stiffer line holds the devices closer together. It is the greatest at which

- the noise of both encoders makes no effort beyond `NOISE_SHARE` of a limit (`chatter`): it is
  always felt;
- a held contact that rattles within an encoder step makes none beyond `STEP_SHARE`;
- it is no more than the impedance of both devices at 5 Hz: recorded hands need no more, and a
  stiffer line adds more chatter than it takes error;
- a port's reserve, twice, is no more than the kinetic energy of its device at the velocity limit.
  That includes the bound (1 + n) b T / (2 m) <= 1/2 of the certificate;
- the certificate takes both ports, with an observer: the tank of a plain port is drained by the
  share b T / m of what it transports. Only where that would take less than an eighth of what the
  others allow are plain ports tried.

It is rounded down to two digits. Where a drive's effort step needs a stiffer line than all this
allows (`coarsest_step`), the line is as stiff as that, if the certificate takes it. All is decided
by the rig's beliefs and by the contact that the certificate counts with, so that the same rig gets
the same choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from tautwave.analysis.wave_port.chatter import NoisyEnd, chatter, step_effort
from tautwave.certificate.derate import derate_walls
from tautwave.config import Rig
from tautwave.config.keys.common import AUTO
from tautwave.couplings.wave.claim import moved_inertia
from tautwave.couplings.wave.device_port import SOFTER, port_of
from tautwave.couplings.wave.from_keys import bare_port, coarsest_step, observer_of
from tautwave.couplings.wave.keys import PLAIN, POLES, WavePair
from tautwave.errors import UnchosenKeyError
from tautwave.laws.port import port_reserve
from tautwave.rig import allowances, axis_allowance, command_delays, coupled_axis
from tautwave.types import Choice, CommandDelay

SIDES = ("master", "slave")

NOISE_SHARE = 0.01
STEP_SHARE = 0.05
"""Of the effort limit: the deviation of chatter, and the rattle of a held contact."""

RATTLE = 1.25
"""Deviation of that rattle per effort of one step, at most; as found for `QUANTUM_DRAIN`."""

QUIETER = 1.25
"""Greatest factor by which the impedance is lowered for an observer of less noise."""

FEWER = 8.0
"""Greatest factor by which the impedance is lowered to do without a plain port."""

HALVINGS, FEW_HALVINGS = 6, 2
"""To within some percent of a factor of 8 and more, and of 1.25."""

HAND_HZ = 5.0
"""Up to which a hand moves by will."""

CORNER_HZ = 50.0
"""Ten times that."""

PER_RATE = 15.0
"""Samples per period of the corner at least."""

CERTIFICATE = "the certificate"

Delays = Mapping[str, CommandDelay]


class Bound(NamedTuple):
    """A greatest impedance of the line [N m s/rad or N s/m, master], and its cause."""

    impedance: float
    cause: str


class Asked(NamedTuple):
    """A pair, and what walls and loads leave of the damping of each device that takes effort."""

    rig: Rig
    name: str
    delays: Delays
    left: Mapping[str, float]

    def takes(self, pair: WavePair, side: str) -> bool:
        """Return whether the certificate takes the port of a side with these keys."""
        axis_name, left = f"{side}.{self.name}", self.left[side]
        return left > 0.0 and port_of(self.rig, axis_name, self.delays, left, pair).contracting


def choose_pair(rig: Rig, name: str) -> dict[str, Choice]:
    """Return what the `auto` keys of a pair are, by key."""
    pair = rig.coupling.pairs[name]
    assert isinstance(pair, WavePair)
    delays = command_delays(rig)
    if rig.require != "coupled_stable":  # there a wall's limit needs the whole pair
        friction = {one: has.coupling_coulomb for one, has in allowances(rig, delays).items()}
        rig, _ = derate_walls(rig, delays, friction)
    asked = Asked(rig, name, delays, _damping_left(rig, name, delays))
    chosen: dict[str, Choice] = {}
    if pair.wave_filter_hz == AUTO:
        chosen["wave_filter_hz"] = _corner(rig, name)
        if chosen["wave_filter_hz"].value is None:
            bare = _choose_others(asked, _with(pair, wave_filter_hz=None))
            if bare.taken:
                return chosen | bare.chosen
            chosen["wave_filter_hz"] = _corner(rig, name, bare=True)
        pair = _with(pair, wave_filter_hz=chosen["wave_filter_hz"].value)
    return chosen | _choose_others(asked, pair).chosen


class Others(NamedTuple):
    """What is chosen besides the wave filter, and whether the certificate takes both ports."""

    chosen: dict[str, Choice]
    taken: bool


def _choose_others(asked: Asked, pair: WavePair) -> Others:
    """Choose impedance and poles of a pair whose wave filter is known."""
    chosen: dict[str, Choice] = {}
    if pair.wave_impedance == AUTO:
        if not asked.left:
            raise UnchosenKeyError(
                ("coupling", "pairs", asked.name, "wave_impedance"),
                "auto needs an effort-controlled axis; give a number",
            )
        chosen["wave_impedance"] = _impedance(asked, pair)
        pair = _with(pair, wave_impedance=chosen["wave_impedance"].value)
    for side in SIDES:
        key = f"pole_{side}"
        if getattr(pair, key) == AUTO:
            chosen[key] = _pole(asked, pair, side)
            pair = _with(pair, **{key: chosen[key].value})
    taken = all(asked.takes(pair, side) for side in asked.left)
    return Others(chosen, taken)


def two_digits(value: float, *, up: bool = False) -> float:
    """Return a value rounded down, or up, to two digits; 0 of 0."""
    if value == 0.0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    count = value / step
    whole = math.ceil(count * (1.0 - 1e-12)) if up else math.floor(count * (1.0 + 1e-12))
    return float(f"{whole * step:.1e}")


def _with(pair: WavePair, **values: object) -> WavePair:
    return pair.model_copy(update=values)


def _damping_left(rig: Rig, name: str, delays: Delays) -> dict[str, float]:
    left = {}
    for side in SIDES:
        axis_name = f"{side}.{name}"
        if rig.axes[axis_name].inertia is not None:
            left[side] = axis_allowance(rig, axis_name, delays[axis_name]).coupling_damping
    return left


def _corner(rig: Rig, name: str, *, bare: bool = False) -> Choice:
    """Return the corner of a pair's wave filter; `bare`: without one no port is certified."""
    names = [f"{side}.{name}" for side in SIDES]
    quiet = not any(rig.axes[one].position_noise or rig.axes[one].encoder_quantum for one in names)
    if quiet and not bare:
        return Choice(None, "none, because no noise or encoder step is given")
    slower = max(names, key=rig.axis_period_s)
    corner = float(f"{1.0 / (PER_RATE * rig.axis_period_s(slower)):.3g}")
    by = f"a fifteenth of the rate of {slower}"
    if corner > CORNER_HZ:
        corner, by = CORNER_HZ, "ten times what a hand moves by will"
    why = ", without which no port is certified" if bare else ""
    return Choice(corner, f"{corner:g} Hz, {by}{why}")


def _pole(asked: Asked, pair: WavePair, side: str, poles: Sequence[float | str] = POLES) -> Choice:
    if side not in asked.left:
        return Choice(PLAIN, "plain, because the axis is velocity-controlled")
    if asked.left[side] <= 0.0:
        return Choice(POLES[0], f"{POLES[0]}, since no damping is left to certify it with")
    for at, pole in enumerate(poles):
        if asked.takes(_with(pair, **{f"pole_{side}": pole}), side):
            refused = f"{poles[0]} to {poles[at - 1]}" if at > 1 else "".join(map(str, poles[:at]))
            return Choice(
                pole, f"{pole}, the first that is certified{refused and ', not '}{refused}"
            )
    return Choice(PLAIN, "plain, because no pole is certified")


def _impedance(asked: Asked, pair: WavePair) -> Choice:
    kind = asked.rig.master.axes[asked.name].kind
    unit = "N m s/rad" if kind == "rotary" else "N s/m"
    free = [f"pole_{side}" for side in SIDES if getattr(pair, f"pole_{side}") == AUTO]
    bound = least_bound(asked, _with(pair, **dict.fromkeys(free, POLES[0])))
    top = two_digits(bound.impedance)
    impedance, cause = top, f"bound by {bound.cause}"
    if min(asked.left.values()) > 0.0:
        tried = [(POLES[:count], QUIETER) for count in range(1, len(POLES) - 1)]
        for poles, softer in (*tried, (POLES[:-1], FEWER), (POLES, SOFTER)):
            side = blocked_by(asked, pair, poles, top)
            if not side:
                break
            low, high = top / softer, top
            if blocked_by(asked, pair, poles, two_digits(low)):
                continue
            for _ in range(HALVINGS if softer > QUIETER else FEW_HALVINGS):
                middle = math.sqrt(low * high)
                stop = blocked_by(asked, pair, poles, two_digits(middle))
                low, high, side = (low, middle, stop) if stop else (middle, high, side)
            impedance, cause = two_digits(low), f"bound by {side}"
            break
        else:
            cause += "; none is certified"
    coarse = _coarse(asked, pair)
    needed = two_digits(coarse.impedance, up=True)
    if needed > impedance and not blocked_by(asked, pair, POLES, needed).startswith(CERTIFICATE):
        cause = f"as much as {coarse.cause} needs; else {impedance:g}, {cause}"
        impedance = needed
    return Choice(impedance, f"{impedance:g} {unit}, {cause}")


def blocked_by(asked: Asked, pair: WavePair, poles: Sequence[float | str], impedance: float) -> str:
    """Return what forbids an impedance with the first of some poles that is taken, or nothing."""
    pair = _with(pair, wave_impedance=impedance)
    for side in asked.left:
        key = f"pole_{side}"
        if getattr(pair, key) == AUTO:
            pair = _with(pair, **{key: _pole(asked, pair, side, poles).value})
            if getattr(pair, key) not in poles:
                return f"{CERTIFICATE} of {side}.{asked.name}"
        if not asked.takes(pair, side):
            return f"{CERTIFICATE} of {side}.{asked.name}"
    bound = least_bound(asked, pair)
    return bound.cause if bound.impedance < impedance else ""


def _coarse(asked: Asked, pair: WavePair) -> Bound:
    """Return the least impedance with which ports work with the steps of their drives' efforts."""
    unit = _with(pair, wave_impedance=1.0)
    needed = [Bound(0.0, "no effort step")]
    for side in asked.left:
        axis_name = f"{side}.{asked.name}"
        axis = coupled_axis(asked.rig, axis_name, asked.delays[axis_name])
        least = axis.effort_quantum / coarsest_step(unit, side, axis)
        needed.append(Bound(least, f"the effort step of {axis_name}"))
    return max(needed)


def least_bound(asked: Asked, pair: WavePair) -> Bound:
    """Return what bounds the impedance of a pair whose poles are known, but for the certificate."""
    return min(_bounds(asked, _with(pair, wave_impedance=1.0)))


def _bounds(asked: Asked, pair: WavePair) -> Iterator[Bound]:
    """Yield the bounds of a line of impedance 1: all efforts are in proportion to it."""
    rig, name = asked.rig, asked.name
    ends = {side: _heavy(asked, pair, side) for side in asked.left}
    for side, end in ends.items():
        axis_name = f"{side}.{name}"
        axis = rig.axes[axis_name]
        limit = axis_allowance(rig, axis_name, asked.delays[axis_name]).shared_effort
        assert axis.inertia is not None
        units, period = pair.in_device_units(side, 1.0), end.port.period
        reserve = port_reserve(
            units, period, end.port.lead - 0.5, end.observer.velocity * period, 1.0
        )
        yield Bound(
            0.25 * axis.inertia.lower / reserve,
            f"the reserve of {axis_name}, at half its energy at the velocity limit",
        )
        rattle = RATTLE * step_effort(end.port, end.observer, axis.encoder_quantum)
        if rattle > 0.0:
            share = f"{STEP_SHARE:.0%} of its effort limit"
            cause = f"the rattle of {axis_name} within its encoder step, at {share}"
            yield Bound(STEP_SHARE * limit / rattle, cause)
        effort = chatter(end, next((ends[other] for other in ends if other != side), end))
        if math.isinf(effort):
            raise UnchosenKeyError(
                ("coupling", "pairs", name, "wave_filter_hz"),
                "wave_impedance auto needs a wave filter where noise is stated; set wave_filter_hz "
                "to auto, or give wave_impedance",
            )
        if effort > 0.0:
            cause = f"chatter of {axis_name} at {NOISE_SHARE:.0%} of its effort limit"
            yield Bound(NOISE_SHARE * limit / effort, cause)
    yield Bound(
        moved_inertia(rig, name, pair) * math.tau * HAND_HZ,
        f"the impedance of both devices at {HAND_HZ:g} Hz",
    )


def _heavy(asked: Asked, pair: WavePair, side: str) -> NoisyEnd:
    """Return an end whose device is too heavy to give way: it chatters most."""
    axis_name = f"{side}.{asked.name}"
    axis, delay = asked.rig.axes[axis_name], asked.delays[axis_name]
    period = asked.rig.axis_period_s(axis_name)
    return NoisyEnd(
        bare_port(pair, side, period, math.inf, delay.periods + delay.remainder_s / period),
        observer_of(pair, side, period, math.inf),
        delay.periods,
        axis.position_noise,
        pair.wave_gain(side),
        axis.position_noise_autocorrelation or (),
    )
