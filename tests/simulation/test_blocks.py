"""Numbers that compiled code shares with Python lie in views of one block."""

from __future__ import annotations

import numpy as np

from tautwave_scenes.simulation.blocks import put


def test_numbers_go_to_the_front_of_a_view_and_a_view_replaces_all_of_it() -> None:
    view = memoryview(np.array([7.0, 8.0, 9.0]))
    put(view, [1.0, 2.0])
    assert view.tolist() == [1.0, 2.0, 9.0]
    put(view, memoryview(np.array([3.0, 4.0, 5.0])))
    assert view.tolist() == [3.0, 4.0, 5.0]
