"""How much effort sensor noise makes at the ports of a wave line: chatter, as a standard deviation.

Both levers stand still, and the line between them delays by any phase: the answers of both ports
to a unit of noise, the round trips of their waves included, in the mean over that phase. A free
lever gives way a little, so that the truth is up to a fifth less.

Sources: derived here.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.wave_port.sensor_noise import Complex, noise_responses
from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams
from tautwave.models.noise_colour import spectrum

Float = npt.NDArray[np.float64]

FREQUENCIES = 240


class NoisyEnd(NamedTuple):
    """One end: port, observer, whole periods of command delay, deviation of its noise [rad or m].

    wave: device wave per line wave [1]. colour: the noise's autocorrelation from lag 1 on.
    """

    port: PortParams
    observer: ObserverParams
    delay: int
    deviation: float
    wave: float = 1.0
    colour: tuple[float, ...] = ()


class Answers(NamedTuple):
    """Answers of an end with its lever at rest, each of shape (n,).

    effort and leaving wave per noise; effort per arriving wave; share that is reflected [1].
    """

    effort: Complex
    leaving: Complex
    pushed: Complex
    reflected: Complex


@functools.lru_cache(maxsize=1024)
def chatter(near: NoisyEnd, far: NoisyEnd) -> float:
    """Return the standard deviation of the effort of `near` [N m or N]; inf without wave filters.

    What rate converters smooth where the periods differ is not counted.
    """
    if near.deviation == 0.0 and far.deviation == 0.0:
        return 0.0
    period = near.port.period
    theta = math.pi * (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES
    own, other = _answers(near, theta), _answers(far, theta * far.port.period / period)
    noise, others = _spectrum(near, theta), _spectrum(far, theta * far.port.period / period)
    left = 1.0 - np.abs(own.reflected * other.reflected) ** 2
    if float(np.min(left)) <= 0.0:
        return math.inf
    echo = np.abs(own.leaving * other.reflected) ** 2 * noise
    sent = np.abs(near.wave / far.wave * other.leaving) ** 2 * others * far.port.period / period
    power = np.abs(own.effort) ** 2 * noise + np.abs(own.pushed) ** 2 * (echo + sent) / left
    return math.sqrt(float(np.mean(power)))


def step_effort(port: PortParams, observer: ObserverParams, quantum: float) -> float:
    """Return the jump of the effort when the encoder moves on by its step [N m or N]."""
    velocity = observer.velocity + port.period * port.lead * observer.disturbance
    return port.impedance / port.divisor * velocity * quantum


def _spectrum(end: NoisyEnd, theta: Float) -> Float:
    shares = [spectrum(end.colour, at) for at in theta.tolist()]
    return end.deviation * end.deviation * np.maximum(shares, 0.0)


def _answers(end: NoisyEnd, theta: Float) -> Answers:
    # All is linear: two far ends tell what any does.
    share = 0.5
    ask = (end.port, end.observer, end.delay, theta)
    alone = noise_responses(*ask, np.zeros_like(theta, dtype=complex))
    heard = noise_responses(*ask, np.full_like(theta, share, dtype=complex))
    return Answers(
        effort=alone.effort,
        leaving=alone.leaving,
        pushed=(heard.effort - alone.effort) / (share * heard.leaving),
        reflected=(1.0 - alone.leaving / heard.leaving) / share,
    )
