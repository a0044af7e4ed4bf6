"""Force augmentation of wave ports: an option of law wave, paid by the slave's tank."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave import registry
from tautwave.certificate.couplings import coupling_verdict
from tautwave.config import Rig
from tautwave.contracts import CoupledAxis
from tautwave.controller.records import AxisState
from tautwave.couplings.wave.augmented import forget, with_augmentation
from tautwave.errors import ConfigError
from tautwave.rig import command_delays, coupling_law, make_control
from tautwave.simulation import simulate
from tests.lab.couplings.measure import stated_bound
from tests.lab.couplings.rigs import bench_rig
from tests.rigs.running import rig_of, tree

forces = st.floats(-0.3, 0.3)


def rig(gain: float, **more: Any) -> Rig:
    data = tree({"coupling.pairs.a": {"wave_impedance": 0.05, "force_gain": gain, **more}})
    data["coupling"]["delay_s"] = 0.01
    return rig_of(data)


def slave_of(built: Rig) -> tuple[Any, AxisState, Any]:
    """The law, a slave's axis at rest with a full tank, and its constants."""
    law = coupling_law(built)
    control = make_control(built, command_delays(built), 10)
    s, p = AxisState(end=law.end()), control.params[1]
    s.end.account = p.end.port.reserve
    forget(s)
    return law, s, p


def test_without_a_gain_law_wave_is_itself() -> None:
    plugin = registry.load_coupling("wave")
    assert with_augmentation(plugin, rig(0.0).coupling) is plugin  # type: ignore[arg-type]


@given(forces, st.floats(0.1, 1.0))
def test_a_device_that_its_motor_holds_still_has_nothing_to_add(force: float, gain: float) -> None:
    """What pushes from outside is what the motor resists: the wave is that of a bare port."""
    law, s, p = slave_of(rig(gain))
    s.end.augmented.push = force / p.end.augmented.outside.mass
    s.end.push = force * p.end.observer.inverse_mass
    s.port_effort = s.effort_sum = s.end.wanted = force
    law.steps.close(s, p, 0.0, 1.0, p.site.period, force)
    assert s.end.leaving == pytest.approx(0.0, abs=1e-9)
    assert s.end.gap == pytest.approx(0.0, abs=1e-9)


@given(forces, st.floats(0.1, 1.0))
def test_what_was_added_to_the_integral_is_owed(force: float, gain: float) -> None:
    """An impact that the motor does not know of yet: k F / sqrt(2b) leaves, and is given back."""
    law, s, p = slave_of(rig(gain))
    k = p.end
    s.end.augmented.push = force / k.augmented.outside.mass
    law.steps.close(s, p, 0.5 * k.port.period**2 * s.end.augmented.push, 1.0, k.port.period, 0.0)
    own = s.end.filtered
    added = gain * force / k.port.root
    assert s.end.leaving - own == pytest.approx(added, rel=0.2, abs=1e-6)
    assert s.end.gap == pytest.approx(-k.port.period * (s.end.leaving - own), abs=1e-9)


def test_the_certificate_says_that_it_holds_by_account() -> None:
    built = bench_rig("wave_augmented", 0.0, account=False, contact="free", seconds=1.0)
    delays, verdict = command_delays(built), coupling_verdict(built)
    master, slave = (
        next(iter(verdict.axis_elements(built, f"{side}.lever", delays, 0.0)))
        for side in ("master", "slave")
    )
    assert "by account" in slave.passive.reason
    assert "by account" not in master.passive.reason


def test_an_axis_that_takes_velocity_is_refused() -> None:
    plugin = with_augmentation(registry.load_coupling("wave"), rig(0.5).coupling)  # type: ignore[arg-type]
    pair = rig(0.5).coupling.pairs["a"]
    axis = CoupledAxis(1e-3, 1.0, None, 0.0, 0.0, 0, 10.0)
    with pytest.raises(ConfigError, match="force_gain needs axes that take effort"):
        registry.load_named(plugin.end_constants)(pair, "slave", axis)


def test_against_a_wall_positions_stay_together_and_no_more_is_made_than_claimed() -> None:
    built = bench_rig("wave_augmented", 0.0, account=False, contact="rigid", seconds=1.0)
    run = simulate(built, engine="python")
    assert run.error is None
    works = [run[f"plant.{side}.lever.motor_work"] for side in ("master", "slave")]
    assert float(np.max(works[0] + works[1])) < 1e-3 < stated_bound(built)
    assert float(np.sqrt(np.mean(run["lever.position_error"][-500:] ** 2))) < 0.01
