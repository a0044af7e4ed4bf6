"""`tautwave export --to lerobot`: the files of a v3.0 dataset, row by row out of recordings."""

from __future__ import annotations

import json
import math
import shutil
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader

from tautwave.cli import main
from tautwave.report.export.signals import Signal
from tautwave.runtime.recorder import Recorder
from tautwave.view.camera.file import CameraFile
from tautwave.view.camera.v4l2 import jpeg_of

pq = pytest.importorskip("pyarrow.parquet")

RATE, FPS = 100.0, 30
RIG = """\
name: twin
master: {axes: {knee: {kind: rotary}, lift: {kind: linear}}}
slave: {axes: {knee: {kind: rotary}, lift: {kind: linear, causality: admittance}}}
coupling: {pairs: {knee: {sign: -1}, lift: {position_scale: 2}}}
"""
STATE = ["knee.pos", "knee.vel", "knee.torque", "lift.pos", "lift.vel", "lift.force"]
COLUMNS = (
    "time_s", "operation.episode", "master.knee.position", "master.knee.velocity",
    "master.lift.position", "master.lift.velocity", "slave.knee.position", "slave.knee.velocity",
    "slave.knee.commanded", "slave.lift.position", "slave.lift.velocity",
    "slave.lift.measured_effort", "knee.position_error", "lift.position_error", "operation.state",
    "operation.scale",
    "master.knee.valid", "master.lift.valid", "slave.knee.valid", "slave.lift.valid",
)  # fmt: skip
ROWS = 350
EPISODES = {1: range(20, 141), 2: range(180, 281)}
# As LeRobot 0.6.1 writes it: names of columns, their types, and the note for its library.
SCHEMA = """\
action: fixed_size_list<element: float>[2]
observation.state: fixed_size_list<element: float>[6]
leader: fixed_size_list<element: float>[2]
timestamp: float
frame_index: int64
episode_index: int64
index: int64
task_index: int64
success: int64"""


def recorded(
    folder: Path,
    rig: str = RIG,
    lost: range = range(0),
    skipped: range = range(0),
    states: Mapping[int, Sequence[int]] = types.MappingProxyType({}),
    success: bool | None = None,
    person: range | None = None,
) -> Path:
    """Record rows whose values name row and column; some lack a sample, some are skipped.

    `states` are rows in which the rig is not engaged, `success` is said of the second episode. In
    the rows `person` a person leads instead of a policy; None: there is no policy.
    """
    folder.mkdir()
    columns = COLUMNS if person is None else ("operation.intervention", *COLUMNS)
    recorder = Recorder(
        folder / "recording.mcap", columns, metadata={"rig": "twin", "rate_hz": str(RATE)},
        attachments={"rig.yaml": rig.encode()}, rows=512, lossless=True, rate_hz=RATE,
    )  # fmt: skip
    recorder.start()
    for k in (k for k in range(ROWS) if k not in skipped):
        episode = next((number for number, rows in EPISODES.items() if k in rows), 0)
        values = [k / RATE, float(episode)] + [k + at / 16.0 for at in range(len(COLUMNS) - 2)]
        if person is not None:
            values.insert(0, float(k in person))
        for at, value in enumerate(values):
            recorder.row[at] = value
        for pair in ("knee", "lift"):
            recorder.row[columns.index(f"{pair}.position_error")] += k
        state = next((state for state, rows in states.items() if k in rows), 2)
        recorder.row[columns.index("operation.state")] = state
        recorder.row[columns.index("operation.scale")] = 1.0
        recorder.row[-2] = k not in lost  # as in a run: the other columns keep what was before
        recorder.commit()
    recorder.close()
    marks = [
        {"number": 1, "name": "a", "task": "lift it", "success": True},
        {"number": 2, "name": "b", "task": "", "success": success},
    ]
    (folder / "summary.json").write_text(json.dumps({"operation": {"episodes": marks}}))
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("runs") / "one")


def export(*words: Any) -> tuple[int, str]:
    done = CliRunner().invoke(main, ["export", "--to", "lerobot", *map(str, words)])
    assert "Traceback" not in done.output
    return done.exit_code, done.output


def test_frames_are_rows_of_the_episodes(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    code, said = export(run, run, "--fps", FPS, "--task", "rest", "--out", out)
    assert (code, said) == (0, f"{out}: 4 episodes, 136 frames at 30 fps\n")
    path = out / "data/chunk-000/file-000.parquet"
    table = pq.read_table(path)
    assert "\n".join(f"{one.name}: {one.type}" for one in table.schema) == SCHEMA
    note = json.loads(table.schema.metadata[b"huggingface"])["info"]["features"]
    assert note["action"] == {
        "feature": {"dtype": "float32", "_type": "Value"}, "length": 2, "_type": "List",
    }  # fmt: skip
    assert pq.ParquetFile(path).num_row_groups == 4
    lengths = [37, 31, 37, 31]  # 1.20 s and 1.00 s, both ends counted
    assert table["index"].to_pylist() == list(range(sum(lengths)))
    frame = [k for length in lengths for k in range(length)]
    assert table["frame_index"].to_pylist() == frame
    assert table["timestamp"].to_numpy().tobytes() == (
        (np.array(frame) / FPS).astype(np.float32).tobytes()
    )
    starts = [20, 180, 20, 180]
    rows = [
        start + int(k * RATE / FPS + 1e-9)
        for start, length in zip(starts, lengths, strict=True) for k in range(length)
    ]  # fmt: skip
    action = np.array(table["action"].to_pylist())
    state = np.array(table["observation.state"].to_pylist())
    leader = np.array(table["leader"].to_pylist())
    # sign x error beside the slave's place, and position_scale x error
    assert action.tolist() == [[-row - 6 / 16, 5 * row + 29 / 16] for row in rows]
    assert leader.tolist() == [[row, row + 2 / 16] for row in rows]
    assert state.tolist() == [[row + at / 16 for at in range(4, 10)] for row in rows]
    assert table["task_index"].to_pylist()[36:38] == [0, 1]


def test_meta_agrees_with_the_frames(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    assert export(run, "--task", "rest", "--velocities", "--out", out)[0] == 0
    info = json.loads((out / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert (info["total_frames"], info["splits"], info["fps"]) == (68, {"train": "0:2"}, 30)
    assert info["features"]["action"]["names"] == ["knee.pos", "knee.vel", "lift.pos", "lift.vel"]
    assert info["features"]["observation.state"]["names"] == STATE
    tasks = pq.read_table(out / "meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0, 1], "task": ["lift it", "rest"]}
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    rows = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(one["dataset_from_index"], one["dataset_to_index"]) for one in rows] == [
        (0, 37), (37, 68),
    ]  # fmt: skip
    assert rows[1]["tasks"] == ["rest"]
    first = np.array(pq.read_table(out / "data/chunk-000/file-000.parquet")["action"].to_pylist())
    assert rows[0]["stats/action/max"] == first[:37].max(axis=0).tolist()
    stats = json.loads((out / "meta/stats.json").read_text())
    assert stats["action"]["q90"] == np.quantile(first, 0.9, axis=0).tolist()
    assert stats["action"]["count"] == [68]
    card = (out / "README.md").read_text()
    force = "| observation.state | `lift.force` | `slave.lift.measured_effort` | N |"
    assert force in card.splitlines()
    assert "rig twin (sha256 " in card


def test_a_sample_that_is_missing_is_not_made_up(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run", lost=range(30, 41))
    out = tmp_path / "set"
    code, said = export(run, "--task", "rest", "--out", out)
    assert (code, said.count("\n")) == (2, 1)
    assert "4 of 37 frames of episode a miss a sample" in said
    assert not list(tmp_path.glob("set*"))
    code, said = export(run, "--task", "rest", "--missing", "cut", "--out", out)
    assert (code, said) == (
        0, f"{out}: 2 episodes, 64 frames at 30 fps, 4 frames without a sample left out\n",
    )  # fmt: skip


def test_a_row_does_not_stand_for_later_frames(tmp_path: Path) -> None:
    """Slots that passed, or a chunk that is damaged: nothing was measured there."""
    run = recorded(tmp_path / "run", skipped=range(31, 41))
    code, said = export(run, "--task", "rest", "--out", tmp_path / "set")
    assert (code, "3 of 37 frames of episode a miss a sample" in said) == (2, True)
    one = recorded(tmp_path / "one", skipped=range(31, 32))
    code, said = export(one, "--task", "rest", "--out", tmp_path / "set")  # 20 ms at 30 fps
    assert code == 0, said
    code, said = export(one, "--task", "rest", "--fps", int(RATE), "--out", tmp_path / "all")
    assert (code, "1 of 121 frames of episode a miss a sample" in said) == (2, True)


def test_frames_outside_engaged_are_cut_and_said(tmp_path: Path) -> None:
    """A rig that holds or is clutched has a slave that stands: that is no demonstration."""
    run = recorded(tmp_path / "run", states={4: range(20, 30), 3: range(100, 103)})
    code, said = export(run, "--task", "x", "--fps", int(RATE), "--out", tmp_path / "set")
    counted = "13 frames outside `engaged` left out"
    assert (code, said) == (
        0, f"{tmp_path / 'set'}: 2 episodes, 209 frames at 100 fps, {counted}\n"
    )  # fmt: skip
    assert counted in (tmp_path / "set/README.md").read_text()
    table = pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    rows = [*range(30, 100), *range(103, 141), *range(180, 281)]
    assert [one[0] for one in table["leader"].to_pylist()] == rows
    # A sample that is missing while the rig holds is not missed.
    held = recorded(tmp_path / "held", lost=range(22, 28), states={4: range(20, 30)})
    assert export(held, "--task", "x", "--out", tmp_path / "held-set")[0] == 0


@pytest.mark.parametrize(("end", "fits"), [(40, True), (43, True), (44, False), (141, False)])
def test_an_episode_with_less_than_a_second_is_refused(
    tmp_path: Path, end: int, fits: bool
) -> None:
    run = recorded(tmp_path / "run", states={4: range(20, end)})
    out = ("--task", "x", "--out", tmp_path / "set")
    code, said = export(run, *out)
    assert code == (0 if fits else 2), said
    if not fits:
        assert said.count("\n") == 1
        assert "episode a has" in said
        code, said = export(run, *out, "--missing", "cut")
        assert (code, said) == (
            0, f"{tmp_path / 'set'}: 1 episode, 31 frames at 30 fps, 1 episode shorter than 1 s"
            " left out\n",
        )  # fmt: skip


@pytest.mark.parametrize(("success", "number"), [(False, 0), (None, -1), (True, 1)])
def test_what_was_said_of_an_episode_is_a_column(
    tmp_path: Path, success: bool | None, number: int
) -> None:
    run = recorded(tmp_path / "run", success=success)
    out = tmp_path / "set"
    assert export(run, "--task", "x", "--out", out)[0] == 0
    table = pq.read_table(out / "data/chunk-000/file-000.parquet")
    assert table["success"].to_pylist() == [1] * 37 + [number] * 31
    assert json.loads((out / "meta/info.json").read_text())["features"]["success"] == {
        "dtype": "int64", "shape": [1], "names": None,
    }  # fmt: skip


def test_frames_that_a_person_led_are_marked_and_so_are_demonstrations(tmp_path: Path) -> None:
    led, shown = recorded(tmp_path / "led", person=range(50, 200)), recorded(tmp_path / "shown")
    out = tmp_path / "set"
    assert export(shown, led, "--task", "x", "--out", out)[0] == 0
    table = pq.read_table(out / "data/chunk-000/file-000.parquet")
    assert str(table.schema.field("intervention").type) == "bool"
    rows = [20 + k * 100 / FPS for k in range(37)], [180 + k * 100 / FPS for k in range(31)]
    marked = [50 <= math.floor(row + 1e-9) < 200 for part in rows for row in part]
    assert table["intervention"].to_pylist() == [True] * 68 + marked
    info = json.loads((out / "meta/info.json").read_text())
    assert info["features"]["intervention"] == {"dtype": "bool", "shape": [1], "names": None}
    assert b'"dtype": "bool"' in table.schema.metadata[b"huggingface"]
    assert "`intervention`" in (out / "README.md").read_text()
    # A dataset goes on as it began: of demonstrations alone nobody knows a policy.
    assert export(shown, "--task", "x", "--out", tmp_path / "plain")[0] == 0
    code, said = export(led, "--task", "x", "--out", tmp_path / "plain", "--resume")
    assert (code, "only the runs have the feature intervention" in said) == (2, True)
    more = recorded(tmp_path / "more", lost=range(5, 6))
    code, said = export(more, "--task", "x", "--out", out, "--resume")
    assert code == 0, said
    both = pq.read_table(out / "data")["intervention"].to_pylist()
    assert both == [True] * 68 + marked + [True] * 68


@pytest.mark.parametrize("success", [False, None])
def test_only_successes_are_taken_where_only_these_are_wanted(
    tmp_path: Path, success: bool | None
) -> None:
    run = recorded(tmp_path / "run", success=success)
    out = tmp_path / "set"
    code, said = export(run, "--only", "success", "--out", out)  # nor does the other need a task
    assert (code, said) == (
        0, f"{out}: 1 episode, 37 frames at 30 fps, 1 episode without success left out\n",
    )  # fmt: skip
    assert "1 episode without success left out" in (out / "README.md").read_text()


@pytest.mark.parametrize(("most", "gap"), [(0.1, True), (0.2, False)])
def test_an_episode_with_a_gap_in_its_middle_is_left_out_where_that_is_asked_for(
    tmp_path: Path, most: float, gap: bool
) -> None:
    """15 rows of 100 a second are cut out of the middle of the first; its begin is no gap."""
    run = recorded(tmp_path / "run", states={4: [*range(20, 25), *range(60, 75)]})
    out = tmp_path / "set"
    code, said = export(run, "--task", "x", "--fps", 100, "--max-gap", most, "--out", out)
    assert code == 0, said
    assert ("1 episode with a gap beyond --max-gap left out" in said) == gap
    assert f"{out}: {1 if gap else 2} episode" in said


def test_episodes_that_were_recorded_again_are_in_no_export(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run")
    summary = json.loads((run / "summary.json").read_text())
    summary["operation"]["episodes"][0]["discarded"] = True
    (run / "summary.json").write_text(json.dumps(summary))
    out = tmp_path / "set"
    assert export(run, "--task", "x", "--out", out) == (
        0, f"{out}: 1 episode, 31 frames at 30 fps, 1 episode recorded again left out\n",
    )  # fmt: skip
    tables = CliRunner().invoke(main, ["export", str(run), "--out", str(tmp_path / "tables")])
    assert [Path(one).name for one in tables.output.split()] == ["002-b.csv", "episodes.csv"]


def test_a_dataset_without_episodes_is_none(tmp_path: Path) -> None:
    run = recorded(tmp_path / "run", states={4: range(ROWS)}, success=False)
    wanted = ("--only", "success", "--missing", "cut")
    code, said = export(run, *wanted, "--out", tmp_path / "set")
    assert (code, said.count("\n"), list(tmp_path.glob("set*"))) == (2, 1, [])
    words = "no episode is left for a dataset: 1 episode without success, 1 episode shorter"
    assert words in said


def test_the_live_scale_is_part_of_an_action(tmp_path: Path) -> None:
    one = Signal("knee.pos", "rad", "knee.position_error", "slave.knee.position", -2.0)
    row = {"knee.position_error": 0.5, "slave.knee.position": 1.0, "master.knee.position": 3.0}
    assert one.of(row) == 0.0
    assert one.of(row | {"operation.scale": 0.5}) == 0.5
    scaled = row | {"operation.scale": 0.5}
    assert one.master_of(one.of(scaled), scaled) == 3.0
    assert one.master_of(one.of(scaled) - 1.0, scaled) == 4.0  # the other way round


def test_what_cannot_be_is_refused_in_one_sentence(run: Path, tmp_path: Path) -> None:
    other = recorded(tmp_path / "other", RIG.replace("{kind: linear}", "{kind: rotary}"))
    bare = recorded(tmp_path / "bare", "{}")
    slow = tmp_path / "slow"
    shutil.copytree(run, slow)
    taken = tmp_path / "taken"
    taken.mkdir()
    new = ("--out", tmp_path / "set")
    for words, part in (
        ((run, *new), "--task"),
        ((run, "--task", "x", "--fps", 101, *new), "at most --fps 100"),
        ((run, other, "--task", "x", *new), "one robot"),
        ((bare, "--task", "x", *new), "rig file"),
        ((run, "--task", "x", "--out", taken), "exists"),
        ((run, "--columns", "time_s", *new), "--columns"),
    ):
        code, said = export(*words)
        assert code == 2, said
        assert part in said
        assert not list(tmp_path.glob("set*"))
    (tmp_path / "set.part" / "mine").mkdir(parents=True)
    code, said = export(run, "--task", "x", *new)
    assert (code, "remove it first" in said) == (2, True)
    assert (tmp_path / "set.part" / "mine").exists()
    done = CliRunner().invoke(main, ["export", str(run), "--fps", "3"])
    assert "--fps is for --to lerobot" in done.output


def filmed(
    folder: Path,
    lost: range = range(0),
    late_ns: int = 0,
    damage: Callable[[bytes], bytes] | None = None,
) -> Path:
    """Record as above, with a camera at 50 Hz whose pictures are as bright as their number.

    Some are damaged, if wished.
    """
    run = recorded(folder)
    with open(run / "recording.mcap", "rb") as file:
        first = next(iter(make_reader(file).iter_messages()))[2].log_time
    camera = CameraFile(run / "camera-wrist.mcap", "wrist", 50.0, first + late_ns, 0)
    for k in (k for k in range(-1, 175) if k not in lost):
        grey = np.full((32, 48, 3), k + 1, np.uint8)
        jpeg = jpeg_of(grey, "RGB")
        if damage is not None and k in range(20, 30):
            jpeg = damage(jpeg)
        camera.add(20_000_000 * k + 1_000_000, jpeg, k + 1)
    camera.close()
    return run


@pytest.mark.slow
def test_cameras_become_videos_frame_by_frame(tmp_path: Path) -> None:
    pytest.importorskip("av")
    import av

    out = tmp_path / "set"
    code, said = export(filmed(tmp_path / "run"), "--fps", FPS, "--task", "rest", "--out", out)
    assert (code, said) == (0, f"{out}: 2 episodes, 68 frames at 30 fps\n")
    key = "observation.images.wrist"
    info = json.loads((out / "meta/info.json").read_text())
    feature = info["features"][key]
    assert (feature["dtype"], feature["shape"]) == ("video", [32, 48, 3])
    assert feature["names"] == ["height", "width", "channels"]
    place = info["video_path"].format(video_key=key, chunk_index=0, file_index=0)
    with av.open(str(out / place)) as video:
        seen = [frame.to_ndarray(format="rgb24").mean() for frame in video.decode(video=0)]
        assert video.streams.video[0].average_rate == FPS
    starts, lengths = [20, 180], [37, 31]
    at = [(start + int(k * RATE / FPS + 1e-9)) / RATE for start, length in
          zip(starts, lengths, strict=True) for k in range(length)]  # fmt: skip
    newest = [math.floor((one - 0.001) / 0.02 + 1e-9) for one in at]
    assert seen == pytest.approx([k + 1 for k in newest], abs=2.0)
    assert all(0.001 + 0.02 * k <= one + 1e-9 for k, one in zip(newest, at, strict=True))
    episodes = pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    times = [(one[f"videos/{key}/from_timestamp"], one[f"videos/{key}/to_timestamp"])
             for one in episodes]  # fmt: skip
    assert times == [(0.0, 37 / FPS), (37 / FPS, 68 / FPS)]
    stats = json.loads((out / "meta/stats.json").read_text())[key]
    assert np.shape(stats["mean"]) == (3, 1, 1)
    assert stats["count"] == [68]
    assert stats["max"][0][0][0] == pytest.approx((max(newest) + 1) / 255, abs=0.01)
    table = pq.read_table(out / "data/chunk-000/file-000.parquet")
    assert "\n".join(f"{one.name}: {one.type}" for one in table.schema) == SCHEMA


@pytest.mark.slow
def test_a_picture_that_stands_is_none(tmp_path: Path) -> None:
    pytest.importorskip("av")
    run = filmed(tmp_path / "run", lost=range(20, 30))
    code, said = export(run, "--task", "rest", "--out", tmp_path / "set")
    assert code != 0
    assert "frames of episode a miss a sample or a picture" in said
    code, said = export(run, "--task", "rest", "--out", tmp_path / "set", "--missing", "cut")
    assert code == 0
    assert "frames without a sample left out" in said
    code, said = export(run, "--task", "rest", "--out", tmp_path / "bare", "--no-video")
    assert said.endswith("2 episodes, 68 frames at 30 fps\n")
    assert json.loads((tmp_path / "bare/meta/info.json").read_text())["video_path"] is None


@pytest.mark.sparse(5)
@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (lambda jpeg: jpeg[: len(jpeg) // 2], "miss a sample or a picture"),
        (lambda jpeg: b"", "miss a sample or a picture"),
        (lambda jpeg: bytes(99), "miss a sample or a picture"),
        (lambda jpeg: jpeg[:2] + bytes(99) + jpeg[-2:], "wrist: a picture is damaged"),
        (lambda jpeg: jpeg_of(np.zeros((16, 16, 3), np.uint8), "RGB"), "differ in size"),
    ],
)
def test_a_damaged_picture_is_none(
    damage: Callable[[bytes], bytes], text: str, tmp_path: Path
) -> None:
    pytest.importorskip("av")
    run = filmed(tmp_path / "run", damage=damage)
    code, said = export(run, "--task", "rest", "--out", tmp_path / "set")
    assert (code, said.count("\n"), list(tmp_path.glob("set*"))) == (2, 1, [])
    assert text in said
    padded = filmed(tmp_path / "padded", damage=lambda jpeg: jpeg + bytes(7))  # as some cameras do
    code, said = export(padded, "--task", "rest", "--out", tmp_path / "set")
    assert code == 0, said


def test_pictures_of_another_run_are_refused(tmp_path: Path) -> None:
    run = filmed(tmp_path / "run", late_ns=1)
    code, said = export(run, "--task", "rest", "--out", tmp_path / "set")
    assert code != 0
    assert "camera-wrist.mcap: its pictures are from a different run" in said
    assert not (tmp_path / "set").exists()
    code, said = export(run, "--task", "rest", "--out", tmp_path / "set", "--no-video")
    assert code == 0
