"""The loop's end and the writer's process together: losses, kills, full disks, signals."""

from __future__ import annotations

import contextlib
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from tautwave.errors import RecordingError
from tautwave.recordings.recording import Recording, read_recording
from tautwave.runtime import recorder as recorder_module
from tautwave.runtime.recorder import Recorder
from tautwave.runtime.ring import HEAD, TAIL, WRITTEN
from tautwave.runtime.tap import Tap
from tautwave.view.watched import read_live

COLUMNS = ("time_s", "cycle", "square")
LOOP = Path(__file__).with_name("recording_loop.py")


def make(path: Path, columns: tuple[str, ...] = COLUMNS, **options: Any) -> Recorder:
    options = {"lossless": True, "rate_hz": 1000.0, "rows": 64, **options}
    return Recorder(path, columns, metadata={"version": "1"}, attachments={}, **options)


def put(recorder: Recorder, cycles: range) -> int:
    """Hand over a row for each cycle; how many were accepted."""
    accepted = 0
    row = recorder.row
    for cycle in cycles:
        row[0], row[1], row[2] = cycle * 1e-3, cycle, cycle * cycle
        accepted += recorder.commit()
    return accepted


def check_rows(recording: Recording, cycles: Any) -> None:
    expected = np.array([(k * 1e-3, k, k * k) for k in cycles], dtype=float)
    assert recording.data.tobytes() == expected.tobytes()


def wait_until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.005)


def state_of(pid: int) -> str:
    """Return the state of a process that may not be our child: T is stopped, Z has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "Z"


def test_what_is_put_in_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    recorder = Recorder(
        path,
        COLUMNS,
        metadata={"version": "0.1", "git": "abc"},
        attachments={"rig.yaml": b"name: bench\n", "big.bin": bytes(range(256)) * 2000},
        lossless=True,
        rate_hz=1000.0,
        epoch_ns=5,
    )
    recorder.start()
    values = [0.0, -0.0, float("nan"), float("inf"), 5e-324, 1 / 3]
    for k, value in enumerate(values):
        recorder.row[0], recorder.row[1], recorder.row[2] = k * 1e-3, value, -value
        assert recorder.commit()
    assert recorder.problem() is None
    stats = recorder.close()
    assert stats == (6, 6, 0, path.stat().st_size, None)
    assert recorder.close() is stats
    assert recorder.problem() is None
    assert not recorder.commit()
    recording = read_recording(path)
    expected = [(k * 1e-3, value, -value) for k, value in enumerate(values)]
    assert recording.data.tobytes() == np.array(expected).tobytes()
    assert recording.metadata == {
        "version": "0.1",
        "git": "abc",
        "rate_hz": "1000.0",
        "format": "1",
    }
    assert recording.attachments["rig.yaml"] == b"name: bench\n"
    assert recording.attachments["big.bin"] == bytes(range(256)) * 2000
    assert recording.ending == {
        "rows_offered": "6",
        "rows_written": "6",
        "rows_dropped": "0",
        "ended_by": "the loop closed the recording",
    }


def test_time_begins_with_the_first_slot_not_with_the_file(tmp_path: Path) -> None:
    recorder = make(tmp_path / "r.mcap", lossless=True, rate_hz=1000.0, live={})
    recorder.start()
    tap = Tap.of_run(read_live(tmp_path))
    assert tap.begun_ns == 0
    time.sleep(0.05)  # buses open, drives are enabled
    before = time.time_ns()
    recorder.begin(777)
    after = time.time_ns()
    assert tap.begun_ns == 777
    epoch_ns = tap.epoch_ns
    tap.close()
    assert before <= epoch_ns <= after
    put(recorder, range(3))
    recorder.close()
    with open(tmp_path / "r.mcap", "rb") as file:
        times = [message.log_time for _, _, message in make_reader(file).iter_messages()]
    assert times == [epoch_ns + 1_000_000 * k for k in range(3)]


@pytest.mark.parametrize("rows", [2, 7, 1000])
def test_lossless_waits_and_loses_nothing(tmp_path: Path, rows: int) -> None:
    cycles = range(20_000 if rows == 1000 else 20 * rows)
    recorder = make(tmp_path / "r.mcap", rows=rows)
    recorder.start()
    assert put(recorder, cycles) == len(cycles)
    assert recorder.close()[:3] == (len(cycles), len(cycles), 0)
    recording = read_recording(tmp_path / "r.mcap")
    check_rows(recording, cycles)
    assert recording.missing_rows == 0


@pytest.mark.slow
def test_a_stopped_writer_costs_rows_but_no_time(tmp_path: Path) -> None:
    recorder = make(tmp_path / "r.mcap", lossless=False)
    recorder.start()
    assert recorder.writer_pid is not None
    put(recorder, range(10))
    wait_until(
        lambda: recorder._ring.words[WRITTEN] == 10
    )  # an old chunk is written after a second
    writer = recorder.writer_pid
    os.kill(writer, signal.SIGSTOP)
    wait_until(lambda: state_of(writer) == "T")  # not before it is scheduled
    assert put(recorder, range(10, 200)) == 64
    os.kill(writer, signal.SIGCONT)
    wait_until(lambda: recorder._ring.words[TAIL] == recorder._ring.words[HEAD])
    assert put(recorder, range(200, 210)) == 10
    stats = recorder.close()
    assert stats[:3] == (210, 84, 126)
    assert stats.error is None
    recording = read_recording(tmp_path / "r.mcap")
    check_rows(recording, [*range(74), *range(200, 210)])
    assert recording.missing_rows == 126
    assert recording.ending["rows_dropped"] == "126"


@pytest.mark.slow
def test_a_killed_loop_loses_nothing(tmp_path: Path) -> None:
    dice = random.Random(1)
    for attempt in range(3):
        path = tmp_path / f"{attempt}.mcap"
        with subprocess.Popen(
            [sys.executable, str(LOOP), str(path), "1e-5"], stdout=subprocess.PIPE, text=True
        ) as loop:
            assert loop.stdout is not None
            writer = int(loop.stdout.readline())
            time.sleep(dice.uniform(0.0, 0.3))
            loop.kill()
            reported = loop.stdout.read().split()
        wait_until(lambda pid=writer: state_of(pid) == "Z")  # type: ignore[misc]
        recording = read_recording(path)
        assert not recording.truncated
        assert recording.ending["ended_by"] == "the loop's process vanished"
        assert len(recording) >= int(reported[-1] if reported else 0)
        check_rows(recording, range(len(recording)))


@pytest.mark.slow
def test_a_killed_writer_loses_at_most_its_open_chunk(tmp_path: Path) -> None:
    dice = random.Random(2)
    columns = (*COLUMNS, *(f"c{k}" for k in range(97)))
    chunk = 65_536 // (35 + 8 * len(columns))
    for attempt in range(3):
        path = tmp_path / f"{attempt}.mcap"
        recorder = make(path, columns, rows=8192, lossless=False)
        recorder.start()
        assert recorder.writer_pid is not None
        cycle = dice.randrange(2 * chunk, 2500, 10)
        for first in range(0, cycle, 10):
            put(recorder, range(first, min(first + 10, cycle)))
            time.sleep(0.0001)
        words = recorder._ring.words
        wait_until(lambda w=words: w[TAIL] == w[HEAD])  # type: ignore[misc]  # all is taken out
        os.kill(recorder.writer_pid, signal.SIGKILL)
        wait_until(lambda r=recorder: r.problem() is not None)  # type: ignore[misc]
        assert put(recorder, range(cycle, cycle + 9_000)) <= 8192  # the loop goes on
        stats = recorder.close()
        assert stats.rows_offered == cycle + 9_000
        assert stats.rows_dropped == stats.rows_offered - stats.rows_written
        assert cycle - stats.rows_written < chunk
        assert stats.error == (
            f"the recording's writer was killed by SIGKILL; {stats.rows_written} rows are in "
            f"{path}, which `tautwave report` still reads"
        )
        recording = read_recording(path, COLUMNS)
        assert recording.truncated
        check_rows(recording, range(stats.rows_written))


@pytest.mark.slow
def test_a_writer_killed_in_full_swing_leaves_whole_chunks(tmp_path: Path) -> None:
    dice = random.Random(3)
    for attempt in range(6):
        path = tmp_path / f"{attempt}.mcap"
        recorder = make(path, rows=8192)
        recorder.start()
        assert recorder.writer_pid is not None
        cycle = 0
        end = time.monotonic() + dice.uniform(0.05, 0.15)
        while time.monotonic() < end or recorder._ring.words[WRITTEN] == 0:
            put(recorder, range(cycle, cycle + 100))
            cycle += 100
        os.kill(recorder.writer_pid, signal.SIGKILL)
        stats = recorder.close()
        assert stats.error is not None
        recording = read_recording(path)
        # Killed between writing a chunk and counting it, the file holds one chunk more.
        assert len(recording) - stats.rows_written in (0, 65_536 // 59)
        check_rows(recording, range(len(recording)))


def test_without_a_writer_lossless_does_not_hang(tmp_path: Path) -> None:
    recorder = make(tmp_path / "r.mcap")
    recorder.start()
    assert recorder.writer_pid is not None
    os.kill(recorder.writer_pid, signal.SIGKILL)
    assert put(recorder, range(1000)) == 64
    assert recorder.close()[:3] == (1000, 0, 1000)


@pytest.mark.usefixtures("no_bytecode")
def test_a_disk_that_fills_up_is_said_and_keeps_what_is_written(tmp_path: Path) -> None:
    """The limit on the file's size stands in for the disk: the same failing write."""
    path = tmp_path / "r.mcap"
    recorder = make(path, lossless=False, rows=8192)
    recorder.start()
    assert recorder.writer_pid is not None
    resource.prlimit(recorder.writer_pid, resource.RLIMIT_FSIZE, (50_000, 50_000))
    cycle = 0
    while recorder.problem() is None:
        put(recorder, range(cycle, cycle + 500))
        cycle += 500
        assert cycle < 1_000_000
        time.sleep(0.01)
    put(recorder, range(cycle, cycle + 500))
    stats = recorder.close()
    assert stats.error == (
        f"the recording {path} cannot be written: File too large; {stats.rows_written} rows are in "
        f"{path}, which `tautwave report` still reads"
    )
    assert 0 < stats.rows_written < stats.rows_offered
    assert stats.bytes == path.stat().st_size <= 50_000
    recording = read_recording(path)
    assert recording.truncated
    check_rows(recording, range(stats.rows_written))


def test_signals_that_end_the_loop_do_not_end_the_writer(tmp_path: Path) -> None:
    recorder = make(tmp_path / "r.mcap")
    recorder.start()
    pid = recorder.writer_pid
    assert pid is not None
    assert os.getpgid(pid) != os.getpgid(0)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(pid, number)
    put(recorder, range(500))
    assert recorder.close()[:3] == (500, 500, 0)


def test_the_writer_does_not_inherit_the_loop_s_core_and_priority(tmp_path: Path) -> None:
    cores, policy = os.sched_getaffinity(0), os.sched_getscheduler(0)
    recorder = make(tmp_path / "r.mcap")
    try:
        os.sched_setaffinity(0, {min(cores)})
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        recorder.start()
        assert recorder.writer_pid is not None
        assert os.sched_getaffinity(recorder.writer_pid) >= cores
        assert os.sched_getscheduler(recorder.writer_pid) == os.SCHED_OTHER
    finally:
        os.sched_setscheduler(0, policy, os.sched_param(0))
        os.sched_setaffinity(0, cores)
        recorder.close()


@pytest.mark.slow
def test_a_slow_loop_is_on_disk_after_a_second(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    recorder = make(path)
    recorder.start()
    put(recorder, range(3))

    def is_there() -> bool:
        try:
            return len(read_recording(path)) == 3
        except RecordingError:
            return False

    wait_until(is_there)
    assert recorder.close().rows_written == 3


def test_a_stuck_writer_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorder_module, "STUCK_S", 0.2)
    recorder = make(tmp_path / "r.mcap")
    recorder.start()
    assert recorder.writer_pid is not None
    os.kill(recorder.writer_pid, signal.SIGSTOP)
    put(recorder, range(10))
    stats = recorder.close()
    assert stats[:3] == (10, 0, 10)
    assert "made no progress for 0.2 s and was killed" in str(stats.error)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("{tmp}/none/r.mcap", "the directory {tmp}/none does not exist"),
        ("{tmp}", "it is a directory"),
        ("{tmp}/file/r.mcap", "Not a directory"),
        ("/sys/r.mcap", "no permission to write in /sys"),
        ("/dev/full", "No space left on device"),
    ],
)
def test_a_file_that_cannot_be_written_is_one_sentence_at_the_start(
    tmp_path: Path, name: str, why: str
) -> None:
    (tmp_path / "file").write_text("")
    path, why = name.format(tmp=tmp_path), why.format(tmp=tmp_path)
    recorder = make(Path(path))
    with pytest.raises(RecordingError) as caught:
        recorder.start()
    assert str(caught.value) == f"the recording {path} cannot be written: {why}"
    assert recorder.close() == (0, 0, 0, 0, str(caught.value))


def test_a_writer_that_cannot_start_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    recorder = make(tmp_path / "r.mcap")
    with pytest.raises(RecordingError, match="ended with exit code 1 before it was ready"):
        recorder.start()


@pytest.mark.parametrize(
    ("end", "how"),
    [("exit 0", "ended with exit code 0"), ("exit 3", "ended with exit code 3"),
     ("kill -KILL $$", "was killed by SIGKILL")],
)  # fmt: skip
def test_a_writer_that_ends_early_is_told_as_it_ended(tmp_path: Path, end: str, how: str) -> None:
    recorder = make(tmp_path / "r.mcap")
    pipe = subprocess.PIPE
    with subprocess.Popen(["/bin/sh", "-c", end], stdin=pipe, stdout=pipe) as writer:
        recorder._writer = writer
        writer.wait()
        assert str(recorder.problem()).startswith(f"the recording's writer {how}; 0 rows are in ")
        recorder.close()


def test_wrong_arguments_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="needs a column 'time_s'"):
        make(tmp_path / "r.mcap", ("a",))
    with pytest.raises(RecordingError, match="columns given twice: a"):
        make(tmp_path / "r.mcap", ("time_s", "a", "a"))
    with pytest.raises(RecordingError, match=r"at least 2 rows \(got 1\)"):
        make(tmp_path / "r.mcap", rows=1)
    recorder = make(tmp_path / "r.mcap")
    assert recorder.close() == (0, 0, 0, 0, None)
    with pytest.raises(RecordingError, match="was already started"):
        recorder.start()


def test_nothing_is_left_in_shared_memory_nor_open(tmp_path: Path) -> None:
    shared = Path("/dev/shm")
    before = set(shared.iterdir()) if shared.exists() else set()
    opened = len(os.listdir("/proc/self/fd"))
    recorder = make(tmp_path / "r.mcap")
    recorder.start()
    put(recorder, range(10))
    assert (set(shared.iterdir()) if shared.exists() else set()) <= before
    recorder.close()
    assert len(os.listdir("/proc/self/fd")) == opened


def test_the_loop_imports_neither_numpy_nor_mcap() -> None:
    code = (
        "import sys, tautwave.runtime.recorder; "
        "print(sorted({'numpy', 'mcap', 'zstandard'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_rows_that_a_stopped_writer_has_not_taken_are_the_backlog(tmp_path: Path) -> None:
    recorder = make(tmp_path / "recording.mcap", lossless=False, rows=64)
    recorder.start()
    assert recorder.writer_pid is not None
    os.kill(recorder.writer_pid, signal.SIGSTOP)
    try:
        wait_until(lambda: state_of(recorder.writer_pid or 0) == "T")
        assert recorder.backlog == 0.0
        assert put(recorder, range(48)) == 48
        assert recorder.backlog == 0.75
    finally:
        os.kill(recorder.writer_pid, signal.SIGCONT)
    wait_until(lambda: recorder.backlog == 0.0)
    stats = recorder.close()
    assert (stats.rows_written, stats.rows_dropped) == (48, 0)
