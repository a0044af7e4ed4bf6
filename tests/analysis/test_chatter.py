"""Chatter of a pair: the prediction against the laws run on noise, and what it depends on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.analysis.wave_port.chatter import NoisyEnd, chatter, step_effort
from tautwave.laws.observer import observe
from tautwave.laws.port import port_close, port_effort
from tests.laws.ports import ends

SIGMA = 9e-5


def noisy(
    deviation: float = SIGMA, *, pole: float = 0.5, delay: int = 0, **keys: float
) -> NoisyEnd:
    end = ends(pole=pole, delay=delay, **keys)
    return NoisyEnd(end.port, end.observer, delay, deviation)


class Locked:
    """A port on a lever that stands still, without a limit to its tank."""

    def __init__(self, end: NoisyEnd, noise: list[float]) -> None:
        self.port, self.observer = end.port._replace(reserve=1e9), end.observer
        self.noise = noise
        self.at = self.velocity = self.outside = self.filtered = self.last = 0.0
        self.efforts, self.waves = [0.0] * (end.delay + 1), [0.0] * (end.delay + 1)

    def step(self, slot: int, arriving: float) -> tuple[float, float]:
        """Return the leaving wave, and the effort of what arrives."""
        effort, wave, sample = self.efforts.pop(0), self.waves.pop(0), self.noise[slot]
        ahead, self.velocity, self.outside = observe(
            self.observer, self.at, self.velocity, self.outside, sample, effort, 1.0
        )
        leaving, _, _, self.filtered, _, _, _ = port_close(
            self.port, 1e6, 0.0, self.filtered, sample - self.last, ahead - self.at, 1.0, effort,
            wave, 0.0, False,
        )  # fmt: skip
        self.at, self.last = ahead, sample
        wanted = port_effort(
            self.port, 1e6, self.velocity, self.outside, sum(self.efforts), arriving
        )
        self.efforts.append(wanted)
        self.waves.append(arriving)
        return leaving, wanted


@pytest.mark.parametrize(("pole", "delay"), [(0.5, 0), (0.3, 1)])
@pytest.mark.parametrize("share", [1.0, 0.2])
def test_it_is_that_of_the_laws_run_on_noise(pole: float, delay: int, share: float) -> None:
    """The second encoder has a share of the noise; the line is long, so that all phases occur."""
    near, far = noisy(pole=pole, delay=delay), noisy(share * SIGMA, pole=pole, delay=delay)
    slots, line = 6000, 41
    noise = np.random.default_rng(3).normal(0.0, SIGMA, (2, slots))
    one, two = Locked(near, noise[0].tolist()), Locked(far, (share * noise[1]).tolist())
    there, back = [0.0] * line, [0.0] * line
    efforts = []
    for slot in range(slots):
        left, effort = one.step(slot, back.pop(0))
        right, _ = two.step(slot, there.pop(0))
        there.append(left)
        back.append(right)
        efforts.append(effort)
    measured = float(np.std(efforts[slots // 6 :]))
    assert chatter(near, far) == pytest.approx(measured, rel=0.05)


def test_without_noise_there_is_none_and_a_line_that_loses_nothing_collects_it() -> None:
    assert chatter(noisy(0.0), noisy(0.0)) == 0.0
    assert chatter(noisy(0.0), noisy()) > 0.0
    lossless = noisy()._replace(port=noisy().port._replace(filter_gain=1.0))
    assert math.isinf(chatter(lossless, lossless))


def test_waves_from_the_other_end_are_scaled_with_the_power() -> None:
    quiet, far = noisy(0.0), noisy()
    assert chatter(quiet, far._replace(wave=2.0)) == pytest.approx(0.5 * chatter(quiet, far))
    assert chatter(quiet._replace(wave=3.0), far) == pytest.approx(3.0 * chatter(quiet, far))


def test_the_colour_of_the_noise_counts() -> None:
    """White noise is half and half of one colour and its opposite, at either end."""
    white = noisy()
    slow, fast = white._replace(colour=(0.45,)), white._replace(colour=(-0.45,))
    for mixed in ((slow, white, fast, white), (white, slow, white, fast)):
        one, two = chatter(*mixed[:2]), chatter(*mixed[2:])
        assert one != pytest.approx(two, rel=1e-3)
        assert one**2 + two**2 == pytest.approx(2.0 * chatter(white, white) ** 2)


@given(st.floats(0.1, 10.0), st.sampled_from([0.3, 0.5]), st.integers(0, 2))
def test_it_is_in_proportion_to_the_noise_and_grows_with_that_of_the_other(
    factor: float, pole: float, delay: int
) -> None:
    end, louder = noisy(pole=pole, delay=delay), noisy(factor * SIGMA, pole=pole, delay=delay)
    assert chatter(louder, louder) == pytest.approx(factor * chatter(end, end))
    assert (chatter(end, louder) > chatter(end, end)) == (factor > 1.0)


@pytest.mark.parametrize("delay", [0, 1])
def test_a_step_of_the_encoder_is_felt_as_the_law_makes_it(delay: int) -> None:
    end, step = noisy(delay=delay), 1e-3
    _, velocity, outside = observe(end.observer, 0.0, 0.0, 0.0, step, 0.0, 1.0)
    effort = port_effort(end.port, 1e6, velocity, outside, 0.0, 0.0)
    assert step_effort(end.port, end.observer, step) == pytest.approx(effort)
