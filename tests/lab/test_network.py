"""A pair over random networks: no energy with our receiver, and those in common use do not do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.errors import ConfigError
from tests.lab.command import lab
from tests.lab.lines import many
from tests.lab.lines import suite as bench
from tests.lab.lines.patterns import (
    RECEIVERS,
    Outcome,
    Pattern,
    draw_pattern,
    end_params,
    run_pattern,
)
from tests.lab.lines.suite import MAKERS, WAYS, chosen_pattern

SHORT = {"rest": 0.15, "end": 0.25}


def reserves(seed: int) -> float:
    """Return what the ports have in reserve [J]: a port may lend it, a receiver may not add."""
    return sum(end_params(draw_pattern(seed), side, "play-out").port.reserve for side in (0, 1))


@pytest.mark.parametrize("law", ["play-out", "auto depth", "newest"])
def test_random_patterns_make_no_energy(law: str) -> None:
    for seed in range(3):
        outcome, _ = run_pattern(draw_pattern(seed)._replace(**SHORT), law, compiled=False)
        assert outcome.violations == 0
        assert outcome.excess <= 0.0
        assert outcome.made < reserves(seed)


THROUGH = {"rest": 0.8, "end": 1.2}
"""Most outages are over by then [s]."""


@pytest.mark.parametrize(
    "seeds", [range(200), pytest.param(range(200, 1000), marks=pytest.mark.slow)], ids=str
)
def test_random_pairs_make_no_energy(seeds: range) -> None:
    pytest.importorskip("numba")  # as in Python, to the bit: below
    for seed in seeds:
        x = draw_pattern(seed)._replace(**THROUGH)
        outcome, _ = run_pattern(x, many.OURS[seed % len(many.OURS)])
        assert outcome.violations == 0, seed
        assert outcome.excess <= 0.0, seed
        assert outcome.made < reserves(seed), seed


@pytest.mark.slow
def test_with_receivers_in_common_use_they_do() -> None:
    pytest.importorskip("numba")
    makers = {
        law: sum(
            run_pattern(draw_pattern(seed)._replace(**THROUGH), law)[0].excess > many.MADE
            for seed in range(100)
        )
        for law in MAKERS
    }
    assert makers["hold-last"] > 50
    assert makers["null packets"] > 2
    assert makers["fixed buffer"] > 2


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
@pytest.mark.nightly
def test_compiled_it_is_the_same_to_the_bit() -> None:
    for seed in range(8):
        for law in RECEIVERS:
            x = draw_pattern(seed)._replace(**SHORT)
            one, rows = run_pattern(x, law)
            two, same = run_pattern(x, law, compiled=False)
            assert one == two
            assert np.array_equal(rows, same)


@pytest.mark.slow
@pytest.mark.nightly
def test_hundreds_of_patterns_are_passive_to_the_bit_and_the_test_can_fail() -> None:
    found = many.run_many(0, 300, jobs=1)
    for law in many.OURS:
        assert found[law].patterns == 300
        assert found[law].violations == 0
        assert found[law].excess <= 0.0
        assert found[law].made < 0.1  # no more than the ports have in reserve
    assert found["hold-last"].makers > 210
    assert found["null packets"].makers > 6
    assert found["fixed buffer"].makers > 6


def test_what_is_done_is_kept_and_not_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[int] = []
    most = 40

    def run(x: Pattern, receiver: str = "play-out") -> tuple[Outcome, None]:
        if len(ran) == most:
            raise KeyboardInterrupt
        ran.append(x.seed)
        made = 1e-3 if receiver == "hold-last" else -1e-6
        return Outcome(
            int(receiver == "newest"), made, 0.0, 0.0, 1e-4 * x.seed, 0.0, 0.0, 0.0
        ), None

    monkeypatch.setattr(many, "PIECE", 2)
    monkeypatch.setattr(many, "MOST", 3)
    monkeypatch.setattr(many, "run_pattern", run)
    keep = tmp_path / "patterns.jsonl"
    with pytest.raises(KeyboardInterrupt):
        many.run_many(0, 12, keep=keep)
    with keep.open("a") as file:
        file.write('{"command": "cut of')
    ran.clear()
    most = 1000
    found = many.run_many(0, 12, keep=keep)
    assert 0 < len(ran) < 20
    assert found == many.run_many(0, 12)
    assert [found[law].patterns for law in RECEIVERS] == [12, 12, 12, 3, 3, 3]
    assert found["newest"].violations == 12
    assert found["hold-last"].makers == 3
    keep.write_text("{}\n")
    with pytest.raises(ConfigError, match=r"patterns\.jsonl:1: no piece of"):
        many.run_many(0, 12, keep=keep)


@pytest.mark.slow
@pytest.mark.nightly
def test_the_table_shows_what_the_page_says() -> None:
    done = CliRunner().invoke(lab, ["network", "--patterns", "100", "--hour", "--json"])
    assert done.exit_code == 0
    shown = json.loads(done.output)
    assert all(goal["met"] for goal in shown["goals"] if goal["measured"] is not None)
    held = shown["tables"][-2]["rows"]
    kept = [row["force_120_s"] / row["force_3_s"] for row in held]
    assert kept == [pytest.approx(1.0, abs=0.015)] * 5  # 100 ppm creep a little
    assert held[-1]["network"] == "outage 0.5 s"
    assert [row["offset_ppm"] for row in held] == pytest.approx([0.0, 100.0, -100.0, 0.0, 0.0])
    rows = {row["receiver"]: row for row in shown["tables"][3]["rows"]}
    assert shown["tables"][3]["title"] == "Tracking: loss 10 %"
    assert rows["play-out"]["rest_mrad"] < 0.05
    assert min(rows[law]["rest_mrad"] for law in ("null packets", "fixed buffer")) > 5.0
    for row in shown["tables"][-1]["rows"]:  # an hour
        assert row["rest_mrad"] <= row["allowed_mrad"]
        assert row["violations"] == 0
    assert len(shown["tables"]) == 3 + len(bench.WAYS)
