"""The face of the offline room: columns, errors, engines that are not there, timing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import FrozenInstanceError

import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave.simulation import simulate
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


def test_errors_say_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="unknown engine 'fortran'; engines: compiled, python"):
        simulate(RIG, engine="fortran")
    with pytest.raises(ConfigError, match="nothing to simulate; add a simulation block"):
        simulate(RIG.model_copy(update={"simulation": None}), engine="python")
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(ConfigError, match=r"pip install 'tautwave\[fast\]'"):
        compiled.load_numba()


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
