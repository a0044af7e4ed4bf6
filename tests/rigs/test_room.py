"""What README.md says of its rig, and a tutorial of the same levers over 20 ms."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tautwave.certificate import certify
from tautwave.certificate.haptics.feel import rig_feel
from tautwave.config import Rig, load_rig
from tautwave.simulation import Simulation, simulate
from tests.certificate.rigs import CONFIGS
from tests.lab.couplings.frontier import LAWS_OF_LAB
from tests.lab.port.tracking import ABOVE_HZ, rms

ROOM = CONFIGS / "bench-room-loopback.yaml"
README = CONFIGS.parent / "README.md"
TUTORIAL = CONFIGS.parent / "docs/tutorials/delay-and-waves.md"


def room(*settings: str) -> Rig:
    return load_rig(ROOM, settings)


def loud(run: Simulation, period: float) -> float:
    """Return both motors' efforts above 20 Hz [N m]."""
    found = []
    for side in ("master", "slave"):
        values = run[f"{side}.lever.commanded"]
        parts = np.fft.rfft(values - np.mean(values))
        parts[np.fft.rfftfreq(len(values), period) < ABOVE_HZ] = 0.0
        found.append(rms(np.fft.irfft(parts, len(values))))
    return rms(np.array(found))


def errors_of(run: Simulation) -> tuple[float, float]:
    """Return the position error, rms and greatest [mrad]."""
    error = run["lever.position_error"]
    return 1e3 * rms(error), 1e3 * float(np.max(np.abs(error)))


def said(page: str, pattern: str) -> list[float]:
    """Return the numbers of the sentence of a page."""
    found = re.search(pattern, page.replace("\n", " "))
    assert found is not None, pattern
    return [float(one) for one in found.groups()]


def rounded(value: float, like: float) -> float:
    return round(value, len(str(like).partition(".")[2].rstrip("0")))


def agree(numbers: list[float], values: list[float]) -> None:
    assert numbers == [rounded(one, like) for one, like in zip(values, numbers, strict=True)]


@pytest.mark.slow
def test_readme_has_the_numbers_of_its_run() -> None:
    rig, page = room(), README.read_text(encoding="utf-8")
    run, felt = simulate(rig, engine="python"), rig_feel(rig)[0][0]
    assert felt.stiffness is not None
    assert felt.drag is not None
    agree(
        said(page, r"levers are ([\d.]+) mrad \(rms\) apart, (\d+) at most"),
        [*errors_of(run)],
    )
    agree(
        said(page, r"of 250 N m/rad the hand feels (\d+); in the air it feels (\d+) mN m"),
        [felt.stiffness, 1e3 * felt.drag],
    )


@pytest.mark.slow
def test_the_tutorial_has_the_numbers_of_both_laws_over_20_ms() -> None:
    page = TUTORIAL.read_text(encoding="utf-8")
    for pattern, law in (
        (
            r"levers (\d+) mrad \(rms\) apart, .*? feels like (\d+)\. .*? with (\d+) mrad",
            (),
        ),
        (
            r"hold them exactly, but (\d+) mrad \(rms\) .*? feel like (\d+)\.",
            ("coupling.law=wave",),
        ),
    ):
        rig = room("coupling.delay_s=0.02", *law)
        error, worst = errors_of(simulate(rig, engine="python"))
        stiffness = rig_feel(rig)[0][0].stiffness
        assert stiffness is not None
        numbers = said(page, pattern)
        agree(numbers, [error, stiffness, worst][: len(numbers)])


@pytest.mark.slow
def test_two_levers_in_a_room_are_close_and_quiet() -> None:
    rig = room()
    assert rig.coupling.law == "wave"
    assert certify(rig).passed
    run = simulate(rig, engine="python")
    assert run.error is None
    assert rms(run["lever.position_error"]) < 12e-3
    assert np.max(np.abs(run["lever.position_error"])) < 20e-3
    walls = rig.coupling.pairs["lever"]
    inner = ", ".join(
        f"{key}: {{position: {wall.position}, stiffness: {wall.stiffness}, "
        f"damping: {wall.damping}, side: {wall.side}}}"
        for key, wall in (("wall_master", walls.wall_master), ("wall_slave", walls.wall_slave))
        if wall is not None
    )
    block = LAWS_OF_LAB["cf"].block.replace("lever: {", f"lever: {{{inner}, ")
    lab = simulate(room(f"coupling={block}"), engine="python")
    assert loud(run, rig.period_s) < 1.5 * loud(lab, rig.period_s)


@pytest.mark.slow
def test_over_twenty_milliseconds_it_is_a_rendered_model() -> None:
    rig = room("coupling.delay_s=0.02")
    assert rig.coupling.law == "mediated"
    assert certify(rig).passed
    run = simulate(rig, engine="python")
    assert run.error is None
    error = rms(run["lever.position_error"])
    assert error < 14e-3
    line = simulate(room("coupling.delay_s=0.02", "coupling.law=wave"), engine="python")
    assert 2.0 * error < rms(line["lever.position_error"])
