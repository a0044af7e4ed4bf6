"""The records of an MCAP file: where its chunks are, and the messages of each as an array."""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata
from numpy.typing import NDArray

from tautwave.errors import RecordingError
from tautwave.recordings.layout import MAGIC

_RECORD = struct.Struct("<BQ")  # opcode, length of what follows
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, its CRC, length of compression
_FOOTER_BYTES = 20
_LARGEST_CHUNK = 1 << 30
_LONGEST_NAME = 16  # of a compression
_HEAD_BYTES = _RECORD.size + _CHUNK.size + _LONGEST_NAME


class ChunkPlace(NamedTuple):
    """Where the content of one chunk lies in the file, and its destination."""

    start: int
    stop: int
    size: int
    checksum: int
    compression: str


@dataclass
class Contents:
    """Result of one pass over the records."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    chunks: list[ChunkPlace] = field(default_factory=list)
    complete: bool = False


def walk_records(file: int) -> Contents:
    """Every record up to the footer, or up to where the file breaks off."""
    contents = Contents()
    at = len(MAGIC)
    end = os.fstat(file).st_size
    while at + _RECORD.size <= end:
        head = os.pread(file, _HEAD_BYTES, at)
        opcode, length = _RECORD.unpack_from(head)
        at += _RECORD.size
        if opcode == 0 or at + length > end:
            break
        if opcode == Opcode.CHUNK:
            chunk = _chunk(head, at, length)
            if chunk is not None:
                contents.chunks.append(chunk)
        elif opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
            _keep(contents, opcode, os.pread(file, length, at))
        elif opcode == Opcode.FOOTER:
            tail = os.pread(file, len(MAGIC) + 1, at + length)
            contents.complete = length == _FOOTER_BYTES and tail == MAGIC
            break
        at += length
    return contents


def _chunk(head: bytes, at: int, length: int) -> ChunkPlace | None:
    """The chunk whose record starts with `head`, or None when that is damaged."""
    if len(head) < _RECORD.size + _CHUNK.size:
        return None
    _, _, size, checksum, letters = _CHUNK.unpack_from(head, _RECORD.size)
    text = _RECORD.size + _CHUNK.size
    content = at + _CHUNK.size + letters + 8
    if letters > _LONGEST_NAME or content > at + length or size > _LARGEST_CHUNK:
        return None
    compression = head[text : text + letters].decode("ascii", "replace")
    return ChunkPlace(content, at + length, size, checksum, compression)


def _keep(contents: Contents, opcode: int, raw: bytes) -> None:
    stream = ReadDataStream(io.BytesIO(raw))
    try:
        if opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            contents.metadata[metadata.name] = metadata.metadata
        else:
            attachment = Attachment.read(stream)
            contents.attachments[attachment.name] = attachment.data
    except (ValueError, struct.error, McapError):  # damaged; the rows may still be good
        return


def chunk_records(file: int, chunk: ChunkPlace, kind: np.dtype[Any]) -> NDArray[Any] | None:
    """Messages of a chunk as a structured array, or None when it is damaged."""
    content = os.pread(file, chunk.stop - chunk.start, chunk.start)
    if chunk.compression == "zstd":
        try:
            if zstandard.frame_content_size(content) not in (chunk.size, -1):
                return None
            content = zstandard.ZstdDecompressor().decompress(content, max_output_size=chunk.size)
        except zstandard.ZstdError:
            return None
    elif chunk.compression:
        raise RecordingError(
            f"a chunk is compressed with {chunk.compression!r}; tautwave writes and reads zstd"
        )
    if len(content) != chunk.size or (chunk.checksum and zlib.crc32(content) != chunk.checksum):
        return None
    # Tools that rewrite MCAP files put schema and channel in front of a chunk's messages.
    pieces = [
        np.frombuffer(content, kind, count, offset)
        for offset, count in _runs(content, kind.itemsize)
    ]
    if not pieces:
        return np.empty(0, kind)
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)


def _runs(content: bytes, size: int) -> Iterator[tuple[int, int]]:
    """Offset and number of neighbouring messages of `size` bytes each."""
    head = _RECORD.pack(Opcode.MESSAGE, size - _RECORD.size)
    if len(content) % size == 0 and content[: len(head)] == head:
        heads = np.frombuffer(content, np.uint8).reshape(-1, size)[:, : len(head)]
        if (heads == np.frombuffer(head, np.uint8)).all():
            yield 0, len(content) // size
            return
    at = 0
    while at + _RECORD.size <= len(content):
        opcode, length = _RECORD.unpack_from(content, at)
        whole = _RECORD.size + length
        if opcode == Opcode.MESSAGE and whole == size and at + whole <= len(content):
            yield at, 1
        at += whole
