"""Write rows of float64 as an MCAP file, a chunk at a time.

The `mcap` library's `Writer.add_message` costs 12-22 us a row in Python, too much beside a loop
that simulates 20-50 times faster than real time. Here NumPy assembles the messages of one chunk and
their index in one operation, 2 us for a row of 60 floats and 4 us for 100, most of it zstd; every
other record is written by the library. Format: https://mcap.dev/spec
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from tautwave import formats
from tautwave.files import create
from tautwave.recordings.layout import ENDING_NAME, MAGIC, METADATA_NAME, record_type
from tautwave.runtime.mcap_schema import CDR_HEADER, SCHEMA_NAME, TOPIC, message_layout

CHUNK_BYTES = 64 * 1024
CHANNEL_ID = 1
SCHEMA_ID = 1
# Level 1: recorded floats hardly compress (level 3 saves 1-2 % more for 1.5 times the CPU).
COMPRESSION_LEVEL = 1


class McapFile:
    """A recording being written. Every method may raise OSError; the rows in the file stay intact.

    Parameters
    ----------
    path
        The new file; an existing one is replaced.
    columns
        Names; one of them is `time_s`.
    metadata, attachments
        Written before the rows, so that a truncated file has them too.
    epoch_ns
        Unix time [ns] of `time_s` = 0; it may be set until the first row.
    """

    def __init__(
        self,
        path: str,
        columns: Sequence[str],
        metadata: Mapping[str, str],
        attachments: Mapping[str, bytes],
        epoch_ns: int,
    ) -> None:
        layout = message_layout(columns)
        self._order = None if layout.order == tuple(range(len(columns))) else list(layout.order)
        self._time_column = list(columns).index("time_s")
        self.epoch_ns = epoch_ns
        self._last_time = epoch_ns
        self._type = record_type(len(columns))
        self.rows_per_chunk = max(1, CHUNK_BYTES // self._type.itemsize)
        self._records = self._empty_records()
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        self._schema = Schema(
            id=SCHEMA_ID, name=SCHEMA_NAME, encoding="ros2msg", data=layout.definition.encode()
        )
        self._channel = Channel(
            id=CHANNEL_ID, topic=TOPIC, message_encoding="cdr", metadata={}, schema_id=SCHEMA_ID
        )
        self._chunk_indexes = bytearray()  # kept encoded: an hour has some 50 000 of them
        self._attachment_indexes: list[McapRecord] = []
        self._metadata_indexes: list[McapRecord] = []
        self._statistics = Statistics(
            attachment_count=0,
            channel_count=1,
            channel_message_counts={CHANNEL_ID: 0},
            chunk_count=0,
            message_count=0,
            message_end_time=0,
            message_start_time=0,
            metadata_count=0,
            schema_count=1,
        )
        self.length = 0
        self._descriptor = create(path)
        self._write(MAGIC + _encode(Header(profile="ros2", library="tautwave")))
        names = {"columns": json.dumps(list(columns)), "order": json.dumps(list(layout.order))}
        version = {"format": str(formats.RECORDING)}
        self._add_metadata(METADATA_NAME, {**metadata, **version, **names})
        for name, content in attachments.items():
            self._add_attachment(name, content)
        self._write(_encode(self._schema) + _encode(self._channel))

    @property
    def rows(self) -> int:
        """Rows in the file."""
        return self._statistics.message_count

    def append(self, slots: NDArray[np.float64]) -> None:
        """Write one chunk: `slots` is (n <= rows_per_chunk, columns + 1), the mark of each last."""
        count = len(slots)
        records = self._records[:count]
        rows = slots[:, :-1]
        records["row"] = rows if self._order is None else rows[:, self._order]
        records["sequence"] = slots[:, -1]
        times = self._log_times(slots[:, self._time_column])
        records["log_time"] = times
        records["publish_time"] = times
        start, end = int(times.min()), int(times.max())
        plain = records.tobytes()
        compressed = self._compressor.compress(plain)
        chunk = _encode(
            Chunk(
                compression="zstd",
                data=compressed,
                message_end_time=end,
                message_start_time=start,
                uncompressed_crc=zlib.crc32(plain),
                uncompressed_size=len(plain),
            )
        )
        index = self._message_index(times)
        chunk_at = self.length
        self._write(chunk + index)
        statistics = self._statistics
        if statistics.chunk_count == 0:
            statistics.message_start_time = start
        statistics.message_start_time = min(statistics.message_start_time, start)
        statistics.message_end_time = max(statistics.message_end_time, end)
        statistics.chunk_count += 1
        statistics.message_count += count
        statistics.channel_message_counts[CHANNEL_ID] += count
        self._chunk_indexes += _encode(
            ChunkIndex(
                chunk_length=len(chunk),
                chunk_start_offset=chunk_at,
                compression="zstd",
                compressed_size=len(compressed),
                message_end_time=end,
                message_index_length=len(index),
                message_index_offsets={CHANNEL_ID: chunk_at + len(chunk)},
                message_start_time=start,
                uncompressed_size=len(plain),
            )
        )

    def finish(self, ending: Mapping[str, str]) -> None:
        """Write how the run ended and the summary for seeking; the file is then complete."""
        self._add_metadata(ENDING_NAME, ending)
        data_end = _encode(DataEnd(data_section_crc=0))
        summary_at = self.length + len(data_end)
        groups: list[tuple[Opcode, bytes]] = [
            (Opcode.SCHEMA, _encode(self._schema)),
            (Opcode.CHANNEL, _encode(self._channel)),
            (Opcode.STATISTICS, _encode(self._statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indexes)),
            (Opcode.ATTACHMENT_INDEX, b"".join(map(_encode, self._attachment_indexes))),
            (Opcode.METADATA_INDEX, b"".join(map(_encode, self._metadata_indexes))),
        ]
        summary = b""
        offsets = b""
        for opcode, content in groups:
            if content:
                at = summary_at + len(summary)
                offsets += _encode(
                    SummaryOffset(group_opcode=opcode, group_start=at, group_length=len(content))
                )
            summary += content
        offsets_at = summary_at + len(summary)
        # The checksum covers the footer up to itself.
        front = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_at, offsets_at)
        checksum = zlib.crc32(front, zlib.crc32(summary + offsets))
        footer = _encode(
            Footer(summary_start=summary_at, summary_offset_start=offsets_at, summary_crc=checksum)
        )
        self._write(data_end + summary + offsets + footer + MAGIC)

    def close(self) -> None:
        """Close the descriptor. Idempotent."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _empty_records(self) -> NDArray[Any]:
        records = np.zeros(self.rows_per_chunk, self._type)
        records["opcode"] = Opcode.MESSAGE
        records["length"] = self._type.itemsize - 9
        records["channel"] = CHANNEL_ID
        records["cdr"] = np.void(CDR_HEADER)
        return records

    def _log_times(self, time_s: NDArray[np.float64]) -> NDArray[np.uint64]:
        """Unix time [ns] of each row; a row whose time is NaN gets its predecessor's."""
        good = np.abs(time_s) < 4e9
        offsets = np.rint(np.where(good, time_s, 0.0) * 1e9).astype(np.int64)
        times = np.maximum(self.epoch_ns + offsets, 0)
        if not good.all():
            for index in np.flatnonzero(~good):
                times[index] = times[index - 1] if index else self._last_time
        self._last_time = int(times[-1])
        return times.astype(np.uint64)

    def _message_index(self, times: NDArray[np.uint64]) -> bytes:
        entries = np.empty((len(times), 2), "<u8")
        entries[:, 0] = times
        entries[:, 1] = np.arange(len(times), dtype=np.uint64) * np.uint64(self._type.itemsize)
        size = entries.nbytes
        head = struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + size, CHANNEL_ID, size)
        return head + entries.tobytes()

    def _add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        encoded = _encode(Metadata(name=name, metadata=dict(entries)))
        self._metadata_indexes.append(
            MetadataIndex(offset=self.length, length=len(encoded), name=name)
        )
        self._statistics.metadata_count += 1
        self._write(encoded)

    def _add_attachment(self, name: str, content: bytes) -> None:
        media = "application/yaml" if name.endswith((".yaml", ".yml")) else "text/plain"
        attachment = Attachment(
            create_time=self.epoch_ns,
            data=content,
            log_time=self.epoch_ns,
            media_type=media,
            name=name,
        )
        encoded = _encode(attachment)
        self._attachment_indexes.append(
            AttachmentIndex(
                create_time=self.epoch_ns,
                data_size=len(content),
                length=len(encoded),
                log_time=self.epoch_ns,
                media_type=media,
                name=name,
                offset=self.length,
            )
        )
        self._statistics.attachment_count += 1
        self._write(encoded)

    def _write(self, content: bytes) -> None:
        """Append whole records, or none: a full disk leaves no partial record."""
        rest = memoryview(content)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError:
            self._cut_back()
            raise
        self.length += len(content)

    def _cut_back(self) -> None:
        try:
            os.ftruncate(self._descriptor, self.length)
            os.lseek(self._descriptor, self.length, os.SEEK_SET)
        except OSError:  # a device, not a file
            return


def _encode(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
