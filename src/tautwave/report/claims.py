"""Compare the energy of the motors with the stated limit; reads summaries, without NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tautwave.report.units import number

ROUNDING = 1e-9
"""Share of the gross flow by which rounding may exceed a stated debt."""


def exceeds(motors: Mapping[str, Any], gross_flow: float) -> bool:
    """Return whether motors delivered more than `stated_debt`.

    `motors` is a pair's `motors` in the summary (`tautwave.report.motors.motor_energy`),
    `gross_flow` in J.
    """
    worst, debt = number(motors.get("worst")), number(motors.get("stated_debt"))
    return worst is not None and debt is not None and worst > debt + ROUNDING * gross_flow
