"""A law that is wrapped for every rig is the same law each time: it is compiled once."""

from __future__ import annotations

import pytest

from tautwave.controller.steps import Law
from tautwave.registry import load_named
from tautwave.rig import coupling_law, coupling_part
from tautwave.rig.controller import law_over_link
from tests.lab.couplings.rigs import LAWS, bench_rig


def laws(name: str) -> dict[str, Law]:
    """Return a rig's law as it is alone, over a network and at both of two sites."""
    wrapped = not name.startswith("wave")
    part = coupling_part(rig := bench_rig(name, 0.01, account=wrapped, contact="free", seconds=1.0))
    sites = load_named(part.at_sites)
    return {
        "alone": coupling_law(rig),
        "over a network": law_over_link(part),
        **{side: site.law for side, site in sites.items()},
    }


@pytest.mark.parametrize("name", LAWS)
def test_another_rig_with_the_same_law_has_the_same_steps(name: str) -> None:
    one, other = laws(name), laws(name)
    for where, law in one.items():
        assert law.steps == other[where].steps, where
        assert law.end is other[where].end, where
        assert law.link is other[where].link, where
        assert law.elements is other[where].elements, where
    assert len({law.steps for law in one.values()}) == len(one)  # and none for another
