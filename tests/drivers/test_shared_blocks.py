"""A bus' block has two readers, its driver and its simulated devices: they take it alike."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from tautwave.registry import load_driver, load_simulator


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Return the models that an annotation names, whatever is around them."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [one for part in get_args(annotation) for one in models_in(part)]


def shared(
    simulated: type[BaseModel], real: type[BaseModel], place: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Yield every key that both models have and the driver does not require, and its defaults."""
    for name in sorted(simulated.model_fields.keys() & real.model_fields.keys()):
        here, there = simulated.model_fields[name], real.model_fields[name]
        inner = models_in(here.annotation), models_in(there.annotation)
        if all(inner):
            yield from shared(inner[0][0], inner[1][0], f"{place}{name}.")
        elif name != "simulator" and not there.is_required():
            yield f"{place}{name}", here.get_default(), there.get_default()


OWN = {"servos.zero_counts": (None, 2048)}
"""Other models than those of the driver can be simulated, and have their middle elsewhere."""


@pytest.mark.parametrize("driver", ["canopen", "dynamixel", "modbus"])
def test_what_is_left_out_means_the_same_to_both(driver: str) -> None:
    simulated, real = load_simulator(driver).options, load_driver(driver).options
    found = {key: (one, other) for key, one, other in shared(simulated, real)}
    apart = {key: both for key, both in found.items() if both[0] != both[1]}
    assert apart == {key: both for key, both in OWN.items() if key in found}
    assert len(found) > 5
