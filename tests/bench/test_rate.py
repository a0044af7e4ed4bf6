"""`bench loop --rate`: what it measures and says, at a rate and a length that any machine keeps."""

from __future__ import annotations

import json

import pytest

from tautwave.bench.live import child, rate
from tautwave.bench.live.rate import measure, pairs_rig, rate_suite
from tautwave.config import Rig, parse_rig
from tautwave.errors import TautwaveError


def test_pairs_are_alike_but_for_their_names() -> None:
    rig = pairs_rig(6, 4000, "python")
    assert len(rig.coupling.pairs) == 6
    assert len({str(pair) for pair in rig.coupling.pairs.values()}) == 1
    assert rig.rate_hz == 4000.0
    assert pairs_rig(1, 1000, "compiled").loop.engine == "compiled"


@pytest.mark.slow
def test_a_case_is_measured_beside_an_empty_loop() -> None:
    found = measure(0.1, 2, pairs=(1,), rates_hz=(1000,), engines=("python",))
    [case] = found["cases"]
    assert set(case["missed_share"]) == {"python", "counting", "empty"}
    share = case["compute_share"]["python"]
    assert 0.0 < share["p50"] <= share["p99"] <= share["p999"]
    counted = case["compute_share"]["counting"]
    assert 0.0 < counted["p50"] <= counted["p99"] <= counted["p999"]
    assert found["seconds"] == 0.2


@pytest.mark.slow
def test_a_run_that_a_guard_ends_counts_until_then_and_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plain = pairs_rig

    def slowed(pairs: int, rate_hz: int, engine: str) -> Rig:
        given = plain(pairs, rate_hz, engine).model_dump(mode="json", exclude_unset=True)
        given["master"]["axes"]["lever1"]["velocity_limit"] = 0.05
        reference = given["simulation"]["hand"]["lever1"]["reference"]
        reference["waypoints"] = [[0.02, 0.0], [0.1, 0.5]]
        return parse_rig(json.dumps(given))

    monkeypatch.setattr(rate, "pairs_rig", slowed)
    found = measure(0.3, 1, pairs=(1,), rates_hz=(1000,), engines=("python",))
    [reason] = found["cases"][0]["stopped"]["python"]
    assert "master.lever1" in reason
    [table] = rate_suite(found).tables
    assert table.rows[0][-1] == 1
    assert reason in table.what
    assert "1 run was ended early" in table.what


def test_a_measuring_process_that_fails_is_one_sentence() -> None:
    with pytest.raises(TautwaveError, match=r"its measuring process nothing.*No mod"):
        child._answer("nothing.here")


def test_goals_are_those_of_the_compiled_loop() -> None:
    slow = {"p50": 0.1, "p99": 0.2, "p999": 0.6, "max": 0.9}
    quick = {"p50": 0.1, "p99": 0.2, "p999": 0.3, "max": 0.9}
    cases = [
        {
            "pairs": pairs,
            "rate_hz": rate,
            "missed_share": {
                "python": 0.5, "compiled": missed, "counting": empty, "empty": empty
            },
            "compute_share": {"python": quick, "compiled": quick, "counting": slow},
            "stopped": {"python": [], "compiled": [], "counting": []},
        }
        for pairs, rate, missed, empty in ((1, 10000, 0.002, 0.001), (6, 4000, 0.0, 0.0),
                                           (2, 1000, 0.0, 0.0))
    ]  # fmt: skip
    suite = rate_suite({"cases": cases, "seconds": 1.0, "realtime": ["not requested"]})
    assert len(suite.tables[0].rows) == 9
    assert [goal.measured for goal in suite.goals] == [30.0, 0.5, 2.0, 30.0, 0.5, 0.0]
    assert [goal.met for goal in suite.goals] == [True, True, False, True, True, True]
