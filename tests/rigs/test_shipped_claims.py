"""What a shipped rig may supply means something to a person, or its file says why not."""

from __future__ import annotations

import math
import re

import pytest

from tautwave.config import load_rig
from tautwave.rig import command_delays, coupling_part, watchdogs
from tautwave.session.claims import claims_of
from tests.certificate.rigs import CONFIGS

AT_LINES = re.compile("law: (wave|auto)")
RIGS = sorted(path for path in CONFIGS.glob("*.yaml") if AT_LINES.search(path.read_text()))
IN_ARMS = (CONFIGS / "arms").glob("*.yaml")
ARMS = sorted(path for path in IN_ARMS if AT_LINES.search(path.read_text()))


@pytest.mark.parametrize(
    "path",
    [*RIGS, *(pytest.param(path, marks=pytest.mark.slow) for path in ARMS)],
    ids=lambda path: path.stem,
)
def test_every_claim_passes_or_its_file_says_why_not(path) -> None:
    """Prompt at most twice the kinetic energy, and a lever let go in a stall once, or a comment."""
    rig = load_rig(path)
    claims = [one for one in claims_of(rig, command_delays(rig)) if one.kinetic_j]
    lines = (line.strip() for line in path.read_text().splitlines())
    comments = " ".join(line.lstrip("# ") for line in lines if line.startswith("#"))
    assert claims
    assert {one.judged for one in claims} <= {"passed", "conditional"}
    assert all(one.judged == "passed" for one in claims) is ("says conditional" not in comments)
    for one in claims:
        if one.judged == "passed":
            assert one.stated.let_go_j <= one.kinetic_j * (1.0 + 1e-9)
            assert one.stated.prompt_j <= 2.0 * one.kinetic_j


WHOLE = (
    "bench-1dof-2khz", "bench-1dof-2khz-noisy", "bench-1dof-loopback", "bench-2axis-loopback",
    "bench-admittance-loopback", "bench-canopen-virtual", "bench-foam-loopback",
    "bench-modbus-rtu-sim", "bench-stiff-wall-loopback", "network-loopback",
)  # fmt: skip
"""Rigs whose host has all the time to stall that their efforts allow."""


@pytest.mark.parametrize("name", WHOLE)
def test_stalls_are_as_long_as_the_whole_effort_allows(name: str) -> None:
    """A slot more, and some axis would be without the bound."""
    path = CONFIGS / f"{name}.yaml"
    longer = load_rig(path).overrun_limit + 1
    more = load_rig(path, [f"loop.overrun_limit={longer}"])
    found = [one for one in claims_of(more, command_delays(more)) if one.kinetic_j]
    assert any(one.stated.let_go_j > one.kinetic_j for one in found)


def test_no_claim_of_a_shipped_rig_is_unbounded() -> None:
    for path in RIGS:
        rig = load_rig(path)
        assert coupling_part(rig).claim_terms
        assert all(math.isfinite(one.claim_j) for one in claims_of(rig, command_delays(rig)))


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("xl330-pair", 0.1, 0.3), ("xm430-pair", 1.0, 1.3), ("epos4-pair", 0.2, 0.3)],
)
def test_a_dead_host_gives_what_the_watchdog_of_the_drive_lets(
    name: str, least: float, most: float
) -> None:
    """F (v h + F h**2 / 2m) with h the drive's time-out, a command delay and half of the ramp."""
    rig = load_rig(CONFIGS / f"{name}.yaml")
    delays, watched = command_delays(rig), watchdogs(rig)
    for one in claims_of(rig, delays):
        axis, delay = rig.axes[one.axis], delays[one.axis]
        period = rig.axis_period_s(one.axis)
        late = delay.periods * period + delay.remainder_s
        held = watched[one.axis] + late + 0.5 * axis.effort_limit / axis.effort_rate_limit
        drawn = axis.velocity_limit * held
        driven = 0.5 * axis.effort_limit * held**2 / axis.inertia.lower
        assert one.stated.dead_j == pytest.approx(axis.effort_limit * (drawn + driven), rel=0.1)
        assert least < one.stated.dead_j < most


def test_devices_in_the_process_of_the_host_end_with_it() -> None:
    rig = load_rig(CONFIGS / "bench-modbus-tcp-sim.yaml")
    master, slave = claims_of(rig, command_delays(rig))
    assert watchdogs(rig).keys() == {"slave.lever"}
    assert master.stated.dead_j is None
    assert slave.stated.dead_j > slave.stated.stall_j
    unwatched = load_rig(CONFIGS / "dsy-rs-pair.yaml")
    assert {one.stated.dead_j for one in claims_of(unwatched, command_delays(unwatched))} == {
        math.inf
    }
