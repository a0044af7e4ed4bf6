"""What a run refuses before it begins, and how it tells what devices reported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError, DriverError
from tautwave.session.certified import certificate_of
from tautwave.session.running import run
from tests.commands import keep_in_one_process

CONFIGS = Path(__file__).parents[2] / "configs"
RIG = CONFIGS / "bench-canopen-virtual.yaml"
HARDWARE = CONFIGS / "xm430-pair.yaml"


def test_a_run_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "canopen", None)
    reported = r"driver 'canopen' needs canopen; pip install 'tautwave\[canopen\]'"
    with pytest.raises(ConfigError, match=reported):
        run(load_rig(RIG), out=tmp_path / "out", clock="fake")
    assert not list(tmp_path.iterdir())


def test_a_fault_is_reported_with_its_axis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keep_in_one_process(monkeypatch)
    faults = "buses.can.options.simulator={nodes: {2: {fault_at_s: 0.5}}}"
    result = run(load_rig(RIG, [faults]), out=tmp_path / "out", clock="fake", duration_s=1.0)
    assert result.exit_code == 5
    assert result.summary.axes["master.lever"].faults == ()
    reported = result.summary.axes["slave.lever"].faults
    assert reported
    assert all(one.text.startswith("slave.lever") for one in reported)
    assert all(one in result.summary.faults for one in reported)


@pytest.mark.slow
def test_a_bus_that_is_refused_leaves_no_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    rig = load_rig(HARDWARE, ["buses.servos.options.port=/dev/no-such-port"])
    (tmp_path / "mine.txt").write_text("precious")
    for out in (tmp_path / "new" / "out", tmp_path):
        with pytest.raises(DriverError, match="/dev/no-such-port: no such device"):
            run(rig, out=out, allow_uncertified=True, allow_unwatched=True)
        assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(("given", "threads"), [(None, "1"), ("3", "3")])
def test_the_certificate_computes_on_one_thread_unless_told(
    monkeypatch: pytest.MonkeyPatch, given: str | None, threads: str
) -> None:
    """More wait for each other: ten times as long on a busy machine, beyond the limit."""
    asked: dict[str, str] = {}

    def computed(*_: object, env: dict[str, str], **__: object) -> object:
        asked.update(env)
        return subprocess.CompletedProcess([], 0, '{"passed": true}', "")

    monkeypatch.setattr(subprocess, "run", computed)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    if given is not None:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", given)
    assert certificate_of(load_rig(RIG), {})["passed"]
    assert asked["OPENBLAS_NUM_THREADS"] == threads


def test_a_simulated_run_of_more_than_a_day_is_not_called_endless(tmp_path: Path) -> None:
    long = load_rig(CONFIGS / "bench-1dof-loopback.yaml", ["duration_s=1e6"])
    with pytest.raises(ConfigError, match=r"duration_s is 1e\+06 s: .* less than a day"):
        run(long, out=tmp_path / "out", clock="fake")
