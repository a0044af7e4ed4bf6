"""`bench loop --rate`: what it measures and says, at a rate and a length that any machine keeps."""

from __future__ import annotations

from tautwave.bench.live.rate import measure, pairs_rig, rate_suite


def test_pairs_are_alike_but_for_their_names() -> None:
    rig = pairs_rig(6, 4000, "python")
    assert len(rig.coupling.pairs) == 6
    assert len({str(pair) for pair in rig.coupling.pairs.values()}) == 1
    assert rig.rate_hz == 4000.0
    assert pairs_rig(1, 1000, "compiled").loop.engine == "compiled"


def test_a_case_is_measured_beside_an_empty_loop() -> None:
    found = measure(0.1, 2, pairs=(1,), rates_hz=(1000,), engines=("python",))
    [case] = found["cases"]
    assert set(case["missed_share"]) == {"python", "empty"}
    share = case["compute_share"]["python"]
    assert 0.0 < share["p50"] <= share["p99"] <= share["p999"]
    assert found["seconds"] == 0.2


def test_goals_are_those_of_the_compiled_loop() -> None:
    quick = {"p50": 0.1, "p99": 0.2, "p999": 0.3, "max": 0.9}
    cases = [
        {
            "pairs": pairs,
            "rate_hz": rate,
            "missed_share": {"python": 0.5, "compiled": missed, "empty": empty},
            "compute_share": {"python": quick, "compiled": quick},
        }
        for pairs, rate, missed, empty in ((1, 10000, 0.002, 0.001), (6, 4000, 0.0, 0.0),
                                           (2, 1000, 0.0, 0.0))
    ]  # fmt: skip
    suite = rate_suite({"cases": cases, "seconds": 1.0, "realtime": ["not requested"]})
    assert len(suite.tables[0].rows) == 6
    assert [goal.measured for goal in suite.goals] == [30.0, 2.0, 30.0, 0.0]
    assert [goal.met for goal in suite.goals] == [True, False, True, True]
