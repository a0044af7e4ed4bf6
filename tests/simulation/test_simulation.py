"""The face of the offline room: columns, errors, engines that are not there, timing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.config.shipped import find_example
from tautwave.errors import ConfigError
from tautwave.simulation import simulate, simulate_pieces
from tautwave.simulation.kernel import compiled
from tests.simulation.live import CONFIGS

RIG = load_rig(next(path for path in CONFIGS if path.stem == "bench-1dof-loopback"))


def test_columns_by_name() -> None:
    simulation = simulate(RIG, duration_s=0.1, engine="python")
    assert len(simulation) == 100
    assert simulation["time_s"][-1] == pytest.approx(0.099)
    assert simulation.error is None
    with pytest.raises(KeyError, match=r"did you mean 'master\.lever\.position'"):
        simulation["master.lever.positon"]
    with pytest.raises(FrozenInstanceError):
        simulation.data = simulation.data[:1]  # type: ignore[misc]


@pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_pieces_laid_end_to_end_are_the_whole(engine: str) -> None:
    """With slots skipped and samples lost, and the last piece shorter; and a second time."""
    faults = "{missing_probability: 0.02, overrun_probability: 0.02, overrun_slots: 3}"
    rig = load_rig(RIG.source, [f"simulation.faults={faults}"])
    whole = simulate(rig, duration_s=0.4, engine=engine)
    for _ in range(2):
        pieces = [
            piece.data.copy() for piece in simulate_pieces(rig, 77, duration_s=0.4, engine=engine)
        ]
        assert [len(piece) for piece in pieces[:-1]] == [77] * (len(whole) // 77)
        np.testing.assert_array_equal(np.concatenate(pieces), whole.data)


def test_the_last_piece_says_what_ended_it() -> None:
    rig = load_rig(RIG.source, ["master.axes.lever.velocity_limit=0.05"])
    pieces = [(len(piece), piece.error) for piece in simulate_pieces(rig, 100, engine="python")]
    whole = simulate(rig, engine="python")
    assert sum(count for count, _ in pieces) == len(whole) < 10_000
    assert str(pieces[-1][1]) == str(whole.error)
    assert "velocity" in str(whole.error)


def test_errors_say_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="unknown engine 'fortran'; engines: compiled, python"):
        simulate(RIG, engine="fortran")
    with pytest.raises(ConfigError, match="nothing to simulate; add a simulation block"):
        simulate(RIG.model_copy(update={"simulation": None}), engine="python")
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ConfigError, match=r"pip install 'tautwave\[fast\]'"):
        compiled.load_numba()


@pytest.mark.slow
def test_numba_is_not_imported_before_it_is_used() -> None:
    code = (
        "import sys; from tautwave import simulate, load_rig; "
        "simulate(load_rig(sys.argv[1]), duration_s=0.01, engine='python'); "
        "print(sorted({'numba', 'scipy', 'matplotlib'} & set(sys.modules)))"
    )
    said = subprocess.run(
        [sys.executable, "-c", code, str(RIG.source)], capture_output=True, text=True, check=True
    )
    assert said.stdout == "[]\n"


@pytest.mark.parametrize("name", ["bench-1dof-loopback", "scene-resonator"])
def test_rows_beyond_memory_are_one_sentence(name: str) -> None:
    """Of a billion seconds, which no machine holds."""
    with pytest.raises(ConfigError, match=r"1e.09 s at .* Hz are more rows than fit into memory"):
        simulate(load_rig(find_example(name).path), duration_s=1e9)
