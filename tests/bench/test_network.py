"""A pair over random networks: no energy with our receiver, and those in common use do not do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tautwave.bench.lines import suite as bench
from tautwave.bench.lines.patterns import RECEIVERS, draw_pattern, end_params, run_pattern
from tautwave.bench.lines.suite import WAYS, chosen_pattern
from tests.commands import tautwave

SHORT = {"rest": 0.15, "end": 0.25}


def reserves(seed: int) -> float:
    """Return what the ports have in reserve [J]: a port may lend it, a receiver may not add."""
    return sum(end_params(draw_pattern(seed), side, "play-out").port.reserve for side in (0, 1))


@pytest.mark.parametrize("law", ["play-out", "auto depth", "newest"])
def test_random_patterns_make_no_energy(law: str) -> None:
    for seed in range(6):
        outcome, _ = run_pattern(draw_pattern(seed)._replace(**SHORT), law, compiled=False)
        assert outcome.violations == 0
        assert outcome.excess <= 0.0
        assert outcome.made < reserves(seed)


def test_a_wave_that_is_held_makes_energy() -> None:
    for name in ("clean", "jitter 5 ms", "30 %, jitter, 5 % twice"):
        x = chosen_pattern(WAYS[name])._replace(**SHORT)
        outcome, _ = run_pattern(x, "hold-last", compiled=False)
        assert (outcome.excess > 1e-9) is (name != "clean"), name


def test_a_loss_is_not_felt_at_all_where_null_waves_lose_position() -> None:
    clean, lossy = (
        chosen_pattern(WAYS[name])._replace(rest=0.4, end=0.6) for name in ("clean", "loss 10 %")
    )
    _, undisturbed = run_pattern(clean, compiled=False)
    _, rows = run_pattern(lossy, compiled=False)
    assert np.abs(rows[:, :2] - undisturbed[:, :2]).max() < 1e-9
    _, nulls = run_pattern(lossy, "null packets", compiled=False)
    assert np.abs(nulls[:, :2] - undisturbed[:, :2]).max() > 5e-3


@pytest.mark.slow
def test_compiled_it_is_the_same_to_the_bit() -> None:
    for seed in range(8):
        for law in RECEIVERS:
            x = draw_pattern(seed)._replace(**SHORT)
            one, rows = run_pattern(x, law)
            two, same = run_pattern(x, law, compiled=False)
            assert one == two
            assert np.array_equal(rows, same)


@pytest.mark.slow
def test_a_thousand_patterns_are_passive_to_the_bit_and_the_test_can_fail() -> None:
    found = {law: [run_pattern(draw_pattern(s), law)[0] for s in range(1000)] for law in RECEIVERS}
    for law in ("play-out", "auto depth", "newest"):
        assert sum(o.violations for o in found[law]) == 0
        assert max(o.excess for o in found[law]) <= 0.0
        assert all(o.made < reserves(seed) for seed, o in enumerate(found[law]))
    made = {law: np.mean([o.excess > 1e-9 for o in found[law]]) for law in RECEIVERS}
    assert made["hold-last"] > 0.7
    assert made["null packets"] > 0.02
    assert made["fixed buffer"] > 0.02


@pytest.mark.slow
def test_the_table_shows_what_the_page_says(tmp_path: Path) -> None:
    done = tautwave("bench", "network", "--patterns", "20", "--hour", "--json", cwd=tmp_path)
    assert done.exit_code == 0
    shown = json.loads(done.output)
    assert all(goal["met"] for goal in shown["goals"])
    held = shown["tables"][-2]["rows"]
    assert all(abs(row["force_60_s"] / row["force_3_s"] - 1.0) < 0.01 for row in held)
    assert [row["offset_ppm"] for row in held] == pytest.approx([0.0, 100.0, -100.0])
    rows = {row["receiver"]: row for row in shown["tables"][3]["rows"]}
    assert shown["tables"][3]["title"] == "Tracking: loss 10 %"
    assert rows["play-out"]["rest_mrad"] < 0.05
    assert min(rows[law]["rest_mrad"] for law in ("null packets", "fixed buffer")) > 5.0
    for row in shown["tables"][-1]["rows"]:  # an hour: within an encoder step
        assert row["rest_mrad"] < 0.0209
        assert row["violations"] == 0
    assert len(shown["tables"]) == 3 + len(bench.WAYS)
