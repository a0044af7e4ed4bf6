"""Books of an operated rig whose motors act beside the coupling: they close over all states."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.runtime.operate import states as st
from tests.runtime.operating import BARE, FREE, STANDING, bench, operate

SCRIPT = """
0.2 engage
1.5 clutch
1.8 engage
3.2 hold
3.5 rest
3.6 engage
"""


@pytest.mark.parametrize("late", ["0", "0.002", "0.0013"])
@pytest.mark.parametrize("shares", ["coulomb: 0.5, viscous: 0.5", "inertia: 0.6"])
def test_what_is_compensated_is_booked_once_and_only_while_engaged(shares: str, late: str) -> None:
    """Each change of state counted the friction's share again; at rest the inertia's went on."""
    keys = [f"buses.{bus}.options={{command_delay_s: {late}}}" for bus in ("hand", "arm")]
    for side in ("master", "slave"):
        keys.append(f"{side}.axes.lever.coulomb=1.0e-3")
        keys.append(f"{side}.axes.lever.compensation={{{shares}}}")
    done = operate(bench(STANDING, FREE, *BARE, *keys), SCRIPT, 5.0)
    assert done.result.error is None
    assert np.abs(done.residual()).max() <= 1e-13
    kind = "inertia" if "inertia" in shares else "compensation"
    given = done.columns[f"lever.{kind}_master.absorbed"]
    assert np.ptp(given) > 0.0
    resting = done.columns["operation.state"] != st.STATES.index(st.ENGAGED)
    assert not np.diff(given)[resting[1:] & resting[:-1]].any()
