"""Reading recordings back: exactly, in part, and by other people's readers."""

from __future__ import annotations

import json
import sys
import time
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings.recording import read_recording
from tautwave.runtime.recorder import Recorder
from tests.report.recordings import COLUMNS, EPOCH_NS, Sample, slots, write

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from mcap_ros2.decoder import DecoderFactory


def test_every_bit_comes_back(sample: Sample) -> None:
    path, rows, _ = sample
    recording = read_recording(path)
    assert recording.columns == COLUMNS
    assert recording.data.shape == (2500, len(COLUMNS))
    assert recording.data.tobytes() == rows[:, :-1].tobytes()
    assert recording["wrist.position_error"].tobytes() == rows[:, 4].tobytes()
    assert recording.time_s.tobytes() == rows[:, 0].tobytes()
    assert recording.metadata == {"version": "1.2", "rate_hz": "1000.0", "format": "1"}
    assert recording.attachments == {"rig.yaml": b"name: x\n"}
    assert recording.ending == {"rows_written": "2500"}
    assert (recording.truncated, recording.damaged_chunks, recording.missing_rows) == (False, 0, 0)
    assert len(recording) == 2500
    assert "time_s" in recording


def test_axes_pairs_and_elements_are_found_among_the_columns(sample: Sample) -> None:
    recording = read_recording(sample[0], rows=slice(0, 1))
    assert recording.axes() == ("master.wrist", "slave.wrist")
    assert recording.pairs() == ("wrist",)
    assert recording.elements("wrist") == ("line",)


@pytest.mark.parametrize("reader", [make_reader, NonSeekingReader])
def test_the_mcap_library_and_a_ros_decoder_read_the_same_floats(
    sample: Sample, reader: type[NonSeekingReader]
) -> None:
    path, rows, _ = sample
    with path.open("rb") as stream:
        found = list(
            reader(
                stream, validate_crcs=True, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages()
        )
    assert len(found) == 2500
    for k in (0, 7, 8, 1234, 2499):
        schema, channel, message, decoded = found[k]
        assert schema is not None
        assert (schema.name, schema.encoding) == ("tautwave/msg/Cycle", "ros2msg")
        assert (channel.topic, channel.message_encoding) == ("/tautwave/cycle", "cdr")
        assert message.sequence == k
        assert message.log_time == message.publish_time == EPOCH_NS + k * 1_000_000
        values = [
            decoded.time_s,
            decoded.master.wrist.position,
            decoded.slave.wrist.position,
            decoded.master.wrist.wave_in,
            decoded.wrist.position_error,
            decoded.slave.wrist.wave_in,
            decoded.wrist.line.absorbed,
            decoded.truth.master.wrist.position,
        ]
        assert np.array(values).tobytes() == rows[k, :-1].tobytes()


def test_the_summary_lets_a_viewer_seek(sample: Sample) -> None:
    path, _, per_chunk = sample
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        statistics = summary.statistics
        assert statistics is not None
        assert statistics.message_count == 2500
        assert statistics.chunk_count == len(summary.chunk_indexes) == -(-2500 // per_chunk)
        assert (statistics.attachment_count, statistics.metadata_count) == (1, 2)
        assert statistics.message_start_time == EPOCH_NS
        assert statistics.message_end_time == EPOCH_NS + 2_499_000_000
        assert all(index.uncompressed_size <= 64 * 1024 for index in summary.chunk_indexes)
        at = EPOCH_NS + 2_000_000_000
        part = list(reader.iter_messages(starting_at=at, ending_before=at + 5_000_000))
        assert [message.sequence for _, _, message in part] == [2000, 2001, 2002, 2003, 2004]
        assert [m.name for m in reader.iter_metadata()] == ["tautwave", "tautwave ending"]
        (attachment,) = reader.iter_attachments()
        assert (attachment.name, attachment.data) == ("rig.yaml", b"name: x\n")


@given(
    start=st.one_of(st.none(), st.integers(-2600, 2600)),
    stop=st.one_of(st.none(), st.integers(-2600, 2600)),
    stride=st.sampled_from([1, 2, 3, 7, 100, 901, 2499, 2500, 1 << 62]),
    names=st.lists(st.sampled_from(COLUMNS), max_size=3),
)
def test_a_selection_is_a_slice_of_the_whole(
    sample: Sample, start: int | None, stop: int | None, stride: int, names: list[str]
) -> None:
    path, rows, _ = sample
    part = read_recording(path, names, rows=slice(start, stop), stride=stride)
    expected = rows[start:stop:stride][:, [COLUMNS.index(name) for name in names]]
    assert part.columns == tuple(names)
    assert part.data.tobytes() == expected.tobytes()
    assert part.missing_rows == 0


def test_times_that_are_no_numbers_do_not_break_the_order(tmp_path: Path) -> None:
    rows = slots(10)
    rows[0, 0], rows[4, 0], rows[9, 0] = np.nan, np.inf, -np.inf
    write(tmp_path / "r.mcap", rows)
    with (tmp_path / "r.mcap").open("rb") as stream:
        times = [m.log_time - EPOCH_NS for _, _, m in make_reader(stream).iter_messages()]
    assert times == [k * 1_000_000 for k in (0, 1, 2, 3, 3, 5, 6, 7, 8, 8)]
    assert read_recording(tmp_path / "r.mcap").data.tobytes() == rows[:, :-1].tobytes()


def test_a_row_larger_than_a_chunk_is_a_chunk_of_its_own(tmp_path: Path) -> None:
    columns = ("time_s", *(f"g{k % 50}.c{k}" for k in range(9000)))
    rows = slots(3, len(columns))
    assert write(tmp_path / "r.mcap", rows, columns).rows_per_chunk == 1
    assert read_recording(tmp_path / "r.mcap").data.tobytes() == rows[:, :-1].tobytes()


def test_chunks_are_at_most_64_kib(sample: Sample) -> None:
    with sample[0].open("rb") as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if isinstance(r, Chunk)]
    assert {chunk.compression for chunk in chunks} == {"zstd"}
    assert all(63_000 < chunk.uncompressed_size <= 65_536 for chunk in chunks[:-1])


def test_the_names_as_they_were_are_in_the_file(sample: Sample) -> None:
    with sample[0].open("rb") as stream:
        names = next(make_reader(stream).iter_metadata()).metadata
    assert json.loads(names["columns"]) == list(COLUMNS)


# -- other ways to it ------------------------------------------------------------------------------


def test_the_directory_of_a_run_will_do(tmp_path: Path) -> None:
    write(tmp_path / "recording.mcap", slots(500))
    again = read_recording(tmp_path, ["wrist.position_error"], rows=slice(100, 200))
    assert np.array_equal(again["wrist.position_error"], slots(500)[100:200, 4])


def test_a_run_that_is_still_going_shows_what_is_in_its_file(tmp_path: Path) -> None:
    path = tmp_path / "recording.mcap"
    recorder = Recorder(path, COLUMNS, metadata={}, attachments={}, lossless=True, rate_hz=1e3)
    recorder.start()
    try:
        rows = slots(5000)
        for row in rows:
            recorder.row[:] = memoryview(row[:-1].copy())
            recorder.commit()
        found = None
        for _ in range(1000):
            with suppress(RecordingError):  # no rows yet
                found = read_recording(tmp_path)
                break
            time.sleep(0.01)
        assert found is not None
        assert found.truncated
        assert np.array_equal(found.data, rows[: len(found), :-1])
    finally:
        assert recorder.close().error is None
    assert not read_recording(tmp_path).truncated


def test_rows_as_a_data_frame(sample: Sample) -> None:
    pandas = pytest.importorskip("pandas")
    recording = read_recording(sample[0])
    frame = recording.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == [name for name in COLUMNS if name != "time_s"]
    assert np.array_equal(frame.index, recording.time_s)
    for name in frame.columns:
        assert np.array_equal(frame[name], recording[name], equal_nan=True)
    assert frame.attrs["rate_hz"] == "1000.0"
    part = read_recording(sample[0], ["wrist.position_error"], rows=slice(0, 3)).to_pandas()
    assert list(part.index) == [0, 1, 2]


def test_rows_as_an_arrow_table(sample: Sample) -> None:
    pytest.importorskip("pyarrow")
    recording = read_recording(sample[0])
    table = recording.to_arrow()
    assert table.column_names == list(COLUMNS)
    for name in COLUMNS:
        assert np.array_equal(table[name].to_numpy(), recording[name], equal_nan=True)
    assert table.schema.metadata[b"rate_hz"] == b"1000.0"


@pytest.mark.parametrize(
    ("library", "method", "extra"),
    [("pandas", "to_pandas", "pandas"), ("pyarrow", "to_arrow", "parquet")],
)
def test_a_library_that_is_missing_is_one_sentence(
    sample: Sample, monkeypatch: pytest.MonkeyPatch, library: str, method: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    reported = rf"this needs {library}; pip install 'tautwave\[{extra}\]'"
    with pytest.raises(ConfigError, match=reported):
        getattr(read_recording(sample[0]), method)()


def test_a_loop_gives_row_by_row_by_name(sample: Sample) -> None:
    path, rows, _ = sample
    recording = read_recording(path, ["master.wrist.position", "time_s"], rows=slice(5, 9))
    looped = list(recording)
    assert len(looped) == len(recording) == 4
    assert [list(row) for row in looped] == [["master.wrist.position", "time_s"]] * 4
    assert np.array_equal([list(row.values()) for row in looped], rows[5:9, [1, 0]], equal_nan=True)
    assert type(looped[0]["time_s"]) is float
