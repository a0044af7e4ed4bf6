"""A dataset is in one frame: replayed on the simulated slave, it does what the episodes did."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from tautwave import load_rig, simulate
from tests.commands import keep_in_one_process, tautwave

pq = pytest.importorskip("pyarrow.parquet")

CONFIG = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
FPS = 250
PAIR = ("coupling.pairs.lever.wall_master=null", "coupling.pairs.lever.wall_slave=null")
CHANGES = (
    *PAIR, "operate={}", "simulation.environment={}", "coupling.pairs.lever.sign=-1",
    "coupling.pairs.lever.position_scale=0.5", "operate.scales=[0.8]",
    "coupling.pairs.lever.pole_slave=0.0",
    "simulation.hand.lever.reference.waypoints=[[0.5, 0], [1.5, 0.3], [2.2, 0.3], [3.0, 0.05],"
    " [4.2, 0.05], [4.9, 0.28]]",
)  # fmt: skip
SCRIPT = """\
0.1 engage
0.45 episode first
1.8 episode success
2.0 clutch
3.1 engage
3.8 scale 0.8
4.0 episode second
5.2 episode success
"""


def columns(values: object) -> np.ndarray:
    return np.array(values.to_pylist())[:, 0]  # type: ignore[attr-defined]


@pytest.mark.slow
def test_a_dataset_replayed_on_the_slave_is_the_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    (tmp_path / "script").write_text(SCRIPT)
    words = [word for one in CHANGES for word in ("--set", one)]
    run = ("run", CONFIG, *words, "--clock", "fake", "--duration", 5.4, "--commands", "script")
    done = tautwave(*run, "--out", "run", "--quiet", cwd=tmp_path)
    assert done.exit_code == 0, done.output
    words = ("--to", "lerobot", "--fps", FPS, "--task", "follow", "--out", "set")
    done = tautwave("export", "run", *words, cwd=tmp_path)
    assert done.exit_code == 0, done.output
    table = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    number = np.array(table["episode_index"].to_pylist())
    action, state, leader = (
        columns(table[name]) for name in ("action", "observation.state", "leader")
    )
    assert set(number) == {0, 1}
    for episode in (0, 1):
        rows = number == episode
        asked, was = action[rows], state[rows]
        error = np.max(np.abs(asked - was))
        assert error < 0.2 * np.ptp(was)  # the pair held, and the slave moved
        with open(tmp_path / "asked.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["time_s", "x"])
            writer.writerows((k / FPS, x) for k, x in enumerate(asked))
        device = f"{{id: 1, file: {tmp_path / 'asked.csv'}, position: x, repeat: false}}"
        rig = load_rig(
            CONFIG,
            [
                *PAIR, "simulation.environment={}", "simulation.hand={}",
                f"buses.hand={{driver: replay, options: {{devices: [{device}]}}}}",
                "simulation.axes={slave.lever: {inertia: 2.1e-3, damping: 4e-3, coulomb: 2e-3}}",
                # 2 x force at half the motion: the line's impedance as the slave has it
                "coupling.pairs.lever.wave_impedance=0.08", "coupling.pairs.lever.pole_slave=0.0",
                f"duration_s={(len(asked) - 1) / FPS}",
            ],
        )  # fmt: skip
        again = simulate(rig)
        # As a replay has the master's place, the offset is the action's own: none.
        x = again["slave.lever.position"][:: round(rig.rate_hz / FPS)][: len(was)]
        far = np.max(np.abs(x - was[: len(x)]))
        assert far <= error, (episode, far, error)
        # What the leader's own coordinates would have asked is elsewhere.
        assert np.max(np.abs(leader[rows] - was)) > 5.0 * error


@pytest.mark.slow
def test_tables_have_the_target_beside_what_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep_in_one_process(monkeypatch)
    (tmp_path / "script").write_text(SCRIPT.replace("1.8 episode success", "1.0 hold"))
    words = [word for one in CHANGES for word in ("--set", one)]
    run = ("run", CONFIG, *words, "--clock", "fake", "--duration", 1.4, "--commands", "script")
    assert tautwave(*run, "--out", "run", "--quiet", cwd=tmp_path).exit_code == 0
    done = tautwave("export", "run", "--out", "table", cwd=tmp_path)
    assert done.exit_code == 0, done.output
    with open(tmp_path / "table/001-first.csv", newline="") as file:
        rows = [{name: float(x) for name, x in row.items()} for row in csv.DictReader(file)]
    held = [row for row in rows if row["operation.state"] == 2.0]
    with open(tmp_path / "table/episodes.csv", newline="") as file:
        (index,) = csv.DictReader(file)
    assert (int(index["rows"]), int(index["engaged_rows"])) == (len(rows), len(held))
    assert 0 < len(held) < len(rows)
    offset = {round(r["slave.lever.target"] + 0.5 * r["master.lever.position"], 9) for r in held}
    assert len(offset) == 1  # of this engagement
