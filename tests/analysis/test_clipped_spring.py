"""A sampled spring, clipped and not: closed forms, the form at every angle, cut answers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from tautwave.analysis.ports import clipped_spring
from tautwave.analysis.ports.clipped_spring import (
    Asked,
    Needs,
    Spring,
    clipped_lack,
    clipped_needs,
    closed_answers,
    linear_lack,
    spring_of,
)

Array = npt.NDArray[np.float64]
T = 1e-3


class Law(NamedTuple):
    """A spring, a damper between the ends and one to ground, a line, late commands, a filter."""

    stiffness: float
    line: int = 0
    late: int = 0
    damper: float = 0.0
    ground: float = 0.0
    gain: float = 1.0

    def answers(self) -> Array:
        size = self.line + self.late + 2 + (0 if self.gain == 1.0 else int(30 / self.gain))
        out = np.zeros((size, 2, 2))
        moved = np.array([self.gain * (1.0 - self.gain) ** j for j in range(size)])
        velocity = np.diff(np.r_[0.0, moved]) / T
        for j in range(size - self.late):
            spring = self.stiffness if j == 0 else 0.0
            for end in (0, 1):
                out[j + self.late, end, end] += spring + (self.damper + self.ground) * velocity[j]
                if j + self.late + self.line < size:
                    out[j + self.late + self.line, end, 1 - end] -= (
                        spring + self.damper * velocity[j]
                    )
        return out

    def spring(self) -> Spring:
        found = spring_of(self.answers(), T)
        assert found is not None
        return found


def need_at(spring: Spring, angles: Array) -> float:
    """The need at angles, straight from its definition."""
    slots = np.arange(1, len(spring.tails) + 1)
    form = np.einsum("tk,kij->tij", np.exp(-1j * np.outer(angles, slots)), spring.tails)
    total = spring.stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    whole = 0.5 * (form + form.conj().swapaxes(1, 2)) + 0.5 * total
    return float(T * np.max(np.linalg.eigvalsh(whole)[:, 1]))


def laws(count: int) -> list[Law]:
    draw = np.random.default_rng(1)
    found = []
    for _ in range(count):
        stiffness = 10.0 ** draw.uniform(0.0, 4.0)
        found.append(
            Law(
                stiffness,
                int(draw.choice([0, 1, 2, 5, 20, 100, 700])),
                int(draw.integers(0, 3)),
                float(draw.choice([0, 1]) * stiffness * T * draw.uniform(0.0, 3.0)),
                float(draw.choice([0, 1]) * stiffness * T * draw.uniform(0.0, 5.0)),
                float(draw.choice([1.0, draw.uniform(0.05, 1.0)])),
            )
        )
    return found


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("line", [0, 1, 7, 488, 4096])
def test_a_bare_spring_needs_a_period_for_each_it_is_late(line: int, late: int) -> None:
    """K T (n + 1 + 2 L), exactly."""
    spring = Law(50.0, line, late).spring()
    wanted = 50.0 * T * (line + 1 + 2 * late)
    assert clipped_needs(spring).lack(0.0, 0.0) == pytest.approx(wanted, rel=1e-12)
    assert clipped_lack(spring) == pytest.approx(wanted, rel=1e-12)
    assert wanted <= linear_lack(spring).damping <= 1.01 * wanted


def test_a_damper_counts_as_its_size_at_both_ends() -> None:
    """Between the ends as twice itself, to ground as itself."""
    needs = clipped_needs(Law(50.0, 0, 0, 0.2, 0.3).spring())
    assert needs.lack(0.0, 0.0) == pytest.approx(50.0 * T + 2.0 * 0.2 + 0.3)


def test_what_is_clipped_needs_no_less_than_what_is_not() -> None:
    """And of laws at random the median need is not far above."""
    angles = np.concatenate([np.linspace(0.0, math.pi, 1001), np.geomspace(1e-4, 0.5, 300)])
    ratios = []
    for law in laws(80):
        spring = law._replace(gain=1.0).spring()
        found = linear_lack(spring).damping
        if law.line <= 20:
            need = need_at(spring, angles)
            assert need * (1.0 - 1e-12) <= found <= 1.012 * need
        if law.line <= 5:
            ratios.append(clipped_lack(spring) / found)
            assert clipped_lack(spring) <= clipped_needs(spring).lack(0.0, 0.0)
    assert min(ratios) > 0.99
    assert float(np.median(ratios)) < 1.05
    assert max(ratios) < 1.25


def damped(count: int) -> list[Law]:
    """Laws of dampers beside a spring, each with a line of a few periods."""
    draw = np.random.default_rng(7)
    return [
        Law(
            1.0 / T,
            int(draw.choice([0, 1, 2, 5, 20])),
            int(draw.integers(0, 3)),
            float(draw.uniform(0.1, 2.0)),
            float(draw.choice([0.0, 1.0]) * draw.uniform(0.0, 2.0)),
        )
        for _ in range(count)
    ]


def test_dampers_early_against_a_late_line_are_not_counted_by_their_size_alone() -> None:
    """The closed form alone asks for up to 2.5 times what no clip needs."""
    springs = [law.spring() for law in damped(16)]
    linear = np.array([linear_lack(spring).damping for spring in springs])
    closed = np.array([clipped_needs(spring).lack(0.0, 0.0) for spring in springs])
    found = np.array([clipped_lack(spring) for spring in springs])
    assert float(np.median(closed / linear)) > 1.3
    assert float(np.median(found / linear)) < 1.05
    assert np.all(found >= 0.99 * linear)


SIZE = 120


def cut_as_it_pays(spring: Spring) -> float:
    """The most that motors give, over sum u^2 / T, if ends are cut exactly where they would take.

    Worse than any clip: the tail of an effort acts where it gives, and not where it takes. With
    those places fixed the worst motion is an eigenvector, and of that motion the places are better.
    """
    tails = np.zeros((2 * SIZE, 2 * SIZE))
    for slot, tail in enumerate(spring.tails[: SIZE - 1], 1):
        tails += np.kron(tail, np.eye(SIZE, k=-slot))
    held = 0.5 * spring.stiffness * np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(SIZE))
    acts, most = np.ones(2 * SIZE), 0.0
    for _ in range(4):
        cut = acts[:, None] * tails
        values, motions = np.linalg.eigh(held + 0.5 * (cut + cut.T))
        assert values[-1] >= most * (1.0 - 1e-12)
        most = float(values[-1])
        acts = np.where((tails @ motions[:, -1]) * motions[:, -1] > 0.0, 1.0, 0.0)
    return T * most


@pytest.mark.parametrize("number", range(6))
def test_who_cuts_each_effort_as_it_pays_gets_no_more(number: int) -> None:
    """And comes near, or the bound would be empty."""
    spring = damped(6)[number].spring()
    bound = clipped_lack(spring)
    assert 0.9 * bound <= cut_as_it_pays(spring) <= bound * (1.0 + 1e-12)


def test_devices_of_unlike_damping_lack_what_the_form_says() -> None:
    """At every angle, with weights of its own: no less than what no clip needs."""
    for law in damped(4):
        spring = law.spring()
        have = (0.3, 1.7)
        assert clipped_lack(spring, have) <= clipped_needs(spring).lack(*have)
        assert clipped_lack(spring, have) >= linear_lack(spring, have).damping - 0.01
        alike = clipped_lack(spring, (0.5, 0.5))
        assert alike == pytest.approx(clipped_lack(spring) - 0.5, abs=2e-3)


@pytest.mark.parametrize("points", [8, 16])
def test_what_lies_between_the_points_is_counted(
    monkeypatch: pytest.MonkeyPatch, points: int
) -> None:
    """Every law's need is found from few points, too, and never missed."""
    monkeypatch.setattr(clipped_spring, "POINTS", points)
    fine = np.linspace(0.0, math.pi, 4001)
    for law in laws(12):
        spring = law._replace(line=17, gain=1.0).spring()
        assert linear_lack(spring).damping >= need_at(spring, fine) * (1.0 - 1e-12)


def test_damping_that_devices_have_is_set_off() -> None:
    spring = Law(50.0, 4, 0, 0.05).spring()
    bare = linear_lack(spring).damping
    assert linear_lack(spring, (0.1, 0.1)).damping == pytest.approx(bare - 0.1, rel=1e-9)
    angles = np.linspace(0.0, math.pi, 5001)
    assert linear_lack(spring, (0.3, 0.05)).damping >= _short_at(spring, angles, (0.3, 0.05))


def _short_at(spring: Spring, angles: Array, have: tuple[float, float]) -> float:
    slots = np.arange(1, len(spring.tails) + 1)
    form = np.einsum("tk,kij->tij", np.exp(-1j * np.outer(angles, slots)), spring.tails)
    total = spring.stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    whole = T * (0.5 * (form + form.conj().swapaxes(1, 2)) + 0.5 * total) - np.diag(have)
    return float(np.max(np.linalg.eigvalsh(whole)[:, 1]))


def test_needs_are_covered_exactly_where_nothing_is_lacking() -> None:
    draw = np.random.default_rng(2)
    for _ in range(200):
        one, two, both = draw.uniform(0.0, 1.0, 3)
        spread = tuple(draw.choice([0.0, 0.1]) * draw.uniform(0.0, 1.0, 2))
        needs = Needs(one, two, both, (spread[0], spread[1]))
        have = draw.uniform(0.0, 3.0, 2)
        lack = needs.lack(*have)
        assert needs.covered(*(have + lack + 1e-9))
        assert not needs.covered(*(have + lack - 1e-9))


def test_what_both_devices_lack_does_not_make_up_for_each_other() -> None:
    """The product of two negative numbers is positive."""
    assert not Needs(1.0, 1.0, 0.5).covered(0.0, 0.0)
    assert not Needs(1.0, 1.0, 0.5).covered(3.0, 0.5)
    assert Needs(1.0, 1.0, 0.5).covered(1.5, 1.5)


@pytest.mark.parametrize("late", [1, 2, 5])
def test_one_end_that_acts_later_than_the_other(late: int) -> None:
    """N11 = N12 = L K, N21 = N22 = 0: n12 is the mean of both."""
    answers = np.zeros((late + 1, 2, 2))
    answers[late, 0], answers[0, 1] = (50.0, -50.0), (-50.0, 50.0)
    spring = spring_of(answers, T)
    assert spring is not None
    needs = clipped_needs(spring)
    step = 50.0 * T
    wanted = (step * (0.5 + late), step * 0.5, step * (0.5 + 0.5 * late))
    assert (needs.one, needs.two, needs.both) == pytest.approx(wanted)
    assert linear_lack(spring).damping <= needs.lack(0.0, 0.0) * 1.01


def test_what_a_cut_leaves_out_is_added_to_the_need() -> None:
    spring = Law(50.0, 2).spring()
    more = linear_lack(spring._replace(rest=3.0)).damping - linear_lack(spring).damping
    assert more == pytest.approx(2.0 * T * 3.0)


def test_answers_that_are_no_spring_are_refused() -> None:
    answers = Law(50.0, 2).answers()
    assert spring_of(answers, T) is not None
    for at, end, of, value in ((0, 0, 0, 1e-3), (2, 0, 1, -1e-3), (1, 1, 1, 5.0)):
        wrong = answers.copy()
        wrong[at, end, of] += value
        assert spring_of(wrong, T) is None
    assert spring_of(-answers, T) is None


def hearing(gain: float, belief: float, damper: float, line: int) -> Asked:
    """A damper on velocities that are filtered, and predicted from what was sent."""
    pole = 1.0 - gain
    size = line + math.ceil(math.log(1e-17) / math.log(pole)) + 4
    moved = gain * pole ** np.arange(size)
    velocity = np.diff(np.r_[0.0, moved]) / T
    heard = np.zeros(size)
    heard[1:] = -belief * (pole ** np.arange(1, size) + np.r_[0.0, pole ** np.arange(1, size - 1)])
    to_sample, to_effort = np.zeros((size, 2, 2)), np.zeros((size, 2, 2))
    for end in (0, 1):
        to_sample[:, end, end] = damper * velocity
        to_sample[line:, end, 1 - end] = -damper * velocity[: size - line]
        to_effort[:, end, end] = damper * heard
        to_effort[line:, end, 1 - end] = -damper * heard[: size - line]
        to_sample[0, end, end] += 30.0
        to_sample[line, end, 1 - end] -= 30.0
    return Asked(to_sample, to_effort, (pole, pole))


@pytest.mark.parametrize("line", [0, 3, 40])
@pytest.mark.parametrize(("gain", "belief", "damper"), [(0.5, 0.5, 0.1), (0.3, 0.05, 0.3)])
def test_a_cut_leaves_out_no_more_than_is_said(
    gain: float, belief: float, damper: float, line: int
) -> None:
    """Against answers of ten times the length."""
    asked = hearing(gain, belief, damper, line)
    found = closed_answers(asked)
    assert found is not None
    answers, rest = found
    longer = clipped_spring._closed(asked, 4 * len(answers))
    assert longer is not None
    size = float(np.max(np.abs(answers)))
    assert np.allclose(longer[: len(answers)], answers, rtol=0.0, atol=1e-12 * size)
    beyond = np.linalg.norm(longer[len(answers) :], axis=(1, 2))
    left = float(np.sum(np.arange(len(answers), len(longer)) * beyond))
    assert left <= rest
    assert rest <= 1e-7 * float(np.max(np.abs(asked.to_sample)))
    assert spring_of(answers, T, rest=rest) is not None


def test_a_law_that_hears_itself_too_loudly_is_given_up() -> None:
    assert closed_answers(hearing(0.05, 3.0, 0.3, 2)) is None


def test_one_end_that_hears_the_other_alone_comes_to_an_end() -> None:
    """Position-force: the master gets what was sent at the slave, a period later."""
    to_sample = Law(50.0).answers()
    to_effort = np.zeros((3, 2, 2))
    to_effort[1, 0, 1] = -1.0
    found = closed_answers(Asked(to_sample, to_effort, (0.0, 0.0)))
    assert found is not None
    answers, rest = found
    assert rest == 0.0
    assert answers[1, 0, 0] == pytest.approx(50.0)
    back = to_effort.copy()
    back[1, 1, 0] = -0.5
    assert closed_answers(Asked(to_sample, back, (0.0, 0.0))) is None
