"""Recordings that are damaged, cut off, rewritten or none at all."""

from __future__ import annotations

import io
import random
import warnings
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.writer import Writer

from tautwave.cli import main as cli
from tautwave.errors import RecordingError
from tautwave.recordings.recording import read_recording
from tautwave.runtime.mcap_schema import CDR_HEADER
from tests.report.recordings import COLUMNS, Sample, slots, write
from tests.report.synthetic import make_run

with warnings.catch_warnings():
    warnings.simplefilter("ignore")


def test_a_full_ring_leaves_a_gap_that_is_counted(tmp_path: Path) -> None:
    rows = slots(1000)
    kept = np.delete(rows, slice(300, 420), axis=0)
    write(tmp_path / "r.mcap", kept)
    recording = read_recording(tmp_path / "r.mcap")
    assert (len(recording), recording.missing_rows) == (880, 120)


def test_cut_off_anywhere_in_the_last_chunk_the_rest_is_whole(
    sample: Sample, tmp_path: Path
) -> None:
    path, rows, per_chunk = sample
    content = path.read_bytes()
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    last = max(summary.chunk_indexes, key=lambda index: index.chunk_start_offset)
    first = last.chunk_start_offset
    chunk_end = first + last.chunk_length
    whole = 2500 // per_chunk * per_chunk
    dice = random.Random(4)
    edges = {first, first + 1, first + 8, first + 9, first + 60, chunk_end - 1, chunk_end}
    edges |= {len(content) - n for n in (1, 7, 8, 9, 20, 37)}
    for cut in sorted(edges | {dice.randrange(first, len(content)) for _ in range(60)}):
        short = tmp_path / "short.mcap"
        short.write_bytes(content[:cut])
        recording = read_recording(short)
        expected = whole if cut < chunk_end else 2500
        assert recording.truncated
        assert recording.data.tobytes() == rows[:expected, :-1].tobytes(), cut
        assert recording.attachments == {"rig.yaml": b"name: x\n"}


def test_a_damaged_chunk_is_left_out_and_counted(sample: Sample, tmp_path: Path) -> None:
    path, rows, per_chunk = sample
    content = bytearray(path.read_bytes())
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    second = sorted(index.chunk_start_offset for index in summary.chunk_indexes)[1]
    content[second + 400] ^= 0xFF
    (tmp_path / "bad.mcap").write_bytes(content)
    recording = read_recording(tmp_path / "bad.mcap")
    assert recording.damaged_chunks == 1
    expected = np.delete(rows, slice(per_chunk, 2 * per_chunk), axis=0)
    assert recording.data.tobytes() == expected[:, :-1].tobytes()


def test_whatever_is_damaged_there_is_one_sentence_or_whole_rows(
    sample: Sample, tmp_path: Path
) -> None:
    path, rows, _ = sample
    content = path.read_bytes()[:60_000] + path.read_bytes()[-3000:]
    known = {row.tobytes() for row in rows[:, :-1]}
    dice = random.Random(5)
    sentences = []
    for _ in range(150):
        bad = bytearray(content)
        for _ in range(dice.randrange(1, 4)):
            at = dice.randrange(len(bad)) if dice.random() < 0.5 else dice.randrange(1500)
            bad[at] = dice.randrange(256)
        (tmp_path / "bad.mcap").write_bytes(bad)
        try:
            recording = read_recording(tmp_path / "bad.mcap")
        except RecordingError as error:
            sentences.append(str(error))
            continue
        if recording.columns == COLUMNS:
            assert {row.tobytes() for row in recording.data} <= known
    assert sentences
    assert not any("\n" in sentence for sentence in sentences)


def test_a_file_rewritten_by_other_tools_still_reads(sample: Sample, tmp_path: Path) -> None:
    path, rows, _ = sample
    target = tmp_path / "rewritten.mcap"
    with path.open("rb") as stream, target.open("wb") as out:
        reader = make_reader(stream)
        writer = Writer(out, chunk_size=20_000)
        writer.start()
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        ids = None
        for schema, channel, message in reader.iter_messages():
            if ids is None:
                assert schema is not None
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids = writer.register_channel(channel.topic, channel.message_encoding, known)
                other = writer.register_channel("/other", "cdr", known)
                writer.add_message(other, 0, b"something else", 0)
            writer.add_message(
                ids, message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()  # type: ignore[no-untyped-call]
    recording = read_recording(target)
    assert recording.data.tobytes() == rows[:, :-1].tobytes()
    assert read_recording(target, stride=10).data.tobytes() == rows[::10, :-1].tobytes()


def foreign() -> bytes:
    out = io.BytesIO()
    writer = Writer(out)
    writer.start()
    schema = writer.register_schema("a/msg/B", "ros2msg", b"float64 x\n")
    channel = writer.register_channel("/b", "cdr", schema)
    writer.add_message(channel, 1, CDR_HEADER + bytes(8), 1)
    writer.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "is empty"),
        (b"time_s,position\n0,1\n" * 100, "is not an MCAP file"),
        (b"\x89MCA", "is not an MCAP file"),
        (foreign(), "is an MCAP file, but not a tautwave recording"),
        (foreign()[:30], "is an MCAP file, but not a tautwave recording"),
    ],
)
def test_what_is_no_recording_is_said_in_one_sentence(
    tmp_path: Path, content: bytes, sentence: str
) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=sentence) as caught:
        read_recording(path)
    assert str(path) in str(caught.value)


def test_no_file_no_rows_no_such_column(sample: Sample, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nope\.mcap cannot be read: No such file"):
        read_recording(tmp_path / "nope.mcap")
    with pytest.raises(RecordingError, match=r"holds no recording\.mcap; give a recording, or the"):
        read_recording(tmp_path)
    write(tmp_path / "none.mcap", slots(0))
    with pytest.raises(RecordingError, match="holds no rows"):
        read_recording(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match=r"did you mean 'master\.wrist\.position'"):
        read_recording(sample[0], ["master.wrist.positon"])
    with pytest.raises(RecordingError, match=r"there is no column 'zzz'$"):
        read_recording(sample[0], ["time_s"])["zzz"]
    with pytest.raises(RecordingError, match="every n-th row"):
        read_recording(sample[0], stride=0)


def test_a_page_is_not_replaced_by_one_without_a_recording(tmp_path: Path) -> None:
    """It says why, and exits with 2; where there is no page one is written, and it exits with 7."""
    make_run(tmp_path, rows=200)
    page = tmp_path / "report.html"
    page.write_text("good")
    (tmp_path / "recording.mcap").write_bytes(b"no recording")
    done = CliRunner().invoke(cli, ["report", str(tmp_path)])
    assert (done.exit_code, page.read_text()) == (2, "good")
    (sentence,) = done.output.splitlines()
    assert sentence.startswith(f"{page}: not rebuilt. ")
    assert "recording.mcap is not an MCAP file" in sentence
    page.unlink()
    done = CliRunner().invoke(cli, ["report", str(tmp_path)])
    assert done.exit_code == 7
    assert "cannot be read" in page.read_text()
    assert done.output.startswith(f"{page}: is incomplete. ")


def test_a_loop_of_links_is_no_run(tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    done = CliRunner().invoke(cli, ["export", str(loop)])
    assert done.exit_code == 2
    assert done.output == f"{loop}: no such directory; give the --out of a run\n"
