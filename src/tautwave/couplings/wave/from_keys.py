"""From the keys of a wave pair to the constants of its ports, SI of each device."""

from __future__ import annotations

import math

from tautwave.analysis.wave_port.effort_step import COARSEST, step_power
from tautwave.analysis.wave_port.lag import lag_power
from tautwave.analysis.wave_port.sensor_noise import NoisePower, noise_bounds, noise_power
from tautwave.contracts import CoupledAxis
from tautwave.couplings.wave.keys import WavePair
from tautwave.couplings.wave.port import WHITE, WaveEndParams
from tautwave.errors import ConfigError
from tautwave.laws.observer import ObserverParams, observer_params, plain_observer
from tautwave.laws.port import PortParams, port_params, port_reserve, recovery_params
from tautwave.laws.servo.admittance import admittance_params, effort_leak, rigid_port
from tautwave.laws.servo.follower import lag_damping

WATCHED_S = 1.0
"""Time over which the share of cut waves is taken [s]."""

STARVED_SHARE = 1e-3
"""Of the waves' energy: between levers that stand, a loss of that share is the force in seconds."""

EMPTY_SHARE = 1e-9
"""Share of the reserve below which a tank is empty."""

NOISIER = 1.15
"""Over the deviation that the leak is made for: from there on noise is named as the cause."""

PATIENCE_S = 10.0
"""For so long a port may owe more than a period's way at the velocity limit [s]."""

FRICTIONS = 2.0
"""Times its Coulomb friction that an axis resists with at most while its emptied tank recovers."""

FRICTION_SHARE = 0.01
"""Of its effort limit, what it resists with where that is more."""

RECOVERED = 0.2
"""Of the gap that is astray, what is owed where that friction is in full."""


def port_impedance(pair: WavePair, side: str) -> float:
    """Return the wave impedance of the port at one side [N m s/rad or N s/m]."""
    return pair.in_device_units(side, pair.impedance)


def observer_of(pair: WavePair, side: str, period: float, mass: float) -> ObserverParams:
    """Return the observer of one side."""
    pole = pair.pole(side)
    return plain_observer(period, mass) if pole is None else observer_params(period, mass, pole)


def bare_port(
    pair: WavePair,
    side: str,
    period: float,
    mass: float,
    delay: float,
    *,
    reserve: float = math.inf,
    leak: float = 0.0,
    effort_rate: float = math.inf,
) -> PortParams:
    """Return the port of one side; without a reserve it is rich, for analysis."""
    return port_params(
        period,
        port_impedance(pair, side),
        mass,
        delay=delay,
        matched=pair.is_matched(side),
        filter_gain=pair.filter_step(period),
        reserve=reserve,
        leak=leak,
        effort_rate=effort_rate,
    )


def declared_noise(pair: WavePair, side: str, axis: CoupledAxis) -> NoisePower:
    """Return what encoder step and noise can take from a tank and feign [W]."""
    assert axis.inertia is not None
    whole = axis.delay + (1 if axis.late > 0.0 else 0)
    port = bare_port(pair, side, axis.period, axis.inertia, axis.delay + axis.late)
    observer = observer_of(pair, side, axis.period, axis.inertia)
    power = noise_power(
        port, observer, whole, axis.position_noise, axis.encoder_quantum, axis.noise_lags
    )
    return power._replace(lost=to_nine_digits(power.lost))


def to_nine_digits(power: float) -> float:
    """Return a power, rounded up.

    The last bits of a spectrum depend on library and processor, and a run's rows would with them.
    """
    return float(f"{power * (1.0 + 1e-8):.9g}")


def swing_lag(pair: WavePair, side: str, axis: CoupledAxis) -> float:
    """Return what the observer's lag can take from a tank [W] while a lever is moved hard."""
    assert axis.inertia is not None
    power = lag_power(
        bare_port(pair, side, axis.period, axis.inertia, axis.delay + axis.late),
        observer_of(pair, side, axis.period, axis.inertia),
        axis.delay + (1 if axis.late > 0.0 else 0),
        axis.effort_limit,
        axis.velocity_limit,
    )
    return to_nine_digits(power)


def effort_steps(axis: CoupledAxis) -> float:
    """Return what the step of the drive's effort can take from a tank [W]."""
    assert axis.inertia is not None
    return step_power(axis.period, axis.inertia, axis.effort_quantum)


def tank_leak(pair: WavePair, side: str, axis: CoupledAxis) -> float:
    """Return the power of a tank's leak [W]: what noise, steps and lag may take from it."""
    return declared_noise(pair, side, axis).lost + swing_lag(pair, side, axis) + effort_steps(axis)


def end_constants(pair: WavePair, side: str, axis: CoupledAxis) -> WaveEndParams:
    """Return the constants of one end.

    Raises
    ------
    ConfigError
        The axis has no velocity limit, so that nothing can be claimed, or the wave filter's corner
        is above half its rate.
    """
    if math.isinf(axis.velocity_limit):
        raise ConfigError(
            f"law wave: the {side}'s axis has no velocity_limit, and without it the port's energy "
            "output is unbounded; give its maximum safe velocity"
        )
    corner = pair.wave_filter_hz
    if isinstance(corner, float) and corner > 0.5 / axis.period:
        raise ConfigError(
            f"law wave: wave_filter_hz {corner:g} is above half the rate of the {side}'s bus, "
            f"{0.5 / axis.period:g} Hz; lower it"
        )
    impedance = port_impedance(pair, side)
    if axis.inertia is None:
        port = servo_port(pair, side, axis)
        observer = plain_observer(axis.period, 1.0)
    else:
        leak = tank_leak(pair, side, axis) * axis.period
        delay = axis.delay + axis.late
        observer = observer_of(pair, side, axis.period, axis.inertia)
        reserve = port_reserve(
            impedance,
            axis.period,
            delay,
            observer.velocity * axis.period,
            axis.velocity_limit,
        )
        port = bare_port(
            pair,
            side,
            axis.period,
            axis.inertia,
            delay,
            reserve=reserve,
            leak=leak,
            effort_rate=axis.effort_rate,
        )
        port = port._replace(
            recovery=recovery_params(
                axis.period,
                axis.inertia,
                delay=delay,
                friction=recovery_limit(axis),
                noise=axis.position_noise,
                quantum=axis.encoder_quantum,
                gap=RECOVERED * port.root * axis.velocity_limit * axis.period,
                reserve=reserve,
            )
        )
    return WaveEndParams(
        port=port,
        observer=observer,
        admittance=admittance_params(
            axis.period,
            impedance,
            axis.outside_stiffness,
            axis.delay,
            lag_damping(axis.outside_stiffness, axis.follows or 0.0),
        ),
        wave=pair.wave_gain(side),
        quantum=1.001 * axis.effort_quantum + 1e-12,
        step=axis.effort_quantum if axis.inertia is not None else 0.0,
        late=axis.late,
        delay=axis.delay,
        window=round(WATCHED_S / axis.period),
        port_starved=STARVED_SHARE,
        empty=EMPTY_SHARE * port.reserve,
        position_debt=port.root * axis.velocity_limit * axis.period,
        patience=round(PATIENCE_S / axis.period),
        coarse=math.inf if axis.inertia is None else coarsest_step(pair, side, axis),
        noisy=math.inf if axis.inertia is None else _noisy(pair, side, axis, port.leak),
    )


def recovery_limit(axis: CoupledAxis) -> float:
    """Return the greatest friction by which an emptied tank recovers [N m or N]."""
    if math.isinf(axis.effort_limit):
        return FRICTIONS * axis.coulomb
    return min(axis.effort_limit, max(FRICTIONS * axis.coulomb, FRICTION_SHARE * axis.effort_limit))


def coarsest_step(pair: WavePair, side: str, axis: CoupledAxis) -> float:
    """Return the greatest effort step that a port works with, `COARSEST` [N m or N]."""
    return COARSEST * port_impedance(pair, side) * axis.velocity_limit


def _noisy(pair: WavePair, side: str, axis: CoupledAxis, leak: float) -> float:
    """Return the mean square of third differences of noise that takes clearly too much.

    `leak` is what the tank gets in a period [J].
    """
    assert axis.inertia is not None
    port = bare_port(pair, side, axis.period, axis.inertia, axis.delay + axis.late)
    observer = observer_of(pair, side, axis.period, axis.inertia)
    whole = axis.delay + (1 if axis.late > 0.0 else 0)
    drain = noise_bounds(port, observer, whole).drain
    variance = leak / drain if drain > 0.0 else math.inf
    pulses = axis.effort_quantum * axis.period**2 / axis.inertia
    return NOISIER * NOISIER * WHITE * variance + 4.0 * pulses * pulses


def servo_port(pair: WavePair, side: str, axis: CoupledAxis) -> PortParams:
    """Return the port of an axis that takes velocity: what closes it, with reserve and leak."""
    impedance = port_impedance(pair, side)
    error = axis.position_noise + 0.5 * axis.encoder_quantum
    leak = effort_leak(axis.period, impedance, error, 0.5 * axis.effort_quantum)
    return rigid_port(
        axis.period,
        impedance,
        filter_gain=pair.filter_step(axis.period),
        reserve=port_reserve(
            impedance, axis.period, axis.delay + axis.late, 1.0, axis.velocity_limit
        ),
        leak=leak * axis.period,
    )
