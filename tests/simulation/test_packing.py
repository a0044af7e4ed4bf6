"""What is computed of a rig before it is simulated: once."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from types import FrameType

from tautwave import load_rig
from tautwave.simulation.kernel.pack import pack_rig, rig_facts

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
ONCE = ("tank_leak", "coupled_axis", "axis_params", "site_params")


def calls_of(work: object) -> Counter[str]:
    """Return how often each function is called in `work()`."""
    found: Counter[str] = Counter()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            found[frame.f_code.co_name] += 1

    assert callable(work)
    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return found


def test_constants_of_an_axis_are_computed_once_to_simulate_it() -> None:
    rig = load_rig(BENCH)
    found = calls_of(lambda: pack_rig(rig, 0.1))
    assert {name: found[name] for name in ONCE} == dict.fromkeys(ONCE, len(rig.axes))
    assert found["build_rig"] == 1


def test_a_rig_that_was_built_before_gets_the_same_constants() -> None:
    rig = load_rig(BENCH, ["master.axes.lever.velocity_filter_s=0.003"])
    alone, with_facts = pack_rig(rig, 0.1), pack_rig(rig, 0.1, rig_facts(rig))
    assert alone.params == with_facts.params
    assert alone.pairs == with_facts.pairs


def test_axes_are_put_together_once_and_anew_for_a_copy_with_another_side() -> None:
    rig = load_rig(BENCH)
    assert rig.axes is rig.axes
    axis = rig.master.axes["lever"].model_copy(update={"effort_limit": 0.125})
    side = rig.master.model_copy(update={"axes": {"lever": axis}})
    assert rig.model_copy(update={"master": side}).axes["master.lever"] is axis
    assert rig.model_copy() == rig
    assert rig.axes["master.lever"] is not axis
