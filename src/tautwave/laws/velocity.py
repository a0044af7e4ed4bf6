"""The velocity of a device from the displacement between two samples and the known efforts."""

from __future__ import annotations


def track_velocity(gain: float, predicted: float, displacement: float, span: float) -> float:
    """Correct a predicted mean velocity by the measured one: gain 1 is the plain difference.

    Parameters
    ----------
    gain : float
        Share of the error that is corrected, T / (T + t_f) with a time constant t_f [1].
    predicted : float
        Mean velocity that the known efforts make likely [rad/s or m/s].
    displacement, span : float
        Measured displacement [rad or m] in that time [s].
    """
    return predicted + gain * (displacement / span - predicted)
