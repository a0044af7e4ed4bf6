"""The second seed's worked example: a hand on a controller that renders a ringing resonator.

Hand and device: mass m_g, damper R_g, spring k_g to ground (G, eq. 7). Virtual object: a lightly
damped mass m_v on a spring, felt through the coupling spring k_c (K0 K, eq. 8). The ideal impedance
is positive real. Half a sample of delay (eq. 9) or a real sampler takes that away, and k_c has a
limit; how high it is depends on how the resonator is discretised.

Source: Berdahl, Smith & Niemeyer (the second seed), eqs 7-9 and appendix B; numbers recomputed.
Units: SI, linear. Frequencies in rad/s unless named `_hz`.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.delay_roots import DelayLoop, rightmost_roots
from tautwave.analysis.exact.polynomials import Number, Poly, exact
from tautwave.analysis.exact.rational import Complexes, Delayed, Rational
from tautwave_scenes.certificate.impedance import (
    GROUND,
    Damper,
    Mass,
    Part,
    Spring,
    admittance,
    impedance,
)
from tests.analysis.reference.delay_loops import CriticalGain, critical_gains

Floats = npt.NDArray[np.float64]


class Oscillator(NamedTuple):
    """Mass [kg], damping [N s/m] and stiffness [N/m] to ground."""

    mass: Number
    damping: Number
    stiffness: Number

    def polynomial(self) -> Poly:
        """Return m s**2 + R s + k."""
        return poly.polynomial([self.mass, self.damping, self.stiffness])


HAND = Oscillator(0.143, 5.0, 538.0)
"""The seed's hand with its device."""
RESONATOR = Oscillator(0.004, 0.01, 14200.0)
"""The seed's virtual object."""
COUPLING = 3000.0
"""The seed's coupling spring k_c [N/m]."""
PERIODS_S = (1e-3, 1e-4)
"""The seed's two sampling periods [s]."""


class Features(NamedTuple):
    """What is heard and felt of the ideal object through k_c.

    anti_resonance_hz, resonance_hz (device blocked) [Hz]; decay_s: time constant of the ring [s];
    their quality factors; peak: greatest |K0 K| [N s/m].
    """

    anti_resonance_hz: float
    resonance_hz: float
    decay_s: float
    anti_resonance_quality: float
    resonance_quality: float
    peak: float


class TableRow(NamedTuple):
    """One row of the seed's Bode plots: |G| [m/(N s)], |K0 K| [N s/m], phases [degrees].

    delayed_phase_deg: phase of K0 K with half a sample of delay, for each period, unwrapped.
    """

    frequency_hz: float
    device: float
    device_phase_deg: float
    controller: float
    controller_phase_deg: float
    delayed_phase_deg: tuple[float, ...]


def device_admittance(hand: Oscillator = HAND) -> Rational:
    """Return G(s) = s/(m s**2 + R s + k), eq. 7 [m/(N s)]."""
    parts: list[Part] = [
        Mass("hand", hand.mass),
        Damper("hand", GROUND, hand.damping),
        Spring("hand", GROUND, hand.stiffness),
    ]
    return admittance(parts, "hand")


def controller_impedance(
    coupling: Number = COUPLING, resonator: Oscillator = RESONATOR
) -> Rational:
    """Return K0 K(s) = (k_c/s) D/(D + k_c), D = m s**2 + R s + k, eq. 8 [N s/m]."""
    parts: list[Part] = [
        Spring("hand", "object", coupling),
        Mass("object", resonator.mass),
        Damper("object", GROUND, resonator.damping),
        Spring("object", GROUND, resonator.stiffness),
    ]
    return impedance(parts, "hand")


def delayed_controller(
    delay: float, coupling: Number = COUPLING, resonator: Oscillator = RESONATOR
) -> Delayed:
    """Return K0 K(s) exp(-s delay); eq. 9 is half a sampling period of delay [s]."""
    return Delayed(controller_impedance(coupling, resonator), delay)


def features(coupling: float = COUPLING, resonator: Oscillator = RESONATOR) -> Features:
    """Return the frequencies, decay and peak of the ideal controller."""
    m, r, k = (float(exact(x)) for x in resonator)
    low, high = math.sqrt(k / m), math.sqrt((k + coupling) / m)
    ideal = controller_impedance(coupling, resonator)
    w = np.linspace(high * (1.0 - r / (m * high)), high * (1.0 + r / (m * high)), 4001)
    return Features(
        low / (2.0 * math.pi),
        high / (2.0 * math.pi),
        2.0 * m / r,
        m * low / r,
        m * high / r,
        float(np.abs(ideal.at(np.asarray(1j * w))).max()),
    )


def table(frequencies_hz: Floats, periods_s: tuple[float, ...] = PERIODS_S) -> list[TableRow]:
    """Return magnitudes and phases at frequencies [Hz], with half a sample of delay per period."""
    device, ideal = device_admittance(), controller_impedance()
    rows = []
    for hz in frequencies_hz:
        w = 2.0 * math.pi * float(hz)
        g, k = device(1j * w), ideal(1j * w)
        phase = math.degrees(np.angle(k))
        late = tuple(phase - math.degrees(0.5 * w * t) for t in periods_s)
        rows.append(TableRow(float(hz), abs(g), math.degrees(np.angle(g)), abs(k), phase, late))
    return rows


def loop(
    coupling: Number = COUPLING,
    delay: float = 0.0,
    hand: Oscillator = HAND,
    resonator: Oscillator = RESONATOR,
) -> DelayLoop:
    """Return the characteristic function of hand and delayed controller, linear in k_c.

    D D_g + k_c (D_g + D exp(-s delay)) with D of the object and D_g of the hand.
    """
    fixed, plain, late = _parts(hand, resonator)
    k = exact(coupling)
    return DelayLoop(poly.add(fixed, poly.scale(plain, k)), poly.scale(late, k), delay)


def closed_loop_poles(coupling: Number = COUPLING, delay: float = 0.0) -> Complexes:
    """Return both rightmost pairs of poles [rad/s] (upper half), with a pure delay [s]."""
    return rightmost_roots(loop(coupling, delay), 2)


def critical_couplings(
    delay: float,
    highest_hz: float = 3000.0,
    hand: Oscillator = HAND,
    resonator: Oscillator = RESONATOR,
) -> list[CriticalGain]:
    """Return every k_c [N/m] that puts a pole on the axis up to a frequency [Hz], rising.

    k_c(w) = -s D/(s + D exp(-s delay) G) at s = jw wherever that is real and positive.
    """
    fixed, plain, late = _parts(hand, resonator)
    turn = 2.0 * math.pi
    return critical_gains(fixed, plain, late, delay, turn * 0.1, turn * highest_hz)


def greatest_passive_delay(coupling: Number = COUPLING, resonator: Oscillator = RESONATOR) -> float:
    """Return the delay [s] up to which K0 K exp(-s delay) resists at the lowest frequencies.

    Re K -> R_v k_c**2/(k_v + k_c)**2 - delay k_v k_c/(k_v + k_c). Half a sampling period is this
    delay for T = 2 R_v k_c/(k_v (k_v + k_c)).
    """
    c, r, k = exact(coupling), exact(resonator.damping), exact(resonator.stiffness)
    return float(r * c / (k * (k + c)))


def _parts(hand: Oscillator, resonator: Oscillator) -> tuple[Poly, Poly, Poly]:
    d, g = resonator.polynomial(), hand.polynomial()
    return poly.multiply(d, g), g, poly.scale(d, Fraction(1))
