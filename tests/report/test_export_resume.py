"""`tautwave export --to lerobot --resume`: a dataset that goes on is that of all runs at once."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.report.export.lerobot_resume import together
from tests.report.test_export_lerobot import RIG, export, filmed, recorded

pq = pytest.importorskip("pyarrow.parquet")


def files_of(root: Path) -> dict[str, bytes]:
    return {
        str(one.relative_to(root)): one.read_bytes() for one in root.rglob("*") if one.is_file()
    }


def frames_of(root: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for one in sorted(root.glob("data/*/*.parquet")):
        for key, values in pq.read_table(one).to_pydict().items():
            found.setdefault(key, []).extend(values)
    return found


def episodes_of(root: Path) -> list[dict[str, Any]]:
    (path,) = root.glob("meta/episodes/*/*.parquet")
    found: list[dict[str, Any]] = pq.read_table(path).to_pylist()
    return [{key: one[key] for key in one if not key.startswith("data/")} for one in found]


def test_a_dataset_that_goes_on_is_that_of_all_runs_at_once(tmp_path: Path) -> None:
    """Numbers, tasks, statistics and what was left out, after each of three runs."""
    runs = [
        recorded(tmp_path / "a", success=True),
        recorded(tmp_path / "b", states={4: range(20, 30)}),
        recorded(tmp_path / "c", success=False),
    ]
    out, once = tmp_path / "out", tmp_path / "once"
    first, *others = runs
    assert export(first, "--task", "rest", "--fps", 20, "--out", out)[0] == 0
    for run in others:
        before = files_of(out)
        code, said = export(run, "--task", "rest", "--out", out, "--resume")
        assert code == 0, said
        assert "added 2 episodes" in said
        old = [name for name in before if name.startswith("data/")]
        assert {name: files_of(out)[name] for name in old} == {name: before[name] for name in old}
    assert "now 6 episodes" in said
    assert export(*runs, "--task", "rest", "--fps", 20, "--out", once)[0] == 0
    assert frames_of(out) == frames_of(once)
    assert episodes_of(out) == episodes_of(once)
    for name in ("meta/stats.json", "meta/info.json", "meta/tautwave.json", "README.md"):
        assert (out / name).read_text() == (once / name).read_text(), name
    code, said = export(recorded(tmp_path / "d"), "--task", "wait", "--out", out, "--resume")
    assert pq.read_table(out / "meta/tasks.parquet").to_pydict() == {
        "task_index": [0, 1, 2], "task": ["lift it", "rest", "wait"]
    }  # fmt: skip
    assert frames_of(out)["task_index"][-1] == 2
    assert not list(tmp_path.glob("out.*"))


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("--fps", 25), "fps 30, but 25 would follow"),
        (("--velocities",), "names of action is knee.pos, lift.pos, but knee.pos, knee.vel, "),
    ],
)
def test_what_differs_is_refused_by_its_name(
    tmp_path: Path, words: tuple[Any, ...], part: str
) -> None:
    out = tmp_path / "out"
    assert export(recorded(tmp_path / "a"), "--task", "x", "--out", out)[0] == 0
    before = files_of(out)
    other = recorded(tmp_path / "b")
    code, said = export(other, "--task", "x", "--out", out, "--resume", *words)
    assert (code, said.count("\n")) == (2, 1)
    assert part in said
    assert files_of(out) == before
    assert not list(tmp_path.glob("out.*"))


def _other_axis(root: Path) -> None:
    info = json.loads((root / "meta/info.json").read_text())
    info["robot_type"] = "other"
    (root / "meta/info.json").write_text(json.dumps(info))


def _older(root: Path) -> None:
    info = json.loads((root / "meta/info.json").read_text())
    info["codebase_version"] = "v2.1"
    (root / "meta/info.json").write_text(json.dumps(info))


def _column_less(root: Path) -> None:
    info = json.loads((root / "meta/info.json").read_text())
    del info["features"]["success"]
    (root / "meta/info.json").write_text(json.dumps(info))


def _frames_lost(root: Path) -> None:
    info = json.loads((root / "meta/info.json").read_text())
    info["total_frames"] += 1
    (root / "meta/info.json").write_text(json.dumps(info))


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("change", "part"),
    [
        (_other_axis, "robot_type other, but twin would follow"),
        (_older, "format v2.1; only v3.0"),
        (_column_less, "only the runs have the feature success"),
        (_frames_lost, "damaged, and cannot be resumed: 68 frames"),
        (lambda root: (root / "meta/tautwave.json").unlink(), "has not made it"),
        (lambda root: (root / "meta/info.json").unlink(), "no LeRobot dataset"),
        (lambda root: (root / "meta/stats.json").write_text("{"), "damaged"),
        (
            lambda root: (root / "data/chunk-000/file-000.parquet").write_bytes(b"PAR1"),
            "damaged, and cannot be resumed",
        ),
        (lambda root: root.with_name("out.part").mkdir(), "remove it first"),
        (lambda root: root.with_name("out.before").mkdir(), "look at it first"),
    ],
)
def test_what_is_no_dataset_to_go_on_with_is_left_alone(
    tmp_path: Path, change: Callable[[Path], Any], part: str
) -> None:
    out = tmp_path / "out"
    assert export(recorded(tmp_path / "a"), "--task", "x", "--out", out)[0] == 0
    change(out)
    before = files_of(out)
    other = recorded(tmp_path / "b")
    code, said = export(other, "--task", "x", "--out", out, "--resume")
    assert (code, said.count("\n")) == (2, 1)
    assert part in said
    assert files_of(out) == before


def test_a_recording_is_in_a_dataset_once(tmp_path: Path) -> None:
    out, run = tmp_path / "out", recorded(tmp_path / "a")
    assert export(run, "--task", "x", "--out", out)[0] == 0
    run = run.rename(tmp_path / "renamed")
    code, said = export(run, "--task", "x", "--out", out, "--resume")
    assert (code, "has the recording of renamed already, as a" in said) == (2, True)
    other = recorded(tmp_path / "b", RIG.replace("rotary", "linear"))
    code, said = export(other, "--task", "x", "--out", out, "--resume")
    assert (code, "only the dataset has" in said or "names of" in said) == (2, True), said
    code, said = export(run, "--task", "x", "--resume")
    assert (code, "name the dataset with --out" in said) == (2, True)


def test_a_file_system_without_links_gets_copies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    out = tmp_path / "out"
    assert export(recorded(tmp_path / "a"), "--task", "x", "--out", out)[0] == 0
    monkeypatch.setattr(os, "link", refuse)
    other = recorded(tmp_path / "b")
    assert export(other, "--task", "x", "--out", out, "--resume")[0] == 0
    assert len(frames_of(out)["index"]) == 136


def test_statistics_of_parts_are_those_of_the_whole() -> None:
    rng = np.random.default_rng(3)
    from tautwave.report.export.lerobot_video import picture_statistics

    some = rng.integers(0, 256, (9, 4, 5, 3), np.uint8)
    whole = picture_statistics(some)
    found = together([picture_statistics(some[:2]), picture_statistics(some[2:])])
    assert found["count"] == whole["count"]
    for name in ("min", "max", "mean", "std"):
        assert np.array(found[name]) == pytest.approx(np.array(whole[name]), abs=1e-12), name
    assert np.shape(found["q50"]) == (3, 1, 1)


@pytest.mark.slow
def test_videos_go_on_in_a_file_of_their_own(tmp_path: Path) -> None:
    pytest.importorskip("av")
    import av

    out, key = tmp_path / "out", "observation.images.wrist"
    assert export(filmed(tmp_path / "a"), "--task", "x", "--out", out)[0] == 0
    first = (out / f"videos/{key}/chunk-000/file-000.mp4").read_bytes()
    again = filmed(tmp_path / "b")
    code, said = export(recorded(tmp_path / "c"), "--task", "x", "--out", out,
                        "--resume")  # fmt: skip
    assert (code, f"only the dataset has the feature {key}" in said) == (2, True), said
    code, said = export(again, "--task", "x", "--out", out, "--resume")
    assert code == 0, said
    assert (out / f"videos/{key}/chunk-000/file-000.mp4").read_bytes() == first
    with av.open(str(out / f"videos/{key}/chunk-000/file-001.mp4")) as video:
        assert sum(1 for _ in video.decode(video=0)) == 68
    rows = episodes_of(out)
    assert [(one[f"videos/{key}/file_index"], one[f"videos/{key}/from_timestamp"]) for one in rows
            ] == [(0, 0.0), (0, 37 / 30), (1, 0.0), (1, 37 / 30)]  # fmt: skip
    assert json.loads((out / "meta/stats.json").read_text())[key]["count"] == [136]
