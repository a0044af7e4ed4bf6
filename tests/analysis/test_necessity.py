"""A controller that is not positive real meets the passive hand it cannot hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.exact.positive_real import positive_real
from tautwave.analysis.exact.rational import Delayed, Rational, Sampled, rational
from tautwave.analysis.ports.necessity import Controller, User, destabilising_hand
from tautwave.errors import ConfigError
from tests.analysis.reference.delay_loops import verified_unstable
from tests.analysis.reference.resonator import sampled_controller
from tests.examples import tried
from tests.lab.papers.necessity_motion import simulate_hand
from tests.lab.papers.resonator_loop import controller_impedance, delayed_controller

TWENTY_HZ = 40.0 * math.pi
WALL = Sampled(rational([1200, -200], [1, 0]), 1e-3)  # K = 1000, B = .2, T = 1 ms: bound 0.7


@pytest.mark.parametrize(
    ("period", "hand", "root"),
    [
        (1e-3, (0.62909242, 0.61814393, 7464.29483), 0.49096165 + 125.66275812j),
        (1e-4, (0.62787107, 0.06171675, 7440.17561), 0.04913780 + 125.66369660j),
    ],
)
def test_example_2_5(period: float, hand: tuple[float, ...], root: complex) -> None:
    controller = delayed_controller(period / 2)
    found = destabilising_hand(controller, TWENTY_HZ)
    assert found is not None
    assert found.hand == pytest.approx(hand, rel=1e-7)
    assert found.root == pytest.approx(root, abs=2e-8)
    assert verified_unstable(found, controller)


def test_the_sentence_that_is_printed() -> None:
    found = destabilising_hand(delayed_controller(5e-4), TWENTY_HZ)
    assert found is not None
    assert found.sentence() == (
        "this controller is unstable with this hand: m = 0.629 kg, R = 0.618 N s/m, "
        "k = 7464 N/m; the vibration at 20.0 Hz grows e-fold every 2.04 s"
    )
    assert "kg m^2, R = 0.618 N m s/rad, k = 7464 N m/rad" in found.sentence(rotary=True)


SPECIAL: dict[str, Controller] = {
    "double integrator": rational([1], [1, 0, 0]),
    "negative double integrator": rational([-1], [1, 0, 0]),
    "triple integrator": rational([1], [1, 0, 0, 0]),
    "negative spring": rational([-1], [1, 0]),
    "negative mass": rational([-1, 0]),
    "negative damper": rational([-1]),
    "acceleration of acceleration": rational([1, 0, 0, 0]),
    "unstable, phase within 90": rational([1, -1], [1, -2]),
    "unstable and ringing": rational([1, 1, 5], [1, "-0.1", 5]),
    "negative residue off zero": rational([-1, 0], [1, 0, 1]),
    "double pole off zero": rational([1], [1, 0, 2, 0, 1]),
    "low pass": rational([1], [1, 1, 1]),
    "late damper": rational([0.5, 1000], [0.001, 1, 0]),
    "unstable with a delay": Delayed(rational([1, -1], [1, -2]), 0.01),
    "spring with a delay": Delayed(rational([1000], [1, 0]), 1e-3),
    "spring and damper, sampled": WALL,
    "spring, a third of a period late": Sampled(rational([1000]), 1e-3, 0.3e-3),
    "unstable law": Sampled(rational([10, 0], [1, "-1.01"]), 1e-3),
    "resonator, sampled": sampled_controller(1e-3, "tustin", 1),
}


@pytest.mark.parametrize("name", SPECIAL)
def test_every_kind_of_defect_has_its_hand_and_grows_in_time(name: str) -> None:
    controller = SPECIAL[name]
    found = destabilising_hand(controller)
    assert found is not None
    assert min(found.hand) >= 0.0
    assert found.root.real > 0.0
    assert verified_unstable(found, controller)
    if not (isinstance(controller, Rational) and controller.relative_degree < -2):
        motion = simulate_hand(found, controller, growth_times=12.0)
        swings = found.root.imag == 0.0 or found.root.imag > 3.0 * found.root.real
        rough = 0.03 if swings else 0.25  # less than a swing is seen
        assert motion.growth == pytest.approx(1.0 / found.growth_time, rel=rough)
        assert motion.amplitude[-1] > 5.0


def test_a_violation_that_no_grid_sees_is_still_shown() -> None:
    controller = rational([1, 1, 1], [1, 1, 4 + 1e-12])
    found = destabilising_hand(controller)
    assert found is not None
    assert 0.0 < found.hand.damping < 1e-12
    assert verified_unstable(found, controller)
    with pytest.raises(ConfigError, match="too slowly"):
        simulate_hand(found, controller)


@pytest.mark.slow
@pytest.mark.nightly
def test_example_grows_in_time_at_the_root_s_rate() -> None:
    controller = delayed_controller(5e-4)
    found = destabilising_hand(controller, TWENTY_HZ)
    assert found is not None
    motion = simulate_hand(found, controller, growth_times=5.0)
    assert motion.growth == pytest.approx(0.49096, rel=2e-3)
    assert np.all(np.diff(motion.amplitude[20:]) > 0.0)


def test_passive_controllers_have_no_such_hand() -> None:
    assert destabilising_hand(controller_impedance()) is None
    assert destabilising_hand(rational([1, 1, 1], [1, 1, 4])) is None
    spring = Delayed(rational([1000], [1, 0]), 1e-3)
    assert destabilising_hand(spring, device=User(0.1, 1.001)) is None  # K delay = 1
    assert destabilising_hand(WALL, device=User(0.1, 0.701)) is None


@pytest.mark.parametrize(
    ("controller", "damping"),
    [
        (Delayed(rational([1000], [1, 0]), 1e-3), 0.99),
        (Sampled(rational([1000]), 1e-3), 0.499),
        (Sampled(rational([1000], [1, 0]), 1e-3), 1.49),  # a period late: K (T/2 + T)
    ],
)
def test_hand_is_found_up_to_the_passive_bound(controller: Controller, damping: float) -> None:
    found = destabilising_hand(controller, device=User(0.1, damping))
    assert found is not None
    assert found.total.damping > damping
    assert verified_unstable(found, controller)


def test_sampled_damper_is_met_at_the_nyquist_frequency() -> None:
    """Colgate's K T/2 + B at z = -1: exact for a light device, 8/pi^2 of it for a heavy one."""
    light = destabilising_hand(WALL, device=User(1e-7, 0.699))
    assert light is not None
    assert verified_unstable(light, WALL)
    heavy = destabilising_hand(WALL, device=User(0.1, 0.55))
    assert heavy is not None
    assert abs(heavy.root.imag) == pytest.approx(1000 * math.pi, rel=1e-3)
    motion = simulate_hand(heavy, WALL)
    assert motion.growth == pytest.approx(1.0 / heavy.growth_time, rel=0.01)


def test_bad_questions_are_sentences() -> None:
    with pytest.raises(ConfigError, match="not negative"):
        destabilising_hand(delayed_controller(5e-4), 2 * math.pi * 320)
    with pytest.raises(ConfigError, match="share"):
        destabilising_hand(WALL, share=1.0)


coefficients = st.lists(st.integers(-3, 6), min_size=1, max_size=4)


@given(coefficients, coefficients, st.integers(0, 2))
@settings(max_examples=tried(120))
def test_not_positive_real_means_a_hand_and_only_then(
    num: list[int], den: list[int], damping: int
) -> None:
    if not any(den):
        return
    controller = rational(num, den)
    found = destabilising_hand(controller, device=User(0.0, float(damping)))
    assert (found is None) == positive_real(controller + damping).positive_real
    if found is not None:
        assert min(found.hand) >= 0.0
        assert found.root.real > 0.0
        assert verified_unstable(found, controller)


@given(
    st.floats(10.0, 1e5),
    st.just(0.0) | st.floats(1e-9, 5.0),
    st.floats(2e-5, 2e-2),
    st.floats(0.0, 3.0),
)
@settings(max_examples=tried(40))
def test_every_undamped_sampled_wall_has_its_hand(
    stiffness: float, damping: float, period: float, periods_late: float
) -> None:
    law = rational([stiffness + damping / period, -damping / period], [1, 0])
    wall = Sampled(law, period, periods_late * period)
    found = destabilising_hand(wall)
    assert found is not None
    assert min(found.hand) >= 0.0
    assert verified_unstable(found, wall)


@given(st.floats(1.0, 1e4), st.just(0.0) | st.floats(1e-9, 10.0), st.floats(1e-5, 0.1))
@settings(max_examples=tried(30))
def test_every_late_spring_and_damper_has_its_hand(
    stiffness: float, damping: float, delay: float
) -> None:
    controller = Delayed(rational([damping, stiffness], [1, 0]), delay)
    found = destabilising_hand(controller)
    assert found is not None
    assert verified_unstable(found, controller)
