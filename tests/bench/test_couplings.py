"""Drawn rigs: in an account no law gives more than its certificate states; bare ones do."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.bench.couplings.measure import run_coupling, stated_bound
from tautwave.bench.couplings.recorded import likenesses, median_ratio
from tautwave.bench.couplings.rigs import LAWS, bench_rig, drawn_rig, without_account
from tautwave.bench.couplings.suite import OWN_ACCOUNT
from tautwave.cli import main

DATA = Path(__file__).parents[3] / "shared" / "data" / "teleop-1dof"
QUICK = "{type: multisine, ramp_s: 0.01, components: [[2.0, 0.1, 0.0]]}"
LAWS_WITHOUT = [law for law in LAWS if law not in OWN_ACCOUNT]


@pytest.mark.parametrize("first", range(0, 100, 10))
def test_in_an_account_no_drawn_rig_gives_more_than_its_bound(first: int) -> None:
    for seed in range(first, first + 10):
        rig = drawn_rig(seed, account=True, seconds=0.08)
        found = run_coupling(rig, bound=stated_bound(rig), engine="python")
        assert found.excess <= 0.0, f"seed {seed}"


def test_a_law_that_makes_half_a_joule_makes_none_in_an_account() -> None:
    """Position over 20 ms each way: bare, it runs away within half a second."""
    bare, kept = (
        run_coupling(
            bench_rig("position", 0.02, account=it, contact="free", reference=QUICK, seconds=0.6),
            engine="python",
        )
        for it in (False, True)
    )
    assert bare.made > 0.3
    assert kept.made < 1e-3
    assert not kept.stopped


@pytest.mark.slow  # 160 rigs; numba compiles four laws, bare and in an account
@pytest.mark.timeout(600)
def test_no_law_in_an_account_gives_more_than_its_bound_and_bare_ones_do() -> None:
    bare = 0
    for seed in range(160):
        rig = drawn_rig(seed, account=True)
        bound = stated_bound(rig)
        assert run_coupling(rig, bound=bound).excess <= 0.0, f"seed {seed}"
        bare += run_coupling(without_account(rig), bound=bound).excess > 0.0
    assert bare >= 2


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("law", LAWS_WITHOUT)  # a law's kernels are compiled by one worker
def test_on_the_bench_an_account_takes_the_energy_and_leaves_the_law(law: str) -> None:
    """It tracks no worse than bare, where that is stable, and makes a millijoule at most."""
    for contact, delay in product(("free", "rigid"), (0.0, 0.01, 0.05)):
        bare, kept = (
            run_coupling(bench_rig(law, delay, account=it, contact=contact, seconds=3.0))
            for it in (False, True)
        )
        assert kept.made < 1e-3
        assert not kept.stopped
        if bare.made < 1e-3:
            assert 0.9 * bare.error < kept.error < 1.03 * bare.error


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_command_prints_both_tables() -> None:
    result = CliRunner().invoke(main, ["bench", "couplings", "--rigs", "3"])
    assert result.exit_code == 0, result.output
    assert "Rigs drawn at random" in result.output
    assert "four_channel" in result.output


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.skipif(not DATA.is_dir(), reason="no recordings")
def test_the_laboratorys_gains_make_the_laboratorys_error() -> None:
    found = likenesses(DATA)
    assert len(found) == 12
    assert median_ratio(found) == pytest.approx(1.0, abs=0.15)
    springs = [each.ratio for each in found if "spring" in each.name]
    assert springs == pytest.approx([1.0] * len(springs), abs=0.1)
