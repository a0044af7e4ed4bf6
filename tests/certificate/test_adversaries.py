"""No passive user, made for the controller it meets, draws energy out of what is certified.

The user is that of the necessity theorem: a mass on a spring, without any damping of its own, tuned
to where the controller supplies most. The same users destabilise most walls of 1.3
times the passive limit: else these tests could not fail. A port that its user holds more stiffly
than it bears rests on its energy account, and that is a case of its own, at the end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tautwave.analysis.loop_modes import spectral_radius
from tautwave.analysis.rational import Sampled, rational
from tautwave.analysis.sampled_loop import Device
from tautwave.analysis.sampled_wall import SampledWall, wall_transfer
from tautwave.analysis.wall_limits import is_passive
from tautwave.analysis.wall_passivity import wall_leak
from tautwave.analysis.wall_stability import wall_matrix, wall_mode
from tautwave.certificate import certify
from tautwave.certificate.ports import ACCOUNT
from tautwave.laws.port import port_debt, port_params
from tautwave.offline import simulate
from tests.rigs.drawing import magnitudes
from tests.rigs.running import Tree, rig_of, tree

ROUNDING = 1e-9
OVER = 1.3
DRAW = (Phase.explicit, Phase.generate)  # to shrink a whole rig takes a minute
CALM = settings(deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


@st.composite
def walls(draw: st.DrawFn) -> tuple[SampledWall, float]:
    """A wall and the mass of its device: any rate, delay, filter, and B of either sign."""
    period, mass = draw(magnitudes(2e-5, 1e-2)), draw(magnitudes(1e-3, 10.0))
    stiffness = mass / period**2 * draw(magnitudes(1e-5, 2.0))
    damping = stiffness * period * draw(st.one_of(st.just(0.0), st.floats(-0.4, 10.0)))
    delay = draw(st.one_of(st.sampled_from([0.0, 1.0, 2.0]), st.floats(0.0, 10.0)))
    lag = period * draw(st.one_of(st.just(0.0), magnitudes(0.1, 20.0)))
    return SampledWall(stiffness, damping, period, delay, lag), mass


def tuned(wall: SampledWall, device: Device) -> Iterator[Device]:
    """Yield the device with undamped hands tuned to where the wall supplies most, and elsewhere."""
    pulse = wall_transfer(wall)
    law = rational(list(pulse.numerator), list(pulse.denominator))
    own = (device.mass, device.damping, device.stiffness)
    late = (wall.delay + device.command_delay) * wall.period
    controller = Sampled(law, wall.period, late, own)
    nyquist = math.pi / wall.period
    worst = 2.0 * math.pi * wall_leak(wall._replace(delay=late / wall.period)).frequency
    places = np.array([worst, 1e-2 * nyquist, 0.1 * nyquist, 0.4 * nyquist, 0.97 * nyquist])
    places = np.unique(np.clip(places, 1e-3 * nyquist, nyquist))
    for w, value in zip(places, controller.at(1j * places), strict=True):
        for mass in (0.0, device.mass, max(device.mass, 4.0 * abs(value.imag) / w)):
            stiffness = (mass * w + value.imag) * w
            if stiffness >= 0.0:
                yield device._replace(mass=float(device.mass + mass), stiffness=float(stiffness))


def grows(wall: SampledWall, held: Device) -> bool:
    """Refine what the eigenvalues call unstable: near z = 1 rounding is larger than this."""
    if spectral_radius(np.eye(len(m := wall_matrix(wall, held))) + m) <= 1.0 + ROUNDING:
        return False
    return wall_mode(wall, held).radius > 1.0 + ROUNDING


def hold_walls(drawn: tuple[SampledWall, float], share: float) -> None:
    wall, mass = drawn
    damping = share * wall_leak(wall).damping
    assert is_passive(wall, damping)
    for held in tuned(wall, Device(mass, damping)):
        assert not grows(wall, held), (wall, held)


@settings(CALM, max_examples=150)
@given(walls(), st.floats(1.0, 1.5))
def test_no_tuned_hand_destabilises_a_passive_wall(
    drawn: tuple[SampledWall, float], share: float
) -> None:
    hold_walls(drawn, share)


@pytest.mark.slow
@settings(CALM, max_examples=3000)
@given(walls(), st.floats(1.0, 1.5))
def test_thousands_of_passive_walls(drawn: tuple[SampledWall, float], share: float) -> None:
    hold_walls(drawn, share)


def test_tuned_hands_destabilise_walls_beyond_the_limit() -> None:
    seen = []

    @settings(CALM, max_examples=100, database=None)
    @given(walls())
    def over(drawn: tuple[SampledWall, float]) -> None:
        wall, mass = drawn
        device = Device(mass, wall_leak(wall).damping / OVER)
        assert not is_passive(wall, device.damping)
        seen.append(any(grows(wall, held) for held in tuned(wall, device)))

    over()
    assert np.mean(seen) > 0.6


# -- whole rigs: wave ports, line and walls, in simulation ---------------------------------------


@st.composite
def rigs(draw: st.DrawFn, cycles: int) -> Tree:
    """A wave rig, its walls passive, some just so, held on both sides by tuned users."""
    rate = draw(st.sampled_from([500.0, 1000.0, 4000.0]))
    out = tree(
        {
            "rate_hz": rate,
            "duration_s": cycles / rate,
            "coupling.delay_s": draw(st.integers(0, 8)) / rate,
            "coupling.pairs.a.wave_impedance": draw(magnitudes(0.01, 30.0)),
        }
    )
    if draw(st.booleans()):
        out["coupling"]["wave_filter_hz"] = rate * draw(st.floats(0.02, 0.5))
    known: Tree = {}
    for side, bus in (("master", "hand"), ("slave", "arm")):
        mass = draw(magnitudes(0.05, 5.0))
        true_mass = mass * draw(st.floats(1.0, 2.0))
        late = draw(st.sampled_from([0, 0, 1, 2]))
        stiffness = mass * rate**2 * draw(magnitudes(1e-4, 0.2))
        damper = stiffness / rate * draw(st.sampled_from([0.0, 0.3, 2.0]))
        wall = SampledWall(stiffness, damper, 1.0 / rate, float(late))
        damping = wall_leak(wall).damping * draw(st.sampled_from([1.0, 1.1, 2.0, 10.0]))
        out["buses"][bus]["options"] = {"command_delay_s": late / rate}
        limit = draw(st.sampled_from([20.0, 1e6]))
        axis = {"damping": damping, "effort_limit": limit}
        out[side]["axes"]["a"].update(
            axis, inertia={"value": true_mass, "lower": mass, "source": "test"}
        )
        if draw(st.integers(0, 3)):
            # Not pressed at the start: it would give back what it never took.
            where = draw(st.sampled_from([0.0, 0.004]))
            out["coupling"]["pairs"]["a"][f"wall_{side}"] = {
                "position": where,
                "stiffness": stiffness,
                "damping": damper,
            }
        known[f"{side}.a"] = {"inertia": true_mass, "damping": damping}
        users = list(tuned(wall, Device(true_mass, damping)))
        user = draw(st.sampled_from([u for u in users if u.stiffness > 0.0]))
        if side == "master":
            hz = math.sqrt((user.stiffness + stiffness) / user.mass) / (2.0 * math.pi)
            hand = {
                "mass": user.mass - true_mass,
                "damping": 0.0,
                "stiffness": user.stiffness,
                "reference": {
                    "type": "multisine",
                    "ramp_s": 5.0 / rate,
                    "offset": 0.005,
                    "components": [[min(hz, 0.45 * rate), 0.01, 0.3]],
                },
            }
        else:
            spring = {"type": "spring", "stiffness": user.stiffness, "position": 0.01}
    out["simulation"] = {"axes": known, "hand": {"a": hand}, "environment": {"a": spring}}
    return out


def given_out(data: Tree, engine: str) -> float:
    """Return the most that motors gave less what the devices' dampers took, as a share of flow."""
    run = simulate(rig_of(data), engine=engine)
    total, flow = 0.0, 0.0
    for side in ("master", "slave"):  # both scales are 1: so is the weight
        work, lost = (run[f"plant.{side}.a.{part}"] for part in ("motor_work", "viscous_loss"))
        total = total + (work - work[0]) - (lost - lost[0])
        flow += float(np.abs(np.diff(work)).sum())
    return float(np.max(total)) / flow if flow > 0.0 else 0.0


def within_bounds(data: Tree) -> bool:
    """Whether `passive` passes and no port rests on its energy account with these users."""
    verdict = certify(rig_of(data)).verdicts["passive"]
    return verdict.passed and not any(ACCOUNT in text for text in verdict.conditions)


@settings(CALM, max_examples=12, phases=DRAW)
@given(rigs(cycles=100))
def test_no_tuned_user_draws_energy_from_a_certified_rig(data: Tree) -> None:
    if within_bounds(data):
        assert given_out(data, "python") <= ROUNDING


@pytest.mark.slow
@settings(CALM, max_examples=150, phases=DRAW)
@given(rigs(cycles=1500))
def test_hundreds_of_certified_rigs(data: Tree) -> None:
    if within_bounds(data):
        assert given_out(data, "compiled") <= ROUNDING


@pytest.mark.parametrize("duration", [0.2, 3.0])
def test_energy_account_holds_a_port_that_reverses_within_periods(duration: float) -> None:
    """Five samples a swing and a period of delay: every prediction is wrong, and the port lets go.

    Found by the rigs above: without the bound on its debt this port gave 881 kJ in 3 s.
    """
    data = tree(
        {
            "rate_hz": 500.0,
            "duration_s": duration,
            "coupling.delay_s": 0.002,
            "coupling.pairs.a.wave_impedance": 0.7,
            "buses.hand.options": {"command_delay_s": 0.002},
            "master.axes.a.inertia": {"value": 1.0, "lower": 1.0, "source": "test"},
            "simulation": {
                "axes": {"master.a": {"inertia": 1.0, "damping": 0.06}},
                "hand": {
                    "a": {
                        "mass": 4.1,
                        "damping": 0.0,
                        "stiffness": 2.04e6,
                        "reference": {
                            "type": "multisine",
                            "ramp_s": 0.01,
                            "offset": 0.005,
                            "components": [[100.0, 0.01, 0.3]],
                        },
                    }
                },
            },
        }
    )
    data["master"]["axes"]["a"]["damping"] = 0.06
    run = simulate(rig_of(data), engine="python")
    port = port_params(0.002, 0.7, 1.0, matched=False, drift_time=0.05, allowance=0.0)
    fastest = np.abs(np.diff(run["master.a.position"])).max() / 0.002
    debt = port_debt(port, 1, float(fastest), float(run["master.a.gross_flow"][-1]))
    period = float(np.abs(np.diff(run["master.a.port_energy"])).max())
    generated = -float(run["a.port_master.absorbed"].min())
    assert 0.0 < generated <= debt + 2.0 * period
