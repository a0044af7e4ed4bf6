"""Assumptions of a first rig file about a motor whose data sheet is unknown."""

from __future__ import annotations

from tautwave.types import Setting

INERTIA_S2 = 2.0e-3
DAMPING_S = 1.0e-2
RISE_S = 5.0e-3
RANGE_RAD = 1.5


def assumed_axis(torque: float, limit: float, what: str, speed: Setting) -> dict[str, Setting]:
    """Return the keys of a rotary axis that takes effort.

    Parameters
    ----------
    torque : float
        [N m] Greatest torque of the device at its output; inertia and damping of geared motors go
        with it, within a factor of two or three (XL330 to XM540, EPOS4 with small EC motors).
    limit : float
        [N m] Effort limit to begin with.
    what : str
        What that limit is, for the comment.
    speed : Setting
        [rad/s] The velocity limit.
    """
    mass, damping = _round(INERTIA_S2 * torque), _round(DAMPING_S * torque)
    return {
        "kind": Setting("rotary"),
        "causality": Setting("impedance", "takes effort"),
        "inertia": Setting(_belief(mass), "[kg m^2] TODO: measure it with `tautwave identify`"),
        "damping": Setting(_belief(damping), "[N m s/rad] TODO: likewise"),
        "effort_limit": Setting(
            _round(limit), f"[N m] TODO: {what}; what is safe for your device?"
        ),
        "effort_rate_limit": Setting(_round(limit / RISE_S), "[N m/s] full effort in 5 ms"),
        "velocity_limit": speed,
        "position_range": Setting(
            [-RANGE_RAD, RANGE_RAD], "[rad] TODO: from zero to just short of the end stops"
        ),
    }


def _belief(value: float) -> dict[str, object]:
    return {"value": value, "lower": _round(0.6 * value), "source": "assumed from the torque"}


def _round(value: float) -> float:
    return float(f"{value:.2g}")
