"""What a recording's column names say of its pairs and elements; messages of a chunk."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

from tautwave.recordings.mcap_chunks import _HEAD_BYTES, ChunkPlace, _chunk, chunk_records
from tautwave.recordings.recording import Recording

COLUMNS = (
    *("time_s", "position_error", "lever.position_error", "arm.tip.position_error"),
    *("lever.port_master.absorbed", "lever.port_master.stored", "lever.absorbed"),
    *("lever.line.absorbed", "wrist.line.absorbed", "load.lever.deep.absorbed"),
    *("master.lever.position", "slave.lever.position", "true.master.lever.position"),
)
KIND = np.dtype([("head", "V9"), ("row", "<f8", (2,))])
RECORD = struct.Struct("<BQ")


def test_pairs_axes_and_elements_are_in_the_names() -> None:
    one = Recording(COLUMNS, np.zeros((1, len(COLUMNS))), {}, {}, False, 0, 0, {})
    assert one.pairs() == ("lever", "arm.tip")
    assert one.elements("lever") == ("port_master", "line")
    assert one.elements("wrist") == ("line",)
    assert one.axes() == ("master.lever", "slave.lever")


@pytest.mark.parametrize(("letters", "taken"), [(16, True), (17, False)])
def test_a_chunk_has_a_compression_of_sixteen_letters_at_most(letters: int, taken: bool) -> None:
    name = b"x" * letters
    head = RECORD.pack(Opcode.CHUNK, 500) + struct.pack("<QQQII", 0, 1, 100, 7, letters) + name
    place = _chunk(head[:_HEAD_BYTES], 9, 500)
    assert place == (ChunkPlace(9 + 32 + letters + 8, 509, 100, 7, "x" * 16) if taken else None)


def message(*row: float, opcode: int = Opcode.MESSAGE) -> bytes:
    return RECORD.pack(opcode, 8 * len(row)) + struct.pack(f"<{len(row)}d", *row)


A, B = message(1.0, 2.0), message(3.0, 4.0)
CHANNEL = message(9.0, 9.0, opcode=Opcode.CHANNEL)  # as long as a message
SCHEMA = message(9.0, opcode=Opcode.SCHEMA)


@pytest.mark.parametrize(
    ("content", "rows"),
    [
        (A + B, [[1, 2], [3, 4]]),
        (SCHEMA + CHANNEL + A + B, [[1, 2], [3, 4]]),
        (A + CHANNEL + B, [[1, 2], [3, 4]]),
        (CHANNEL + A, [[1, 2]]),
        (A + message(5.0) + B, [[1, 2], [3, 4]]),  # of another channel
        (A + message(5.0, 6.0, 7.0) + B, [[1, 2], [3, 4]]),
        (A + B[:-1], [[1, 2]]),
        (A + B + A[:1], [[1, 2], [3, 4]]),
        (A, [[1, 2]]),
        (b"", []),
        (A + B[:8], [[1, 2]]),
        (SCHEMA, []),
    ],
)
@pytest.mark.parametrize("checked", [True, False])
def test_the_messages_of_a_chunk_are_found_among_others(
    tmp_path: Path, content: bytes, rows: list[list[float]], checked: bool
) -> None:
    (tmp_path / "chunk").write_bytes(b"before" + content)
    with (tmp_path / "chunk").open("rb") as file:
        place = ChunkPlace(6, 6 + len(content), len(content), checked * zlib.crc32(content), "")
        found = chunk_records(file.fileno(), place, KIND)
        assert found is not None
        assert found["row"].tolist() == rows
        if checked:
            assert chunk_records(file.fileno(), place._replace(checksum=1), KIND) is None
        assert chunk_records(file.fileno(), place._replace(size=len(content) + 1), KIND) is None
