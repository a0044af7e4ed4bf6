"""The tap: only whole rows are accepted, and the run does not notice."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.cli.rigs import view
from tautwave.cli.terminal.live import Health, live_lines, news_lines, watch_health
from tautwave.errors import RecordingError, SafetyStop
from tautwave.runtime import ring as words
from tautwave.runtime.recorder import Recorder
from tautwave.runtime.ring import Ring
from tautwave.runtime.tap import Live, Tap
from tautwave.session.viewing.facts import tell_end
from tautwave.view.watched import read_live

COLUMNS = ("time_s", "lateness_us", "skipped_slots", "x")
RACE = """
import sys
from tautwave.runtime import ring as words
from tautwave.runtime.ring import Ring
ring = Ring(64, 8, int(sys.argv[1]))
row = ring.row
for k in range(int(sys.argv[2])):
    ring.words[words.TAIL] = k  # nobody drains: rows are overwritten as fast as they come
    for at in range(8):
        row[at] = k
    assert ring.push()
ring.words[words.CLOSED] = 1
"""


def raced(count: int) -> tuple[int, int, int]:
    """Tap a ring of 64 rows that is filled at full speed; return seen, missed and torn rows."""
    ring = Ring(64, 8)
    child = subprocess.Popen(
        [sys.executable, "-c", RACE, str(ring.descriptor), str(count)],
        pass_fds=(ring.descriptor,),
    )
    tap = Tap(ring.descriptor, 64, 8)
    seen = torn = 0
    last = -1.0
    while True:
        closed = tap.closed
        for row in tap.take():
            torn += len(set(row)) != 1 or row[0] <= last
            last = row[0]
            seen += 1
        if closed:
            break
    assert child.wait(60) == 0
    missed = tap.missed
    tap.close()
    ring.close()
    return seen, missed, torn


def test_no_torn_row_is_accepted() -> None:
    seen, missed, torn = raced(20_000)
    assert torn == 0
    assert seen > 0
    assert seen + missed == 20_000


@pytest.mark.slow
def test_no_torn_row_in_a_million() -> None:
    seen, missed, torn = raced(1_000_000)
    assert torn == 0
    assert seen + missed == 1_000_000


def test_a_slot_that_is_being_filled_again_does_not_count() -> None:
    ring = Ring(8, 1)
    tap = Tap(ring.descriptor, 8, 1)
    for k in range(8):
        ring.row[0] = k
        ring.push()
    # Between the copy and the second look the loop went on by five rows.
    looks = iter((8, 13))

    class Moving:
        def __getitem__(self, at: int) -> int:
            return next(looks)

    tap._words = Moving()  # type: ignore[assignment]
    assert tap.take() == [[6.0], [7.0]]  # 4 and 5 may have been overwritten; 0 to 3 were too old
    assert tap.missed == 6
    ring.close()


def recorder(folder: Path) -> Recorder:
    return Recorder(
        folder / "recording.mcap", COLUMNS, metadata={}, attachments={}, rows=64, lossless=True,
        epoch_ns=7, rate_hz=100.0, live={"rig": "bench", "units": {"j": "rad"}},
    )  # fmt: skip


def test_a_viewer_sees_rows_of_a_run_and_nothing_is_left_of_it(tmp_path: Path) -> None:
    run = recorder(tmp_path)
    run.start()
    live = read_live(tmp_path)
    assert live.facts == {"rig": "bench", "units": {"j": "rad"}}
    tap = Tap.of_run(live)
    assert tap.epoch_ns == 7
    for k in range(10):
        for at, value in enumerate((0.01 * k, 5.0 * k, 1.0, 7.0)):
            run.row[at] = value
        run.commit()
    rows = tap.take()
    assert [row[3] for row in rows] == [7.0] * 10
    assert watch_health(rows, live, Health(0.0, 2)) == Health(45.0, 12)
    done = CliRunner().invoke(main, ["view", str(tmp_path), "--json"])
    assert done.exit_code == 0
    assert json.loads(done.output)["x"] == 7.0
    assert run.close().rows_dropped == 0
    assert tap.closed
    assert not (tmp_path / "live.json").exists()
    with pytest.raises(RecordingError, match="the run has ended"):
        Tap.of_run(live)
    done = CliRunner().invoke(main, ["view", str(tmp_path)])
    assert done.exit_code != 0
    assert "no run in progress here" in done.output


def test_a_viewer_waits_for_the_first_row_only_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = recorder(tmp_path)
    run.start()
    monkeypatch.setattr(view, "PATIENCE_NS", -1)
    done = CliRunner().invoke(main, ["view", str(tmp_path), "--once"])
    assert done.exit_code == 2
    assert done.stderr == f"{tmp_path}: no rows arrive; is the run still opening its buses?\n"
    run.row[0] = 0.5
    run.commit()
    done = CliRunner().invoke(main, ["view", str(tmp_path), "--once"])
    assert done.exit_code == 0
    assert "loop  0.5 s, 100 Hz" in done.stdout
    run.close()


def test_another_process_descriptor_is_no_ring(tmp_path: Path) -> None:
    with open(tmp_path / "x", "wb") as file, pytest.raises(RecordingError, match="has ended"):
        Tap.of_run(Live(os.getpid(), file.fileno(), COLUMNS, 64, 1.0, {}))
    (tmp_path / "live.json").write_text("[]")
    with pytest.raises(RecordingError, match="was not written by a run"):
        read_live(tmp_path)


def test_a_run_is_shown_in_80_columns_whatever_its_numbers() -> None:
    columns = [
        "time_s", "operation.state", "operation.episode", "j.position_error",
        "master.j.position", "master.j.commanded", "master.j.valid",
        "slave.j.position", "slave.j.commanded", "slave.j.valid",
    ]  # fmt: skip
    live = Live(1, 3, columns, 64, 1000.0, {"units": {"j": "rad"}})
    row = [12.0, 3.0, 2.0, 0.001, 0.1, -0.02, 1.0, 0.099, 0.02, 1.0]
    lines = live_lines(row, live, Health(120.0, 4), 0)
    assert lines[1].split() == [
        "j", "+0.100", "rad", "+0.099", "rad", "+0.001", "rad", "-0.020", "N", "m", "clutched",
    ]  # fmt: skip
    assert lines[2] == ("loop  12.0 s, 1000 Hz, late up to 0.12 ms, 4 slots skipped, episode 2")
    wild = [1e6, 0.0, 9e5, float("nan"), -1e300, 1e9, 1.0, 0.0, 0.0, 0.0]
    lines = live_lines(wild, live, Health(1e9, 10**9), 10**9)
    assert all(len(line) <= 80 for line in lines)
    assert "no sample of slave" in lines[1]


def test_what_was_said_last_is_shown_in_two_lines_without_controls() -> None:
    def said(word: str, text: str) -> str:
        entry = {"at_s": 3.25, "word": word, "source": "key", "state": "idle", "text": text}
        return json.dumps([[1, {"text": "older"}], [2, entry]])

    assert news_lines("") == news_lines("[]") == news_lines('[[1, {"at_s": 1}]]') == []
    assert news_lines(said("engage", "")) == ["last  3.2 s, engage by key"]
    refusal = "engage: not possible after a fault; see what failed, then give rest"
    assert news_lines(said("engage", refusal)) == [f"last  3.2 s, {refusal}"]
    assert news_lines(said("fault", "it \x1b[2Jis hot")) == ["last  3.2 s, fault: it ?[2Jis hot"]
    long = news_lines(said("fault", 40 * "over-temperature "), 40)
    assert len(long) == 2
    assert all(len(line) <= 40 for line in long)
    assert long[1].endswith("...")


def test_news_are_read_whole_or_as_before() -> None:
    ring = Ring(8, 1)
    tap = Tap(ring.descriptor, 8, 1)
    assert tap.news() == ""
    ring.tell("x" * 5000)
    assert tap.news() == "x" * words.NEWS_BYTES
    ring.tell("engaged: ü")
    assert tap.news() == "engaged: ü"
    ring.words[words.NEWS] += 1  # the next ones are being written
    ring._news[:2] = b"##"
    assert tap.news() == "engaged: ü"
    tap.close()
    ring.close()
    ring.tell("after the end")


def test_viewers_are_shown_why_a_run_ended() -> None:
    reported: list[str] = []
    recorder: Any = SimpleNamespace(tell=reported.append)
    control = SimpleNamespace(run=SimpleNamespace(period_ns=1_000_000))
    assembly: Any = SimpleNamespace(control=control, buses=())
    result: Any = SimpleNamespace(error=None, cycles=1200, missed_cycles=34)
    tell_end(assembly, recorder, result)
    assert not reported
    result.error = SafetyStop("lever is too fast")
    tell_end(assembly, recorder, result)
    ((number, entry),) = json.loads(reported[0])
    assert (number, entry["at_s"], entry["word"]) == (1, 1.234, "fault")
    assert entry["text"] == "lever is too fast"
