"""Keys of a pair that may be left to its law."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from tautwave.config.keys.coupling import Gain


@pytest.mark.parametrize(
    ("value", "taken"),
    [("auto", "auto"), (0, 0.0), (0.0, 0.0), (3, 3.0), (-1e-9, None), (True, None), (False, None),
     (float("inf"), None), (float("nan"), None), ("none", None), (None, None), ([], None)],
)  # fmt: skip
def test_a_gain_is_auto_or_a_number_of_at_least_0(value: Any, taken: Any) -> None:
    gain = TypeAdapter(Gain)
    if taken is None:
        with pytest.raises(ValidationError, match="'auto' or a number of at least 0"):
            gain.validate_python(value)
    else:
        assert gain.validate_python(value) == taken
